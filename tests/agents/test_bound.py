"""The searches leave nothing out that symmetry does not bring back, and find what is known."""

import itertools
import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from agents import coasting
from agents.coasting import CoastingProgress, fit_coasting
from agents.hyperparameters import Hyperparameters
from agents.ppo import make_training_env
from seastar_gym import Numerics, Scene
from seastar_gym.controllers.scripted import to_actions
from seastar_gym.envs.commands import command_table
from seastar_gym.envs.options import make_scene
from seastar_gym.envs.paths import make_path
from seastar_gym.envs.reward import RewardWeights
from seastar_gym.envs.stations import body_heading
from seastar_gym.envs.symmetry import action_table
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.gaits import pair_gait
from seastar_gym.simulator import Simulator
from studies.command import main
from studies.learning import bound
from studies.learning.bound import (
    all_directions,
    distinct_gaits,
    draw,
    measure,
    mixed_speed,
    search_path,
)

FAST = Scene(numerics=Numerics.preset("fast"))


@pytest.mark.parametrize(("period", "actions", "classes"), [(1, "pairs", 5), (1, "joint", 30), (2, "pairs", 35)])
def test_every_gait_is_the_image_of_exactly_one(period, actions, classes):
    gaits = distinct_gaits(period, actions)
    assert len(gaits) == classes
    images = [
        {tuple(np.roll(carried[gait], shift)) for carried in action_table(actions, 5) for shift in range(period)}
        for gait in gaits
    ]
    n_actions = len(command_table(actions, 5))
    assert set().union(*images) == set(itertools.product(range(n_actions), repeat=period))
    assert sum(map(len, images)) == n_actions**period


def test_the_alternation_is_faster_than_either_pair():
    pairs = to_actions(np.concatenate([pair_gait(3, 4), pair_gait(2, 5)]), "pairs", 5)
    gaits = np.array([[pairs[0], pairs[0]], [pairs[1], pairs[1]], pairs])
    first, second, both = np.linalg.norm(measure(FAST, gaits, "pairs").hub, axis=1)
    assert both > 1.05 * max(first, second)


def test_gaits_in_turns_make_the_speeds_of_their_convex_hull():
    square = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0], [0.5, 0.0]])
    np.testing.assert_allclose(mixed_speed(square, np.radians([0.0, 45.0, 180.0])), [1.0, np.sqrt(2.0), 1.0])


def test_directions_are_turned_and_mirrored():
    ten = all_directions(np.array([[np.cos(0.1), np.sin(0.1)]]))
    angles = np.sort(np.arctan2(ten[:, 1], ten[:, 0]))
    expected = np.concatenate([k * 0.4 * np.pi + np.array([-0.1, 0.1]) for k in (-2, -1, 0, 1, 2)])
    np.testing.assert_allclose(angles, expected, atol=1e-12)


def test_the_path_search_visits_all_waypoints_or_says_that_it_did_not():
    corner = np.array([[0.03, 0.0], [0.03, 0.03]])
    assert 8 <= len(search_path(FAST, corner, "pairs", beam=4)) <= 12
    assert len(search_path(FAST, corner, "pairs", beam=1, max_strokes=3)) == 0


def test_the_narrowest_search_swims_round_the_pentagon():
    waypoints = make_path("pentagon", np.random.default_rng(0))
    assert 145 < len(search_path(FAST, waypoints, "pairs", beam=1)) < 180


@pytest.mark.slow
def test_the_study_writes_numbers_and_a_picture(tmp_path, monkeypatch):
    file = tmp_path / "bound.json"
    monkeypatch.setattr(bound, "STUDY", replace(bound.STUDY, run=partial(bound.run, beam=1)))
    assert main(["learning.bound", "--out", str(file)]) == 0
    results = json.loads(file.read_text(encoding="utf-8"))
    assert results["fastest_gaits"][0]["searched"] == 30
    assert len(results["pentagon"]["gait"]) == results["pentagon"]["strokes"] > 150
    draw(results, tmp_path / "again.png")
    assert file.with_suffix(".png").stat().st_size > 10_000


# Progress by where the hub would come to rest: what is predicted, and what it adds to the reward.


PERIOD = 0.2
SCENE = make_scene(None, "fast", PERIOD)


@pytest.fixture(scope="module")
def fitted():
    """Fitted to fewer swims than a training's."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(coasting, "ROBOTS", 128)
        yield fit_coasting(SCENE, PERIOD, np.random.default_rng(0))


def batch(n_robots, **arguments):
    return SeastarSwimVectorEnv(
        n_robots, actions="pairs", scene=SCENE, decision_period=PERIOD, random_heading=True, threads=1,
        autoreset_mode=AutoresetMode.SAME_STEP, **arguments,
    )  # fmt: skip


def test_it_foretells_where_other_robots_come_to_rest(fitted):
    env, simulator = batch(64), Simulator(SCENE, 64, threads=1)
    env.reset(seed=5)
    env.action_space.seed(6)
    for _ in range(7):
        observations, *_ = env.step(env.action_space.sample())
    simulator.set_state(env.simulator.get_state())
    simulator.advance(2.0)
    moved, heading = (
        simulator.hub_position() - env.simulator.hub_position(),
        body_heading(env.simulator.positions, SCENE.robot),
    )
    along = (moved * np.stack([np.cos(heading), np.sin(heading)], axis=1)).sum(axis=1)
    foretold = SCENE.robot.limb_length * fitted(observations)
    assert np.sqrt(np.mean(moved**2)) > 1e-3
    assert np.mean((foretold[:, 0] - along) ** 2) < 0.1 * np.mean(along**2)
    np.testing.assert_allclose(np.mean(foretold**2), np.mean(moved**2), rtol=0.2)


def test_a_robot_at_rest_goes_nowhere(fitted):
    observations, _ = batch(4).reset(seed=0)
    assert np.abs(SCENE.robot.limb_length * fitted(observations)).max() < 2e-4


def test_what_is_added_is_the_change_of_the_way_saved(fitted):
    weights, actions = RewardWeights(), [3, 3, 0, 7, 7, 0, 0, 0, 0, 0, 0]
    plain, shaped = batch(8), CoastingProgress(batch(8), fitted, weights)
    before, _ = plain.reset(seed=1)
    shaped.reset(seed=1)
    added = np.zeros(8)
    for action in actions:
        after, rewards, *_ = plain.step(np.full(8, action))
        observations, more, *_ = shaped.step(np.full(8, action))
        np.testing.assert_array_equal(observations, after)
        added += more - rewards
    np.testing.assert_allclose(added, 200.0 * (shaped.gain(after) - shaped.gain(before)), atol=1e-9)
    swum = np.linalg.norm(plain.simulator.hub_position(), axis=1)
    assert swum.min() > 1e-3
    assert np.abs(shaped.gain(after)).max() < swum.min() / 7.0  # at rest, but for the fit


def test_progress_counts_before_the_way_is_swum(fitted):
    """At the end of a pulse towards the waypoint, most of its way is still to come or to be lost."""
    env = CoastingProgress(batch(20, path=[[0.0, 0.3]]), fitted, RewardWeights())
    env.reset(seed=1)
    observations, *_ = env.step(np.arange(1, 21))
    now = env.gain(observations)
    hub = env.unwrapped.simulator.hub_position().copy()
    for _ in range(8):
        env.step(np.zeros(20, int))
    came = np.linalg.norm([0.0, 0.3] - hub, axis=1) - np.linalg.norm(
        [0.0, 0.3] - env.unwrapped.simulator.hub_position(), axis=1
    )
    assert np.corrcoef(now, came)[0, 1] > 0.95


def test_the_last_step_of_an_episode_has_the_environment_s_own_reward(fitted):
    arguments = {"path": [[0.0, 0.0105]], "max_episode_steps": 2}
    plain, shaped = batch(4, **arguments), CoastingProgress(batch(4, **arguments), fitted, RewardWeights())
    plain.reset(seed=3)
    shaped.reset(seed=3)
    for step in range(2):
        _, rewards, *_ = plain.step(np.full(4, 5))
        _, more, terminated, truncated, _ = shaped.step(np.full(4, 5))
        over = terminated | truncated
        np.testing.assert_array_equal(more[over], rewards[over])
        assert (more != rewards)[~over].all() and over.any() == (step == 1 or terminated.any())
    assert over.any()


@pytest.mark.parametrize("asked", [False, True])
def test_a_training_has_it_where_it_is_asked_for(asked, monkeypatch):
    monkeypatch.setattr(coasting, "ROBOTS", 32)
    hyperparameters = Hyperparameters(num_envs=8, rollout=8, batch_size=32, decision_period=PERIOD, coasting=asked)
    env = make_training_env(hyperparameters, "random", True, "fast", threads=1)
    assert env.env_is_wrapped(CoastingProgress)[0] == asked
    env.reset()
    _, rewards, _, infos = env.step(np.arange(8))
    own = [sum(value for name, value in info.items() if name.startswith("reward_")) for info in infos]
    assert np.allclose(rewards, own, atol=1e-5) != asked
