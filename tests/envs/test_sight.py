"""Robots seen through a camera, and commands that come late: exact times, the same bits in batches, and refusals."""

from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from episodes import assert_same, both, swim_together, swum
from refusals import assert_refused
from seastar_gym import DomainRandomization, Scene, Sight, Simulator, SmaPulse, SmaWires, SymmetryReduction, Uniform
from seastar_gym.envs.commands import command_table
from seastar_gym.envs.layout import VELOCITY_SCALE, Layout
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.stations import heading_of
from symmetries import matrix, reduced_swim

TIMED = "SeastarSwimTimed-v0"
PERIOD = 0.5
BAD = Sight(
    delay=Uniform(0.05, 0.15), jitter=0.03, dropout=0.2, noise=Uniform(0.0, 2e-3), turn_noise=0.02, sees="pose"
)
SEEN = ("pose", 1, 3, 9, "nodes")
SHORT = [[0.004, 0.0], [0.009, 0.0]]


def env_of(id=TIMED, **arguments):
    return gym.make(id, **({"fidelity": "fast"} | arguments), disable_env_checker=True)


def seen_by(sees):
    return replace(BAD, sees=sees)


def observations_of(env):
    return [entry for entry in swum(env) if np.shape(entry) == env.observation_space.shape]


# In time


@pytest.mark.parametrize(
    ("id", "rate"),
    [(TIMED, 2.0), ("SeastarSwim-v0", 1.0), ("SeastarSwimHeading-v0", 2.0), ("SeastarSwimTimedHard-v0", 10.0),
     ("SeastarPrizes-v0", 1.0), ("SeastarObstTrapTimed-v0", 4.0), ("SeastarMiswired-v0", 1.0)],
)  # fmt: skip
def test_a_camera_without_delay_shows_the_present_observation_to_the_last_bit(id, rate):
    plain, seen = env_of(id), env_of(id, sight=Sight(rate, sees="nodes"))
    age = seen.unwrapped.layout.further.stop - 1
    for ours, theirs in zip(*map(observations_of, (seen, plain)), strict=True):
        assert ours[age] == 0.0
        np.testing.assert_array_equal(np.delete(ours, age), theirs)


def test_a_camera_changes_no_bit_of_the_swim():
    plain, seen = env_of(), env_of(sight=BAD)
    plain.reset(seed=0), seen.reset(seed=0)
    for action in (3, 0, 7, 12):
        plain.step(action), seen.step(action)
    np.testing.assert_array_equal(plain.unwrapped.simulator.q, seen.unwrapped.simulator.q)


def test_pictures_change_no_bit_of_what_is_seen():
    late = {"sight": BAD, "action_delay": 0.2}
    found = [swum(env_of(render_mode=mode, **late)) for mode in (None, "rgb_array_list")]
    assert_same(*found)
    env = env_of(render_mode="rgb_array_list", frames_per_stroke=4, **late)
    env.reset(seed=0), env.step(3)
    assert len(env.render()) == 5


# Late


def test_a_late_picture_shows_the_robot_as_it_was():
    env = env_of(sight=Sight(rate=10.0, delay=0.1, sees="pose"), path=[[0.5, 0.0]])
    env.reset(seed=0)
    simulator, layout = Simulator(env.unwrapped.scene), env.unwrapped.layout
    commands = command_table("pairs", 5)
    for action in (3, 8):
        seen = env.step(action)[0]
        for since in simulator.advance_in_parts(PERIOD, commands[[action]], 5):
            if since == pytest.approx(PERIOD - 0.1):
                hub, heading = simulator.hub_position()[0], heading_of(simulator)[0]
        x, y = np.array([0.5, 0.0]) - hub
        c, s = np.cos(heading), np.sin(heading)
        expected = np.array([c * x + s * y, c * y - s * x]) / 0.1
        np.testing.assert_allclose(seen[layout.current_waypoint], expected, atol=1e-6)
        assert seen[layout.further][-1] == pytest.approx(0.1)


def test_the_age_is_that_of_the_newest_picture_that_was_seen():
    env = env_of(sight=Sight(rate=8.0, delay=0.2))
    first, info = env.reset(seed=0)
    at = env.unwrapped.layout.further.stop - 1
    assert first[at] == info["sight_age"] == pytest.approx(0.25)  # the last before -0.2 s
    observation, *_, info = env.step(0)
    assert observation[at] == pytest.approx(0.5 - 0.25) and info["sight_age"] == pytest.approx(0.25)


def test_velocities_are_differences_of_what_two_decisions_saw():
    env = env_of(sight=Sight(rate=2.0, sees="pose"), path=[[0.5, 0.0]])
    env.reset(seed=0)
    layout, simulator = env.unwrapped.layout, env.unwrapped.simulator
    places = [(simulator.hub_position()[0], heading_of(simulator)[0])]
    for action in (3, 8):
        seen = env.step(action)[0][layout.further]
        places.append((simulator.hub_position()[0], heading_of(simulator)[0]))
        (before, old), (after, new) = places[-2:]
        c, s = np.cos(new), np.sin(new)
        velocity = np.array([[c, s], [-s, c]]) @ (after - before) / PERIOD / VELOCITY_SCALE
        np.testing.assert_allclose(seen, [*velocity, (new - old) / PERIOD, 0.0], atol=1e-6)


@pytest.mark.parametrize("n", [1, 3, 9])
def test_markers_are_stations_and_their_velocities_are_differences(n):
    all_seen, some = (env_of(sight=Sight(2.0, sees=sees)) for sees in ("nodes", n))
    histories = []
    for env in (all_seen, some):
        at = env.unwrapped.layout
        rows = [env.reset(seed=0)[0], *(env.step(action)[0] for action in (3, 8))]
        histories.append([row[at.positions].reshape(5, -1, 2) for row in rows])
    velocities = rows[-1][at.velocities].reshape(5, -1, 2)
    for whole, ours in zip(*histories, strict=True):
        np.testing.assert_array_equal(ours, whole[:, 9 // n - 1 :: 9 // n])
    moved = (histories[1][2] - histories[1][1]) * 0.1 / PERIOD / VELOCITY_SCALE
    np.testing.assert_allclose(velocities, moved, atol=1e-6)
    assert np.abs(moved).max() > 0.1


def test_who_is_lost_from_sight_is_seen_where_it_was_and_ever_older():
    env = env_of(sight=Sight(dropout=1.0), path=[[0.5, 0.0]])
    first, _ = env.reset(seed=0)
    layout = env.unwrapped.layout
    for k in (1, 2):
        observation = env.step(3)[0]
        np.testing.assert_array_equal(observation[layout.waypoints], first[layout.waypoints])
        np.testing.assert_allclose(observation[layout.further], [0.0, 0.0, 0.0, k * PERIOD], atol=1e-6)


def test_noise_has_its_standard_deviation():
    batch = gym.make_vec(TIMED, 2000, "vector_entry_point", fidelity="fast", path=[[0.5, 0.0]],
                         sight=Sight(noise=3e-3, turn_noise=0.05, sees=1))  # fmt: skip
    seen, at = batch.reset(seed=0)[0].astype(float), Layout(5, 2, ("pseudoscalar", "scalar"), stations=1)
    to_goal = seen[:, at.current_waypoint]
    headings = -np.arctan2(to_goal[:, 1], to_goal[:, 0])
    assert headings.std() == pytest.approx(np.hypot(0.05, 3e-3 / 0.5), rel=0.06)
    assert np.hypot(*to_goal.T).std() * 0.1 == pytest.approx(3e-3, rel=0.06)
    radial = np.hypot(seen[:, 0], seen[:, 1]) * 0.1  # of limb 1's tip, hub and tip with errors of their own
    assert radial.std() == pytest.approx(np.sqrt(2) * 3e-3, rel=0.06)


# Commands on their way


def test_commands_that_are_late_by_whole_decisions_are_those_of_earlier_ones():
    late, plain = env_of(action_delay=2 * PERIOD), env_of()
    for env in (late, plain):
        env.reset(seed=0)
    for action, arriving in zip((3, 8, 0, 5), (0, 0, 3, 8), strict=True):
        ours, theirs = late.step(action)[0], plain.step(arriving)[0]
        np.testing.assert_array_equal(ours, theirs)


def test_commands_reach_the_wires_after_their_delay():
    env = env_of(action_delay=PERIOD + 0.2)
    env.reset(seed=0)
    simulator, nothing = Simulator(env.unwrapped.scene), np.zeros((1, 5))
    commands = command_table("pairs", 5)
    infos = [env.step(action)[4] for action in (3, 8, 2)]
    for command in (nothing, commands[[3]], commands[[8]]):
        simulator.advance(0.2, nothing)
        report = simulator.advance(PERIOD - 0.2, command)
    np.testing.assert_array_equal(env.unwrapped.simulator.q, simulator.q)
    assert infos[0]["heating_time"] == 0.0 and infos[2]["heating_time"] == report.heating_time[0] == pytest.approx(0.2)


@pytest.mark.parametrize("actuator", [None, SmaPulse()])
def test_strokes_can_only_be_late_by_whole_decisions(actuator):
    strokes = {} if actuator is None else {"scene": Scene(actuator=actuator)}
    with assert_refused("action_delay", "whole decisions of 1 s", "SmaWires"):
        SeastarSwimEnv(action_delay=0.1, **strokes)
    SeastarSwimEnv(action_delay=3.0, **strokes)


# Batches, seeds, draws


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
@pytest.mark.parametrize("sees", ["pose", 3, "nodes"])
def test_a_batch_gives_the_bits_of_single_environments_across_resets(sees, mode):
    arguments = {"sight": seen_by(sees), "action_delay": Uniform(0.0, 0.7), "path": SHORT, "max_episode_steps": 4}
    swim_together(*both(TIMED, 5, mode, waypoint_radius=0.003, **arguments), 9)


@pytest.mark.parametrize(
    "id", ["SeastarSwim-v0", "SeastarSwimHeading-v0", "SeastarFailBlind-v0", "SeastarPrizesTimed-v0",
           "SeastarObstTrap-v0", "SeastarMiswiredTimed-v0", "SeastarPreyTimed-v0", "SeastarStation-v0"],
)  # fmt: skip
def test_every_task_can_be_seen_through_a_camera(id):
    period = env_of(id).unwrapped.decision_period
    swim_together(*both(id, 2, sight=BAD, action_delay=period), 3)


def test_every_seed_is_one_episode_and_the_next_episode_another():
    env = env_of(sight=BAD, action_delay=Uniform(0.0, 0.3))
    assert_same(swum(env), swum(env))
    names = ("sight.delay", "sight.noise", "action_delay")
    drawn = [tuple(env.reset(seed=seed)[1][name] for name in names) for seed in (1, None, None)]
    assert len(set(drawn)) == 3
    assert all(0.05 <= delay <= 0.15 and noise <= 2e-3 and late <= 0.3 for delay, noise, late in drawn)


def test_domain_randomization_draws_the_numbers_of_the_sight():
    draws = DomainRandomization({"sight.delay": Uniform(0.1, 0.2), "robot.density": Uniform(990.0, 1010.0),
                                 "action_delay": Uniform(0.1, 0.3)})  # fmt: skip
    env = env_of(sight=Sight(delay=0.01), randomization=draws)
    info = env.reset(seed=0)[1]
    assert 0.1 <= info["sight.delay"] <= 0.2 and 0.1 <= info["action_delay"] <= 0.3 and info["robot.density"] != 1000.0
    swim_together(*both(TIMED, 3, sight=Sight(sees=1), randomization=draws), 3)


@pytest.mark.parametrize("element", [0, 2, 5])
@pytest.mark.parametrize("sees", SEEN)
def test_what_is_seen_is_carried_by_symmetry(sees, element):
    scene, sight = Scene(actuator=SmaWires()), Sight(rate=7.0, delay=0.1, sees=sees)
    rewards, seen = zip(
        *(reduced_swim(scene, None, matrix(k, 5), [3, 9, 14, 5], decision_period=PERIOD, sight=sight)
          for k in (0, element)), strict=True,
    )  # fmt: skip
    np.testing.assert_allclose(*rewards, atol=1e-4)
    np.testing.assert_allclose(*seen, atol=2e-4)
    assert isinstance(SymmetryReduction(env_of(sight=sight)), SymmetryReduction)


# Refusals


@pytest.mark.parametrize(
    ("numbers", "words"),
    [({"rate": 0.0}, "Sight.rate"), ({"rate": 2e3}, "at most 1000 Hz"), ({"delay": -0.1}, "Sight.delay"),
     ({"delay": Uniform(-0.1, 0.1)}, "Sight.delay"), ({"delay": 6.0}, "at most 5 s"), ({"dropout": 1.1}, "at most 1 1"),
     ({"noise": "1"}, "Sight.noise"), ({"sees": "hub"}, "Sight.sees"), ({"sees": 2}, "1, 3 or 9 markers"),
     ({"sees": True}, "Sight.sees"), ({"turn_noise": Sight()}, "Sight.turn_noise")],
)  # fmt: skip
def test_a_camera_that_there_cannot_be_is_refused(numbers, words):
    with assert_refused(words):
        Sight(**numbers)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [({"sight": 30.0}, "a Sight or None"), ({"action_delay": -1.0}, "action_delay"),
     ({"action_delay": Sight()}, "action_delay"), ({"action_delay": "late"}, "action_delay"),
     ({"randomization": DomainRandomization({"sight.delay": Uniform(0.0, 1.0)})}, "sight.delay"),
     ({"randomization": DomainRandomization({"sight.rate": Uniform(0.0, 1.0)}), "sight": Sight()}, "sight.rate"),
     ({"randomization": DomainRandomization({"sight.delay": Uniform(0.0, 9.0)}), "sight": Sight()}, "at most 5 s"),
     ({"randomization": DomainRandomization({"action_delay": Uniform(-1.0, 1.0)})}, "action_delay")],
)  # fmt: skip
def test_an_environment_refuses_what_is_no_sight_and_no_delay(arguments, words):
    with assert_refused(words):
        SeastarSwimEnv(decision_period=PERIOD, fidelity="fast", **arguments)
