"""The long run: `pytest tests/fuzz --fuzz-minutes 60 -s`, and its failures one by one, by `--fuzz-case`."""

import pytest

from fuzz import hour


def test_what_is_drawn_for_as_long_as_asked_keeps_every_promise(request, capsys):
    minutes, seed = request.config.getoption("--fuzz-minutes"), request.config.getoption("--fuzz-seed")
    if not minutes:
        pytest.skip("runs with --fuzz-minutes")
    with capsys.disabled():
        tally = hour.run(minutes, seed)
        print(tally)
    assert not tally.failed


def test_a_case_keeps_its_promise(request):
    name = request.config.getoption("--fuzz-case")
    if not name:
        pytest.skip("runs with --fuzz-case, as the long run prints it")
    hour.attempt(hour.Trial.named(name))


def test_a_name_is_all_that_a_trial_is():
    for trial, _ in zip(hour.trials(3), range(500), strict=False):
        assert hour.Trial.named(str(trial)) == trial
