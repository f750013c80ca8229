"""Learners of Stable-Baselines3 and sb3-contrib learn for an iteration each, on the batch and on one robot."""

import runpy
from dataclasses import replace
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from later import Later
from seastar_gym import Scene, SmaWires
from seastar_gym.controllers.learned import load, save
from seastar_gym.envs.goal import GoalForm
from seastar_gym.evaluation.swim import swim

adapter = Later("seastar_gym.adapters.stable_baselines3")
torch = Later("torch")

REPLAY = {"learning_starts": 4, "buffer_size": 100, "batch_size": 4}
ONCE = {"n_steps": 8, "batch_size": 8, "n_epochs": 1}
LEARNERS = {
    "PPO": ("limbs", ONCE),
    "A2C": ("joint", {"n_steps": 4}),
    "DQN": ("pairs", REPLAY),
    "SAC": ("continuous", REPLAY),
    "TD3": ("continuous", REPLAY),
    "TRPO": ("pairs", {"n_steps": 8, "batch_size": 8}),
    "QRDQN": ("pairs", REPLAY),
    "MaskablePPO": ("limbs", ONCE),
    "RecurrentPPO": ("pairs", ONCE),
}
"""Action mode and arguments of learners."""
ARGUMENTS = {"fidelity": "fast", "max_episode_steps": 5}


def batch(actions, **arguments):
    same_step = {"actions": actions, "autoreset_mode": "SameStep", **arguments}
    return adapter.BatchVecEnv(gym.make_vec("SeastarSwim-v0", 4, vectorization_mode="vector_entry_point", **same_step))


def single(actions, **arguments):
    return gym.make("SeastarSwim-v0", actions=actions, **arguments)


def learner_of(name, env, policy="MlpPolicy", **arguments):
    """A small learner of this kind."""
    import sb3_contrib
    import stable_baselines3

    kind = getattr(stable_baselines3, name, None) or getattr(sb3_contrib, name)
    return kind(policy, env, policy_kwargs={"net_arch": [8]}, seed=0, device="cpu", **arguments)


@pytest.mark.parametrize("make", [batch, single])
@pytest.mark.parametrize("name", LEARNERS)
def test_a_learner_learns_for_an_iteration(name, make):
    actions, arguments = LEARNERS[name]
    policy = "MlpLstmPolicy" if name == "RecurrentPPO" else "MlpPolicy"
    learner = learner_of(name, make(actions, **ARGUMENTS), policy, **arguments)
    before = [weight.detach().clone() for weight in learner.policy.parameters()]
    learner.learn(16)
    assert learner.num_timesteps >= 16
    assert any(not torch.equal(one, other) for one, other in zip(before, learner.policy.parameters(), strict=True))
    observation = np.zeros(learner.observation_space.shape, np.float32)
    assert learner.action_space.contains(np.asarray(learner.predict(observation)[0]))


def test_hindsight_changes_goals_and_learns():
    from stable_baselines3 import HerReplayBuffer

    env, replay = GoalForm(single("continuous", **ARGUMENTS)), REPLAY | {"learning_starts": 8}
    learner = learner_of("SAC", env, "MultiInputPolicy", replay_buffer_class=HerReplayBuffer, **replay).learn(16)
    drawn = learner.replay_buffer.sample(64)
    episode_goals = learner.replay_buffer.observations["desired_goal"][:16, 0]
    goals = drawn.observations["desired_goal"].numpy()
    changed = ~np.isclose(goals[:, None], episode_goals[None], atol=1e-6).all(axis=2).any(axis=1)
    assert changed.any() and not changed.all()
    distance = np.linalg.norm(drawn.next_observations["achieved_goal"].numpy() - goals, axis=1)
    np.testing.assert_array_equal(drawn.rewards.numpy()[:, 0] == 0.0, distance <= 0.1)


def test_a_masked_learner_never_asks_for_what_wires_cannot_follow():
    """Refractory wires that are warm: a command to them would be refused, and counts in info."""
    from sb3_contrib.common.maskable.utils import get_action_masks

    scene = replace(Scene.preset("fast"), actuator=SmaWires(refractory=True))
    env = batch("joint", scene=scene, decision_period=0.2, max_episode_steps=10)
    learner = learner_of("MaskablePPO", env, **ONCE).learn(32)
    seen, refused, closed = env.reset(), 0, 0
    for _ in range(8):
        masks = get_action_masks(env)
        closed += (~masks).sum()
        seen, _, _, infos = env.step(learner.predict(seen, action_masks=masks)[0])
        refused += sum(info["masked_limbs"] for info in infos)
    assert closed > 0 and refused == 0


def test_gymnasiums_torch_wrapper_takes_the_batch_and_every_entry_of_its_info():
    pytest.importorskip("array_api_compat")  # which the wrapper needs, and the extra `learners` has
    env = gym.wrappers.vector.NumpyToTorch(gym.make_vec("SeastarPrey-v0", 2, fidelity="fast", max_episode_steps=2))
    env.reset(seed=0)
    for _ in range(3):
        observations, *_, info = env.step(torch.zeros(2, dtype=torch.int64))
    assert all(isinstance(value, torch.Tensor) for value in [observations, *info.values()])


# Loops and learners of examples/ learn for an iteration each on the native batch.


EXAMPLES = Path(__file__).parents[2] / "examples"


def example(name):
    return runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name=name)


@pytest.fixture(scope="module")
def single_file():
    """The loop in one file, and a training of one iteration."""
    loop = example("single_file_ppo")

    def train(**changed):
        shape = {"num_envs": 8, "rollout": 8, "batch_size": 32, "epochs": 1, "hidden": 8, "num_threads": 1}
        return loop["train"](loop["Options"](**{"strokes": 64, **shape, **changed}), quiet=True)

    return train


def test_the_loop_in_one_file_learns_for_an_iteration_a_policy_of_the_project(single_file, tmp_path):
    one, again, hardly = single_file(), single_file(), single_file(learning_rate=1e-12)
    assert all(np.array_equal(one.weights[name], again.weights[name]) for name in one.weights)
    assert max(np.abs(one.weights[name] - hardly.weights[name]).max() for name in one.weights) > 1e-4
    save(one, tmp_path / "policy.safetensors", strokes=64)
    policy = load(tmp_path / "policy.safetensors")
    env = single(policy.actions, scene=policy.scene).unwrapped
    assert swim("learned", policy, env, max_strokes=2, seed=0).strokes == 2


@pytest.mark.filterwarnings("ignore")  # of the library's own
def test_torchrl_learns_for_an_iteration():
    pytest.importorskip("torchrl")
    loop = example("torchrl_ppo")
    shape = {"num_envs": 8, "rollout": 8, "batch_size": 32, "epochs": 1, "max_episode_steps": 5}
    actor, rewards = loop["train"](loop["Options"](strokes=128, **shape))
    assert len(rewards) == 2 and np.isfinite(rewards).all()
    env = loop["make_env"](loop["Options"](**shape))
    rollout = env.rollout(7, actor, break_when_any_done=False)
    ended = rollout["next", "done"][..., 0]
    assert ended[:, 4].all() and ended.sum() == 8  # all run out of time in the fifth stroke, and begin anew
    waypoints = rollout["observation"][..., -4:-2]
    assert not np.allclose(waypoints[:, 5], rollout["next", "observation"][:, 4, -4:-2])


@pytest.mark.filterwarnings("ignore")
def test_skrl_learns_for_an_iteration():
    pytest.importorskip("skrl")
    loop = example("skrl_ppo")
    shape = {"num_envs": 8, "rollout": 8, "mini_batches": 2, "epochs": 1, "max_episode_steps": 5}
    agents = [loop["train"](loop["Options"](strokes=strokes, **shape)) for strokes in (64, 128)]
    (once, first), (twice, rewards) = agents
    assert len(first) == 8 and len(rewards) == 16 and np.isfinite(rewards).all()
    assert first == rewards[:8]
    weights = [list(agent.models["policy"].parameters()) for agent in (once, twice)]
    assert any(not torch.equal(one, other) for one, other in zip(*weights, strict=True))


@pytest.mark.filterwarnings("ignore")
def test_rllib_learns_for_an_iteration():
    """In an environment of its own, see .ci/learners."""
    pytest.importorskip("ray")
    pytest.importorskip("tree")  # which RLlib needs, and Ray does not
    found = example("rllib")["learner_of"](0, 64, max_episode_steps=5).train()
    assert np.isfinite(found["env_runners"]["episode_return_mean"])


@pytest.mark.filterwarnings("ignore")
def test_a_recorded_dataset_is_swum_again_to_the_bit_and_cloned(tmp_path, monkeypatch):
    minari = pytest.importorskip("minari")
    pytest.importorskip("h5py")
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    offline = example("offline")
    offline["record"]("SeastarSwim/learned-v0", "learned", 2, fidelity="fast", max_episode_steps=20)
    dataset = minari.load_dataset("SeastarSwim/learned-v0")
    env, (_, second) = dataset.recover_environment(), dataset.iterate_episodes()
    observation, info = env.reset(seed=1)
    for step, action in enumerate(second.actions):
        np.testing.assert_array_equal(second.observations[step], observation)
        np.testing.assert_array_equal(second.infos["hub_position"][step], info["hub_position"])
        observation, reward, *_, info = env.step(action)
        assert reward == second.rewards[step]
    seen, actions = offline["decisions_of"](dataset)
    network = offline["clone"](seen, actions, 300)
    assert (network(seen).argmax(1) == actions).float().mean() > 0.7
