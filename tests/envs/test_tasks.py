"""Every registered task is what its docstring says, besides what test_conformance.py says of all ids."""

import copy
import itertools
from dataclasses import dataclass

import gymnasium as gym
import numpy as np
import pytest

import seastar_gym
from refusals import assert_refused
from seastar_gym import FailBlind, Miswired, ObstTrap, Prey, Prizes, Sight, Station
from seastar_gym.envs.group import limb_order, transform_commands
from seastar_gym.envs.randomization import drawn_scene
from seastar_gym.envs.robots import Score, Task
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.symmetry import symmetry_in
from seastar_gym.envs.tasks import NAMED
from seastar_gym.envs.tasks.obst_trap import draw_discs, rims, ways
from seastar_gym.envs.tasks.prey import CHASE, Courses, Pursuit, draw_course
from seastar_gym.envs.tasks.prizes import best_round, distances, draw_prizes, greedy_round
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.scene.water import UniformCurrent

SWIM, IDS = "SeastarSwim-v0", tuple(seastar_gym.TASKS)
HIDDEN = {
    "miswired": ["wiring"],
    "prey": ["course"],
    "fast-prey": ["course"],
    "station": ["fluid.current.u_x", "fluid.current.u_y"],
    "fail-blind": ["limb_strengths"],
    "obst-trap": ["discs"],
    "prizes": [],
    "fast-prizes": [],
    "sim-to-real": ["robot.youngs_modulus", "fluid.drag_coefficient", "limb_strengths", "sight.delay"],
}
"""Entries of info that the robot is not told, by challenge."""


def made(id: str, **arguments):
    return gym.make(id, fidelity="fast", **arguments)


# Promises of every task


@pytest.mark.parametrize("id", IDS)
def test_an_episode_follows_from_its_split_and_its_number(id):
    env = made(id, split="test")
    *_, info = env.reset(seed=0)[1], env.reset(seed=0)[1]
    chosen = env.reset(seed=5, options={"instance": info["instance"]})[1]
    assert all(np.array_equal(chosen[name], info[name]) for name in info)
    other = made(id, split="train").reset(options={"instance": info["instance"]})[1]
    hidden = HIDDEN[seastar_gym.TASKS[id].task]
    drawn = ["distance", *(name for name in hidden if name not in ("wiring", "limb_strengths"))]
    assert all(not np.array_equal(other[name], info[name]) for name in drawn)


@pytest.mark.parametrize("id", IDS)
def test_a_batch_draws_numbers_from_all_of_the_split_and_takes_one_or_one_for_each_robot(id):
    batch = gym.make_vec(id, 64, "vector_entry_point", fidelity="fast", split="test")
    numbers = batch.reset(seed=0)[1]["instance"]
    assert numbers.min() < 100 and 900 < numbers.max() < 1000
    batch = gym.make_vec(id, 8, "vector_entry_point", fidelity="fast")
    assert batch.reset(seed=0)[1]["instance"].min() >= 1000
    one, _ = batch.reset(options={"instance": 7})
    np.testing.assert_array_equal(one, np.tile(one[0], (8, 1)))
    each, info = batch.reset(options={"instance": np.arange(8)})
    np.testing.assert_array_equal(each[7], one[0])
    assert info["instance"].tolist() == [*range(8)] and not np.array_equal(each[0], each[1])


@pytest.mark.parametrize("id", [id for id in IDS if HIDDEN[seastar_gym.TASKS[id].task]])
def test_what_is_hidden_is_not_observed(id):
    """Two robots that differ in what is hidden, and in nothing else, begin with the same observation."""
    env, (name, *_) = made(id), HIDDEN[seastar_gym.TASKS[id].task]
    observation, _ = env.reset(seed=0)
    robots = env.unwrapped._robots
    now, simulator = robots.episode, robots.simulator
    if name == "wiring":
        now.wiring *= -1.0
    elif name == "course":
        place, velocity = robots.task.prey(robots)
        now.course[0] = _course_that_turns_the_other_way(now.course[0], place[0], velocity[0])
    elif name == "limb_strengths":
        simulator.set_limb_strengths(1.0 - simulator.limb_strengths)
    elif name == "discs":
        far = np.argsort(np.hypot(*now.discs[0, :, :2].T) - now.discs[0, :, 2])[6:]
        now.discs[0, far, 0] += 0.2
    else:
        robots.drawn[name] = robots.drawn[name] * 1.1 + 0.001
        simulator.set_scene(drawn_scene(simulator.scene, robots.drawn))
    np.testing.assert_allclose(robots.observe()[0], observation, atol=1e-6)


def _course_that_turns_the_other_way(course, place, velocity):
    """A circle through the same place, with the same velocity."""
    radius, speed = course[3], np.hypot(*velocity)
    rate = -np.sign(course[7]) * speed / radius
    outwards = np.sign(rate) * np.array([velocity[1], -velocity[0]]) / speed
    centre = place - radius * outwards
    return np.array([*centre, course[2], radius, 0.0, np.arctan2(outwards[1], outwards[0]), 0.0, rate])


# Miswired


@pytest.mark.parametrize("period", [1.0, 0.5])
def test_a_miswired_limb_does_the_opposite_and_tells_of_wires_by_the_names_of_commands(period):
    env = SeastarSwimEnv(task="miswired", fidelity="fast", actions="continuous", decision_period=period)
    env.reset(options={"instance": 4})
    wiring, plain = env._robots.episode.wiring[0].copy(), copy.deepcopy(env)
    assert set(wiring) == {-1.0, 1.0}
    plain._robots.episode.wiring[:] = 1.0
    wires = slice(182, 192) if period < 1.0 else slice(182, 182)
    for command in np.array([[1, -1, 0, 0.5, 0], [-1, 0, 1, 0, 1], [0, 0, 0, 0, 0]], np.float32):
        ours, *_, info = env.step(command)
        theirs, *_, its_info = plain.step((command * wiring).astype(np.float32))
        np.testing.assert_array_equal(info["hub_position"], its_info["hub_position"])
        np.testing.assert_array_equal(env.simulator.positions, plain.simulator.positions)
        by_limb = (slice(182, -4), (5, -1))
        seen, told = (one[by_limb[0]].reshape(by_limb[1]) for one in (ours, theirs))
        np.testing.assert_array_equal(seen[:, -1], command)
        expected = np.where(wiring[:, None] < 0, told[:, :-1][:, ::-1], told[:, :-1])
        np.testing.assert_array_equal(seen[:, :-1], expected)
    assert wires.stop - wires.start == 5 * (seen.shape[1] - 1)


def test_wires_are_swapped_and_limbs_are_dead_as_often_as_asked():
    def drawn(n, task, name):
        return SeastarSwimVectorEnv(n, actions="pairs", task=task, fidelity="fast").reset(seed=0)[1][name]

    assert abs((drawn(400, Miswired(0.2), "wiring") < 0.0).mean() - 0.2) < 0.04
    assert (drawn(9, Miswired(0.0), "wiring") == 1.0).all()
    sets, counts = np.unique(drawn(500, "fail-blind", "limb_strengths"), axis=0, return_counts=True)
    assert len(sets) == 10 and counts.min() > 25
    assert (drawn(9, FailBlind(dead=1), "limb_strengths").sum(axis=1) == 4.0).all()


# Station


def test_a_resting_robot_is_carried_by_the_current():
    env = SeastarSwimEnv(task="station", fidelity="fast", actions="joint")
    _, first = env.reset(seed=1)
    flow = np.array([first["fluid.current.u_x"], first["fluid.current.u_y"]])
    assert 0.001 <= np.hypot(*flow) <= 0.0025
    for _ in range(30):
        *_, info = env.step(0)
    later = info["hub_position"]
    for _ in range(10):
        *_, info = env.step(0)
    drift = (info["hub_position"] - later) / 10.0  # drag is quadratic: the last tenth of the speed takes long
    assert 0.9 < drift @ flow / (flow @ flow) < 1.0 and abs(drift[0] * flow[1] - drift[1] * flow[0]) < 1e-9


def test_a_station_is_near_and_no_waypoint_rewards_count_its_distance_and_its_current_is_seen_in_pictures_alone():
    env = SeastarSwimEnv(task=Station(distance=(0.01, 0.03)), fidelity="fast", actions="joint")
    _, before = env.reset(seed=2)
    assert 0.01 <= before["distance"] <= 0.03 and env.waypoints.shape == (0, 2) and env.scene.fluid.current is None
    assert env.frame().current == UniformCurrent(before["fluid.current.u_x"], before["fluid.current.u_y"])
    *_, info = env.step(17)
    assert info["distance"] == pytest.approx(np.hypot(*(info["hub_position"] - info["station"])), abs=1e-15)
    assert info["reward_progress"] == pytest.approx(200.0 * (before["distance"] - info["distance"]))
    assert info["reward_distance"] == pytest.approx(-100.0 * min(info["distance"], 0.02))
    assert info["is_success"] == (info["distance"] <= 0.002)
    env = SeastarSwimEnv(actions="pairs", task=Station(current=(0.0, 0.0)), fidelity="fast")
    env.reset(seed=0)
    for away, counted in ((0.015, 0.015), (0.02, 0.02), (0.021, 0.02), (0.5, 0.02)):  # and no farther than 20 mm
        env._robots.episode.station[0] = env._robots.simulator.hub_position()[0] + [away, 0.0]
        assert env.step(0)[4]["reward_distance"] == pytest.approx(-100.0 * counted, rel=1e-3)


# Prey


def test_a_course_begins_at_its_time_and_its_angles_comes_back_and_has_the_velocity_of_its_place():
    rng = np.random.default_rng(0)
    courses = np.array([draw_course(rng, (0.1, 0.2), (0.006, 0.008), 0.2, Pursuit(0.004, 0.02)) for _ in range(5)])
    h, time = 1e-4, np.full(5, 12.3)
    slope = (Courses(courses).place(time + h) - Courses(courses).place(time - h)) / (2.0 * h)
    np.testing.assert_allclose(Courses(courses).velocity(time), slope, rtol=1e-6, atol=1e-9)
    speeds = np.array([np.hypot(*Courses(courses).velocity(t * np.ones(5)).T) for t in np.linspace(0.0, 400.0, 4001)])
    assert (speeds > 0.0035).all() and (np.sqrt((speeds**2).mean(axis=0)) < 0.0085).all()
    around = Courses(courses[0]).once_round()
    np.testing.assert_allclose(around[0], around[-1], atol=1e-12)
    assert np.hypot(*around[0]) >= 0.08
    numbers = np.array([[0.01, -0.02, 7.0, 0.1, 0.03, 0.4, 1.1, 0.05]])
    for at, first, second in ((7.0, 0.4, 1.1), (9.0, 0.5, 1.3)):
        expected = 0.01 - 0.02j + 0.1 * np.exp(1j * first) + 0.03 * np.exp(1j * second)
        assert Courses(numbers).place(at) @ [1.0, 1.0j] == pytest.approx(expected)


def test_a_prey_within_reach_is_caught_and_the_next_one_begins_around_the_robot():
    env = SeastarSwimEnv(actions="pairs", task=Prey(wanted=2), fidelity="fast")
    env.reset(seed=0)
    now, hub = env._robots.episode, env.simulator.hub_position()[0]
    for catches in (1, 2):
        now.course[0] = [*hub, env.simulator.time[0], 1e-3, 0.0, 0.0, 0.0, 0.1]
        _, _, over, _, info = env.step(0)
        assert info["catches"] == catches and info["reward_catch"] == 10.0 and not over
        assert info["is_success"] == (catches == 2)
        np.testing.assert_array_equal(info["course"][:2], now.drawn[0, catches, :2] + info["hub_position"])
        assert info["course"][2] == info["time"] and info["distance"] >= 0.08
    *_, info = env.step(0)
    assert info["catches"] == 2 and info["reward_catch"] == 0.0


def test_progress_counts_against_the_prey_that_was_hunted_and_the_second_target_tells_its_velocity():
    env = SeastarSwimEnv(actions="pairs", task="prey", fidelity="fast")
    observation, before = env.reset(seed=0)
    ahead = 0.1 * (observation[-2:] - observation[-4:-2]) / 10.0
    assert np.hypot(*ahead) == pytest.approx(np.hypot(*env.task.prey(env._robots)[1][0]), rel=1e-5)
    *_, info = env.step(6)
    assert info["reward_progress"] == pytest.approx(50.0 * (before["distance"] - info["distance"]))


# FailBlind


@pytest.mark.parametrize("period", [1.0, 0.5])
def test_dead_limbs_do_nothing_and_nothing_is_seen_but_the_way(period):
    env = SeastarSwimEnv(task="fail-blind", fidelity="fast", actions="continuous", decision_period=period)
    _, first = env.reset(options={"instance": 4})
    strengths, live = first["limb_strengths"], copy.deepcopy(env)
    assert sorted(strengths) == [0.0, 0.0, 1.0, 1.0, 1.0]
    for command in np.array([[1, -1, 0.5, -0.5, 0], [-1, 0, 1, 0, 1], [0, 0, 0, 0, 0]], np.float32):
        seen, *_, info = env.step(command)
        theirs, *_, its_info = live.step((command * strengths).astype(np.float32))
        np.testing.assert_array_equal(info["hub_position"], its_info["hub_position"])
        np.testing.assert_array_equal(seen[-7:], theirs[-7:])  # the way
        np.testing.assert_array_equal(seen[:-7], command)


@pytest.mark.parametrize("period", [1.0, 0.5])
def test_odometry_is_the_way_in_the_frame_in_which_the_decision_began(period):
    env = SeastarSwimEnv(task="fail-blind", fidelity="fast", actions="joint", decision_period=period)
    seen, info = env.reset(seed=0)
    assert not seen[-7:-4].any()
    for action in (5, 100, 200, 77):
        heading, before = env._robots.heading()[0], info["hub_position"]
        seen, *_, info = env.step(action)
        x, y = (info["hub_position"] - before) / (0.025 * period)
        c, s = np.cos(heading), np.sin(heading)
        np.testing.assert_allclose(seen[-7:-5], [c * x + s * y, c * y - s * x], atol=1e-6)
        assert seen[-5] == pytest.approx(env._robots.heading()[0] - heading, abs=1e-6)
    assert np.abs(seen[-7:-4]).max() > 0.01


# ObstTrap


@pytest.fixture(scope="module")
def fields():
    """Fields of discs before a goal half a metre away."""
    rng = np.random.default_rng(0)
    return [draw_discs(rng, np.array([0.5, 0.0]), 3, 0.85) for _ in range(120)]


def joints(discs) -> int:
    """Number of the first eight discs that overlap with the next: 7 in a horseshoe, 4 in one with a hole."""
    return int((np.hypot(*np.diff(discs[:8, :2], axis=0).T) < 1.9 * discs[0, 2]).sum())


def test_every_field_has_a_way_around_and_horseshoes_may_be_absent_or_have_a_hole(fields):
    goal = np.array([0.5, 0.0])
    for discs in fields:
        assert discs.shape == (11, 3) and min(rims(np.zeros(2), discs).min(), rims(goal, discs).min()) >= 0.06
        assert ways(discs, goal, 0.015, 0.01)(np.zeros((1, 2)))[0] < 0.9
    whole, there = (np.mean([joints(discs) >= least for discs in fields]) for least in (7, 4))
    assert 0.7 < there < 0.9 and 0.35 < whole / there < 0.65


def test_ways_on_the_grid_are_as_long_as_ways_are():
    goal, start = np.array([0.5, 0.0]), np.zeros((1, 2))
    free = ways(np.zeros((0, 3)), goal, 0.01, 0.01)
    away = np.array([[0.0, 0.0], [0.1, 0.1], [0.5, -0.3], [0.33, 0.27]])
    lengths = np.hypot(*(away - goal).T)
    assert (free(away) >= lengths - 1e-9).all() and (free(away) < 1.03 * lengths + 1e-3).all()
    radius = 0.1  # around one disc: two tangents and the arc between them
    disc = np.array([[0.25, 0.0, radius - 0.01]])
    tangent = np.sqrt(0.25**2 - radius**2)
    around = 2.0 * tangent + radius * (np.pi - 2.0 * np.arccos(radius / 0.25))
    assert around - 0.004 < ways(disc, goal, 0.01, 0.01)(start)[0] < 1.04 * around
    wall = np.column_stack([np.full(41, 0.25), np.linspace(-0.4, 0.4, 41), np.full(41, 0.02)])
    assert ways(wall, goal, 0.01, 0.01)(start)[0] == np.inf
    found = ways(np.array([[0.5, 0.0, 0.05]]), np.array([0.5, 0.0]), 0.01, 0.02)
    assert found.lengths.shape == (51, 41) and (found(np.zeros((1, 2))) == np.inf).all()
    away = np.array([[9.0, 0.0]])  # beyond the grid, the way to it counts
    assert ways(np.zeros((0, 3)), np.array([0.5, 0.0]), 0.01, 0.02)(away)[0] == pytest.approx(8.5, rel=0.01)
    disc = np.array([[0.25, 0.0, 0.09]])
    found = ways(disc, np.array([0.5, 0.0]), 0.01, 0.01)
    inside, rim = found(np.array([[0.24, 0.0], [0.14, 0.0]]))
    assert inside == pytest.approx(rim + 0.1, abs=0.03)


def test_the_six_nearest_discs_are_seen_in_the_body_frame():
    env = SeastarSwimEnv(actions="pairs", task="obst-trap", fidelity="fast")
    seen, info = env.reset(options={"instance": 2})
    for action in (3, 8, 14):
        discs = seen[-22:-4].reshape(6, 3).astype(np.float64) * 0.1
        heading = env._robots.heading()[0]
        c, s = np.cos(heading), np.sin(heading)
        world = discs[:, :2] @ [[c, s], [-s, c]] + info["hub_position"]
        far = np.hypot(*(info["discs"][:, :2] - info["hub_position"]).T) - info["discs"][:, 2]
        nearest = info["discs"][np.argsort(far)[:6]]
        np.testing.assert_allclose(np.column_stack([world, discs[:, 2]]), nearest, atol=1e-7)
        assert info["clearance"] == pytest.approx(far.min())
        seen, *_, info = env.step(action)


@pytest.mark.parametrize("at_goal, in_disc", [(True, False), (True, True), (False, True)])
def test_who_reaches_the_goal_ends_with_success_and_who_touches_a_disc_without(at_goal, in_disc):
    env = SeastarSwimEnv(actions="pairs", task="obst-trap", fidelity="fast")
    _, info = env.reset(seed=0)
    assert not info["is_success"]
    if at_goal:
        env._robots.episode.waypoints[0, 0] = info["hub_position"] + [0.005, 0.0]
        env.task.know_legs(env._robots)
    if in_disc:
        env._robots.episode.discs[0, 0] = [*info["hub_position"], 0.05]
    _, reward, over, _, info = env.step(0)
    assert over and info["is_success"] != in_disc and info["reward_touch"] == (-20.0 if in_disc else 0.0)
    assert in_disc == (info["clearance"] < 0.0) and info["reward_waypoint"] == at_goal
    assert at_goal or reward < -19.0


def test_the_geodesic_potential_counts_the_way_around():
    straight, around = (
        SeastarSwimEnv(actions="pairs", task=ObstTrap(potential=potential), fidelity="fast")
        for potential in ("straight", "geodesic")
    )
    (first, info), (its_first, _) = (env.reset(options={"instance": 5}) for env in (straight, around))
    np.testing.assert_array_equal(first, its_first)
    field = ways(info["discs"], np.array([info["distance"], 0.0]), 0.015, 0.01)
    before = field(info["hub_position"][None])[0]
    *_, info = around.step(9)
    assert info["reward_progress"] == pytest.approx(200.0 * (before - field(info["hub_position"][None])[0]))
    assert straight.step(9)[4]["reward_progress"] != info["reward_progress"]


# Prizes


def test_the_best_round_is_that_of_all_orders():
    rng = np.random.default_rng(0)
    for _ in range(20):
        places, worth = rng.uniform(-0.35, 0.35, (5, 2)), rng.choice([1.0, 2.0, 4.0], 5)
        first, between, way = np.hypot(*places.T), distances(places), rng.uniform(0.2, 1.2)
        best = 0.0
        for order in itertools.permutations(range(5)):
            swum = np.cumsum([first[order[0]], *(between[a, b] for a, b in itertools.pairwise(order))])
            best = max(best, worth[list(order)][swum <= way].sum())
        found = best_round(first, between, worth, way)
        assert found.worth == best == worth[found.order].sum() and len({*found.order}) == len(found.order)
        ends = np.array([np.zeros(2), *places[found.order]])
        assert np.hypot(*np.diff(ends, axis=0).T).sum() <= way
        assert greedy_round(first, between, worth, way) <= best
    assert best_round(np.ones(2), np.ones((2, 2)), np.ones(2), 0.5) == (0.0, [])


def test_a_prize_within_reach_is_taken_once_and_in_time():
    env = SeastarSwimEnv(actions="pairs", task=Prizes(seconds=2.5), fidelity="fast")
    _, info = env.reset(seed=0)
    worth = info["prizes"][:, 2].copy()
    env._robots.episode.prizes[0, 3, :2] = info["hub_position"]
    seen, _, over, _, info = env.step(0)
    assert info["taken"] == worth[3] and info["reward_prize"] == 5.0 * worth[3] and not over
    assert len(env.task.scenery(env._robots, 0).rings) == len(worth) - 1
    assert info["prizes"][3, 2] == 0.0 and not seen[-8:-5].any()  # the last of the prizes that are seen is none
    assert seen[-5] == pytest.approx(1.0 - 1.0 / 2.5)
    assert env.step(0)[4]["reward_prize"] == 0.0
    env._robots.episode.prizes[0, 5, :2] = info["hub_position"]
    *_, info = env.step(0)
    assert info["time"] == 3.0 and info["taken"] == worth[3]  # too late
    _, info = env.reset(seed=0)
    env._robots.episode.prizes[0, :, :2] = info["hub_position"]
    seen, _, over, _, info = env.step(0)
    assert over and info["is_success"] and info["distance"] == 0.0 and not seen[-4:].any()
    assert info["taken"] == pytest.approx(info["reward_prize"] / 5.0)
    env = SeastarSwimEnv(actions="pairs", task="prizes", fidelity="fast")
    _, info = env.reset(seed=0)
    hub = info["hub_position"]
    env._robots.episode.prizes[0] = [*(hub + [0.0151, 0.0]), 2.0]
    env._robots.episode.prizes[0, 0, :2] = hub + [0.0149, 0.0]
    env._robots.episode.hub = hub[None].copy()
    assert env.step(0)[4]["taken"] == 2.0
    env._robots.episode.prizes[0] = [*(hub + [0.3, 0.0]), 0.0]
    env._robots.episode.prizes[0, 0, 2] = 4.0
    env._robots.episode.hub = hub[None] - [0.1, 0.0]  # as if it had come by a tenth of a metre
    gained = 2.0 * 4.0 * (np.exp(-3.0) - np.exp(-4.0))
    assert env.step(0)[4]["reward_progress"] == pytest.approx(gained, rel=1e-3)


@pytest.mark.parametrize("id", [id for id in IDS if "Prizes" in id])
def test_prizes_end_as_terminated_when_the_time_that_they_show_is_up(id):
    """What is observed ends an episode, and what is not observed cuts it off."""
    env, batch = made(id), gym.make_vec(id, 2, "vector_entry_point", fidelity="fast")
    decisions = round(env.unwrapped.task.seconds / env.unwrapped.decision_period)
    env.reset(seed=0), batch.reset(seed=[0, 0])
    for _ in range(decisions):
        seen, _, terminated, truncated, info = env.step(0)
        _, _, all_terminated, all_truncated, _ = batch.step(np.zeros(2, int))
        assert not truncated and not all_truncated.any() and terminated == all_terminated.all()
        assert terminated == (seen[-5] < 1e-6)
    assert terminated and not info["is_success"] and info["time"] == pytest.approx(env.unwrapped.task.seconds)


def test_prizes_are_seen_nearest_first_and_two_of_them_as_targets():
    env = SeastarSwimEnv(actions="pairs", task="prizes", fidelity="fast")
    seen, info = env.reset(options={"instance": 2})
    shown = seen[-35:-5].reshape(10, 3)
    far = np.hypot(*shown[:, :2].T)
    np.testing.assert_allclose(far, 10.0 * np.sort(np.hypot(*info["prizes"][:, :2].T)), rtol=1e-6)
    np.testing.assert_allclose(seen[-4:].reshape(2, 2), shown[:2, :2], atol=1e-6)
    heading = env._robots.heading()[0]
    away = info["prizes"][np.argmin(np.hypot(*info["prizes"][:, :2].T))]
    angle = np.arctan2(shown[0, 1], shown[0, 0]) + heading
    assert np.exp(1j * angle) == pytest.approx(np.exp(1j * np.arctan2(away[1], away[0])), abs=1e-6)
    assert shown[0, 2] == away[2]


# SimToReal


def test_sim_to_real_is_waypoints_seen_by_its_camera_or_another():
    env = made("SeastarSwimSimToReal-v0")
    _, info = env.reset(options={"instance": 5})
    assert 0.05 <= info["sight.delay"] <= 0.15 <= info["sight_age"] + 0.1
    assert 0.6e6 <= info["robot.youngs_modulus"] <= 1.3e6 and 0.7 <= info["fluid.drag_coefficient"] <= 1.4
    assert ((info["limb_strengths"] >= 0.8) & (info["limb_strengths"] <= 1.0)).all()
    own = made("SeastarSwimSimToReal-v0", sight=Sight(10.0, 0.0, sees=3))
    observation, info = own.reset(options={"instance": 5})
    assert len(observation) == own.unwrapped.layout.size > 70 and "sight.delay" not in info


def test_privileged_observations_are_those_without_a_camera():
    """Of a twin that swims the same episode unseen."""
    arguments = {"fidelity": "fast", "decision_period": 0.2, "path": "random", "random_heading": True}
    seen, plain = SeastarSwimEnv(sight=Sight(delay=0.1, noise=1e-3), **arguments), SeastarSwimEnv(**arguments)
    seen.reset(seed=3)
    observation, _ = plain.reset(seed=3)
    for action in ([0, 1, 0, 2, 0], [1, 0, 0, 0, 0], [0, 0, 0, 0, 0]):
        np.testing.assert_array_equal(seen.privileged_observations(), observation[None])
        np.testing.assert_array_equal(plain.privileged_observations(), observation[None])
        seen.step(action)
        observation, *_ = plain.step(action)


# Symmetry


OF_THEIR_OWN = (FailBlind, Miswired, ObstTrap, Prizes)
"""Tasks that show more than robots, and are seen without noise; test_observation.py turns what a camera sees."""


@pytest.mark.parametrize("id", [id for id in IDS if isinstance(NAMED[seastar_gym.TASKS[id].task], OF_THEIR_OWN)])
def test_what_a_task_shows_of_its_own_is_carried_by_the_symmetry(id):
    """A robot turned by fifths of a turn, in a world that may be mirrored, swims and sees as the symmetry says."""
    env, other = made(id).unwrapped, made(id).unwrapped
    for element in (2, 3, 9):
        env.reset(options={"instance": 1}), other.reset(options={"instance": 1})
        _carry(env._robots, other._robots, element)
        for action in (7, 11, 2):
            seen, theirs = (task.observe() for task in (env._robots, other._robots))
            np.testing.assert_allclose(theirs, symmetry_in(env).carry(seen, [element]), atol=2e-4)
            action = np.array([action])
            env.step(action[0]), other.step(symmetry_in(env).carry_actions(action, [element])[0])
        carried = transform_commands(env._robots.last_commands, [element])
        np.testing.assert_array_equal(carried, other._robots.last_commands)


def _carry(ours, theirs, element):
    """Turn a robot by its element, and mirror its world at the x axis if that mirrors."""
    flip = np.array([1.0, -1.0 if element % 2 else 1.0])
    heading = flip[1] * (ours.heading() + 0.4 * np.pi * ((element + 1) // 2))
    for name in ("waypoints", "discs", "prizes"):
        if hasattr(theirs.episode, name):
            getattr(theirs.episode, name)[..., :2] *= flip
    if ours.wiring is not None:
        theirs.wiring[:] = ours.wiring[:, limb_order(5)[element]]
    theirs.simulator.set_limb_strengths(ours.simulator.limb_strengths[:, limb_order(5)[element]])
    theirs.simulator.reset(np.array([True]), heading)
    theirs.task.begin(theirs, np.array([True]))


def test_every_prey_that_is_drawn_can_be_met_and_most_only_ahead_of_it():
    rng, pursuit, straight = np.random.default_rng(1), Pursuit(0.004, 0.02), 0
    for _ in range(40):
        course = draw_course(rng, (0.12, 0.2), (0.006, 0.008), 0.2, pursuit)
        places = Courses(course).place(CHASE)
        found = pursuit.meeting_time(np.zeros(2), places, CHASE)
        assert course[2] == 0.0 < found < 100.0
        there = Courses(course).place(found)
        assert abs(np.hypot(*there) - 0.02 - 0.004 * found) < 2e-4  # linear between whole seconds
        straight += bool(np.hypot(*(there - places[0])) < 0.02)
    assert straight < 4
    rests = np.tile([0.1, 0.0], (101, 1))
    assert Pursuit(0.004, 0.02).meeting_time(np.zeros(2), rests, CHASE) == pytest.approx(0.08 / 0.004)
    assert Pursuit(0.0005, 0.02).meeting_time(np.zeros(2), rests, CHASE) == np.inf
    assert Pursuit(0.004, 0.11).meeting_time(np.zeros(2), rests, CHASE) == 0.0


def test_greed_takes_worth_per_metre_while_there_is_way_and_costs_in_every_draw():
    rng, about = np.random.default_rng(2), Prizes(gain=0.3)
    for _ in range(5):
        x, y, worth = draw_prizes(rng, about).T
        asked = np.hypot(x, y), distances(np.column_stack([x, y])), worth, about.robot_speed * about.seconds
        assert best_round(*asked).worth >= 1.3 * greedy_round(*asked) > 0.0
        assert len(x) == 10 and 0.2 < np.abs([x, y]).max() <= 0.35 and {*worth} <= {1.0, 2.0, 4.0}
    with assert_refused("ask for less gain"):
        draw_prizes(rng, Prizes(side=0.1, gain=5.0))
    places = np.array([[0.1, 0.0], [0.3, 0.0], [-0.3, 0.0], [0.0, 0.35]])
    first, between = np.hypot(*places.T), distances(places)
    assert best_round(first, between, np.array([1.0, 2.0, 3.0, 3.0]), 0.32) == (3.0, [0, 1])
    assert best_round(first, between, np.array([1.0, 2.0, 3.0, 3.0]), 0.3) in ((3.0, [2]), (3.0, [0, 1]))
    worth = np.array([1.0, 2.0, 5.0, 9.0])
    assert greedy_round(first, between, worth, 0.34) == 5.0  # 9 is too far, and 5 is worth most per metre
    assert greedy_round(first, between, worth, 0.36) == 9.0 and greedy_round(first, between, worth, 0.09) == 0.0
    assert greedy_round(first, between, np.array([4.0, 2.0, 1.0, 1.0]), 0.3) == 6.0  # all of the way
    assert distances(places)[0].tolist() == pytest.approx([0.0, 0.2, 0.4, np.hypot(0.1, 0.35)])


# A task of one's own


@dataclass(frozen=True)
class Own(Task):
    """Swims away from the start, which it remembers."""

    terms = "reward_far", "reward_time"

    def draw(self, rng, scene):
        return {"far": 0, "number": np.int64(3)}

    def begin(self, robots, begun):
        robots.episode.far[begun] = 0.25

    def targets(self, robots):
        return [[0.1, 0.0, 0.2, 0.0]] * robots.n_robots

    def score(self, robots, hub, pulses):
        robots.episode.far += 1.0
        return Score({"reward_far": robots.episode.far, "reward_time": -0.25}, over=[0] * robots.n_robots)


@dataclass(frozen=True)
class Priced(Own):
    price: float = 0.5


def test_a_task_may_say_one_number_for_all_robots_and_write_fractions_and_its_arrays_stay_its_own():
    batch = gym.make_vec(SWIM, 2, vectorization_mode="vector_entry_point", task=Own(), fidelity="fast")
    batch.reset(seed=0)
    (_, first, over, _, told), (_, second, *_) = (batch.step(np.zeros((2, 5), int)) for _ in range(2))
    assert first.tolist() == [1.0, 1.0] and second.tolist() == [2.0, 2.0] and over.dtype == bool
    assert told["reward_far"].tolist() == [1.25, 1.25] and told["reward_time"].tolist() == [-0.25, -0.25]
    with assert_refused("made with its price"):
        gym.make(SWIM, task=Priced(), fidelity="fast").unwrapped.price = 1.0


WRONG = {
    "targets must have two points of every robot, shape (1, 4), not (1, 2)": {"targets": lambda *_: np.zeros((1, 2))},
    "observation is of shape (1, 2), and its entries say (1, 0)": {"observation": lambda *_: np.zeros((1, 2))},
    "score has the terms reward_a, and its terms are": {"score": lambda *_: Score({"reward_a": np.zeros(1)})},
    "reward_far of Wrong.score must be numbers of shape (1,), not array(": {
        "score": lambda *_: Score({"reward_far": np.zeros((1, 1)), "reward_time": 0.0})
    },
    "more of Wrong.info must be an array over 1 robots": {"info": lambda *_: {"more": 2.0}},
    "draws numbers, and its name is 'a'": {"draw": lambda *_: {"name": "a"}},
    "Wrong.terms must name the terms of the reward": {"terms": "reward_far"},
}  # fmt: skip
"""Sentences, and what a task has in the place of what is right."""


@pytest.mark.parametrize("sentence", WRONG)
def test_a_task_of_another_form_is_refused(sentence):
    with assert_refused(sentence):
        env = gym.make(SWIM, task=type("Wrong", (Own,), WRONG[sentence])(), fidelity="fast")
        env.reset(seed=0)
        env.step(np.zeros(5, int))
