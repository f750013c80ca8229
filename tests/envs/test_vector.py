"""The native batch does, to the last bit, what the same environments do one by one."""

import copy
import pickle

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

import seastar_gym  # noqa: F401
from episodes import assert_same_infos, assert_same_steps, both, break_robot
from refusals import assert_refused
from seastar_gym import DomainRandomization, Numerics, RewardWeights, Scene, Seastar, SolverStatus, Uniform
from seastar_gym.envs.batch_pictures import picture_size
from seastar_gym.envs.buffers import Buffers
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.simd.lanes import N_LANES

NEXT_STEP, SAME_STEP, DISABLED = AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP, AutoresetMode.DISABLED
ID = "SeastarSwim-v0"
SHORT_PATH = [[0.004, 0.0], [0.009, 0.0]]  # some two strokes of the straight gait


def native(num_envs=3, **arguments) -> SeastarSwimVectorEnv:
    arguments = {"fidelity": "fast"} | arguments
    return gym.make_vec(ID, num_envs, "vector_entry_point", **arguments)


def swim_both(batch, singles, n_strokes: int, seed: int = 0) -> list[tuple]:
    """Steps with the same random actions, straight ones among them; asserts that all they give is the same."""
    rng, steps = np.random.default_rng(seed), []
    (observations, info), (expected, expected_info) = (env.reset(seed=seed) for env in (batch, singles))
    np.testing.assert_array_equal(observations, expected)
    assert_same_infos(info, expected_info)
    for _ in range(n_strokes):
        actions = rng.integers(0, 3, (batch.num_envs, 5))
        actions[rng.random(batch.num_envs) < 0.7] = [0, 1, 0, 0, 2]
        steps.append(batch.step(actions))
        assert_same_steps(steps[-1], singles.step(actions))
    return steps


# The same bits


@pytest.mark.parametrize("autoreset_mode", [NEXT_STEP, SAME_STEP])
@pytest.mark.parametrize(
    "arguments",
    [
        {"max_episode_steps": 5, "path": SHORT_PATH, "waypoint_radius": 0.003},
        {"max_episode_steps": 2, "path": SHORT_PATH, "waypoint_radius": 0.003},  # both ends at once
        {"path": SHORT_PATH, "reward": RewardWeights(100.0, 3.0, 0.2)},
    ],
    ids=["short", "both", "weights"],
)
def test_a_batch_gives_the_bits_of_single_environments_across_resets(autoreset_mode, arguments):
    batch, singles = both(ID, N_LANES + 1, autoreset_mode, **arguments)
    steps = swim_both(batch, singles, 12)
    ends = np.array([step[2] | step[3] for step in steps])
    assert ends.any(axis=0).all()


def test_a_batch_without_autoreset_gives_the_bits_of_single_environments():
    batch, singles = both(ID, 3, DISABLED, path=SHORT_PATH, max_episode_steps=4, waypoint_radius=0.003)
    rng, over = np.random.default_rng(0), np.zeros(3, bool)
    np.testing.assert_array_equal(batch.reset(seed=0)[0], singles.reset(seed=0)[0])
    for _ in range(15):
        if over.any():
            with pytest.raises(gym.error.ResetNeeded, match="reset_mask"):
                batch.step(np.zeros((3, 5), int))
            (one, one_info), (other, other_info) = (
                env.reset(options={"reset_mask": over.copy()}) for env in (batch, singles)
            )
            np.testing.assert_array_equal(one[over], other[over])
            np.testing.assert_array_equal(one, other)
            assert_same_infos(one_info, other_info)
        actions = rng.integers(0, 3, (3, 5))
        actions[rng.random(3) < 0.7] = [0, 1, 0, 0, 2]
        found = batch.step(actions)
        assert_same_steps(found, singles.step(actions))
        over = found[2] | found[3]


@pytest.mark.parametrize("threads", [1, 2])
def test_threads_change_no_bit(threads):
    n = 2 * N_LANES + 1
    one, other = (
        native(n, path="random", max_episode_steps=3, threads=threads),
        native(n, path="random", max_episode_steps=3),
    )
    one.reset(seed=0)
    other.reset(seed=0)
    for k in range(5):
        actions = np.random.default_rng(k).integers(0, 3, (n, 5))
        assert_same_steps(one.step(actions), other.step(actions))


# Contracts


def test_make_vec_gives_the_native_batch_with_the_registered_time_limit():
    batch = gym.make_vec("SeastarSwim-v0", num_envs=2)
    assert isinstance(batch, SeastarSwimVectorEnv)
    assert batch.max_episode_steps == 400 and batch.num_envs == 2
    assert batch.simulator.scene == Scene.preset("balanced")


@pytest.mark.parametrize("autoreset_mode", [NEXT_STEP, SAME_STEP, DISABLED])
def test_metadata_says_how_episodes_begin_again(autoreset_mode):
    assert native().metadata["autoreset_mode"] is NEXT_STEP
    assert native(autoreset_mode=autoreset_mode).metadata["autoreset_mode"] is autoreset_mode
    assert SeastarSwimVectorEnv.metadata["autoreset_mode"] is NEXT_STEP


def test_nothing_that_was_returned_changes_later():
    batch = native(4, path=SHORT_PATH, autoreset_mode=SAME_STEP, max_episode_steps=2)
    returned = [batch.reset(seed=0)]
    for k in range(5):
        kept = copy.deepcopy(returned)
        returned.append(batch.step(np.random.default_rng(k).integers(0, 3, (4, 5))))
        for before, after in zip(kept, returned, strict=False):
            for one, other in zip(before[:-1], after[:-1], strict=True):
                np.testing.assert_array_equal(one, other)
            for name in before[-1]:
                if not isinstance(before[-1][name], dict) and before[-1][name].dtype != object:
                    np.testing.assert_array_equal(before[-1][name], after[-1][name])


def test_what_a_caller_does_to_the_arrays_changes_no_robot():
    meddled, left = native(3, max_episode_steps=2), native(3, max_episode_steps=2)
    meddled.reset(seed=0)
    left.reset(seed=0)
    actions = np.ones((3, 5), int)
    for _ in range(5):
        found, expected = meddled.step(actions), left.step(actions)
        assert_same_steps(found, expected)
        for array in found[:4]:
            array[:] = True
        for name, array in found[4].items():
            array[:] = not name.startswith("_")
    assert actions.min() == 1


# Episodes


def test_next_step_ignores_the_action_after_an_end_and_gives_the_next_first_observation():
    batch = native(2, path="random", max_episode_steps=2)
    batch.reset(seed=0)
    actions = np.ones((2, 5), int)
    batch.step(actions)
    _, _, terminated, truncated, _ = batch.step(actions)
    assert truncated.all() and not terminated.any()
    observations, reward, terminated, truncated, info = batch.step(actions)
    assert not (terminated | truncated).any() and not reward.any()
    assert not info["time"].any() and not info["hub_position"].any()
    np.testing.assert_allclose(0.1 * np.hypot(*observations[:, 182:184].T), info["distance"], rtol=1e-6)
    assert batch.step(actions)[4]["time"].tolist() == [1.0, 1.0]


def test_same_step_puts_the_last_observation_and_info_away():
    batch, alone = (
        native(2, path=SHORT_PATH, waypoint_radius=0.003, autoreset_mode=SAME_STEP),
        native(2, path=SHORT_PATH, waypoint_radius=0.003),
    )
    batch.reset(seed=0)
    alone.reset(seed=0)
    actions = np.array([[0, 1, 0, 0, 2], [0, 0, 0, 0, 0]])
    for _ in range(5):
        found, expected = batch.step(actions), alone.step(actions)
        if expected[2].any():
            break
    assert found[2].tolist() == [True, False]
    info = found[4]
    assert info["_final_obs"].tolist() == info["_final_info"].tolist() == [True, False]
    np.testing.assert_array_equal(info["final_obs"][0], expected[0][0])
    assert info["final_obs"][1] is None
    assert info["final_info"]["is_success"][0] and info["final_info"]["waypoint_index"][0] == 2
    assert info["waypoint_index"].tolist() == [0, 0] and info["time"][0] == 0.0
    np.testing.assert_array_equal(found[0][1], expected[0][1])
    np.testing.assert_array_equal(found[1], expected[1])
    assert "final_obs" not in batch.step(actions)[4]


def test_robot_i_has_seed_plus_i_or_a_seed_of_its_own():
    batch = native(3, path="random", random_heading=True)
    first = batch.reset(seed=5)[0]
    np.testing.assert_array_equal(batch.reset(seed=[7, 5, 6])[0][1:], first[:2])
    np.testing.assert_array_equal(batch.reset(seed=[None, 5, 6])[0][1:], first[:2])
    assert np.abs(batch.reset()[0] - first).max() > 1e-3


def test_paths_may_have_different_lengths_and_change_with_a_reset():
    batch, singles = both(ID, 3, max_episode_steps=3)
    for path in ("line", "figure-eight", [[0.1, 0.0], [0.2, 0.0]], "random"):
        found, expected = (env.reset(seed=2, options={"path": path}) for env in (batch, singles))
        np.testing.assert_array_equal(found[0], expected[0])
        for _ in range(5):  # beyond the time limit: then the environment's own path again
            actions = np.ones((3, 5), int)
            assert_same_steps(batch.step(actions), singles.step(actions))


def test_a_reset_of_some_robots_leaves_the_others_alone():
    batch = native(4)
    batch.reset(seed=0)
    before = batch.step(np.ones((4, 5), int))
    mask = np.array([True, False, False, True])
    observations, info = batch.reset(options={"reset_mask": mask, "path": "line"})
    np.testing.assert_array_equal(observations[~mask], before[0][~mask])
    assert info["_time"].tolist() == mask.tolist()
    assert batch.step(np.ones((4, 5), int))[4]["time"].tolist() == [1.0, 2.0, 2.0, 1.0]


# Infos


@pytest.mark.parametrize("autoreset_mode", [NEXT_STEP, SAME_STEP, DISABLED])
def test_infos_have_the_same_names_types_and_shapes_always(autoreset_mode):
    """On a reset of all robots and of some, on steps, over the ends of episodes, and where the solver gives up."""
    draws = DomainRandomization({"limb_strengths": Uniform(0.5, 1.0)})
    batch = native(3, autoreset_mode=autoreset_mode, max_episode_steps=2, randomization=draws)
    infos, over = [batch.reset(seed=0)[1]], np.zeros(3, bool)
    for stroke in range(6):
        if autoreset_mode is DISABLED and over.any():
            infos.append(batch.reset(options={"reset_mask": over})[1])
        if stroke == 3:
            break_robot(batch, robot=1)
        *_, terminated, truncated, info = batch.step(np.ones((3, 5), int))
        over = terminated | truncated
        infos.append(info)
        infos += [info["final_info"]] if "final_info" in info else []
    for info in infos:
        names = [name for name in info if "final" not in name]
        assert names == list(infos[0])
        for name in names:
            assert (info[name].dtype, info[name].shape) == (infos[0][name].dtype, infos[0][name].shape), name


def test_every_robot_has_its_own_promise():
    batch = native(3)
    batch.reset(seed=0)
    batch.simulator.set_limb_strengths([[1.0] * 5, [0.5] * 5, [1.0] * 5])
    info = batch.step(np.ones((3, 5), int))[4]
    assert np.isnan(info["path_error"]).tolist() == [False, True, False]


# What a vector environment of Gymnasium offers


@pytest.mark.parametrize(
    "name", ["waypoints", "action_space", "observation_space", "actions", "scene", "np_random_seed", "render_mode"]
)
def test_attributes_are_those_of_single_environments(name):
    batch, singles = both(ID, 3, path="random")
    for env in (batch, singles):
        env.reset(seed=4)
    found, expected = batch.get_attr(name), singles.get_attr(name)
    assert type(found) is type(expected) is tuple and len(found) == len(expected) == 3
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_equal(one, other)
    np.testing.assert_equal(batch.call(name), found)


def test_every_robot_has_its_own_scene_and_generator():
    scene = Scene(Seastar(youngs_modulus=np.array([1e6, 2e6, 3e6])), numerics=Numerics.preset("fast"))
    batch = SeastarSwimVectorEnv(3, scene=scene, path="random", random_heading=True)
    assert [one.robot.youngs_modulus for one in batch.get_attr("scene")] == [1e6, 2e6, 3e6]
    batch.reset(seed=[5, 6, 7])
    assert batch.np_random_seed == batch.get_attr("np_random_seed") == (5, 6, 7)
    generators = batch.get_attr("np_random")
    first = batch.reset(seed=[5, 6, 7])[0]
    batch.set_attr("np_random", generators)  # as they are after one draw
    assert np.abs(batch.reset()[0] - first).max() > 1e-3
    batch.set_attr("np_random", [np.random.default_rng(seed) for seed in (6, 5, 7)])
    np.testing.assert_array_equal(batch.reset()[0][[1, 0, 2]], batch.reset(seed=[5, 6, 7])[0])


def test_methods_are_called_and_what_has_to_be_done_together_is_refused():
    batch = native(2)
    batch.reset(seed=0)
    assert batch.call("get_attr", "actions") == (("limbs", "limbs"),) * 2
    for name in ("reset", "step", "close"):
        with assert_refused(f"use {name}()"):
            batch.call(name)
    with pytest.raises(AttributeError, match="no_such_thing"):
        batch.get_attr("no_such_thing")


def test_attributes_are_set_as_in_single_environments():
    batch, singles = both(ID, 3)
    for env in (batch, singles):
        env.set_attr("mark", ["a", "b", "c"])
        assert env.get_attr("mark") == ("a", "b", "c")
        env.set_attr("mark", 7)
        assert env.get_attr("mark") == (7, 7, 7)
        with pytest.raises(ValueError, match="2"):
            env.set_attr("mark", [1, 2])
    batch.set_attr("max_episode_steps", [3, 3, 3])
    assert batch.max_episode_steps == 3
    with assert_refused("max_episode_steps", "the same for all"):
        batch.set_attr("max_episode_steps", [3, 4, 3])


def test_robots_are_drawn_as_alone():
    """Over the end of an episode, in motion, with paths and sizes of their own."""
    pytest.importorskip("pygame")
    draws = DomainRandomization({"robot.limb_length": Uniform(0.08, 0.12)})
    batch, singles = both(ID, 2, path="random", max_episode_steps=3, randomization=draws, render_mode="rgb_array")
    for env in (batch, singles):
        env.reset(seed=1)
    for _ in range(5):
        actions = np.tile([0, 1, 0, 0, 2], (2, 1))
        batch.step(actions)
        singles.step(actions)
        pictures, expected = batch.render(), singles.render()
        assert len(pictures) == 2 and pictures[0].shape == (720, 960, 3) and pictures[0].dtype == np.uint8
        for one, other in zip(pictures, expected, strict=True):
            np.testing.assert_array_equal(one, other)


def test_pictures_of_many_robots_are_small_and_some_can_be_drawn_alone():
    pytest.importorskip("pygame")
    batch = native(40, render_mode="rgb_array", path="random")
    batch.reset(seed=0)
    all_of_them = batch.render()
    assert len(all_of_them) == 40 and {picture.shape for picture in all_of_them} == {(240, 320, 3)}
    np.testing.assert_array_equal(batch.render_robots([7])[0], all_of_them[7])
    again = pickle.loads(pickle.dumps(batch))
    np.testing.assert_array_equal(again.render_robots([7])[0], all_of_them[7])


@pytest.mark.parametrize("n, width", [(1, 960), (4, 960), (5, 640), (9, 640), (10, 480), (26, 320), (10_000, 320)])
def test_pictures_fit_on_a_sheet_until_they_are_too_small(n, width):
    assert picture_size(n) == (width, width * 3 // 4)
    assert all(size % 4 == 0 for size in picture_size(7 * n))


def test_a_batch_without_a_render_mode_warns_and_draws_nothing():
    with pytest.warns(UserWarning, match="draws nothing"):
        assert native().render() is None


@pytest.mark.filterwarnings("ignore")
def test_gymnasium_records_a_video(tmp_path):
    pytest.importorskip("pygame")
    pytest.importorskip("moviepy")
    if not hasattr(gym.wrappers.vector, "RecordVideo"):
        pytest.skip("this Gymnasium records no vector environment")
    batch = native(4, render_mode="rgb_array", max_episode_steps=3)
    recorder = gym.wrappers.vector.RecordVideo(batch, str(tmp_path), episode_trigger=lambda episode: episode == 0)
    recorder.reset(seed=0)
    for _ in range(5):
        recorder.step(np.ones((4, 5), int))
    recorder.close()
    (video,) = tmp_path.glob("*.mp4")
    assert video.stat().st_size > 1000 and recorder.frames_per_sec == 10


# Failure


@pytest.mark.parametrize("status", [SolverStatus.NOT_CONVERGED, SolverStatus.NOT_FINITE])
@pytest.mark.parametrize("autoreset_mode", [NEXT_STEP, SAME_STEP])
def test_a_robot_that_cannot_be_solved_ends_its_episode_and_no_other(autoreset_mode, status):
    well, ill = native(5, autoreset_mode=autoreset_mode), native(5, autoreset_mode=autoreset_mode)
    others = np.arange(5) != 2
    for batch in (well, ill):
        batch.reset(seed=0)
        batch.step(np.ones((5, 5), int))
    break_robot(ill, status, 2)
    actions = np.random.default_rng(0).integers(0, 3, (5, 5))
    for k in range(4):
        observations, reward, terminated, truncated, info = ill.step(actions)
        expected = well.step(actions)
        assert terminated.tolist() == (~others & (k == 0)).tolist() and not truncated.any()
        assert np.isfinite(observations).all() and np.isfinite(reward).all()
        np.testing.assert_array_equal(observations[others], expected[0][others])
        np.testing.assert_array_equal(reward[others], expected[1][others])
        if k == 0:
            final = info if autoreset_mode is NEXT_STEP else info["final_info"]
            assert final["solver_status"][2] == status
            assert not final["is_success"][2]
        else:
            assert not info["solver_status"].any()


def test_the_message_of_a_failed_robot_is_that_of_a_single_environment():
    batch = native(2)
    batch.reset(seed=0)
    break_robot(batch, robot=1)
    info = batch.step(np.zeros((2, 5), int))[4]
    assert info["solver_message"][1] == SolverStatus.NOT_CONVERGED.sentence
    assert info["solver_message"][0] == "" and info["_solver_message"].all()


# Refusals


def test_the_first_reset_is_of_all_robots():
    with pytest.raises(gym.error.ResetNeeded, match="first reset"):
        native().reset(options={"reset_mask": np.array([True, False, True])})


@pytest.mark.parametrize(
    "actions",
    [
        np.zeros((3, 5)),
        np.full((3, 5), np.nan),
        np.zeros((2, 5), int),
        np.zeros(5, int),
        np.full((3, 5), 3),
        None,
        [[0, 1], [0]],
        [[10**400] * 5] * 3,
        np.zeros((3, 5), bool),
        "up",
    ],
    ids=str,
)
def test_what_is_no_action_is_refused_and_changes_nothing(actions):
    batch, twin = native(max_episode_steps=2), native(max_episode_steps=2)
    batch.reset(seed=0)
    twin.reset(seed=0)
    for _ in range(4):
        with pytest.raises(ValueError, match=r'^With actions="limbs" .*\.$'):
            batch.step(actions)
        good = np.ones((3, 5), int)
        assert_same_steps(batch.step(good), twin.step(good))


@pytest.mark.parametrize(
    "options, words",
    [
        ({"heading": 1.0}, "heading"),
        ({"path": "hexagon"}, "hexagon"),
        ({"path": [[0.0, np.inf]]}, "finite"),
        ({"reset_mask": [1, 0, 0]}, "reset_mask"),
        ({"reset_mask": [[True], [True, False]]}, "reset_mask"),
        ({"reset_mask": "True"}, "reset_mask"),
        ({"reset_mask": np.array([True])}, "reset_mask"),
        ({"reset_mask": np.zeros(3, bool)}, "reset_mask"),
    ],
    ids=str,
)
def test_reset_options_that_mean_nothing_are_refused(options, words):
    batch = native()
    batch.reset(seed=0)
    with assert_refused(words):
        batch.reset(options=options)


@pytest.mark.parametrize(
    "arguments, words",
    [
        *(({"num_envs": value}, "num_envs must be a whole number") for value in (0, 2.5)),
        *(({"max_episode_steps": value}, "max_episode_steps") for value in (0, -1, np.nan, np.inf, 2.5, True, "4")),
        ({"threads": 0}, "threads"),
        ({"render_mode": "human"}, 'The batch draws with render_mode="rgb_array"'),
        ({"autoreset_mode": "sometimes"}, "autoreset_mode must be one of .*sometimes"),
    ],
    ids=str,
)
def test_arguments_that_mean_nothing_are_refused(arguments, words):
    with pytest.raises(ValueError, match=words):
        SeastarSwimVectorEnv(**({"num_envs": 2} | arguments))


# A batch writes its results where it is told, the same numbers, and keeps nothing of what it returned.


N = 3


@pytest.fixture
def batches():
    """Two equal batches, whose episodes end after two strokes."""
    made = [
        gym.make_vec("SeastarSwim-v0", N, vectorization_mode="vector_entry_point", fidelity="fast", max_episode_steps=2)
        for _ in range(2)
    ]
    for batch in made:
        batch.reset(seed=0)
    return made


def memory(steps, size, dtype=np.float32):
    """Memory of a learner, whose rows are the buffers of a step."""
    return Buffers(
        np.full((steps, N, size), np.nan, dtype), np.full((steps, N), np.nan, dtype), np.ones((steps, N), bool),
        np.ones((steps, N), bool),
    )  # fmt: skip


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_results_are_written_into_the_rows_of_a_memory(batches, dtype):
    plain, told = batches
    size = plain.single_observation_space.shape[0]
    rows = memory(3, size, dtype)
    for step in range(3):  # the second ends the episodes, the third begins new ones
        actions = np.tile([0, 1, 0, 0, 2], (N, 1))
        expected = plain.step(actions)
        row = Buffers(*(part[step] for part in rows))
        returned = told.step(actions, out=row)
        assert all(one is other for one, other in zip(returned[:4], row, strict=True))
        for part, right in zip(rows, expected[:4], strict=True):
            np.testing.assert_array_equal(part[step], right.astype(part.dtype))
        assert returned[4].keys() == expected[4].keys()
    assert rows.truncated.any(axis=1).tolist() == [False, True, False]


@pytest.mark.parametrize(
    "name, wrong",
    [
        ("observations", np.zeros((N, 5), np.float32)),
        ("rewards", np.zeros(N, bool)),
        ("rewards", [0.0] * N),
        ("terminated", np.zeros(N)),
        ("truncated", np.broadcast_to(False, N)),
    ],
)
def test_arrays_that_do_not_fit_are_refused_before_the_stroke(batches, name, wrong):
    batch, other = batches
    size = batch.single_observation_space.shape[0]
    fitting = Buffers(*(part[0] for part in memory(1, size)))
    with assert_refused(f"out.{name} must be a writeable array of"):
        batch.step(np.zeros((N, 5), int), out=fitting._replace(**{name: wrong}))
    np.testing.assert_array_equal(batch.step(np.zeros((N, 5), int))[0], other.step(np.zeros((N, 5), int))[0])
