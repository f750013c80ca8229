"""One robot behind Gymnasium: spaces, reward, episodes and refusals are what the docstring says."""

import copy
import math
import pickle
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from episodes import break_robot
from refusals import assert_refused
from seastar_gym import (
    Body,
    DomainRandomization,
    Numerics,
    RewardWeights,
    Scene,
    Seastar,
    Simulator,
    SmaPulse,
    SolverStatus,
    Uniform,
)
from seastar_gym.accuracy import chapters_certificate
from seastar_gym.accuracy.info import NAMES
from seastar_gym.envs import rendering
from seastar_gym.envs.paths import PATHS, cross_track_error, shortest_way
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.vector import SeastarSwimVectorEnv

STRAIGHT = np.array([0, 1, 0, 0, 2])
REST = np.zeros(5, int)
FACTS = {
    "time", "hub_position", "waypoint_index", "distance", "cross_track_error", *NAMES,
}  # fmt: skip
OF_A_STROKE = {
    "is_success", "limbs_heated", "heating_time", "energy", "energy_per_metre", "newton_iterations", "solver_status",
    "solver_message", "smallest_opening_angle",
    "reward_progress", "reward_waypoint", "reward_effort",
}  # fmt: skip


def fast(**arguments) -> SeastarSwimEnv:
    return SeastarSwimEnv(fidelity="fast", **arguments)


def random_episode(env, n_strokes: int, seed: int = 0, **options):
    """Observations, rewards and infos of strokes with random actions."""
    rng = np.random.default_rng(seed)
    observation, info = env.reset(seed=seed, **options)
    observations, rewards, infos = [observation], [], [info]
    for _ in range(n_strokes):
        observation, reward, terminated, truncated, info = env.step(rng.integers(0, 3, 5))
        assert not terminated and not truncated
        observations.append(observation)
        rewards.append(reward)
        infos.append(info)
    return np.array(observations), np.array(rewards), infos


# Contracts


def test_gymnasiums_checker_passes_with_pictures(monkeypatch):
    pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "offscreen")
    check_env(gym.make("SeastarSwim-v0", render_mode="rgb_array", fidelity="fast").unwrapped)


@pytest.mark.filterwarnings("ignore")
def test_gymnasiums_checker_passes_without_a_display(no_display):
    """It makes the environment with every render mode that it names."""
    check_env(gym.make("SeastarSwim-v0", fidelity="fast").unwrapped)


@pytest.mark.parametrize("n_limbs, nodes_per_limb", [(3, 4), (6, 10)])
def test_spaces_follow_the_robot(n_limbs, nodes_per_limb):
    scene = Scene(Seastar(n_limbs, nodes_per_limb), actuator=SmaPulse(0.3), numerics=Numerics.preset("fast"))
    env = SeastarSwimEnv(scene=scene)
    assert env.action_space == gym.spaces.MultiDiscrete([3] * n_limbs)
    observation, _ = env.reset(seed=0)
    assert observation.shape == env.observation_space.shape == (4 * 9 * n_limbs + 6,)
    assert env.step([1] + [2] * (n_limbs - 1))[0].shape == observation.shape


@pytest.mark.parametrize("fidelity", ["fast", "chapter"])
def test_info_tells_what_was_measured_of_the_fidelity(fidelity):
    _, info = SeastarSwimEnv(fidelity=fidelity).reset(seed=0)
    known = chapters_certificate().of(Scene.preset(fidelity))
    assert (info["path_error"], info["gait_error"]) == (known.errors["random"], known.errors["repeated"])
    assert (info["typical_error"], info["typical_gait_error"]) == (known.typical["random"], known.typical["repeated"])
    assert (info["space_error"], info["time_error"]) == (known.space_error, known.time_error)
    assert info["batch_real_time_factor"] == known.speed
    assert info["typical_error"] < info["path_error"] and info["typical_gait_error"] < info["gait_error"]
    assert info["path_error"] == pytest.approx(info["space_error"] + info["time_error"], rel=1e-5)


@pytest.mark.parametrize("scene", [Scene(Seastar(youngs_modulus=2e6)), Scene(fluid=None), Scene(Seastar(5, 9))])
def test_info_promises_nothing_for_scenes_that_were_not_measured(scene):
    _, info = SeastarSwimEnv(scene=scene, fidelity="fast").reset(seed=0)
    assert np.isnan([info["path_error"], info["batch_real_time_factor"]]).all()


def test_info_promises_nothing_for_robots_that_were_drawn():
    draws = DomainRandomization({"limb_strengths": Uniform(0.5, 0.9)})
    env = fast(randomization=draws)
    for info in (env.reset(seed=0)[1], env.step(STRAIGHT)[4]):
        assert np.isnan([info["path_error"], info["batch_real_time_factor"]]).all()


def test_info_promises_nothing_once_the_scene_or_a_strength_was_changed():
    env = fast()
    known = env.reset(seed=0)[1]["path_error"]
    chapters = env.simulator.scene
    env.simulator.set_scene(replace(chapters, robot=replace(chapters.robot, youngs_modulus=1.5e6)))
    assert np.isnan(env.step(STRAIGHT)[4]["path_error"])
    env.simulator.set_scene(chapters)
    assert env.step(STRAIGHT)[4]["path_error"] == known
    env.simulator.set_limb_strengths([1.0, 1.0, 0.5, 1.0, 1.0])
    assert np.isnan(env.step(STRAIGHT)[4]["batch_real_time_factor"])


@pytest.mark.parametrize("fidelity", [None, "fast", "chapter"])
def test_a_scene_that_names_no_numerics_swims_at_the_fidelity(fidelity):
    scene = Scene(Seastar(density=1100.0))
    for given in (scene, pickle.loads(pickle.dumps(scene)), replace(scene, contact=None)):
        env = SeastarSwimEnv(scene=given, fidelity=fidelity)
        preset = Scene.preset(fidelity or "balanced")
        assert env.scene == replace(preset, robot=replace(preset.robot, density=1100.0))


def swum_straight(simulator: Simulator) -> bytes:
    simulator.stroke([[0.0, 1.0, 0.0, 0.0, -1.0]])
    return simulator.positions.tobytes()


@pytest.mark.parametrize("fidelity", [None, "fast"])
def test_a_scene_is_swum_alike_however_it_is_asked_for(fidelity):
    scene = Scene() if fidelity is None else Scene.preset(fidelity)
    simulators = [Simulator(scene)]
    for arguments in ({}, {"scene": Scene()}, {"scene": Scene().to_dict()}, {"scene": Scene(Seastar())}):
        env = gym.make("SeastarSwim-v0", **arguments, **({} if fidelity is None else {"fidelity": fidelity}))
        env.reset(seed=0)
        simulators.append(env.unwrapped.simulator)
    assert len({swum_straight(each) for each in simulators}) == 1


def test_numerics_that_a_scene_names_are_kept():
    for numerics in (Numerics("sdirk3", 0.05), Numerics(), replace(Scene().numerics, step=2e-3)):
        assert SeastarSwimEnv(scene=Scene(numerics=numerics)).scene.numerics == numerics
    chapters = Scene.preset("chapter")
    assert SeastarSwimEnv(scene=chapters, fidelity="chapter").scene == chapters


def test_a_fidelity_that_contradicts_the_numerics_of_a_scene_is_refused():
    for make in (SeastarSwimEnv, SeastarSwimVectorEnv):
        with assert_refused('fidelity="fast"', "Numerics()", "give one of them"):
            make(scene=Scene(numerics=Numerics()), fidelity="fast")


def test_a_reset_tells_of_a_stroke_that_has_not_happened():
    info = fast().reset(seed=0)[1]
    assert set(info) == FACTS | OF_A_STROKE
    assert info["smallest_opening_angle"] == pytest.approx(2 * np.pi / 5)
    assert info["is_success"] is False and info["solver_message"] == ""
    assert not any(info[name] for name in OF_A_STROKE - {"smallest_opening_angle"})


def test_limbs_on_a_body_have_no_opening_angle_that_could_close():
    env = fast(scene=Scene(Seastar(4, body=Body.rectangle(0.06, 0.03))))
    infos = [env.reset(seed=0)[1], env.step(np.array([0, 1, 0, 2]))[4]]
    assert [info["smallest_opening_angle"] for info in infos] == [np.pi, np.pi]


@pytest.mark.filterwarnings("ignore")  # about a dataset without a description, and a folder left to the collector
def test_a_dataset_recorder_takes_the_infos(tmp_path, monkeypatch):
    minari = pytest.importorskip("minari")
    pytest.importorskip("jax")
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    env = gym.make("SeastarSwim-v0", fidelity="fast", max_episode_steps=2)
    collector = minari.DataCollector(env, record_infos=True)
    for seed in range(2):
        collector.reset(seed=seed)
        for _ in range(2):
            collector.step(STRAIGHT)
    dataset = collector.create_dataset("seastar/swim-v0")
    assert [len(episode.infos["time"]) for episode in dataset] == [3, 3]


# Physics behind the step


def test_a_step_is_one_stroke_of_the_simulator():
    env = SeastarSwimEnv(scene=Scene(numerics=Numerics("implicit-euler", 0.01)))
    env.reset(seed=0)
    for _ in range(10):
        info = env.step(STRAIGHT)[4]
    assert info["hub_position"][0] == pytest.approx(32.288e-3, rel=1e-3)
    assert info["time"] == 10.0


@pytest.mark.parametrize("actions", ["joint", "pairs"])
def test_table_actions_do_what_the_limb_actions_they_stand_for_do(actions):
    by_table, by_limb = fast(actions=actions), fast()
    row = np.flatnonzero((by_table.command_table == [0, 1, 0, 0, -1]).all(axis=1))
    assert by_limb.command_table is None and len(row) == 1
    by_table.reset(seed=0)
    by_limb.reset(seed=0)
    for action, limbs in ((row[0], STRAIGHT), (0, REST)):
        one, other = by_table.step(action), by_limb.step(limbs)
        np.testing.assert_array_equal(one[0], other[0])
        assert one[1:4] == other[1:4]


# Observation


def test_next_waypoint_is_the_current_one_on_the_last_leg():
    env = fast(path=[[0.004, 0.0], [0.3, 0.1]], waypoint_radius=0.005)
    observation, _ = env.reset(seed=0)
    np.testing.assert_allclose(observation[182:], [0.04, 0.0, 3.0, 1.0], atol=1e-6)
    observation, _, _, _, info = env.step(STRAIGHT)
    assert info["waypoint_index"] == 1
    np.testing.assert_array_equal(observation[182:184], observation[184:186])


@pytest.mark.parametrize("far", [0.05, 0.3, 12.0])
def test_distance_to_the_target_can_be_read_from_the_observation(far):
    env = fast(path=[[0.0, far]])
    observation, info = env.reset(seed=0)
    for _ in range(3):
        assert 0.1 * np.hypot(*observation[182:184].astype(float)) == pytest.approx(info["distance"], rel=1e-6)
        observation, _, _, _, info = env.step(STRAIGHT)


def test_the_same_episode_under_another_heading_looks_the_same():
    """random_heading draws the heading after the path; an array as path draws nothing."""
    path = np.array([[0.1, 0.02], [0.2, -0.05]])
    heading = gym.utils.seeding.np_random(5)[0].uniform(-np.pi, np.pi)
    assert abs(heading) > 0.1
    c, s = np.cos(heading), np.sin(heading)
    here, there = fast(path=path), fast(path=path @ [[c, s], [-s, c]], random_heading=True)
    seen_here, rewards_here, _ = random_episode(here, 20, seed=5)
    seen_there, rewards_there, _ = random_episode(there, 20, seed=5)
    np.testing.assert_allclose(seen_there, seen_here, rtol=0.0, atol=1e-5)
    np.testing.assert_allclose(rewards_there, rewards_here, rtol=0.0, atol=1e-8)
    assert np.abs(there.simulator.positions - here.simulator.positions).max() > 0.01


def test_no_observation_shares_memory_with_the_simulator():
    env = fast()
    _, info = env.reset(seed=0)
    kept = copy.deepcopy(info)
    second = env.step(STRAIGHT)[0]
    np.testing.assert_array_equal(info["hub_position"], kept["hub_position"])
    state, table = env.simulator.get_state(), env.waypoints
    second[:], info["hub_position"][:], table[:] = 7.0, 7.0, 7.0
    np.testing.assert_array_equal(env.simulator.positions, state.positions)
    assert np.abs(env.waypoints).max() < 1.0


# Reward and waypoints


def test_reward_is_the_sum_of_its_terms_and_they_are_what_their_names_say():
    path = np.array([[0.002, 0.001], [0.004, 0.0], [0.15, 0.1]])
    weights = RewardWeights(progress=150.0, waypoint=2.5, effort=0.03, aim=0.6)
    env, rng = fast(path=path, waypoint_radius=0.004, reward=weights), np.random.default_rng(0)
    env.reset(seed=0)
    hub, index = np.zeros(2), 0

    def way_to_go(hub: np.ndarray, index: int) -> float:
        if index == 2:
            return np.linalg.norm(path[2] - hub)
        after = np.linalg.norm(np.diff(path[index + 1 :], axis=0), axis=1).sum()
        return shortest_way(hub, path[index], path[index + 1], 0.6 * 0.004) + after

    indices = []
    for _ in range(15):
        action = rng.integers(0, 3, 5)
        _, reward, _, _, info = env.step(action)
        new_hub, new_index = info["hub_position"], index
        while new_index < 3 and np.linalg.norm(path[new_index] - new_hub) <= 0.004:
            new_index += 1
        assert info["waypoint_index"] == new_index
        assert info["limbs_heated"] == np.count_nonzero(action)
        assert info["reward_progress"] == pytest.approx(150.0 * (way_to_go(hub, index) - way_to_go(new_hub, new_index)))
        assert info["reward_waypoint"] == 2.5 * (new_index - index)
        assert info["reward_effort"] == pytest.approx(-0.03 * np.count_nonzero(action))
        assert reward == pytest.approx(
            info["reward_progress"] + info["reward_waypoint"] + info["reward_effort"], rel=1e-14
        )
        assert info["distance"] == pytest.approx(np.linalg.norm(path[new_index] - new_hub))
        start = path[new_index - 1] if new_index else np.zeros(2)
        assert info["cross_track_error"] == pytest.approx(float(cross_track_error(new_hub, start, path[new_index])))
        hub, index = new_hub, new_index
        indices.append(index)
    assert indices[-1] == 2


def test_progress_adds_up_to_the_way_the_robot_came_nearer():
    """The sum telescopes: no reward is to be had by swimming to and fro."""
    env = fast(path=[[0.3, 0.0]], reward=RewardWeights(progress=1.0, waypoint=0.0, effort=0.0))
    _, rewards, infos = random_episode(env, 30)
    assert rewards.sum() == pytest.approx(infos[0]["distance"] - infos[-1]["distance"], abs=1e-12)


def test_one_stroke_passes_all_the_waypoints_in_reach():
    env = fast(path=[[0.004, 0.0], [0.005, 0.0], [0.006, 0.0], [0.3, 0.0]], waypoint_radius=0.005)
    assert env.reset(seed=0)[1]["waypoint_index"] == 0  # passing takes a stroke
    _, _, terminated, _, info = env.step(STRAIGHT)
    assert info["waypoint_index"] == 3 and not terminated and not info["is_success"]
    assert info["reward_waypoint"] == 3.0


def test_waypoints_count_in_order_only():
    env = fast(path=[[0.3, 0.0], [0.004, 0.0]], waypoint_radius=0.005)
    env.reset(seed=0)
    assert env.step(STRAIGHT)[4]["waypoint_index"] == 0


def test_an_episode_is_over_with_success_at_the_last_waypoint():
    env = fast(path=[[0.012, 0.0]], waypoint_radius=0.005)
    env.reset(seed=0)
    ends = [env.step(STRAIGHT) for _ in range(2)]
    assert [terminated for _, _, terminated, _, _ in ends] == [False, True]
    info = ends[1][4]
    assert info["is_success"] is True and info["waypoint_index"] == 1 and ends[0][4]["is_success"] is False
    assert info["distance"] == pytest.approx(abs(0.012 - info["hub_position"][0]), rel=1e-6)
    with pytest.raises(gym.error.ResetNeeded, match=r"reset\(\)"):
        env.step(STRAIGHT)
    env.reset()
    assert env.step(STRAIGHT)[2] is False


def test_waypoint_radius_is_the_distance_within_which_a_waypoint_counts():
    probe = fast(path=[[0.3, 0.0]])
    probe.reset(seed=0)
    x = probe.step(STRAIGHT)[4]["hub_position"][0]
    for radius, reached in ((0.01, True), (0.0099, False)):
        env = fast(path=[[x + 0.00999, 0.0]], waypoint_radius=radius)
        env.reset(seed=0)
        assert env.step(STRAIGHT)[2] is reached


# Episodes


def test_episodes_without_a_new_seed_differ():
    env = fast(path="random", random_heading=True)
    env.reset(seed=0)
    first, heading = env.waypoints, env.simulator.positions
    env.reset()
    assert np.abs(env.waypoints - first).max() > 1e-3
    assert np.abs(env.simulator.positions - heading).max() > 1e-3


@pytest.mark.parametrize("path", [*PATHS, [[0.1, 0.2]], np.array([[1, 2], [3, 4]])], ids=str)
def test_every_path_can_be_asked_for_at_making_and_at_a_reset(path):
    made, asked = fast(path=path), fast(path="line")
    made.reset(seed=4)
    asked.reset(seed=4, options={"path": path})
    np.testing.assert_array_equal(made.waypoints, asked.waypoints)
    asked.reset(seed=4)
    np.testing.assert_array_equal(asked.waypoints, [[0.3, 0.0]])


def test_a_path_is_copied_when_the_environment_is_made():
    path = np.array([[0.1, 0.2]])
    env = fast(path=path)
    path[:] = 9.0
    env.reset(seed=0)
    np.testing.assert_array_equal(env.waypoints, [[0.1, 0.2]])


def test_random_heading_turns_the_robot_and_its_absence_does_not():
    env = fast(random_heading=True, scene=Scene(Seastar(nodes_per_limb=10)))
    env.reset(seed=0)
    tip = env.simulator.positions[0, 9]
    assert np.hypot(*tip) == pytest.approx(0.1) and abs(tip[1]) > 1e-3
    plain = fast(scene=Scene(Seastar(nodes_per_limb=10)))
    plain.reset(seed=0)
    np.testing.assert_array_equal(plain.simulator.positions[0], Seastar(nodes_per_limb=10).nodes())


# Failure


@pytest.mark.parametrize("status", [SolverStatus.NOT_CONVERGED, SolverStatus.NOT_FINITE])
def test_a_solver_that_gives_up_ends_the_episode_with_a_status_and_a_sentence(status):
    env = fast()
    env.reset(seed=0)
    break_robot(env, status)
    observation, reward, terminated, truncated, info = env.step(STRAIGHT)
    assert terminated is True and truncated is False
    assert SolverStatus(info["solver_status"]) is status
    assert info["solver_message"] == status.sentence
    assert info["is_success"] is False
    assert np.isfinite(observation).all() and math.isfinite(reward)
    no_numbers = "solver_message", "energy_per_metre"  # a robot that makes no way has no energy per metre of it
    assert all(np.isfinite(value).all() for name, value in info.items() if name not in no_numbers)
    with pytest.raises(gym.error.ResetNeeded):
        env.step(STRAIGHT)
    env.reset(seed=0)
    fresh = fast()
    fresh.reset(seed=0)
    np.testing.assert_array_equal(env.step(STRAIGHT)[0], fresh.step(STRAIGHT)[0])


def test_a_converged_stroke_has_no_message():
    env = fast()
    env.reset(seed=0)
    info = env.step(STRAIGHT)[4]
    assert info["solver_status"] == SolverStatus.CONVERGED and info["solver_message"] == ""


# Refusals


@pytest.mark.parametrize(
    "action", [[0.0] * 5, [np.nan] * 5, [0] * 4, 0, [[0] * 5], [3] * 5, [-1] * 5, None, [True] * 5], ids=str
)
def test_what_is_no_action_is_refused_and_changes_nothing(action):
    env = fast()
    env.reset(seed=0)
    env.step(STRAIGHT)
    before = env.simulator.get_state()
    with pytest.raises(ValueError, match=r'^With actions="limbs" .*\.$'):
        env.step(action)
    for one, other in zip(env.simulator.get_state(), before, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize(
    "arguments, words",
    [
        ({"path": "hexagon"}, "hexagon"),
        ({"path": []}, "at least one waypoint"),
        ({"path": [[0.0, np.nan]]}, "finite"),
        ({"path": [1.0, 2.0]}, "shape"),
        ({"path": None}, "path"),
        ({"actions": "binary"}, "actions"),
        ({"fidelity": "exact"}, "fidelity"),
        ({"scene": "chapter"}, "Scene"),
        ({"scene": Seastar()}, "Scene"),
        ({"reward": {"progress": 1.0}}, "RewardWeights"),
        ({"reward": 1.0}, "RewardWeights"),
        ({"waypoint_radius": 0.0}, "waypoint_radius"),
        ({"waypoint_radius": np.nan}, "waypoint_radius"),
        ({"waypoint_radius": "10 mm"}, "waypoint_radius"),
        ({"waypoint_radius": 1e300}, "waypoint_radius"),
        ({"waypoint_radius": np.array([0.01])}, "waypoint_radius"),
        ({"waypoint_radius": True}, "waypoint_radius"),
        ({"path": [[0.1, 0.0], [0.1, 0.0]]}, "are the same point"),
        ({"path": [[0.0, 0.0]]}, "must lead away from the origin"),
        ({"path": [[1e300, 0.0]]}, "within"),
        ({"path": [[True, False]]}, "numbers"),
        ({"path": [[10**400, 0]]}, "numbers"),
        ({"path": b"pentagon"}, "name"),
        ({"random_heading": "False"}, "random_heading"),
        ({"random_heading": np.nan}, "random_heading"),
        ({"random_heading": np.array([True])}, "random_heading"),
        ({"randomization": {}}, "DomainRandomization"),
        ({"render_mode": "ansi"}, "render_mode"),
        *(({"frames_per_stroke": n}, "frames_per_stroke must be a whole number") for n in (0, -1, 2.5, True)),
        ({"scene": Scene(Seastar(hub_hinge="turning", discretisation="chapter"))}, "turning"),
    ],
    ids=str,
)
def test_arguments_that_mean_nothing_are_refused_with_a_sentence(arguments, words):
    for make in (SeastarSwimEnv, SeastarSwimVectorEnv):
        if make is SeastarSwimEnv or not {"render_mode", "frames_per_stroke"} & {*arguments}:  # a batch has its own
            with assert_refused(words):
                make(**arguments)


@pytest.mark.parametrize(
    "options, words",
    [
        ({"heading": 1.0}, "heading"),
        ({"Path": "line"}, "Path"),
        ({"path": "hexagon"}, "hexagon"),
        ({"path": [[np.nan, 0]]}, "finite"),
        ({"path": []}, "at least one"),
    ],
)
def test_reset_options_that_mean_nothing_are_refused_and_the_episode_goes_on(options, words):
    env = fast()
    env.reset(seed=0)
    env.step(STRAIGHT)
    before, waypoints = env.simulator.positions, env.waypoints
    with assert_refused(words):
        env.reset(options=options)
    np.testing.assert_array_equal(env.simulator.positions, before)
    np.testing.assert_array_equal(env.waypoints, waypoints)
    assert env.step(STRAIGHT)[4]["time"] == 2.0


# Pictures


@pytest.mark.parametrize("render_mode", ["rgb_array", "rgb_array_list", "human"])
def test_being_watched_changes_no_bit(render_mode, dummy_window, monkeypatch):
    shown, show = [], rendering.Renderer.show
    monkeypatch.setattr(rendering.Renderer, "show", lambda *given, fps: shown.append(fps) or show(*given, fps))
    watched, alone = fast(render_mode=render_mode, frames_per_stroke=3), fast()
    pictures, actions = [], [STRAIGHT, [1, 2, 0, 1, 0]]
    for env in (watched, alone):
        env.reset(seed=0)
    for action in actions[:1] if render_mode == "human" else actions:  # a window shows a stroke in a second
        one, other = watched.step(action), alone.step(action)
        np.testing.assert_array_equal(one[0], other[0])
        assert one[1:4] == other[1:4]
        pictures.append(watched.render())
    match render_mode:
        case "rgb_array":
            assert pictures[0].dtype == np.uint8 and pictures[0].ndim == 3 and np.any(pictures[0] != pictures[1])
        case "rgb_array_list":
            assert [len(frames) for frames in pictures] == [4, 3]  # the first with that of the reset
        case "human":
            assert pictures == [None] and shown
    watched.close()
    watched.close()


def test_rendering_without_a_mode_warns_and_draws_nothing():
    env = fast()
    env.reset(seed=0)
    with pytest.warns(UserWarning, match="render_mode"):
        assert env.render() is None
