"""Progress by where the hub would come to rest: what is predicted, and what it adds to the reward."""

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from later import Later
from seastar_gym.envs.options import make_scene
from seastar_gym.envs.rewards import RewardWeights
from seastar_gym.envs.stations import body_heading
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.simulator import Simulator

ppo = Later("agents.ppo")

PERIOD = 0.2
SCENE = make_scene(None, "fast", PERIOD)


@pytest.fixture(scope="module")
def fitted():
    """Fitted to fewer swims than a training's."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("agents.ppo.ROBOTS", 128)
        yield ppo.fit_coasting(SCENE, PERIOD, np.random.default_rng(0))


def batch(n_robots, **arguments):
    return SeastarSwimVectorEnv(
        n_robots, actions="pairs", scene=SCENE, decision_period=PERIOD, random_heading=True, threads=1,
        autoreset_mode=AutoresetMode.SAME_STEP, **arguments,
    )  # fmt: skip


def test_it_foretells_where_other_robots_come_to_rest(fitted):
    env, simulator = batch(64), Simulator(SCENE, 64, threads=1)
    observations, _ = env.reset(seed=5)
    at_rest = SCENE.robot.limb_length * ppo.coasted(fitted, observations)
    assert np.abs(at_rest).max() < 2e-4  # goes nowhere
    env.action_space.seed(6)
    for _ in range(7):
        observations, *_ = env.step(env.action_space.sample())
    simulator.set_state(env.simulator.get_state())
    simulator.advance(2.0)
    moved = simulator.hub_position() - env.simulator.hub_position()
    heading = body_heading(env.simulator.positions, SCENE.robot)
    along = (moved * np.stack([np.cos(heading), np.sin(heading)], axis=1)).sum(axis=1)
    foretold = SCENE.robot.limb_length * ppo.coasted(fitted, observations)
    assert np.sqrt(np.mean(moved**2)) > 1e-3
    assert np.mean((foretold[:, 0] - along) ** 2) < 0.1 * np.mean(along**2)
    np.testing.assert_allclose(np.mean(foretold**2), np.mean(moved**2), rtol=0.2)


def test_what_is_added_is_the_change_of_the_way_saved(fitted):
    actions = [3, 3, 0, 7, 7, 0, 0, 0, 0, 0, 0]
    plain, shaped = batch(8), ppo.CoastingProgress(batch(8), fitted, RewardWeights())
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


def test_the_last_step_of_an_episode_has_the_environment_s_own_reward(fitted):
    arguments = {"path": [[0.0, 0.0105]], "max_episode_steps": 2}
    plain, shaped = batch(4, **arguments), ppo.CoastingProgress(batch(4, **arguments), fitted, RewardWeights())
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
    monkeypatch.setattr("agents.ppo.ROBOTS", 32)
    hyperparameters = ppo.Hyperparameters(num_envs=8, rollout=8, batch_size=32, decision_period=PERIOD, coasting=asked)
    env = ppo.make_training_env(hyperparameters, "random", True, fidelity="fast", threads=1)
    assert env.env_is_wrapped(ppo.CoastingProgress)[0] == asked
    env.reset()
    _, rewards, _, infos = env.step(np.arange(8))
    own = [sum(value for name, value in info.items() if name.startswith("reward_")) for info in infos]
    assert np.allclose(rewards, own, atol=1e-5) != asked
