"""The offline search in time tries every command that is heard, keeps different swims, and foresees how they coast."""

import json
from dataclasses import replace

import numpy as np
import pytest

from seastar_gym.envs.commands import command_table
from seastar_gym.scene import Scene
from seastar_gym.scene.actuators.wires import SmaWires
from seastar_gym.simulator import Simulator
from studies.learning.branches import CHUNK, Branches
from studies.learning.coasting import SECONDS, fit_coasting, ridge
from studies.learning.pentagon import Options, audible, best_of, main, search, way_left

DEAF = replace(Scene.preset("fast"), actuator=SmaWires(deaf=True))
PAIRS = command_table("pairs", 5)
CORNER = np.array([[0.03, 0.0], [0.03, 0.03]])


def test_commands_to_deaf_limbs_are_not_tried_and_rest_always_is():
    simulator = Simulator(DEAF)
    simulator.advance(0.2, np.array([[0.0, 1.0, 0.0, 0.0, -1.0]]))
    (tried,) = audible(PAIRS, simulator.deaf_wires())
    assert tried[0] and tried.sum() == 7  # rest, and the pairs of limbs 1, 3 and 4
    assert not PAIRS[tried][:, [1, 4]].any()


def test_all_commands_are_tried_again_once_wires_are_cold():
    branches = Branches(DEAF, 0.2)
    states = branches.swim(branches.at_rest(), PAIRS[[1]]).states
    for _ in range(4):
        assert not audible(PAIRS, branches.deaf_wires(states)).all()
        states = branches.swim(states, PAIRS[[0]]).states
    assert audible(PAIRS, branches.deaf_wires(states)).all()


def test_the_best_swims_are_kept_but_few_that_are_alike():
    value = np.array([3.0, 1.0, 2.0, 0.5, 4.0])
    alike = np.array([[1, 1], [0, 1], [0, 1], [0, 1], [2, 0]])
    np.testing.assert_array_equal(best_of(value, alike, beam=4, most=2), [3, 1, 0, 4])
    np.testing.assert_array_equal(best_of(value, alike, beam=2, most=5), [3, 1])


def test_branches_swim_as_one_robot_does_whatever_their_number():
    branches, n = Branches(DEAF, 0.2), CHUNK + 3
    commands = PAIRS[np.arange(n) % len(PAIRS)]
    done = branches.swim(branches.at_rest().of_robots(np.zeros(n, np.intp)), commands)
    simulator = Simulator(DEAF)
    report = simulator.advance(0.2, commands[-1:])
    np.testing.assert_array_equal(done.states.positions[-1], simulator.positions[0])
    assert len(done.heated) == n and done.heated[-1] == report.heating_time[0] == pytest.approx(0.2)


def test_coasting_is_foreseen_on_swims_that_were_not_fitted():
    coasting = fit_coasting(DEAF, 0.2, np.random.default_rng(0))
    assert coasting.explained > 0.9
    simulator = Simulator(DEAF)
    simulator.advance(0.2, PAIRS[[1]])
    simulator.advance(0.2, PAIRS[[0]])
    foreseen, before = coasting(simulator.get_state())[0], simulator.hub_position()[0]
    simulator.advance(SECONDS)
    swum = simulator.hub_position()[0] - before
    assert np.linalg.norm(foreseen - swum) < 0.4 * np.linalg.norm(swum)


def test_a_ridge_fit_finds_a_linear_function():
    x = np.random.default_rng(0).normal(size=(200, 3)) * [1.0, 1e-3, 1e3]
    expected = np.array([[1.0, 2.0], [-3e3, 0.0], [0.0, 1e-3]])
    np.testing.assert_allclose(ridge(x, x @ expected), expected, rtol=1e-3, atol=1e-3)


def test_the_way_left_goes_by_all_waypoints_that_are_left():
    line = np.array([[0.1, 0.0], [0.2, 0.0], [0.3, 0.0]])
    left = way_left(np.zeros((4, 2)), np.arange(4), line)
    np.testing.assert_allclose(left, [0.3, 0.3, 0.3, 0.0], atol=1e-9)


def test_decisions_in_time_are_faster_than_strokes_and_re_heated_wires_faster_still():
    seconds = {}
    for deaf in (True, False):
        seconds[deaf] = 0.2 * len(search(Options(beam=10, deaf=deaf), CORNER, None).actions)
    assert 0.0 < seconds[False] <= seconds[True] < 8.0  # bound.py's search takes ten strokes of a second


@pytest.mark.slow
def test_the_study_writes_a_swim_that_reaches_every_waypoint_again(tmp_path, capsys):
    file = tmp_path / "pentagon.json"
    assert main(["--beam", "8", "--again", "fast", "--out", str(file)]) == 0
    results = json.loads(file.read_text(encoding="utf-8"))
    assert results["seconds"] < 95.0 and len(results["gait"]) == results["decisions"]
    assert max(results["again"]["fast"]["nearest_mm"]) <= 10.0
    assert results["heated_s"] == pytest.approx(0.1 * results["limbs_heated"])


def test_a_search_that_finds_nothing_says_so(capsys):
    assert main(["--beam", "1", "--max-seconds", "0.4", "--no-coasting"]) == 1
    assert "No swim ended within 0.4 s." in capsys.readouterr().out
