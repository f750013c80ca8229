"""The adapter gives Stable-Baselines3 what its own DummyVecEnv of single environments gives it."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from later import Later
from refusals import assert_refused
from seastar_gym.controllers.open_loop import scripted
from seastar_gym.envs.commands import command_table
from seastar_gym.envs.symmetry import SymmetryReduction, VectorSymmetryReduction

adapter = Later("seastar_gym.adapters.stable_baselines3")
common = Later("stable_baselines3.common.env_util")
vec_env = Later("stable_baselines3.common.vec_env")

N, LIMIT = 4, 6
NEAR = np.array([[0.006, 0.0], [0.012, 0.0]])  # straight ahead: reached within the limit, by some actions
SETTINGS = {"path": NEAR, "waypoint_radius": 0.004, "random_heading": True, "fidelity": "fast", "actions": "pairs"}


def make_batch(symmetry=False, **changes):
    settings = {"num_envs": N, "max_episode_steps": LIMIT, "autoreset_mode": AutoresetMode.SAME_STEP, **SETTINGS}
    batch = gym.make_vec("SeastarSwim-v0", vectorization_mode="vector_entry_point", **{**settings, **changes})
    return adapter.BatchVecEnv(VectorSymmetryReduction(batch) if symmetry else batch)


def make_singles(symmetry=False, **changes):
    def make():
        env = gym.make("SeastarSwim-v0", max_episode_steps=LIMIT, **SETTINGS, **changes)
        return common.Monitor(SymmetryReduction(env) if symmetry else env)

    return vec_env.DummyVecEnv([make] * N)


def assert_infos_equal(ours, theirs):
    assert len(ours) == len(theirs) == N
    for one, other in zip(ours, theirs, strict=True):
        assert one.keys() == other.keys()
        for name in one.keys() - {"episode"}:
            assert type(one[name]) is type(other[name]), name
            np.testing.assert_array_equal(one[name], other[name], err_msg=name)
        if "episode" in one:
            assert one["episode"].keys() == other["episode"].keys() == {"r", "l", "t"}
            assert (one["episode"]["r"], one["episode"]["l"]) == (other["episode"]["r"], other["episode"]["l"])
            assert one["episode"]["t"] > 0.0


@pytest.mark.parametrize("symmetry", [False, True])
def test_it_is_the_dummy_vec_env_of_single_environments(symmetry):
    """Observations, rewards, dones and infos, over episodes that end by truncation and by success."""
    batch, singles = make_batch(symmetry), make_singles(symmetry)
    rng = np.random.default_rng(0)
    truncations = successes = 0
    for seed in (3, 100):  # the second reset cuts episodes short
        assert batch.seed(seed) == singles.seed(seed) == [seed + robot for robot in range(N)]
        observations, expected = batch.reset(), singles.reset()
        for _ in range(40):
            np.testing.assert_array_equal(observations, expected)
            assert observations.dtype == expected.dtype
            assert_infos_equal(batch.reset_infos, singles.reset_infos)
            # Mostly the pair that swims towards the waypoint, so that some episodes succeed.
            actions = np.where(rng.random(N) < 0.7, towards_waypoint(observations), rng.integers(0, 21, N))
            observations, rewards, dones, infos = batch.step(actions)
            expected, expected_rewards, expected_dones, expected_infos = singles.step(actions)
            np.testing.assert_array_equal(rewards, expected_rewards)
            np.testing.assert_array_equal(dones, expected_dones)
            assert (rewards.dtype, dones.dtype) == (expected_rewards.dtype, expected_dones.dtype)
            assert_infos_equal(infos, expected_infos)
            truncations += sum(info["TimeLimit.truncated"] for info in infos)
            successes += sum(info["is_success"] for info in infos)
    assert truncations >= 5
    assert successes >= 5


def towards_waypoint(observations):
    """For every robot the pair whose pushes, roughly, add up towards the waypoint."""
    angles = 2 * np.pi / 5 * np.arange(5)
    pushes = -command_table("pairs", 5) @ np.column_stack([-np.sin(angles), np.cos(angles)])
    return np.argmax(observations[:, -4:-2] @ pushes.T, axis=1)


def test_seeds_and_options_of_the_next_reset_count_once():
    batch = make_batch(path="random")
    batch.seed(5)
    first = batch.reset()
    assert batch._seeds == [None] * N
    assert not np.array_equal(batch.reset(), first)
    batch.seed(5)
    np.testing.assert_array_equal(batch.reset(), first)
    batch = make_batch()
    batch.set_options({"path": "square"})
    for distance in (0.2, 0.006):
        batch.reset()
        np.testing.assert_allclose([info["distance"] for info in batch.reset_infos], distance, rtol=1e-12)
    batch.set_options([{}, *[{"path": "square"}] * (N - 1)])
    with assert_refused("one dictionary for all"):
        batch.reset()


class Telling(gym.vector.VectorWrapper):
    """Puts a number, rows of two lengths and a dictionary into info."""

    def step(self, actions):
        *rest, info = super().step(actions)
        return *rest, {**info, "number": 3, "rows": [[1], [2, 3]], "stats": {"x": 1}}


def test_wrappers_may_put_anything_into_info():
    """Gymnasium's statistics of episodes, too, over the end of one."""
    batch = gym.make_vec("SeastarSwim-v0", 2, vectorization_mode="vector_entry_point", fidelity="fast",
                         max_episode_steps=2, autoreset_mode=AutoresetMode.SAME_STEP)  # fmt: skip
    learner = adapter.BatchVecEnv(Telling(gym.wrappers.vector.RecordEpisodeStatistics(batch)))
    learner.reset()
    infos = [learner.step(np.zeros((2, 5), int))[3][1] for _ in range(3)]
    assert all((info["number"], info["rows"], info["stats"]) == (3, [2, 3], {"x": 1}) for info in infos)
    assert infos[1]["TimeLimit.truncated"] and infos[1]["episode"]["l"] == 2


@pytest.mark.parametrize(
    "call, words",
    [
        (lambda: make_batch(autoreset_mode=AutoresetMode.DISABLED), "needs autoreset_mode=AutoresetMode.SAME_STEP"),
        (lambda: make_batch(on_device=True), "needs observations on the processor: make the batch without on_device"),
        (lambda: common.make_vec_env("SeastarSwim-v0", 2, vec_env_cls=adapter.BatchVecEnv), "gym.make_vec"),
        (lambda: make_batch().set_attr("max_episode_steps", 5, indices=0), "for all of them"),
    ],
)
def test_what_is_no_batch_of_the_adapter_is_refused(call, words):
    with assert_refused(words):
        call()


def test_methods_give_every_robot_its_own_as_of_single_environments():
    batch, singles = make_batch(render_mode="rgb_array"), make_singles(render_mode="rgb_array")
    for env in (batch, singles):
        env.seed(3)
        env.reset()
    for name in ("render", "privileged_observations", "action_masks", "sampling_mask"):
        found, expected = batch.env_method(name, indices=[2, 0]), singles.env_method(name, indices=[2, 0])
        assert type(found) is type(expected) and len(found) == 2
        np.testing.assert_array_equal(found, expected)
    assert batch.metadata["render_fps"] == 1


def test_normalisation_goes_on_top_and_evaluation_takes_its_statistics():
    from stable_baselines3.common.evaluation import evaluate_policy

    batch = make_batch(path="pentagon", waypoint_radius=0.01, actions="limbs")
    assert batch.env_is_wrapped(common.Monitor, indices=0) == [True]
    returns, lengths = evaluate_policy(scripted("straight"), batch, n_eval_episodes=N, return_episode_rewards=True)
    assert lengths == [LIMIT] * N
    assert np.ptp(returns) > 0.0  # random headings
    normalised, plain = vec_env.VecNormalize(make_batch(), training=False), make_batch()
    normalised.obs_rms.mean[:] = 1.0
    for env in (normalised, plain):
        env.seed(0)
        env.reset()
    for _ in range(LIMIT):
        observations, _, dones, infos = normalised.step(np.zeros(N, int))
        raw_observations, _, _, raw_infos = plain.step(np.zeros(N, int))
    assert dones.all()
    ends = zip(infos, raw_infos, strict=True)
    pairs = [(info["terminal_observation"], raw["terminal_observation"]) for info, raw in ends]
    for found, raw in [(observations, raw_observations), *pairs]:
        np.testing.assert_allclose(found, raw - 1.0, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("steps, warns", [(4096, False), (4097, True)])
def test_a_rollout_of_more_than_16384_decisions_is_told_of(steps, warns, recwarn):
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import VecMonitor

    learner = PPO("MlpPolicy", VecMonitor(make_batch()), n_steps=steps, batch_size=4 * steps)
    learner._setup_learn(1)
    told = [str(one.message) for one in recwarn if "updates once in" in str(one.message)]
    assert ("PPO updates once in 16,388 decisions" in "".join(told)) == warns == bool(told)


def test_stable_baselines_records_a_video(tmp_path):
    pytest.importorskip("pygame")
    pytest.importorskip("moviepy")
    batch = make_batch(render_mode="rgb_array", num_envs=2)
    recorder = vec_env.VecVideoRecorder(batch, str(tmp_path), lambda step: step == 0, video_length=3)
    recorder.reset()
    for _ in range(4):
        recorder.step(np.ones(2, int))
    recorder.close()
    (video,) = tmp_path.glob("*.mp4")
    assert video.stat().st_size > 1000 and recorder.frames_per_sec == 10
