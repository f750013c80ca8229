"""How steps are halved and doubled, with steps that succeed or fail as told."""

from typing import NamedTuple

import numpy as np
import pytest

from seastar_gym import Numerics, Scene, Seastar
from seastar_gym.der.rods import make_work
from seastar_gym.der.stepping.interval import FALLBACK_AFTER, cover_interval
from seastar_gym.der.stepping.report import REPORT_ROWS
from seastar_gym.der.stepping.schemes import SCHEMES
from seastar_gym.der.stepping.steps import MOST_HALVINGS, SMALLEST_FRACTION, TURNABLE
from seastar_gym.model.rods import make_limits, make_rods
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simd.numpy_lanes import Lanes, Mask
from slopes import plain, rows

ROBOT = Seastar(5, 2)
RODS = make_rods(Scene(ROBOT))
EVERYONE = Mask(np.ones(N_LANES, bool))
MIDPOINT, EULER = SCHEMES["implicit-midpoint"], SCHEMES["implicit-euler"]


class Trial(NamedTuple):
    """A step that was tried: its start and size, as shares of the interval, and whether it was the fallback's."""

    start: float
    size: float
    on_fallback: bool


def number(lanes: Lanes) -> float:
    """The number that all lanes have."""
    return float(np.unique(lanes.numbers).item())


@pytest.fixture
def tried(monkeypatch):
    """Cover an interval with steps whose verdict (converged, error rate over the limit) a function of them tells."""

    def cover(verdict, adapted=True):
        numerics = Numerics("implicit-midpoint", 5e-3, path_tolerance=0.01 if adapted else None)
        limits, trials = make_limits(Scene(ROBOT, numerics=numerics)), []

        def try_step(rods, work, tableau, actuation, q, v, a, step, going, limits, report):
            trials.append(Trial(number(step.start), number(step.size), tableau is EULER))
            good, error = verdict(trials)
            accepted = good and error <= 1.0
            return (
                going & Mask(np.full(N_LANES, good)),
                going & Mask(np.full(N_LANES, accepted)),
                Lanes(error * float(limits.error_rate[0])),
            )

        monkeypatch.setitem(cover_interval.plain.__globals__, "try_step", try_step)
        q, report = rows(ROBOT.nodes()), np.zeros((len(REPORT_ROWS), N_LANES))
        v, a = np.zeros_like(q), np.zeros((len(q) + 3, N_LANES))
        work, h = make_work(RODS, 1), Lanes(5e-3)
        args = RODS, work, MIDPOINT, EULER, None, q, v, a, h, EVERYONE, limits, report
        return plain(cover_interval.plain(*args)).all(), trials

    return cover


def test_after_four_halvings_steps_are_the_fallbacks_and_after_the_twelfth_the_robot_has_failed(tried):
    arrived, trials = tried(lambda trials: (False, 0.0), adapted=False)
    assert not arrived
    assert [trial.on_fallback for trial in trials] == [False] * 4 + [True] * 9
    assert [trial.size for trial in trials] == [2.0**-k for k in range(13)]


def test_a_robot_is_first_helped_by_short_steps_then_by_the_fallback_then_by_letting_hinges_go_through_poles():
    assert 1.0 <= FALLBACK_AFTER < TURNABLE < MOST_HALVINGS == -np.log2(SMALLEST_FRACTION)


def test_an_adapted_stroke_begins_with_a_short_step_and_finds_the_longest_soon(tried):
    arrived, trials = tried(lambda trials: (True, 0.0))
    assert arrived and [trial.size for trial in trials] == [2.0**-3, 2.0**-3, 0.25, 0.5]


def test_steps_grow_to_where_their_errors_let_them_and_are_not_refused_there(tried):
    """The error per time of a step that is twice as long is four times as large; a quarter of the interval is hard."""

    def verdict(largest: float, trial: Trial) -> tuple[bool, float]:
        return True, (trial.size / (largest if trial.start >= 0.25 else 2.0**-8)) ** 2

    for largest in 2.0 ** np.linspace(-4.9, -3.1, 8):
        arrived, trials = tried(lambda trials, largest=largest: verdict(largest, trials[-1]))
        settled = np.array([trial.size for trial in trials if trial.start > 0.5])
        assert arrived and np.all((settled > 0.4 * largest) & (settled <= largest))


def test_after_a_halving_the_fifth_step_is_longer_again_and_the_next_doubling_waits_twice_as_long(tried):
    _, trials = tried(lambda trials: (len(trials) > 2, 0.0))
    sizes = [trial.size for trial in trials[2:]]
    assert sizes[:4] == [2.0**-5] * 4 and sizes[4] == 2.0**-4
    assert sizes[4:12] == [2.0**-4] * 8 and sizes[12] == 2.0**-3
