"""Agents that search: the displacement map and who swims by it, and the planner, who looks further than a stroke."""

import numpy as np
import pytest

from every_part import ACTUATORS
from seastar_gym import Body, HeadingTargets, Numerics, Scene, Seastar, Simulator
from seastar_gym.controllers import search
from seastar_gym.controllers.open_loop import to_actions
from seastar_gym.controllers.search import (
    Budget,
    Planner,
    Targets,
    displacement_map,
    gait_planner,
    measure_gaits,
    state_of,
    waypoints_of,
)
from seastar_gym.envs.group import action_table, transform_commands
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.evaluation.swim import swim
from seastar_gym.gaits import evolved_gaits, pair_gait

FAST = Scene(numerics=Numerics.preset("fast"))


@pytest.fixture(scope="module", autouse=True)
def cache(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cache")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(folder))
        yield folder


def test_the_map_has_the_symmetry_of_the_robot():
    """A turned or mirrored command moves the hub the turned or mirrored way."""
    hub, turn = displacement_map(FAST)
    x_y = hub @ [1.0, 1.0j]
    for k in range(1, 5):
        np.testing.assert_allclose(x_y[action_table("joint", 5)[2 * k]], x_y * np.exp(-0.4j * np.pi * k), atol=1e-7)
    mirrored = action_table("joint", 5)[9]
    np.testing.assert_allclose(x_y[mirrored], x_y.conj(), atol=1e-7)
    np.testing.assert_allclose(turn[mirrored], -turn, atol=1e-6)
    straight = to_actions(pair_gait(2, 5), "joint", 5)[0]
    assert hub[straight, 0] > 3e-3 and abs(hub[straight, 1]) < 1e-7


def test_the_map_is_measured_once_for_every_scene_and_again_where_its_file_is_damaged(cache, monkeypatch):
    first = displacement_map(FAST)
    files = list((cache / "seastar-gym").iterdir())
    for file in files:
        file.write_bytes(b"no map")
    np.testing.assert_array_equal(displacement_map(FAST).hub, first.hub)
    monkeypatch.setattr(search, "measure_gaits", None)  # would fail if called
    np.testing.assert_array_equal(displacement_map(FAST).hub, first.hub)
    assert list((cache / "seastar-gym").iterdir()) == files
    with pytest.raises(TypeError):
        displacement_map(Scene(numerics=Numerics.preset("accurate")))


def test_displacements_are_a_stroke_s_share_in_the_frame_in_which_they_begin(monkeypatch):
    """Turns are the short way round, such as from a heading of 3 rad to one of -3 rad."""
    gaits = np.array([[[1.0, 0.0, -1.0, 0.0, 0.0]]])
    simulator = Simulator(FAST, 1)
    simulator.stroke(gaits[:, 0])
    hub, heading = simulator.hub_position(), search.heading_of(simulator)
    simulator.stroke(gaits[:, 0])
    simulator.stroke(gaits[:, 0])
    way = (simulator.hub_position() - hub) @ [1.0, 1.0j] * np.exp(-1j * heading) / 2.0
    found = measure_gaits(FAST, gaits, settling=1, measured=2)
    np.testing.assert_allclose(found.hub @ [1.0, 1.0j], way, atol=1e-12)
    np.testing.assert_allclose(found.turn, (search.heading_of(simulator) - heading) / 2.0, atol=1e-12)
    alternation = np.concatenate([pair_gait(3, 4), pair_gait(2, 5)])[None]  # over whole periods
    both = measure_gaits(FAST, np.concatenate([alternation, alternation[:, ::-1]]), settling=10, measured=4)
    np.testing.assert_allclose(both.hub[0], both.hub[1], atol=1e-5)
    assert 4.4e-3 < both.hub[0, 0] < 5.5e-3  # a stroke's share
    headings = iter([np.array([3.0]), np.array([-3.0])])
    monkeypatch.setattr(search, "heading_of", lambda simulator: next(headings))
    found = measure_gaits(FAST, np.zeros((1, 1, 5)), settling=0, measured=2)
    np.testing.assert_allclose(found.turn, np.pi - 3.0)


def swum(n_robots=3, strokes=4, scene=FAST):
    """A batch on its way, with its observations. Where actuators remember, it decides every half second."""
    env = SeastarSwimVectorEnv(
        n_robots, path="random", random_heading=True, actions="pairs", scene=scene, threads=1,
        decision_period=0.5 if scene.actuator.has_memory else None,
    )  # fmt: skip
    observations, _ = env.reset(seed=3)
    env.action_space.seed(4)
    for _ in range(strokes):
        observations, *_ = env.step(env.action_space.sample())
    return env, observations


STATES = {
    "chapter": (FAST, 1e-2), "four limbs": (Scene(Seastar(4, 5), numerics=FAST.numerics), 1e-4),
    "few nodes": (Scene(Seastar(nodes_per_limb=7), numerics=FAST.numerics), 1e-4),
    "more nodes than stations": (Scene(Seastar(nodes_per_limb=19), numerics=FAST.numerics), 1e-2),
    "a body": (Scene(Seastar(4, 5, body=Body.rectangle(0.06, 0.02)), numerics=FAST.numerics), None),
    **{name: (Scene(actuator=ACTUATORS[name], numerics=FAST.numerics), 1e-3)
       for name in ("thermal", "wires", "limited pulse")},
}  # fmt: skip
"""Scenes, and by how much the way of the next stroke may differ from that of a state that was observed: more nodes
than stations are interpolated, so undamped limbs ring otherwise."""


@pytest.mark.parametrize("scene, allowed", STATES.values(), ids=STATES)
def test_an_observation_is_the_whole_state(scene, allowed):
    """From the state read off the observations, the same commands go the same way, as seen in the body frame."""
    env, observations = swum(1 if scene.robot.has_body else 3, 1 if scene.robot.has_body else 4, scene)
    state, hub = state_of(observations, scene), env.simulator.hub_position()
    if scene.robot.has_body:
        shapes = (np.linalg.norm(each, axis=-1) for each in (state.positions, env.simulator.positions - hub[:, None]))
        np.testing.assert_allclose(*shapes, atol=1e-4)
        return
    twin = Simulator(scene, 3, threads=1)
    twin.set_state(state)
    speeds = (np.linalg.norm(simulator.hub_velocity(), axis=1) for simulator in (twin, env.simulator))
    np.testing.assert_allclose(*speeds, rtol=1e-5)
    for found, waypoints, place in zip(waypoints_of(observations, scene)[0], env.waypoints, hub, strict=True):
        assert np.hypot(*found) == pytest.approx(np.hypot(*(waypoints[0] - place)), rel=1e-5)
    if scene.actuator.has_memory:
        largest = max(1.0, twin.actuators.max())
        np.testing.assert_allclose(twin.actuators, env.simulator.actuators, atol=1e-5 * largest)
    commands = np.zeros((3, scene.robot.n_limbs))
    commands[:, :2] = 1.0, -1.0
    for simulator in (twin, env.simulator):
        simulator.advance(0.5 if scene.actuator.has_memory else 1.0, commands)
    moved = np.linalg.norm(env.simulator.hub_position() - hub, axis=1)
    np.testing.assert_allclose(np.linalg.norm(twin.hub_position(), axis=1), moved, rtol=allowed)


@pytest.mark.parametrize("current", [(0.2, 0.1), (0.0, 0.0)])
def test_two_strokes_ahead_it_finds_what_an_exhaustive_search_finds(current):
    """Nearest to the last waypoint; one that is not the last, and within which the robot is, is passed."""
    _, observations = swum(n_robots=1)
    planner, after = Planner(FAST, 0.02, Budget(2, 21), threads=1), np.array([[0.2, 0.1]])
    states = state_of(observations, FAST)
    (chosen,) = planner._search(states, Targets(np.array([current]), after))
    (once,) = planner._branches.decisions(states)
    (twice,) = planner._branches.decisions(once)
    ends = twice.positions[:, 0].reshape(21, 21, 2)
    way = np.hypot(*np.moveaxis(ends - after, -1, 0))
    assert way[chosen].min() == pytest.approx(way.min(), abs=1e-6)


def test_it_swims_round_a_corner_faster_than_by_the_displacement_map():
    env = SeastarSwimEnv(path=[[0.04, 0.0], [0.04, 0.04]], actions="pairs", fidelity="fast")
    done = swim("planner", Planner(FAST, budget=Budget(2, 4), threads=1), env, max_strokes=40)
    assert done.finished and done.strokes <= 15


def test_who_can_arrive_at_the_last_waypoint_arrives_by_the_fewest_decisions():
    """Robots one and two strokes from it, side by side with one that is far away, however far the search looks."""
    _, observations = swum(n_robots=5)
    planner = Planner(FAST, 0.0004, Budget(3, 21), threads=1)
    states = state_of(observations, FAST)
    (once,) = planner._branches.decisions(states)
    first = once.positions[:, 0].reshape(5, 21, 2)
    (twice,) = planner._branches.decisions(once)
    twice = twice.positions[:, 0].reshape(5, 21, 21, 2)
    wanted = [4, 9, 16, 11]
    goals = np.stack([first[0, 4], first[1, 9], twice[2, 16, 3], twice[3, 11, 12], [1.0, 0.0]])
    chosen = planner._search(states, Targets(goals, goals))
    assert chosen[:2].tolist() == wanted[:2]
    for robot in (2, 3):  # by the command that the goal is made of, or another one from which it is in reach
        assert np.hypot(*(twice[robot, chosen[robot]] - goals[robot]).T).min() <= 0.0004
        assert np.hypot(*(first[robot] - goals[robot]).T).min() > 0.0004


def test_the_planner_turns_to_either_side_and_keeps_a_heading_that_is_met():
    ends = []
    for asked in (0.6, -0.6, 0.0):
        headings = HeadingTargets(asked)
        env = SeastarSwimEnv([[0.005, 0.0]], "pairs", "fast", decision_period=0.5, headings=headings)
        planner = Planner(decision_period=0.5, headings=headings, budget=Budget(2, 4, 0.5), threads=1)
        done = swim("planner", planner, env, max_strokes=30)
        assert done.finished
        ends.append(done.time[-1])
    assert ends[0] > 2.0 and ends[1] > 2.0 and ends[2] == 0.5


def test_evolved_gaits_are_all_turns_and_mirror_images_of_each_and_their_pulses_end_with_their_decisions():
    """So no pulse is under way that an observation does not tell of."""
    gaits = evolved_gaits(0.05)
    assert gaits.shape == (10, 20, 5) and np.abs(gaits).max() == 0.5
    carried = [np.asarray(transform_commands(gait, element)) for gait in gaits for element in range(10)]
    assert {gait.tobytes() for gait in np.unique(carried, axis=0) + 0.0} == {gait.tobytes() for gait in gaits + 0.0}
    for other in (None, 0.1):
        with pytest.raises(ValueError, match=r"need a decision every 0\.05 s, not "):
            evolved_gaits(other)


def test_over_periods_of_gaits_it_decides_once_a_second_and_swims_round_a_corner_in_nine():
    planner = gait_planner(0.05, Budget(2, 3), threads=1)
    chosen = []
    choose = planner.choose
    planner.choose = lambda observations: chosen.append(choose(observations)) or chosen[-1]
    corner = [[0.04, 0.0], [0.04, 0.04]]
    env = SeastarSwimEnv(corner, planner.actions, "balanced", decision_period=0.05)
    done = swim("gait-planner", planner, env, max_strokes=400)
    assert done.finished and done.time[-1] < 9.0
    assert len(chosen) == np.ceil(done.time[-1])
