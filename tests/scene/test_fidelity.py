"""Promises of the stored table hold for commands that the study has never seen, and nothing else is promised."""

import json
import subprocess
import sys
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from seastar_gym import Numerics, Scene, Simulator
from seastar_gym.scene import fidelity
from seastar_gym.scene.fidelity import Promise, cheapest, promise, promises
from seastar_gym.scene.numerics import Fidelity
from studies.accuracy.cases import errors, gaits, joined, pentagon, random_sequences, swim, swims

NAMES = get_args(Fidelity)
UNSEEN = random_sequences(24, np.random.default_rng(20_261_121))
"""Random commands that the study did not use: it draws from the seeds 0 and 1."""


# The table


def test_table_comes_with_the_package_and_is_complete():
    assert Path(fidelity.__file__).parent == fidelity.PRESETS.parent
    stored = json.loads(fidelity.PRESETS.read_text(encoding="utf-8"))
    assert list(stored["presets"]) == list(NAMES)
    assert fidelity.machine() == stored["machine"] != ""
    for row in promises():
        assert 0.0 < row.path_error < 0.5 and 0.0 < row.straight_error < 0.5
        assert min(row.gait_error, row.end_error, row.heading_error) > 0.0 and row.speed > 50.0


def test_promises_are_of_the_presets_as_they_are():
    """If this fails, presets were changed without `python -m studies.accuracy --store`."""
    for name in NAMES:
        row, numerics = promise(name), Numerics.preset(name)
        assert (row.scheme, row.step) == (numerics.scheme, numerics.step)
        assert (row.newton_tolerance, row.path_tolerance) == (numerics.newton_tolerance, numerics.path_tolerance)
        assert promise(numerics) == row


def test_presets_keep_what_their_names_say():
    assert promise("fast").path_error <= 0.05
    assert promise("accurate").path_error < 0.01
    assert promise("reference").path_error < 0.002
    speeds = [promise(name).speed for name in ("fast", "balanced", "accurate", "reference")]
    assert speeds == sorted(speeds, reverse=True)
    assert promise("fast").speed > promise("chapter").speed
    assert promise("fast").path_error < promise("chapter").path_error


def test_no_stored_setting_is_worse_than_another_in_everything():
    def figures(row: Promise) -> tuple[float, ...]:
        return -row.speed, row.path_error, row.gait_error, row.straight_error

    for row in promises():
        better = [each for each in promises() if all(np.array(figures(each)) < figures(row))]
        assert not better, f"{better[0]} beats {row}"


@pytest.mark.parametrize("setting", ["exact", "", Numerics("sdirk3", 7.77e-3), Numerics("sdirk2", 20e-3, 3e-3)])
def test_what_was_not_measured_is_not_promised(setting):
    with pytest.raises(ValueError, match=r"^(A preset is one of|Nothing was measured).*\.$"):
        promise(setting)


# for_error


@pytest.mark.parametrize("any_gait", [False, True])
@pytest.mark.parametrize("error", [0.2, 0.1, 0.05, 0.03, 0.02, 0.01, 0.005])
def test_for_error_picks_the_fastest_setting_that_keeps_the_error(error, any_gait):
    chosen = promise(Numerics.for_error(error, any_gait))
    assert chosen == cheapest(error, any_gait)
    assert max(chosen.path_error, chosen.gait_error if any_gait else 0.0) <= error
    for row in promises():
        if row.speed > chosen.speed:
            assert max(row.path_error, row.gait_error if any_gait else 0.0) > error


def test_a_smaller_error_is_never_faster():
    speeds = [promise(Numerics.for_error(error)).speed for error in np.logspace(-0.5, -2.5, 40)]
    assert speeds == sorted(speeds, reverse=True)


@pytest.mark.parametrize("any_gait", [False, True])
def test_for_error_refuses_what_the_table_cannot_promise_and_names_the_best(any_gait):
    best = min(max(row.path_error, row.gait_error if any_gait else 0.0) for row in promises())
    with pytest.raises(ValueError, match=r"^No measured setting keeps .*: the best, .* keeps .* %\.$") as refusal:
        Numerics.for_error(0.9 * best, any_gait)
    assert f"{100 * best:g} %" in str(refusal.value)
    assert Numerics.for_error(best, any_gait)


@pytest.mark.parametrize("error", [0.0, -0.1, float("nan"), float("inf"), True, "1 %", None])
def test_an_error_that_is_no_positive_number_is_refused(error):
    with pytest.raises(ValueError, match=r"^error must be a positive, finite share"):
        Numerics.for_error(error)


def test_reading_a_promise_compiles_and_simulates_nothing():
    code = "import sys; from seastar_gym.scene.fidelity import promise; print(promise('fast').path_error)"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert float(found.stdout) == promise("fast").path_error


# The promise, kept


@pytest.fixture(scope="module")
def reference():
    """Swims at fidelity "reference": unseen random commands with the pairs, and the pentagon."""
    batches = [joined(swims(), UNSEEN), pentagon(4, 1)]
    return batches, [swim(batch, Numerics.preset("reference"), threads=None) for batch in batches]


@pytest.mark.parametrize("name", ["fast", "balanced", "accurate", "chapter"])
def test_runs_at_a_fidelity_and_at_reference_differ_by_no_more_than_promised(name, reference):
    """Gaits and random commands alike; the reference's own promise is part of the difference."""
    batches, exact = reference
    for batch, reference_swim in zip(batches, exact, strict=True):
        off = errors(swim(batch, Numerics.preset(name), threads=None), reference_swim)
        allowed = promise(name).path_error + promise("reference").path_error
        assert off.path.max() <= allowed
        # The worst is not far below, or the promise would be worth little: within a factor of three on the pairs.
        if batch is batches[0]:
            assert off.path.max() > allowed / 3.0


@pytest.mark.parametrize("error", [0.05, 0.01])
def test_for_error_keeps_the_error_on_unseen_commands(error, reference):
    batches, exact = reference
    found = swim(batches[0], Numerics.for_error(error), threads=None)
    assert errors(found, exact[0]).path.max() <= error + promise("reference").path_error


@pytest.mark.slow
@pytest.mark.parametrize("error", [0.1, 0.02])
def test_for_error_of_any_gait_keeps_it_whatever_command_is_repeated(error):
    exact = swim(gaits(), Numerics.preset("reference"), threads=None)
    found = swim(gaits(), Numerics.for_error(error, any_gait=True), threads=None)
    assert errors(found, exact).path.max() <= error + promise("reference").gait_error


@pytest.mark.slow
@pytest.mark.parametrize("name", ["fast", "balanced"])
def test_many_unseen_sequences_stay_within_the_promise(name):
    many = random_sequences(256, np.random.default_rng(99))
    exact = swim(many, Numerics.preset("reference"), threads=None)
    off = errors(swim(many, Numerics.preset(name), threads=None), exact)
    assert off.path.max() <= promise(name).path_error + promise("reference").path_error


def test_a_fidelity_of_an_environment_has_a_promise():
    simulator = Simulator(Scene(numerics=Numerics.for_error(0.05)))
    assert promise(simulator.scene.numerics).path_error <= 0.05
