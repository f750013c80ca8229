"""Every number of an observation is what the table in envs/layout.py says, whichever way the robot points."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from hubs import TEN
from seastar_gym import Attachment, Body, Numerics, Scene, Seastar, Simulator, SmaPulse, ThermalSma
from seastar_gym.envs.layout import HEADINGS, VELOCITY_SCALE, Layout
from seastar_gym.envs.observation import at_station, layout, observe, to_float32
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.stations import at_stations, stations, stations_of
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simd.rows import to_rows
from seastar_gym.simulator import State

SCENES = [
    Scene(TEN, numerics=Numerics.preset("fast")),
    Scene(Seastar(3, 4, limb_length=0.2), actuator=SmaPulse(0.3), numerics=Numerics.preset("fast")),
    Scene(Seastar(nodes_per_limb=7), numerics=Numerics.preset("fast")),
]


def observations_of(simulator: Simulator, targets: np.ndarray) -> np.ndarray:
    """float64 observations, shape (n_robots, size), for targets of shape (n_robots, 4) [m]."""
    rows, robot = to_rows(targets), simulator.scene.robot
    out = np.full((len(rows), Layout(robot.n_limbs).size, N_LANES), np.nan)
    own, places = simulator.coefficients, stations_of(robot)
    observe(own.rest, own.limb_length, simulator.q, simulator.v, places, rows, VELOCITY_SCALE, out)
    return out.transpose(0, 2, 1).reshape(-1, out.shape[1])[: simulator.n_robots]


def test_a_layout_knows_where_the_tips_are():
    env = SeastarSwimEnv(random_heading=False, fidelity="fast")
    observation, _ = env.reset(seed=0)
    tips = env.scene.robot.nodes()[env.scene.robot.nodes_per_limb - 1 :: env.scene.robot.nodes_per_limb - 1]
    np.testing.assert_allclose(observation[env.layout.tips].reshape(5, 2), tips / 0.1, atol=1e-6)


def expected_observation(robot: Seastar, q: np.ndarray, v: np.ndarray, waypoint, following) -> np.ndarray:
    """The table once more, with complex numbers: x + iy turned by exp(-i angle)."""
    rest, seen_q, seen_v = (at_stations(x, robot)[1:] @ [1.0, 1j] for x in (robot.nodes(), q, v))
    hub, hub_v, targets = (np.asarray(x) @ [1.0, 1j] for x in (q[:1], v[:1], [waypoint, following]))
    angle = np.angle(np.sum(np.conj(rest) * seen_q))  # least squares: the sum's argument
    parts = [seen_q / robot.limb_length, seen_v / 0.025, hub_v / 0.025, (targets - hub) / robot.limb_length]
    turned = np.concatenate(parts) * np.exp(-1j * angle)
    return np.stack([turned.real, turned.imag], axis=1).reshape(-1)


def test_scale_and_size_are_the_documented_ones():
    assert VELOCITY_SCALE == 0.025
    assert Layout(5).size == 186


@pytest.mark.parametrize("with_headings", [False, True])
@pytest.mark.parametrize("n_limbs, n_remembered", [(5, 0), (5, 20), (1, 3)])
def test_a_layout_names_every_place_once_and_in_the_order_of_the_table(n_limbs, n_remembered, with_headings):
    at = layout(n_limbs, n_remembered, with_headings)
    assert at == Layout(n_limbs, n_remembered // n_limbs, HEADINGS if with_headings else ())
    places = np.arange(at.size)
    each = [
        places[place]
        for place in (
            at.positions, at.velocities, at.hub_velocity, at.actuators, at.headings, at.current_waypoint,
            at.next_waypoint,
        )
    ]  # fmt: skip
    np.testing.assert_array_equal(np.concatenate(each), places)
    assert [len(one) for one in each] == [2 * 9 * n_limbs] * 2 + [2, n_remembered, 4 * with_headings, 2, 2]
    np.testing.assert_array_equal(places[at.waypoints], places[-4:])
    np.testing.assert_array_equal(places[at.stations_and_hub], places[: 4 * 9 * n_limbs + 2])


def test_the_layout_of_a_scene_finds_what_its_actuators_remember():
    scene = Scene(TEN, actuator=ThermalSma(), numerics=Numerics.preset("fast"))
    env, plain = SeastarSwimEnv(scene=scene), SeastarSwimEnv(fidelity="fast")
    env.reset(seed=0)
    seen, at = env.step([0, 1, 0, 0, 2])[0], Layout.of(scene)
    np.testing.assert_allclose(seen[at.actuators], env.simulator.observe_actuators()[0], rtol=1e-6)
    assert np.any(seen[at.actuators])
    first, bare = plain.reset(seed=0)[0], Layout.of(plain.scene)
    np.testing.assert_array_equal(env.reset(seed=0)[0][at.waypoints], first[bare.waypoints])
    assert env.observation_space.shape == (at.size,) and plain.observation_space.shape == (bare.size,)


@pytest.mark.parametrize("scene", SCENES)
def test_every_index_holds_what_the_table_says(scene):
    n_robots, n_limbs = N_LANES + 3, scene.robot.n_limbs
    simulator, rng = Simulator(scene, n_robots), np.random.default_rng(0)
    simulator.reset(heading=rng.uniform(-np.pi, np.pi, n_robots))
    for _ in range(3):
        simulator.stroke(rng.uniform(-1.0, 1.0, (n_robots, n_limbs)))
    targets = rng.uniform(-1.0, 1.0, (n_robots, 4))
    found = observations_of(simulator, targets)
    for robot in range(n_robots):
        expected = expected_observation(
            scene.robot, simulator.positions[robot], simulator.velocities[robot], targets[robot, :2], targets[robot, 2:]
        )
        np.testing.assert_allclose(found[robot], expected, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("nodes_per_limb", [5, 10])
def test_limbs_on_a_body_are_seen_from_their_roots(nodes_per_limb):
    """Positions and velocities of stations are those of splines through root and nodes, in the frame of best fit."""
    places = ((0.03, 0.015), (-0.03, 0.015), (-0.03, -0.015))
    body = Body.rectangle(0.06, 0.03, attachments=tuple(Attachment(x, y, np.arctan2(y, x)) for x, y in places))
    scene = Scene(Seastar(3, nodes_per_limb, body=body), numerics=Numerics.preset("fast"))
    simulator, rng = Simulator(scene, 3), np.random.default_rng(0)
    simulator.reset(heading=rng.uniform(-np.pi, np.pi, 3))
    for swum in range(2):
        found = observations_of(simulator, np.zeros((3, 4)))
        q, v, roots = simulator.positions, simulator.velocities, simulator.root_positions()
        arms = roots - q[:, :1]
        moving = v[:, :1] + simulator.spin()[:, None, None] * np.stack([-arms[..., 1], arms[..., 0]], axis=-1)
        seen = [along_limbs(nodes, begin) @ [1.0, 1j] for nodes, begin in ((q, roots), (v, moving))]
        rest = along_limbs(scene.robot.nodes()[None], np.array([places])) @ [1.0, 1j]
        axis = np.exp(-1j * np.angle((np.conj(rest) * seen[0]).sum(axis=1)))[:, None]
        expected = np.concatenate([seen[0] * axis / 0.1, seen[1] * axis / 0.025], axis=1)
        expected = np.stack([expected.real, expected.imag], axis=-1).reshape(3, -1)
        np.testing.assert_allclose(found[:, : expected.shape[1]], expected, rtol=0.0, atol=1e-11)
        if swum == 0:
            simulator.advance(0.1, rng.uniform(-1.0, 1.0, (3, 3)))
            assert np.abs(simulator.spin()).max() > 1e-3


def along_limbs(nodes: np.ndarray, roots: np.ndarray) -> np.ndarray:
    """Stations from the hub, shape (n_robots, 27, 2), of nodes, or velocities, of three limbs and their roots."""
    limbs = nodes[:, 1:].reshape(len(nodes), 3, -1, 2)
    limbs = np.concatenate([roots[:, :, None], limbs], axis=2) - nodes[:, None, :1]
    curve = CubicSpline(np.linspace(0.0, 1.0, limbs.shape[2]), limbs, axis=2)
    return curve(np.arange(1, 10) / 9).reshape(len(nodes), 27, 2)


def test_at_rest_the_body_frame_is_that_of_limb_1():
    simulator = Simulator(Scene(TEN), 2)
    simulator.reset(heading=[0.0, 2.0])
    observation = observations_of(simulator, np.zeros((2, 4)))
    np.testing.assert_allclose(observation[:, 16:18], [[1.0, 0.0], [1.0, 0.0]], atol=1e-15)  # tip of limb 1
    np.testing.assert_allclose(observation[:, :90].reshape(2, 45, 2) * 0.1, [TEN.nodes()[1:]] * 2, atol=1e-15)
    assert not observation[:, 90:].any()


def test_an_observation_is_the_same_wherever_the_robot_is_and_whichever_way_it_points():
    simulator, rng, angle, place = Simulator(SCENES[0], 2), np.random.default_rng(1), 2.5, np.array([0.7, -3.0])
    simulator.stroke(np.tile(rng.uniform(-1.0, 1.0, 5), (2, 1)))
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    state, targets = simulator.get_state(), rng.uniform(-1.0, 1.0, (2, 2))
    state.positions[1] = state.positions[1] @ turn + place
    state.velocities[1] = state.velocities[1] @ turn
    simulator.set_state(state)
    both = np.stack([targets.ravel(), (targets @ turn + place).ravel()])
    here, there = observations_of(simulator, both)
    np.testing.assert_allclose(there, here, rtol=0.0, atol=1e-11)


@pytest.mark.parametrize("nodes_per_limb, every", [(10, 1), (19, 2), (37, 4)])
def test_a_station_that_is_a_node_has_its_bits(nodes_per_limb, every):
    robot, places = Seastar(nodes_per_limb=nodes_per_limb), stations(nodes_per_limb)
    rows = np.random.default_rng(3).normal(size=(2 * robot.n_nodes, N_LANES))
    for limb, station in np.ndindex(5, 9):
        node = 1 + limb * (nodes_per_limb - 1) + (station + 1) * every - 1
        x, y = at_station.plain(rows, places, limb, station)
        np.testing.assert_array_equal(x.numbers, rows[2 * node] - rows[0])
        np.testing.assert_array_equal(y.numbers, rows[2 * node + 1] - rows[1])


@pytest.mark.parametrize("nodes_per_limb", [2, 7, 19])
def test_one_robot_sees_what_it_sees_in_a_batch_to_the_last_bit(nodes_per_limb):
    scene = Scene(Seastar(nodes_per_limb=nodes_per_limb), numerics=Numerics.preset("fast"))
    one, batch = SeastarSwimEnv(scene=scene), SeastarSwimVectorEnv(3, scene=scene, threads=1)
    alone, together = one.reset(seed=0)[0], batch.reset(seed=0)[0]
    np.testing.assert_array_equal(together, [alone] * 3)
    for command in ([0, 1, 0, 0, 2], [1, 0, 2, 0, 0]):
        alone, together = one.step(command)[0], batch.step(np.array([command] * 3))[0]
        np.testing.assert_array_equal(together, [alone] * 3)


def seen_of_a_bent_robot(nodes_per_limb: int) -> np.ndarray:
    """Observation of smoothly bent and moving limbs, sampled at so many nodes."""
    robot = Seastar(nodes_per_limb=nodes_per_limb)
    s = np.arange(1, nodes_per_limb) / (nodes_per_limb - 1)
    limbs = [np.exp(2j * np.pi * i / 5) * s * np.exp(1j * np.sin((2.0 + 0.2 * i) * s)) for i in range(5)]
    moving = [(0.2 + 0.1j * i) * s * np.cos(3.0 * s) for i in range(5)]
    positions, velocities = (np.concatenate([[0.0], *parts]) for parts in (limbs, moving))
    simulator = Simulator(Scene(robot, numerics=Numerics.preset("fast")))
    in_plane = [np.stack([z.real, z.imag], axis=1)[None] for z in (0.1 * positions, 0.025 * velocities)]
    simulator.set_state(State(*in_plane, np.zeros(1)))
    return observations_of(simulator, np.ones((1, 4)))[0]


def test_meshes_that_have_a_node_at_every_station_see_the_same():
    for nodes_per_limb in (19, 37):
        np.testing.assert_allclose(seen_of_a_bent_robot(nodes_per_limb), seen_of_a_bent_robot(10), rtol=0.0, atol=1e-13)


def test_what_is_seen_of_a_smooth_robot_converges_with_the_fourth_power_of_the_edge():
    """To what a mesh with nodes at all stations sees; in these, stations stand at like places between nodes."""
    n_edges, exact = np.array([35, 71, 143, 287]), seen_of_a_bent_robot(10)
    errors = [np.abs(seen_of_a_bent_robot(n + 1) - exact).max() for n in n_edges]
    slope = -np.polyfit(np.log(n_edges), np.log(errors), 1)[0]
    assert 3.8 < slope < 4.4 and errors[0] < 1e-6, (slope, errors)


def test_a_robot_without_a_direction_is_seen_in_the_world_frame_not_as_nan():
    simulator = Simulator(Scene(TEN))
    state = simulator.get_state()
    simulator.set_state(state._replace(positions=np.full_like(state.positions, 0.2)))
    observation = observations_of(simulator, np.array([[0.3, 0.2, 0.2, 0.4]]))
    assert np.isfinite(observation).all()
    np.testing.assert_allclose(observation[0, 182:], [1.0, 0.0, 0.0, 2.0], atol=1e-14)


def test_observations_are_fresh_float32_arrays():
    rows = np.random.default_rng(0).random((2, 7, N_LANES))
    first, second = to_float32(rows, N_LANES + 1), to_float32(rows, N_LANES + 1)
    assert first.dtype == np.float32 and first.shape == (N_LANES + 1, 7)
    assert not np.shares_memory(first, second) and not np.shares_memory(first, rows)
    np.testing.assert_array_equal(first[N_LANES], rows[1, :, 0].astype(np.float32))


def test_velocities_are_of_order_one_after_strokes_of_random_commands():
    env, rng = SeastarSwimEnv(), np.random.default_rng(0)
    env.reset(seed=0)
    seen = np.array([env.step(rng.integers(0, 3, 5))[0] for _ in range(50)])
    for part in (seen[:, :90], seen[:, 90:180], seen[:, 180:182]):
        assert 0.1 < np.sqrt(np.mean(part**2)) < 3.0
