"""Intervals that pause are seen at every pause, return what they return, and are closed whatever happens."""

import pytest

from seastar_gym.envs.swimming import first_after
from seastar_gym.simulator.pauses import completed, pausing


def interval(closed):
    """Pauses at 1, 2 and 3; notes that it was closed."""
    try:
        yield from (1.0, 2.0, 3.0)
    finally:
        closed.append(True)
    return "report"


def test_an_interval_is_seen_at_every_pause_and_returns_its_report():
    seen, closed = [], []
    assert completed(interval(closed), seen.append) == "report" and seen == [1.0, 2.0, 3.0] and closed == [True]
    assert completed(interval([])) == "report"


def test_only_what_is_made_of_a_time_is_yielded():
    assert list(pausing(interval([]), lambda time: 10.0 * time if time != 2.0 else None)) == [10.0, 30.0]


@pytest.mark.parametrize(
    "ends, expected", [([], []), ([1.5, 3.0], [2.0, 3.0]), ([0.5, 0.6, 1.0], [1.0]), ([2.0 + 1e-10], [2.0])]
)
def test_the_first_time_after_each_end_is_yielded(ends, expected):
    assert list(pausing(interval([]), first_after(ends))) == expected


def test_an_interval_is_closed_with_its_pauses_and_by_what_goes_wrong_in_them():
    closed = []
    pauses = pausing(interval(closed), float)
    next(pauses)
    pauses.close()
    assert closed == [True]

    def broken(time):
        raise ZeroDivisionError

    for run in (completed, lambda *given: list(pausing(*given))):
        closed = []
        with pytest.raises(ZeroDivisionError):
            run(interval(closed), broken)
        assert closed == [True]
