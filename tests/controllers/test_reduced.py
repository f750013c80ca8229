"""Models that learned behind a symmetry reduction say so in their files, and swim behind it where they are loaded."""

import copy
import pickle

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from later import Later
from refusals import assert_refused
from seastar_gym import Numerics, Scene, Sight, SymmetryReduction, VectorSymmetryReduction
from seastar_gym.controllers.contract import sees_reduced
from seastar_gym.controllers.reduced import ReducedPolicy
from seastar_gym.controllers.registry import load_agent
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.symmetry import ReducedBox
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.evaluation.benchmark import track_of
from seastar_gym.evaluation.rollout import rollout
from seastar_gym.evaluation.swim import swim

sb3, contrib = Later("stable_baselines3"), Later("sb3_contrib")
adapter = Later("seastar_gym.adapters.stable_baselines3")

FAST = Scene(numerics=Numerics.preset("fast"))
PATH = np.array([[-0.03, 0.01], [0.01, -0.04]])
SWIMS = {"until": 5, "record": ("hub_position", "reward_progress")}


def ppo(env):
    return sb3.PPO("MlpPolicy", env, n_steps=16, n_epochs=1, device="cpu", seed=0).learn(64)


LEARNERS = {
    "PPO": (ppo, "pairs", {}),
    "PPO of limbs": (lambda env: sb3.PPO("MlpPolicy", env, n_steps=16, device="cpu", seed=0), "limbs", {}),
    "SAC": (lambda env: sb3.SAC("MlpPolicy", env, buffer_size=10, device="cpu", seed=0), "continuous", {}),
    "DQN through a camera": (
        lambda env: sb3.DQN("MlpPolicy", env, buffer_size=10, device="cpu").learn(8), "joint", {"sight": Sight()}),
    "MaskablePPO": (
        lambda env: contrib.MaskablePPO("MlpPolicy", env, n_steps=16, device="cpu", seed=0), "pairs", {}),
    "RecurrentPPO": (
        lambda env: contrib.RecurrentPPO("MlpLstmPolicy", env, n_steps=16, device="cpu", seed=0), "pairs", {}),
}  # fmt: skip


def batch_of(actions, more, mode="NextStep"):
    arguments = {"actions": actions, "scene": FAST, "random_heading": True, "autoreset_mode": mode, "threads": 1}
    return SeastarSwimVectorEnv(4, path=PATH, **arguments | more)


def env_of(actions="pairs", **more):
    return SeastarSwimEnv(PATH, actions=actions, scene=FAST, random_heading=True, **more)


def saved(learner, folder):
    """A model, its file, and what it learned in."""
    make, actions, more = LEARNERS[learner]
    batch = batch_of(actions, more, "SameStep")
    model = make(adapter.BatchVecEnv(VectorSymmetryReduction(batch)))
    model.save(folder / "mine.zip")
    return model, str(folder / "mine.zip"), actions, more


def assert_same(found, expected):
    for name, values in expected.entries.items():
        np.testing.assert_array_equal(found.entries[name], values)
    np.testing.assert_array_equal(found.returns, expected.returns)


@pytest.mark.parametrize("learner", LEARNERS)
def test_a_model_from_its_file_swims_as_it_does_behind_the_reduction(learner, tmp_path):
    model, file, actions, more = saved(learner, tmp_path)
    agent = load_agent(file, env_of(**more))  # whatever that environment's actions
    assert agent.actions == actions and track_of(agent) == "symmetric" and not sees_reduced(agent)
    expected = rollout(VectorSymmetryReduction(batch_of(actions, more)), model, seeds=3, **SWIMS)
    assert_same(rollout(batch_of(actions, more), agent, seeds=3, **SWIMS), expected)
    env = env_of(actions, **more)
    expected = rollout(SymmetryReduction(env), model, seeds=3, **SWIMS)
    assert_same(rollout(env, agent, seeds=3, **SWIMS), expected)


def test_a_model_that_sees_reduced_observations_is_refused_where_they_are_not(tmp_path, monkeypatch):
    model, file, *_ = saved("PPO", tmp_path)
    with assert_refused("ReducedPolicy(policy, env)"):
        swim("mine", model, env_of(), max_strokes=1)
    swim("mine", ReducedPolicy(model, env_of()), env_of(), max_strokes=1)
    code = f"from stable_baselines3 import PPO\ndef make(env):\n    return PPO.load({file!r}, device='cpu')\n"
    (tmp_path / "mine_in_a_module.py").write_text(code)
    monkeypatch.syspath_prepend(tmp_path)
    assert track_of(load_agent("mine_in_a_module:make", env_of())) == "symmetric"
    heavy = Scene(gravity=(0.0, -1.0), numerics=FAST.numerics)
    with assert_refused("learned behind a symmetry reduction, but this scene has neither", "gravity has a direction"):
        load_agent(file, SeastarSwimEnv(scene=heavy))


def test_a_model_behind_statistics_that_its_file_has_not_is_told_of(tmp_path):
    normalised = sb3.common.vec_env.VecNormalize(adapter.BatchVecEnv(batch_of("pairs", {}, "SameStep")))
    ppo(normalised).save(tmp_path / "mine.zip")
    with pytest.warns(UserWarning, match=r"mine.zip learned behind VecNormalize: .*\.$"):
        load_agent(str(tmp_path / "mine.zip"), env_of())


class OfMasks:
    """Chooses the last action that a mask has, and shows what it was given."""

    actions, batched = "pairs", True

    def predict(self, observation, state=None, episode_start=None, deterministic=False, action_masks=None):
        return action_masks.shape[-1] - 1 - np.argmax(action_masks[..., ::-1], axis=-1), state


def test_masks_are_those_of_the_robot_that_the_policy_sees():
    env = env_of()
    seen = np.stack([env.reset(seed=seed)[0] for seed in range(20)])
    masks = np.random.default_rng(0).random((20, 21)) < 0.2
    masks[:, 0] = True
    policy = ReducedPolicy(OfMasks(), env)
    actions, state = policy.predict(seen, "remembered", action_masks=masks)
    assert masks[np.arange(20), actions].all() and state == "remembered" and len(set(actions.tolist())) > 3
    assert [policy.predict(seen[k], action_masks=masks[k])[0] for k in range(20)] == actions.tolist()


def test_the_space_of_reduced_observations_is_a_box_for_everybody_else():
    env, plain = SymmetryReduction(env_of()), env_of().observation_space
    with pytest.warns(UserWarning, match="different from the unwrapped"):
        check_env(env, skip_render_check=True)
    space = env.observation_space
    assert space == plain and plain == space and repr(space) == repr(plain)
    for one in (copy.deepcopy(space), pickle.loads(pickle.dumps(space))):
        assert isinstance(one, ReducedBox) and one == plain and one.decision_period == 1.0
    singles = gym.vector.SyncVectorEnv([lambda: SymmetryReduction(env_of())] * 2)
    batch = VectorSymmetryReduction(batch_of("pairs", {}))
    assert isinstance(singles.single_observation_space, ReducedBox)
    assert batch.observation_space == gym.vector.utils.batch_space(batch.single_observation_space, 4)
