"""Every number of an observation is what the table in envs/observation.py says, whichever way the robot points."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from episodes import assert_same, swum
from hubs import TEN
from seastar_gym import (
    Attachment,
    Body,
    Limb,
    Numerics,
    Scene,
    Seastar,
    Sight,
    Simulator,
    SmaPulse,
    Uniform,
    UniformCurrent,
    Water,
)
from seastar_gym.envs.commands import command_table
from seastar_gym.envs.layout import VELOCITY_SCALE, Layout
from seastar_gym.envs.observation import observe
from seastar_gym.envs.stations import at_stations, heading_of, stations_of
from seastar_gym.envs.symmetry import VectorFrameStack, VectorSymmetryReduction
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.lanes.registers import N_LANES
from seastar_gym.lanes.rows import to_rows

SCENES = [
    Scene(TEN, numerics=Numerics.preset("fast")),
    Scene(Seastar(3, 4, limb_length=0.2), actuator=SmaPulse(0.3), numerics=Numerics.preset("fast")),
    *(Scene(Seastar(nodes_per_limb=n), numerics=Numerics.preset("fast")) for n in (7, 19)),
]


def observations_of(simulator: Simulator, targets: np.ndarray) -> np.ndarray:
    """float64 observations, shape (n_robots, size), for targets of shape (n_robots, 4) [m]."""
    rows, robot = to_rows(targets), simulator.scene.robot
    out = np.full((len(rows), Layout(robot.n_limbs).size, N_LANES), np.nan)
    own, places = simulator.coefficients, stations_of(robot)
    observe(own.rest, own.limb_length, simulator.q, simulator.v, places, rows, VELOCITY_SCALE, out)
    return out.transpose(0, 2, 1).reshape(-1, out.shape[1])[: simulator.n_robots]


def expected_observation(robot: Seastar, q: np.ndarray, v: np.ndarray, waypoint, following) -> np.ndarray:
    """The table once more, with complex numbers: x + iy turned by exp(-i angle)."""
    rest, seen_q, seen_v = (at_stations(x, robot)[1:] @ [1.0, 1j] for x in (robot.nodes(), q, v))
    hub, hub_v, targets = (np.asarray(x) @ [1.0, 1j] for x in (q[:1], v[:1], [waypoint, following]))
    angle = np.angle(np.sum(np.conj(rest) * seen_q))  # least squares: the sum's argument
    parts = [seen_q / robot.limb_length, seen_v / 0.025, hub_v / 0.025, (targets - hub) / robot.limb_length]
    turned = np.concatenate(parts) * np.exp(-1j * angle)
    return np.stack([turned.real, turned.imag], axis=1).reshape(-1)


@pytest.mark.parametrize("scene", SCENES)
def test_every_index_holds_what_the_table_says(scene):
    n_robots, n_limbs = N_LANES + 3, scene.robot.n_limbs
    simulator, rng = Simulator(scene, n_robots), np.random.default_rng(0)
    simulator.reset(heading=rng.uniform(-np.pi, np.pi, n_robots))
    for _ in range(3):
        simulator.stroke(rng.uniform(-1.0, 1.0, (n_robots, n_limbs)))
    targets = rng.uniform(-1.0, 1.0, (n_robots, 4))
    found, q, v = observations_of(simulator, targets), simulator.positions, simulator.velocities
    for robot in range(n_robots):
        expected = expected_observation(scene.robot, q[robot], v[robot], targets[robot, :2], targets[robot, 2:])
        np.testing.assert_allclose(found[robot], expected, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("nodes_per_limb", [5, 10])
def test_limbs_on_a_body_are_seen_from_their_roots(nodes_per_limb):
    """Stations of their velocities are the change of those of positions in a short time."""
    places = ((0.03, 0.015), (-0.03, 0.015), (-0.03, -0.015))
    body = Body.rectangle(0.06, 0.03, attachments=tuple(Attachment(x, y, np.arctan2(y, x)) for x, y in places))
    scene = Scene(Seastar(3, nodes_per_limb, body=body), numerics=Numerics.preset("fast"))
    simulator, rng, dt = Simulator(scene, 3), np.random.default_rng(0), 1e-6
    simulator.reset(heading=rng.uniform(-np.pi, np.pi, 3))
    rest = at_stations(scene.robot.nodes(), scene.robot, np.zeros(()))[1:] @ [1.0, 1j]
    for stroke in range(2):
        found = observations_of(simulator, np.zeros((3, 4)))
        q, angle = simulator.positions, simulator.orientation()
        later = q + dt * simulator.velocities, angle + dt * simulator.spin()
        seen, then = (at_stations(at, scene.robot, turn)[:, 1:] @ [1.0, 1j] for at, turn in ((q, angle), later))
        axis = np.exp(-1j * np.angle((np.conj(rest) * seen).sum(axis=1)))[:, None]
        expected = np.concatenate([seen * axis / 0.1, (then - seen) / dt * axis / 0.025], axis=1)
        expected = np.stack([expected.real, expected.imag], axis=-1).reshape(3, -1)
        np.testing.assert_allclose(found[:, : expected.shape[1]], expected, rtol=0.0, atol=1e-6)
        if stroke == 0:
            simulator.advance(0.1, rng.uniform(-1.0, 1.0, (3, 3)))
            assert np.abs(simulator.spin()).max() > 1e-3


def test_a_robot_without_a_direction_is_seen_in_the_world_frame_not_as_nan():
    simulator = Simulator(Scene(TEN))
    state = simulator.get_state()
    simulator.set_state(state._replace(positions=np.full_like(state.positions, 0.2)))
    observation = observations_of(simulator, np.array([[0.3, 0.2, 0.2, 0.4]]))
    assert np.isfinite(observation).all()
    np.testing.assert_allclose(observation[0, 182:], [1.0, 0.0, 0.0, 2.0], atol=1e-14)


# Robots seen through a camera, and commands that come late: exact times, the same bits in batches, and refusals.


TIMED = "SeastarSwimTimed-v0"
PERIOD = 0.5
BAD = Sight(delay=Uniform(0.05, 0.15), jitter=0.03, dropout=0.2, noise=Uniform(0.0, 2e-3), turn_noise=0.02, sees="pose")


def env_of(id=TIMED, **arguments):
    return gym.make(id, **({"fidelity": "fast"} | arguments), disable_env_checker=True)


def seen_through(env):
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
    for ours, theirs in zip(*map(seen_through, (seen, plain)), strict=True):
        assert ours[age] == 0.0
        np.testing.assert_array_equal(np.delete(ours, age), theirs)


def test_cameras_and_pictures_change_no_bit():
    plain, seen = env_of(), env_of(sight=BAD)
    plain.reset(seed=0), seen.reset(seed=0)
    for action in (3, 0, 7, 12):
        plain.step(action), seen.step(action)
    np.testing.assert_array_equal(plain.unwrapped.simulator.q, seen.unwrapped.simulator.q)
    late = {"sight": BAD, "action_delay": 0.2}
    assert_same(*(swum(env_of(render_mode=mode, **late)) for mode in (None, "rgb_array_list")))
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
    env = env_of(sight=Sight(rate=8.0, delay=0.2))
    first, info = env.reset(seed=0)
    at = env.unwrapped.layout.further.stop - 1
    assert first[at] == info["sight_age"] == pytest.approx(0.25)  # the last before -0.2 s
    observation, *_, info = env.step(0)
    assert observation[at] == pytest.approx(0.5 - 0.25) and info["sight_age"] == pytest.approx(0.25)


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


@pytest.mark.parametrize("whole, rest", [(1, 0.2), (2, 0.0)])
def test_commands_reach_the_wires_after_their_delay(whole, rest):
    env, actions = env_of(action_delay=whole * PERIOD + rest), [3, 8, 2, 5]
    env.reset(seed=0)
    simulator, commands = Simulator(env.unwrapped.scene), command_table("pairs", 5)
    infos = [env.step(action)[4] for action in actions]
    for arriving in ([0] * whole + actions)[: len(actions)]:
        if rest:
            simulator.advance(rest, commands[[0]])
        report = simulator.advance(PERIOD - rest, commands[[arriving]])
    np.testing.assert_array_equal(env.unwrapped.simulator.q, simulator.q)
    assert infos[0]["heating_time"] == 0.0 and infos[3]["heating_time"] == report.heating_time[0] == pytest.approx(0.2)


# Memory of past observations: in the same limbs throughout, and for one episode.


def batch(task, n=6, **arguments):
    return SeastarSwimVectorEnv(n, 400, task=task, fidelity="fast", threads=1, **{"actions": "pairs"} | arguments)


@pytest.mark.parametrize(
    "task, period",
    [("miswired", 1.0), ("station", 1.0), ("prey", 1.0), ("fail-blind", 1.0), ("obst-trap", 0.5), ("sim-to-real", 0.2)],
)
def test_memory_shows_the_reduced_observation_and_the_past_in_the_same_limbs(task, period):
    def new():
        return batch(task, actions="joint", decision_period=period)

    memory, reduced = VectorFrameStack(new(), 2), VectorSymmetryReduction(new())
    (shown, _), (ours, _) = memory.reset(seed=1), reduced.reset(seed=1)
    assert shown.shape == memory.observation_space.shape
    rng, size, past = np.random.default_rng(0), ours.shape[1], [memory._latest, memory._latest]
    for _ in range(4):
        np.testing.assert_array_equal(shown[:, :size], ours)
        past, actions = [memory._latest, past[0]], rng.integers(0, 243, 6)
        shown, ours = memory.step(actions)[0], reduced.step(actions)[0]
        seen = memory.frame_stack
        for before, told in zip(past, np.moveaxis(shown[:, size:].reshape(6, 2, -1), 1, 0), strict=True):
            carried = seen.symmetry.carry(before, memory._elements)
            np.testing.assert_array_equal(told, carried[:, seen.features])


def test_memory_without_symmetry_shows_any_robot_as_it_is():
    scene = Scene(Seastar(3, 5, limbs=(Limb(length=0.12), Limb(), Limb())), Water(current=UniformCurrent(0.001)))
    memory = VectorFrameStack(batch("station", scene=scene), 1, symmetry=False)
    before, _ = memory.reset(seed=1)
    seen, size = memory.frame_stack, memory.frame_stack.layout.size
    shown, *_ = memory.step(np.array([1, 2, 3, 4, 5, 6]))
    np.testing.assert_array_equal(shown[:, :size], memory._latest)
    np.testing.assert_array_equal(shown[:, size:], before[:, :size][:, seen.features])


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_no_memory_goes_from_one_episode_into_the_next(mode):
    """Robots whose episodes end at different times: the past of a new one is its first observation."""
    memory = VectorFrameStack(batch("prey", 3, autoreset_mode=mode), 2)
    memory.unwrapped.max_episode_steps = 3
    memory.reset(seed=0)
    seen, size = memory.frame_stack, memory.frame_stack.layout.size
    began, ended = 0, np.zeros(3, bool)
    for step in range(9):
        shown, _, terminated, truncated, info = memory.step(np.full(3, step % 21))
        over = terminated | truncated
        begun = over if mode == AutoresetMode.SAME_STEP else ended
        for robot in np.flatnonzero(begun):
            now, past = shown[robot, :size][seen.features], shown[robot, size:].reshape(2, -1)
            np.testing.assert_array_equal(past, np.stack([now, now]))
            began += 1
            if mode == AutoresetMode.SAME_STEP:  # the last observation still has its memory
                last = info["final_obs"][robot]
                assert not np.array_equal(last[size:], np.tile(last[:size][seen.features], 2))
        ended = over
    assert began >= 3


def test_a_reset_of_some_robots_leaves_the_others_memory():
    memory = VectorFrameStack(batch("prey", 2, autoreset_mode=AutoresetMode.DISABLED), 2)
    memory.reset(seed=0)
    for action in (3, 4, 5):
        shown = memory.step(np.array([action, action]))[0]
    again, _ = memory.reset(seed=1, options={"reset_mask": np.array([True, False])})
    np.testing.assert_array_equal(again[1], shown[1])
    now = again[0, : memory.frame_stack.layout.size][memory.frame_stack.features]
    np.testing.assert_array_equal(again[0, memory.frame_stack.layout.size :].reshape(2, -1), np.stack([now, now]))
