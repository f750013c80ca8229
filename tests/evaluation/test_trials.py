"""Disturbances are what they say, and many swims are measured as one is."""

import json

import numpy as np
import pytest

from seastar_gym import Scene, Seastar
from seastar_gym.cli.main import main
from seastar_gym.controllers.open_loop import scripted
from seastar_gym.controllers.search import GreedyPolicy
from seastar_gym.envs.layout import Layout
from seastar_gym.envs.options import SwimOptions, make_scene
from seastar_gym.envs.robots import Robots
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.waypoints import AlongPath
from seastar_gym.evaluation import results as statistics
from seastar_gym.evaluation.swim import DISTURBANCES, Disturbance, DisturbedRobots, swim, swim_many
from seastar_gym.evaluation.trials import SETS, read_trials

FAST = Scene.preset("fast")
N = 16


def disturbed(path="pentagon", scene=FAST, **disturbance):
    rng = np.random.default_rng(0)
    task, options = AlongPath(path, random_heading=True), SwimOptions(scene=scene)
    return begun(DisturbedRobots(Disturbance(**disturbance), rng, task, options, N, 1))


def begun(task):
    task.reset(np.ones(N, bool), [np.random.default_rng(swim) for swim in range(N)])
    return task


def hubs_of(task):
    """Places in the world [m]."""
    return task.facts()["hub_position"]


def test_nothing_disturbed_is_the_task_itself():
    task, plain = disturbed(), begun(Robots(AlongPath(random_heading=True), SwimOptions(scene=FAST), N, 1))
    commands = np.tile([0.0, 1.0, 0.0, 0.0, -1.0], (N, 1))
    for _ in range(3):
        np.testing.assert_array_equal(task.observe(), plain.observe())
        task.step(commands), plain.step(commands)
        np.testing.assert_array_equal(task.last_commands, commands)
    np.testing.assert_array_equal(hubs_of(task), plain.simulator.hub_position())


@pytest.mark.parametrize("mm_per_s", [0.5, 1.5])
def test_a_current_carries_the_robots_its_own_way_and_the_waypoints_stay(mm_per_s):
    task, speed = disturbed(**vars(DISTURBANCES[f"current of {mm_per_s} mm/s"])), 1e-3 * mm_per_s
    first, at = task.observe(), Layout.of(FAST)
    np.testing.assert_allclose(first[:, at.hub_velocity], 0.0, atol=1e-6)  # at rest in the world
    np.testing.assert_array_equal(first[:, at.waypoints], disturbed().observe()[:, at.waypoints])
    waypoint, hubs = np.linalg.norm(first[:, at.current_waypoint], axis=1), []
    for _ in range(80):
        task.step(np.zeros((N, 5)))
        hubs.append(hubs_of(task))
    angles = 2.0 * np.pi * np.arange(N) / 8
    last_strokes = (hubs[-1] - hubs[-11]) / 10.0
    flow = speed * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    np.testing.assert_allclose(last_strokes, flow, atol=0.2 * speed)
    seen = task.observe()
    np.testing.assert_allclose(np.hypot(*seen[:, at.hub_velocity].T) * 0.025, speed, rtol=0.2)
    to_waypoint = np.linalg.norm([0.1437, 0.0] - hubs[-1], axis=1)
    np.testing.assert_allclose(np.linalg.norm(seen[:, at.current_waypoint], axis=1), to_waypoint / 0.1, rtol=1e-5)
    assert waypoint == pytest.approx(1.437)


def test_every_limb_is_the_weak_one_of_some_robot():
    commands = np.tile([1.0, -1.0, 1.0, -1.0, 1.0], (N, 1))
    weak = disturbed(**vars(DISTURBANCES["a limb at half strength"]))
    weak.step(commands)
    np.testing.assert_array_equal(weak.last_commands, commands)
    strengths = np.ones((N, 5))
    strengths[np.arange(N), np.arange(N) % 5] = 0.5
    np.testing.assert_array_equal(weak.simulator.limb_strengths, strengths)
    hub = hubs_of(weak)
    told = disturbed()
    told.step(strengths * commands)
    np.testing.assert_array_equal(hub, hubs_of(told))


def test_noise_is_on_positions_and_has_its_size():
    noisy, clean = disturbed(**vars(DISTURBANCES["1 mm of noise"])).observe(), disturbed().observe()
    error = 0.1 * (noisy - clean)
    np.testing.assert_array_equal(error[:, 90:182], 0.0)  # velocities
    assert error[:, :90].std() == pytest.approx(np.sqrt(2.0) * 1e-3, rel=0.15)  # a node's and the hub's
    np.testing.assert_allclose(error[:, 182:184], error[:, 184:], atol=1e-7)
    assert error[:, 182:].std() == pytest.approx(1e-3, rel=0.5)


def test_lost_strokes_are_lost_whole_and_as_often_as_said():
    lost_strokes = DISTURBANCES["every tenth stroke lost"]
    task, commands = disturbed(**vars(lost_strokes)), np.tile([0.0, 1.0, 0.0, 0.0, -1.0], (N, 1))
    carried_out = np.array([task.step(commands) and task.last_commands for _ in range(30)])
    lost = (carried_out == 0.0).all(axis=2)
    assert lost.mean() == pytest.approx(0.1, abs=0.04)
    np.testing.assert_array_equal(carried_out[~lost], np.broadcast_to(commands, carried_out.shape)[~lost])


@pytest.mark.parametrize(
    "agent, path, period, strokes",
    [(GreedyPolicy(FAST), "square", None, 30), (scripted("lagged", decision_period=0.5), "line", 0.5, 20)],
)
def test_swims_of_a_batch_are_those_of_one_robot(agent, path, period, strokes):
    scene = make_scene(None, "fast", period)
    env = SeastarSwimEnv(path, actions=agent.actions, scene=scene, decision_period=period)
    one = swim("one", agent, env, max_strokes=strokes)
    for done in swim_many("many", agent, path, 3, scene, max_strokes=strokes, threads=1, decision_period=period):
        for name in ("hub", "waypoint_index", "time", "limbs_heated", "heating_time", "energy"):
            np.testing.assert_array_equal(getattr(done, name), getattr(one, name))


# On the command line; more of it in cli/test_cli.py.


@pytest.mark.parametrize(
    "options, sets, words",
    [
        (["--agents", "rest", "--sets", "nominal", "--fidelity", "fast", "balanced", "--seconds", "20"], 2 * 4,
         ("path", "fidelity", "success", "0.0")),
        (["--agents", "rest", "--sets", "nominal", "--fidelity", "fast", "--seconds", "2", "--decision-period", "0.5"],
         4, ("decisions", "of 0.5 s")),
        (["--agents", "straight", "--sets", "nominal", "--scene", "robot.json", "--seconds", "2"], 4, ("its own",)),
        pytest.param(["--agents", "greedy", "pentagon", "--sets", *SETS, "--swims", "4", "--fidelity", "fast"],
                     2 * (4 + 6 + 5), ("success",), marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_the_command_line_writes_a_row_for_every_set_agent_and_fidelity(
    options, sets, words, tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "robot.json").write_text(json.dumps(Scene(Seastar(3, 6)).to_dict()))
    file = tmp_path / "trials.csv"
    assert main(["evaluate", *options, "--num-threads", "1", "--out", str(file)]) == 0
    printed, rows = capsys.readouterr().out, read_trials(file)
    assert len(rows) == sets and all(word in printed for word in words)
    if "balanced" in options:
        assert [row["fidelity"] for row in rows] == ["fast"] * 4 + ["balanced"] * 4
        assert {row["success_rate"] for row in rows} == {0.0}


# Means over seeds and tasks, and their intervals.


def test_means_and_intervals_are_as_kept(golden):
    rng = np.random.default_rng(0)
    found = {
        "of a mean": statistics.mean_with_interval(rng.normal(size=400)),
        "of a constant": statistics.mean_with_interval(np.full(5, 3.0)),
        "of one": statistics.mean_with_interval([3.0]),
        "of nothing": statistics.mean_with_interval(np.zeros(0)),
    }  # fmt: skip
    golden("statistics.txt", "\n".join(f"{name}: {np.round(value, 4).tolist()}" for name, value in found.items()))


@pytest.mark.parametrize("draw", ["normal", "exponential"])
def test_an_interval_covers_the_mean_as_often_as_it_says(draw):
    """The mean of 40 draws, 500 times: 95 % of the intervals, 93 % for skewed draws; one too narrow by 40 %: 76 %."""
    draws = getattr(np.random.default_rng(0), draw)(size=(500, 40))
    _, low, high = np.array([statistics.mean_with_interval(values) for values in draws]).T
    mean = {"normal": 0.0, "exponential": 1.0}[draw]
    covered = np.mean((low <= mean) & (mean <= high))
    assert 0.90 < covered < 0.97
    assert np.mean(high - low) == pytest.approx(2.0 * 1.96 / np.sqrt(40), rel=0.08)
