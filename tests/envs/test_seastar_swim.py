"""One robot behind Gymnasium: spaces, reward, episodes and refusals are what the docstring says."""

import copy
import pickle
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest

from seastar_gym import Body, DomainRandomization, RewardWeights, Scene, Seastar, SmaWires, ThermalSma, Uniform
from seastar_gym.envs import rendering, seastar_swim
from seastar_gym.envs.paths import cross_track_error, shortest_way
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.vector import SeastarSwimVectorEnv

STRAIGHT = np.array([0, 1, 0, 0, 2])


def fast(**arguments) -> SeastarSwimEnv:
    return SeastarSwimEnv(fidelity="fast", **arguments)


# Contracts


SOFT, HOT = Seastar(youngs_modulus=2e6), ThermalSma(largest_temperature=60.0)


@pytest.mark.parametrize(
    "scene, period",
    [*((scene, None) for scene in (Scene(SOFT), Scene(fluid=None), Scene(Seastar(5, 15)), None)),
     (Scene(actuator=SmaWires()), 0.05),
     *((scene, 0.2) for scene in (Scene(SOFT, actuator=SmaWires()), Scene(actuator=SmaWires(refractory=True)),
                                  Scene(actuator=HOT)))],
)  # fmt: skip
def test_info_promises_nothing_for_robots_and_times_that_were_not_measured_or_were_drawn(scene, period):
    draws = None if scene else DomainRandomization({"limb_strengths": Uniform(0.5, 0.9)})
    env = SeastarSwimEnv(scene=scene, fidelity="fast", randomization=draws, decision_period=period)
    for info in (env.reset(seed=0)[1], env.step(STRAIGHT)[4]):
        assert np.isnan([info["path_error"], info.get("batch_real_time_factor", np.nan)]).all()
    env = fast()  # and nothing once the scene or a strength was changed
    known = env.reset(seed=0)[1]["path_error"]
    chapters = env.simulator.scene
    env.simulator.set_scene(replace(chapters, robot=replace(chapters.robot, youngs_modulus=1.5e6)))
    assert np.isnan(env.step(STRAIGHT)[4]["path_error"])
    env.simulator.set_scene(chapters)
    assert env.step(STRAIGHT)[4]["path_error"] == known
    env.simulator.set_limb_strengths([1.0, 1.0, 0.5, 1.0, 1.0])
    assert np.isnan(env.step(STRAIGHT)[4]["batch_real_time_factor"])


@pytest.mark.parametrize("fidelity", [None, "fast"])
def test_a_scene_that_names_no_numerics_is_swum_at_the_fidelity_however_it_is_asked_for(fidelity):
    asked = {} if fidelity is None else {"fidelity": fidelity}
    scene, preset = Scene(Seastar(density=1100.0)), Scene.preset(fidelity or "balanced")
    for arguments in ({}, {"scene": Scene()}, {"scene": Scene().to_dict()}, {"scene": Scene(Seastar())}):
        assert gym.make("SeastarSwim-v0", **arguments, **asked).unwrapped.simulator.scene == preset
    for given in (scene, pickle.loads(pickle.dumps(scene)), replace(scene, contact=None)):
        found = SeastarSwimEnv(scene=given, **asked).scene
        assert found == replace(preset, robot=replace(preset.robot, density=1100.0))


@pytest.mark.parametrize(
    "scene, angle", [(None, 2 * np.pi / 5), (Scene(Seastar(4, body=Body.rectangle(0.06, 0.03))), np.pi)]
)
def test_a_reset_tells_of_a_stroke_that_has_not_happened(scene, angle):
    """Limbs on a body have no opening angle that could close."""
    env = fast(scene=scene)
    info = env.reset(seed=0)[1]
    of_a_stroke = [*info][[*info].index("is_success") :]
    assert info["smallest_opening_angle"] == pytest.approx(angle) and info["is_success"] is False
    assert len(of_a_stroke) == 11 and not any(info[name] for name in of_a_stroke if "angle" not in name)
    angle_then = env.step([0, 1, 0, 2, 0][: env.scene.robot.n_limbs])[4]["smallest_opening_angle"]
    assert (angle_then == np.pi) == (scene is not None)


# Observation


def test_next_waypoint_is_the_current_one_on_the_last_leg():
    env = fast(path=[[0.004, 0.0], [0.3, 0.1]], waypoint_radius=0.005)
    observation, _ = env.reset(seed=0)
    np.testing.assert_allclose(observation[182:], [0.04, 0.0, 3.0, 1.0], atol=1e-6)
    observation, _, _, _, info = env.step(STRAIGHT)
    assert info["waypoint_index"] == 1
    np.testing.assert_array_equal(observation[182:184], observation[184:186])


# Reward and waypoints


def test_terms_of_the_reward_are_what_their_names_say():
    path = np.array([[0.002, 0.001], [0.004, 0.0], [0.15, 0.1]])
    weights = RewardWeights(progress=150.0, waypoint=2.5, effort=0.03, aim=0.6, time=0.25)
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
        *_, info = env.step(action)
        new_hub, new_index = info["hub_position"], index
        while new_index < 3 and np.linalg.norm(path[new_index] - new_hub) <= 0.004:
            new_index += 1
        assert info["waypoint_index"] == new_index
        assert info["limbs_heated"] == np.count_nonzero(action)
        assert info["reward_progress"] == pytest.approx(150.0 * (way_to_go(hub, index) - way_to_go(new_hub, new_index)))
        assert info["reward_waypoint"] == 2.5 * (new_index - index)
        assert info["reward_effort"] == pytest.approx(-0.03 * np.count_nonzero(action))
        assert info["reward_time"] == -0.25
        assert info["distance"] == pytest.approx(np.linalg.norm(path[new_index] - new_hub))
        start = path[new_index - 1] if new_index else np.zeros(2)
        assert info["cross_track_error"] == pytest.approx(float(cross_track_error(new_hub, start, path[new_index])))
        hub, index = new_hub, new_index
        indices.append(index)
    assert indices[-1] == 2


def test_waypoints_count_in_order_and_one_stroke_passes_all_in_reach():
    env = fast(path=[[0.004, 0.0], [0.005, 0.0], [0.006, 0.0], [0.3, 0.0]], waypoint_radius=0.005)
    assert env.reset(seed=0)[1]["waypoint_index"] == 0  # passing takes a stroke
    _, _, terminated, _, info = env.step(STRAIGHT)
    assert info["waypoint_index"] == 3 and not terminated and not info["is_success"]
    assert info["reward_waypoint"] == 3.0
    env.reset(options={"path": [[0.3, 0.0], [0.004, 0.0]]})
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


def test_pictures_that_nobody_takes_are_kept_up_to_a_bound_which_is_said(monkeypatch):
    pytest.importorskip("pygame")
    monkeypatch.setattr(seastar_swim, "MOST_FRAMES", 4)
    env = fast(render_mode="rgb_array_list", frames_per_stroke=2)
    env.reset(seed=0)
    env.step(STRAIGHT)
    with pytest.warns(UserWarning, match="last 4 are kept"):
        env.step(STRAIGHT)
    kept = env.render()
    env.step(STRAIGHT)
    assert len(kept) == 4 and len(env.render()) == 2 and np.any(kept[0] != kept[-1])


def test_rendering_without_a_mode_warns_and_draws_nothing():
    for env in (fast(), SeastarSwimVectorEnv(2, fidelity="fast")):
        env.reset(seed=0)
        with pytest.warns(UserWarning, match="draws nothing"):
            assert env.render() is None


def test_what_a_caller_does_to_infos_and_waypoints_changes_no_robot():
    env = fast()
    _, info = env.reset(seed=0)
    kept = copy.deepcopy(info)
    second = env.step(STRAIGHT)[0]
    np.testing.assert_array_equal(info["hub_position"], kept["hub_position"])
    state, table = env.simulator.get_state(), env.waypoints
    second[:], info["hub_position"][:], table[:] = 7.0, 7.0, 7.0
    np.testing.assert_array_equal(env.simulator.positions, state.positions)
    assert np.abs(env.waypoints).max() < 1.0


def test_a_path_is_copied_when_it_is_asked_for_at_making_or_for_one_episode():
    path = np.array([[0.1, 0.2], [0.3, 0.4]])
    env = fast(path=path)
    expected, path[:] = path.copy(), 9.0
    env.reset(seed=0)
    np.testing.assert_array_equal(env.waypoints, expected)
    env.reset(options={"path": "line"})
    np.testing.assert_array_equal(env.waypoints, [[0.3, 0.0]])
    env.reset()
    np.testing.assert_array_equal(env.waypoints, expected)


def test_random_paths_of_the_test_split_are_numbered_and_no_seed_draws_one():
    held, trained = (fast(path="random", random_heading=True, split=split) for split in ("test", "train"))
    paths = {}
    for number in (0, 999, 0):
        _, info = held.reset(seed=number, options={"instance": number})
        assert info["instance"] == number
        paths.setdefault(number, held.waypoints)
        np.testing.assert_array_equal(held.waypoints, paths[number])
    for seed in (0, 999, 1, 1 + 999 * 2**32, 1 + 999 * 2**32 + 2**128):  # entropies of the split's tasks among them
        trained.reset(seed=seed)
        assert all(np.abs(trained.waypoints - path).max() > 1e-3 for path in paths.values())
