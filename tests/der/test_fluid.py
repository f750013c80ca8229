"""Fluids: drag along and across limbs, and currents, against the oracle and against closed forms."""

import json
from dataclasses import asdict, replace

import numpy as np
import pytest

import oracle
from oracle import Star
from seastar_gym import (
    GridCurrent,
    Numerics,
    Scene,
    Seastar,
    ShearCurrent,
    Simulator,
    SmaPulse,
    UniformCurrent,
    Vortex,
    Water,
)
from seastar_gym.der.lanes import N_LANES
from stages import RandomStages, random_shape


def swirl(x, y):
    """A current that is linear in x, in y and in x y, as bilinear interpolation is."""
    return 0.1 + 0.3 * x - 0.5 * y + 2.0 * x * y, 0.2 * x + 0.05 * y


CURRENTS = {
    "uniform": UniformCurrent(0.03, -0.02),
    "shear": ShearCurrent(0.4, direction=0.7),
    "vortex": Vortex(0.02, x=0.1, y=-0.05, core_radius=0.06),
    "grid": GridCurrent.from_function(swirl, (-0.4, 0.4), (-0.5, 0.4), 0.05),
}


def velocity(name: str, places: np.ndarray) -> np.ndarray:
    """The currents once more, from their definitions."""
    x, y = places.T
    match name:
        case "uniform":
            return np.tile([0.03, -0.02], (len(x), 1))
        case "shear":
            along, across = np.array([np.cos(0.7), np.sin(0.7)]), np.array([-np.sin(0.7), np.cos(0.7)])
            return 0.4 * (places @ across)[:, None] * along
        case "vortex":
            r, angle = np.hypot(x - 0.1, y + 0.05), np.arctan2(y + 0.05, x - 0.1)
            speed = 0.02 / (2.0 * np.pi) * r / (0.06**2 + r**2)
            return speed[:, None] * np.stack([-np.sin(angle), np.cos(angle)], axis=1)
        case _:
            return np.stack(swirl(x, y), axis=1)


def water_and_star(current: str | None, along: float | None, **shape) -> tuple[Water, Star]:
    water = Water(950.0, 1.3, along, current=None if current is None else CURRENTS[current])
    of_place = None if current is None else lambda places: velocity(current, places)
    return water, Star(
        fluid_density=950.0, drag_coefficient=1.3, tangential_drag_coefficient=along, current=of_place, **shape
    )


TERMS = [("uniform", 0.0), ("shear", 0.02), ("vortex", 0.1), ("grid", 1.3)]
# One current and one drag along in all scenes here: every other set of terms is machine code of its own.


# Against the oracle


@pytest.mark.parametrize("current, along", TERMS)
def test_potential_and_newton_direction_in_a_fluid_are_those_of_the_oracle(current, along):
    water, star = water_and_star(current, along, nodes_per_limb=4)
    scene = Scene(Seastar(nodes_per_limb=4), water)
    stages = RandomStages(star, 1e-2, bend=0.05)
    found = stages.run(scene.rods())
    for lane in range(N_LANES):
        data = stages.data(lane)
        gradient = oracle.incremental_gradient(star, stages.q[lane], *data)
        direction = np.linalg.solve(stages.hessian(lane), gradient.ravel()).reshape(-1, 2)
        assert found.phi[lane] == pytest.approx(oracle.incremental_potential(star, stages.q[lane], *data), rel=1e-12)
        assert found.decrement[lane] == pytest.approx(np.sum(gradient * direction), rel=1e-11)
        np.testing.assert_allclose(found.direction[lane], direction, rtol=0.0, atol=1e-11 * np.abs(direction).max())


@pytest.mark.parametrize("current, along", TERMS)
def test_the_oracles_drag_in_a_fluid_is_the_slope_of_its_potential(current, along):
    _, star = water_and_star(current, along, nodes_per_limb=3)
    rng = np.random.default_rng(2)
    frozen, v = random_shape(star, 0.3, 0.01, rng), rng.standard_normal((star.n_nodes, 2))
    force, jacobian = oracle.drag_force(star, v, frozen), oracle.drag_jacobian(star, v, frozen)
    for k in range(v.size):
        step = np.zeros(v.size)
        step[k] = 1e-6
        ahead, behind = v + step.reshape(v.shape), v - step.reshape(v.shape)
        slope = (oracle.drag_potential(star, ahead, frozen) - oracle.drag_potential(star, behind, frozen)) / 2e-6
        assert -force.ravel()[k] == pytest.approx(slope, rel=1e-7, abs=1e-9)
        column = (oracle.drag_force(star, ahead, frozen) - oracle.drag_force(star, behind, frozen)).ravel() / 2e-6
        np.testing.assert_allclose(jacobian[:, k], column, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("current, along", TERMS)
def test_a_step_in_a_fluid_is_the_oracles(current, along):
    h = 0.01
    water, star = water_and_star(current, along, nodes_per_limb=4)
    numerics = Numerics("implicit-euler", h, newton_tolerance=1e-13)
    simulator = Simulator(Scene(Seastar(nodes_per_limb=4), water, SmaPulse(0.3, 2.0 * h, 2.0 * h), numerics))
    rng = np.random.default_rng(3)
    q, v = random_shape(star, 0.05, 1e-3, rng), 0.02 * rng.standard_normal((star.n_nodes, 2))
    command = rng.uniform(-1.0, 1.0, 5)
    simulator.set_state((q[None], v[None], np.zeros(1)))
    next(simulator.stroke_in_parts(command[None], 4))
    q, v = oracle.step(star, q, v, 0.0, h, command, "implicit-euler", peak_angle=0.3, heating_time=0.02)
    np.testing.assert_allclose(simulator.positions[0], q, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(simulator.velocities[0], v, rtol=0.0, atol=1e-10)


# Limits


def swim(water: Water, boost=(0.0, 0.0), n_strokes=2, numerics=Numerics("implicit-midpoint", 5e-3)) -> np.ndarray:
    """Node positions after strokes of a robot that is given a velocity first."""
    simulator = Simulator(Scene(fluid=water, numerics=numerics))
    simulator.v[0, 0::2], simulator.v[0, 1::2] = boost
    for _ in range(n_strokes):
        simulator.stroke([[0.0, 1.0, 0.0, -0.5, -1.0]])
    return simulator.positions[0]


@pytest.mark.parametrize("still", [UniformCurrent(), ShearCurrent(0.0), Vortex(0.0)])
def test_equal_drag_along_and_across_in_a_current_that_stands_still_is_the_chapters_to_the_last_bit(still):
    np.testing.assert_array_equal(swim(Water(tangential_drag_coefficient=1.0, current=still)), swim(Water()))


@pytest.mark.parametrize("along", [1.0, 0.05])
def test_a_uniform_current_is_a_galilean_shift_to_rounding(along):
    water, u = Water(tangential_drag_coefficient=along, current=UniformCurrent()), (0.03, -0.05)
    carried = swim(replace(water, current=UniformCurrent(*u)), boost=u)
    np.testing.assert_allclose(carried, swim(water) + 2.0 * np.array(u), rtol=0.0, atol=1e-8)


def test_a_linear_current_on_a_grid_is_the_current_itself():
    shear = ShearCurrent(0.3, direction=-0.4)
    c, s = np.cos(-0.4), np.sin(-0.4)

    def sheared(x, y):
        return 0.3 * (c * y - s * x) * c, 0.3 * (c * y - s * x) * s

    grid = GridCurrent.from_function(sheared, (-1.0, 1.0), (-1.0, 1.0), 0.1)
    np.testing.assert_allclose(
        swim(Water(1000.0, 1.0, 0.1, grid)), swim(Water(1000.0, 1.0, 0.1, shear)), rtol=0.0, atol=1e-8
    )


def test_a_current_beyond_its_grid_is_that_of_the_nearest_edge():
    grid = GridCurrent.from_function(lambda x, y: (0.02 + 0.0 * x, 0.01), (5.0, 6.0), (-8.0, -7.0), 0.5)
    uniform = UniformCurrent(0.02, 0.01)
    np.testing.assert_allclose(
        swim(Water(1000.0, 1.0, 0.1, grid)), swim(Water(1000.0, 1.0, 0.1, uniform)), rtol=0.0, atol=1e-12
    )


def test_schemes_keep_their_second_order_with_lagged_currents_and_normals():
    water = Water(tangential_drag_coefficient=0.05, current=Vortex(0.05, 0.15, 0.1))
    robot = Seastar(nodes_per_limb=4, youngs_modulus=3e3)

    def end(h):
        numerics = Numerics("implicit-midpoint", h, newton_tolerance=1e-12)
        simulator = Simulator(Scene(robot, water, SmaPulse(0.4, 0.1, 0.1), numerics))
        simulator.stroke([[0.0, 1.0, 0.0, -0.5, -1.0]])
        return simulator.positions[0]

    steps = [4e-3, 2e-3, 1e-3]
    exact = end(1.25e-4)
    errors = [np.abs(end(h) - exact).max() for h in steps]
    order = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert 1.8 < order < 2.3


# Closed forms

SINK = Numerics("implicit-midpoint", 0.01, newton_tolerance=1e-10)


def terminal_velocity(direction: np.ndarray, water: Water) -> np.ndarray:
    """Hub velocity [m/s] of a stiff star of four limbs under a load of 1 mN per limb length along `direction`."""
    robot = Seastar(n_limbs=4, youngs_modulus=1e9)
    lengths = Star(n_limbs=4).voronoi_lengths
    loads = tuple((k, *(0.01 * length * direction)) for k, length in enumerate(lengths))
    scene = Scene(robot, water, SmaPulse(0.0, 5.0, 5.0), SINK, loads=loads)
    simulator = Simulator(scene)
    for _ in range(3):
        simulator.stroke(np.zeros((1, 4)))
    return simulator.hub_velocity()[0]


@pytest.mark.slow  # for the compiler: a fluid of terms and loads is machine code of its own
@pytest.mark.parametrize("along", [0.02, 0.5, 1.0])
def test_terminal_speed_is_where_load_and_drag_balance(along):
    """A cross of four limbs that moves along two of them: half its length has the drag along, half that across."""
    water = Water(drag_coefficient=1.2, tangential_drag_coefficient=along, current=UniformCurrent())
    v_x, v_y = terminal_velocity(np.array([1.0, 0.0]), water)
    per_length = 0.5 * 1000.0 * 2.0 * 1.6e-3 * (along + 1.2) / 2.0
    assert v_x == pytest.approx(np.sqrt(0.01 / per_length), rel=1e-6)
    assert abs(v_y) < 1e-9


@pytest.mark.parametrize("along", [0.0, 0.3, 1.2])
def test_a_robot_at_rest_drifts_until_it_moves_with_the_current(along):
    """Of quadratic drag: 1 - v/u = 1/(1 + k u t). A stiff cross has half its length along the current, half across."""
    u, time = 0.1, 2.0
    scene = Scene(
        Seastar(n_limbs=4, youngs_modulus=1e9), Water(1000.0, 1.2, along, UniformCurrent(u, 0.0)),
        SmaPulse(0.0, 1.0, 1.0), Numerics("implicit-midpoint", 2e-3, newton_tolerance=1e-11),
    )  # fmt: skip
    simulator = Simulator(scene)
    simulator.stroke(np.zeros((1, 4)))
    k = 1000.0 * 0.5 * (along + 1.2) / (np.pi * 1.6e-3 * 1000.0)
    assert simulator.hub_velocity()[0, 0] == pytest.approx(u - u / (1.0 + k * u * time), rel=1e-4)


def test_a_vortex_carries_a_robot_round_its_centre():
    simulator = Simulator(Scene(fluid=Water(1000.0, 1.0, 1.0, Vortex(0.3, x=0.0, y=0.3))))
    for _ in range(4):
        simulator.stroke(np.zeros((1, 5)))
    x, y = simulator.hub_position()[0]
    assert x > 0.05 and y > 0.005  # anti-clockwise, and not through the centre


def test_a_violent_robot_in_a_current_is_guarded_and_finishes():
    water = Water(tangential_drag_coefficient=0.05, current=UniformCurrent(0.5, 0.0))
    simulator = Simulator(Scene(fluid=water, numerics=Numerics(step=0.02)), n_robots=8)
    rng = np.random.default_rng(0)
    simulator.v[:] = rng.standard_normal(simulator.v.shape)
    report = simulator.stroke(rng.uniform(-1.0, 1.0, (8, 5)))
    assert not report.status.any() and report.halvings.sum() > 0


@pytest.mark.parametrize("current", [None, *CURRENTS.values()])
def test_a_fluid_comes_back_from_json(current):
    water = Water(900.0, 1.1, 0.2, current)
    assert Water.from_fields(json.loads(json.dumps(asdict(water)))) == water


# Refusals


@pytest.mark.parametrize(
    "make, words",
    [
        (lambda: Water(tangential_drag_coefficient=1.5), ("tangential_drag_coefficient", "must not exceed")),
        (lambda: Water(tangential_drag_coefficient=-0.1), ("tangential_drag_coefficient", "not negative")),
        (lambda: Water(current=0.1), ("current", "0.1")),
        (lambda: UniformCurrent(np.nan, 0.0), ("u_x", "[m/s]")),
        (lambda: UniformCurrent(0.0, "fast"), ("u_y", "'fast'")),
        (lambda: ShearCurrent(np.inf), ("rate", "[1/s]")),
        (lambda: ShearCurrent(1.0, None), ("direction", "[rad]")),
        (lambda: Vortex(np.nan), ("circulation",)),
        (lambda: Vortex(1.0, core_radius=0.0), ("core_radius", "positive")),
        (lambda: GridCurrent((0.0, 0.0), 0.1, np.zeros((1, 2, 2))), ("velocities", "(1, 2, 2)")),
        (lambda: GridCurrent((0.0, 0.0), 0.1, "current"), ("velocities", "shape")),
        (lambda: GridCurrent((0.0, 0.0), 0.1, np.full((2, 2, 2), np.nan)), ("velocities", "finite")),
        (lambda: GridCurrent((0.0, np.inf), 0.1, np.zeros((2, 2, 2))), ("corner",)),
        (lambda: GridCurrent((0.0, 0.0), -0.1, np.zeros((2, 2, 2))), ("spacing", "positive")),
        (lambda: GridCurrent.from_function(swirl, (0.0, 0.0), (0.0, 1.0), 0.1), ("x", "spacing apart")),
        (lambda: GridCurrent.from_function(swirl, (0.0, 1e4), (0.0, 1e4), 0.1), ("points", "larger spacing")),
    ],
)
def test_bad_fluids_are_refused_with_a_sentence(make, words):
    with pytest.raises(ValueError, match=r"\.$") as caught:
        make()
    for word in words:
        assert word in str(caught.value)
