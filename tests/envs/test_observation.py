"""Every number of an observation is what the table in envs/observation.py says, whichever way the robot points."""

import numpy as np
import pytest

from seastar_gym import Numerics, Scene, Seastar, Simulator, SmaPulse, ThermalSma
from seastar_gym.envs.observation import VELOCITY_SCALE, layout, observation_size, observe, scene_layout, to_float32
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simd.rows import to_rows

SCENES = [
    Scene(numerics=Numerics.preset("fast")),
    Scene(Seastar(3, 4, limb_length=0.2), actuator=SmaPulse(0.3), numerics=Numerics.preset("fast")),
]


def observations_of(simulator: Simulator, targets: np.ndarray) -> np.ndarray:
    """float64 observations, shape (n_robots, size), for targets of shape (n_robots, 4) [m]."""
    rows, robot = to_rows(targets), simulator.scene.robot
    out = np.full((len(rows), observation_size(robot.n_nodes), N_LANES), np.nan)
    own = simulator.coefficients
    observe(own.rest, own.limb_length, simulator.q, simulator.v, rows, VELOCITY_SCALE, out)
    return out.transpose(0, 2, 1).reshape(-1, out.shape[1])[: simulator.n_robots]


def expected_observation(robot: Seastar, q: np.ndarray, v: np.ndarray, waypoint, following) -> np.ndarray:
    """The table once more, with complex numbers: x + iy turned by exp(-i angle)."""
    rest, q, v, targets = (np.asarray(x) @ [1.0, 1j] for x in (robot.nodes(), q, v, [waypoint, following]))
    angle = np.angle(np.sum(np.conj(rest) * (q - q[0])))  # least squares: the sum's argument
    parts = [
        (q[1:] - q[0]) / robot.limb_length,
        (v[1:] - v[0]) / 0.025,
        v[:1] / 0.025,
        (targets - q[0]) / robot.limb_length,
    ]
    turned = np.concatenate(parts) * np.exp(-1j * angle)
    return np.stack([turned.real, turned.imag], axis=1).reshape(-1)


def test_scale_and_size_are_the_documented_ones():
    assert VELOCITY_SCALE == 0.025
    assert observation_size(46) == 186


@pytest.mark.parametrize("n_nodes, n_remembered", [(46, 0), (46, 20), (10, 3)])
def test_a_layout_names_every_place_once_and_in_the_order_of_the_table(n_nodes, n_remembered):
    at = layout(n_nodes, n_remembered)
    places = np.arange(at.size)
    np.testing.assert_array_equal(np.concatenate([places[place] for place in at]), places)
    assert [len(places[place]) for place in at] == [2 * (n_nodes - 1)] * 2 + [2, n_remembered, 2, 2]
    np.testing.assert_array_equal(places[at.waypoints], places[-4:])
    np.testing.assert_array_equal(places[at.nodes_and_hub], places[: 4 * (n_nodes - 1) + 2])


def test_the_layout_of_a_scene_finds_what_its_actuators_remember():
    scene = Scene(actuator=ThermalSma(), numerics=Numerics.preset("fast"))
    env, plain = SeastarSwimEnv(scene=scene), SeastarSwimEnv(fidelity="fast")
    env.reset(seed=0)
    seen, at = env.step([0, 1, 0, 0, 2])[0], scene_layout(scene)
    np.testing.assert_allclose(seen[at.actuators], env.simulator.observe_actuators()[0], rtol=1e-6)
    assert np.any(seen[at.actuators])
    first, bare = plain.reset(seed=0)[0], scene_layout(plain.scene)
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


def test_at_rest_the_body_frame_is_that_of_limb_1():
    simulator = Simulator(Scene(), 2)
    simulator.reset(heading=[0.0, 2.0])
    observation = observations_of(simulator, np.zeros((2, 4)))
    np.testing.assert_allclose(observation[:, 16:18], [[1.0, 0.0], [1.0, 0.0]], atol=1e-15)  # tip of limb 1
    np.testing.assert_allclose(observation[:, :90].reshape(2, 45, 2) * 0.1, [Seastar().nodes()[1:]] * 2, atol=1e-15)
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


def test_a_robot_without_a_direction_is_seen_in_the_world_frame_not_as_nan():
    simulator = Simulator(Scene())
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
