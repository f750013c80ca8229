"""Whole scenes with fluids and material damping, in their limits and against closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from currents import NONE, swirl
from oracle import Star
from refusals import assert_refused
from seastar_gym import (
    Contact,
    GridCurrent,
    Numerics,
    Scene,
    Seastar,
    ShearCurrent,
    Simulator,
    SmaPulse,
    State,
    UniformCurrent,
    Vortex,
    Water,
    relaxation_time,
)
from seastar_gym.simd.lanes import N_LANES

DAMPED = Seastar(relaxation_time=1e-4)


# Limits


def swim(
    water: Water,
    robot: Seastar = Seastar(relaxation_time=0.0),
    boost=(0.0, 0.0),
    n_strokes=2,
    numerics=Numerics("implicit-midpoint", 5e-3),
) -> np.ndarray:
    """Node positions after strokes of a robot that is given a velocity first."""
    simulator = Simulator(Scene(robot, water, numerics=numerics))
    simulator.v[0, 0::2], simulator.v[0, 1::2] = boost
    for _ in range(n_strokes):
        simulator.stroke([[0.0, 1.0, 0.0, -0.5, -1.0]])
    return simulator.positions[0]


@pytest.mark.parametrize("still", [UniformCurrent(), ShearCurrent(0.0), Vortex(0.0)])
def test_terms_of_size_zero_leave_the_plain_scene_to_the_last_bit(still):
    """Equal drag along and across, a current that stands still, no added mass, no relaxation time."""
    np.testing.assert_array_equal(swim(replace(NONE, current=still)), swim(Water(), Seastar()))


@pytest.mark.parametrize("along, added_mass", [(1.0, 0.0), (0.05, 1.0)])
def test_a_uniform_current_is_a_galilean_shift_to_rounding(along, added_mass):
    water, u = Water(1000.0, 1.0, along, UniformCurrent(), added_mass), (0.03, -0.05)
    carried = swim(replace(water, current=UniformCurrent(*u)), boost=u)
    np.testing.assert_allclose(carried, swim(water) + 2.0 * np.array(u), rtol=0.0, atol=1e-8)


def test_a_linear_current_on_a_grid_is_the_current_itself():
    shear = ShearCurrent(0.3, direction=-0.4)
    c, s = np.cos(-0.4), np.sin(-0.4)

    def sheared(x, y):
        return 0.3 * (c * y - s * x) * c, 0.3 * (c * y - s * x) * s

    grid = GridCurrent.from_function(sheared, (-1.0, 1.0), (-1.0, 1.0), 0.1)
    assert np.shape(grid.velocities) == (21, 21, 2)
    sampled, itself = replace(NONE, current=grid), replace(NONE, current=shear)
    np.testing.assert_allclose(swim(sampled), swim(itself), rtol=0.0, atol=1e-8)


def test_a_current_beyond_its_grid_is_that_of_the_nearest_edge():
    grid = GridCurrent.from_function(lambda x, y: (0.02 + 0.0 * x, 0.01), (5.0, 6.0), (-8.0, -7.0), 0.5)
    uniform = UniformCurrent(0.02, 0.01)
    sampled, itself = replace(NONE, current=grid), replace(NONE, current=uniform)
    np.testing.assert_allclose(swim(sampled), swim(itself), rtol=0.0, atol=1e-12)


def test_schemes_keep_their_second_order_with_lagged_currents_normals_and_added_mass():
    water = Water(1000.0, 1.0, 0.05, Vortex(0.05, 0.15, 0.1), 1.0)
    robot = Seastar(nodes_per_limb=4, youngs_modulus=3e3, relaxation_time=0.0)

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

SINK = Numerics("implicit-euler", 0.01, newton_tolerance=1e-10)  # it forgets the ringing, and is exact at rest


def terminal_velocity(direction: np.ndarray, water: Water) -> np.ndarray:
    """Hub velocity [m/s] of a stiff star of four limbs under a load of 1 mN per limb length along `direction`."""
    robot = Seastar(n_limbs=4, youngs_modulus=1e9, relaxation_time=0.0)
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
    water = Water(1000.0, 1.2, along, UniformCurrent(), 1.0)
    v_x, v_y = terminal_velocity(np.array([1.0, 0.0]), water)
    per_length = 0.5 * 1000.0 * 2.0 * 1.6e-3 * (along + 1.2) / 2.0
    assert v_x == pytest.approx(np.sqrt(0.01 / per_length), rel=1e-6)
    assert abs(v_y) < 1e-9


@pytest.mark.parametrize("along", [0.0, 0.3, 1.2])
def test_a_robot_at_rest_drifts_until_it_moves_with_the_current(along):
    """Quadratic drag: 1 - v/u = 1/(1 + k u t). A stiff cross has half its length along the current, half across."""
    u, time = 0.1, 2.0
    robot = Seastar(n_limbs=4, nodes_per_limb=10, youngs_modulus=1e9, relaxation_time=0.0)
    scene = Scene(
        robot, Water(1000.0, 1.2, along, UniformCurrent(u, 0.0), 0.0),
        SmaPulse(0.0, 1.0, 1.0), Numerics("implicit-midpoint", 2e-3, newton_tolerance=1e-11),
    )  # fmt: skip
    simulator = Simulator(scene)
    simulator.stroke(np.zeros((1, 4)))
    k = 1000.0 * 0.5 * (along + 1.2) / (np.pi * 1.6e-3 * 1000.0)
    assert simulator.hub_velocity()[0, 0] == pytest.approx(u - u / (1.0 + k * u * time), rel=1e-4)


VACUUM = Water(0.0, 1.0, 1.0, UniformCurrent(), 1.0)
CLAMP = (0, 1)
FIRST_ROOT = 1.8751040687119611  # of cos x cosh x = -1


def ring(water: Water, robot: Seastar, time: float) -> tuple[np.ndarray, np.ndarray]:
    """(times, deflections) of the tip of limb 1, clamped, after a sideways blow in its first mode, relative to L."""
    pauses = round(time / 1e-3)
    scene = Scene(
        robot, water, SmaPulse(0.0, time / 2.0, time / 2.0),
        Numerics("implicit-midpoint", 2.5e-4, newton_tolerance=1e-12), held_nodes=CLAMP,
    )  # fmt: skip
    simulator = Simulator(scene)
    edges = robot.nodes_per_limb - 1
    free = np.arange(1, edges + 1) / edges - 5.0 / 12.0 / edges  # from the clamp, see first_frequency
    simulator.v[0, 3 : 2 * edges + 2 : 2] = (1e-3 * free**2)[:, None]
    simulator.v[0, 3] = 0.0
    times, tips = [], []
    for t in simulator.stroke_in_parts(np.zeros((1, 5)), pauses):
        times.append(t)
        tips.append(simulator.positions[0, edges, 1] / robot.limb_length)
    return np.array(times), np.array(tips)


def frequency_and_decrement(times: np.ndarray, tips: np.ndarray) -> tuple[float, float]:
    """Frequency and logarithmic decrement of an oscillation, from a fit of exp(-delta t) (a cos + b sin)."""

    def misfit(unknowns):
        delta, omega, *_ = unknowns
        shapes = np.exp(-delta * times)[:, None] * np.stack([np.cos(omega * times), np.sin(omega * times)], axis=1)
        return shapes @ np.linalg.lstsq(shapes, tips, rcond=None)[0] - tips

    crossings = times[1:][np.diff(np.sign(tips)) != 0]
    guess = np.pi / np.diff(crossings).mean()
    delta, omega = least_squares(misfit, [1.0, guess], x_scale=[1.0, guess]).x
    return omega / (2.0 * np.pi), 2.0 * np.pi * delta / omega


def first_frequency(robot: Seastar) -> float:
    """Frequency of a clamped beam in vacuum [Hz]; the clamp is at 5/12 of the first edge.

    The hinge at its end counts curvature along 13/12 of an edge, so that much of 3/2 edges is not held (Gregory).
    """
    length = robot.limb_length - 5.0 / 12.0 * robot.edge_length
    omega = (FIRST_ROOT / length) ** 2 * np.sqrt(robot.youngs_modulus / robot.density) * robot.rod_radius / 2.0
    return float(omega / (2.0 * np.pi))


def test_a_clamped_limb_rings_at_the_frequency_of_beam_theory_without_damping():
    robot = Seastar(nodes_per_limb=20, relaxation_time=0.0)
    frequency, decrement = frequency_and_decrement(*ring(VACUUM, robot, 1.0))
    assert frequency == pytest.approx(first_frequency(robot), rel=0.01)
    assert abs(decrement) < 1e-3


@pytest.mark.parametrize("tau", [1e-3, 5e-3])
def test_the_decrement_of_a_damped_limb_is_that_of_kelvin_and_voigt(tau):
    """A mode of frequency omega has the damping ratio omega tau/2, and the decrement 2 pi z/sqrt(1 - z^2)."""
    plain = frequency_and_decrement(*ring(VACUUM, Seastar(relaxation_time=0.0), 1.0))[0]
    frequency, decrement = frequency_and_decrement(*ring(VACUUM, Seastar(relaxation_time=tau), 1.0))
    ratio = np.pi * plain * tau
    assert decrement == pytest.approx(2.0 * np.pi * ratio / np.sqrt(1.0 - ratio**2), rel=0.05)
    assert frequency == pytest.approx(plain * np.sqrt(1.0 - ratio**2), rel=0.01)


def test_added_mass_lowers_the_frequency_as_a_heavier_limb_would():
    """omega falls with 1/sqrt(rho_m + C_a rho_f): no drag, so that nothing else is at work."""
    robot = Seastar(density=1200.0, relaxation_time=0.0)
    plain = frequency_and_decrement(*ring(VACUUM, robot, 1.0))[0]
    loaded = frequency_and_decrement(*ring(Water(900.0, 0.0, 0.0, UniformCurrent(), 0.7), robot, 1.0))[0]
    assert loaded / plain == pytest.approx(np.sqrt(1200.0 / (1200.0 + 0.7 * 900.0)), rel=2e-3)


def test_a_loss_factor_is_that_of_the_relaxation_time_at_its_frequency():
    assert relaxation_time(0.1, 10.0) == pytest.approx(0.1 / (2.0 * np.pi * 10.0))


def test_energy_only_falls_in_a_damped_robot_that_nothing_drives():
    scene = Scene(DAMPED, VACUUM, SmaPulse(0.0, 0.1, 0.1), Numerics(step=2e-3))
    simulator = Simulator(scene, n_robots=4)
    simulator.v[:] = 0.2 * np.random.default_rng(1).standard_normal(simulator.v.shape)
    energy = [simulator.elastic_energy() + simulator.kinetic_energy()]
    for _ in simulator.stroke_in_parts(np.zeros((4, 5)), 100):
        energy.append(simulator.elastic_energy() + simulator.kinetic_energy())
    assert np.all(np.diff(energy, axis=0) <= 1e-12 * energy[0]) and np.all(energy[-1] < 0.5 * energy[0])


def test_damping_does_not_resist_a_rotation():
    robot = Seastar(nodes_per_limb=4, relaxation_time=0.1)
    simulator = Simulator(Scene(robot, VACUUM, SmaPulse(0.0, 0.25, 0.25), Numerics("implicit-midpoint", 1e-3)))
    simulator.v[0, 0::2], simulator.v[0, 1::2] = -simulator.q[0, 1::2], simulator.q[0, 0::2]
    before = simulator.kinetic_energy()[0]
    simulator.stroke(np.zeros((1, 5)))
    assert simulator.kinetic_energy()[0] == pytest.approx(before, rel=1e-3)


def test_a_vortex_carries_a_robot_round_its_centre():
    simulator = Simulator(Scene(DAMPED, replace(NONE, current=Vortex(0.3, x=0.0, y=0.3))))
    for _ in range(4):
        simulator.stroke(np.zeros((1, 5)))
    x, y = simulator.hub_position()[0]
    assert x > 0.05 and y > 0.005  # anti-clockwise, and not through the centre


def test_a_violent_robot_in_a_current_is_guarded_and_finishes():
    water = Water(1000.0, 1.0, 0.05, UniformCurrent(0.5, 0.0), 1.0)
    simulator = Simulator(Scene(DAMPED, water, numerics=Numerics(step=0.02)), n_robots=8)
    rng = np.random.default_rng(0)
    simulator.v[:] = rng.standard_normal(simulator.v.shape)
    report = simulator.stroke(rng.uniform(-1.0, 1.0, (8, 5)))
    assert not report.status.any() and report.halvings.sum() > 0


# Refusals


@pytest.mark.parametrize(
    "make, words",
    [
        (lambda: Water(tangential_drag_coefficient=1.5), ("tangential_drag_coefficient", "must not exceed")),
        (lambda: Water(current=0.1), ("current", "0.1")),
        (lambda: relaxation_time(0.1, 0.0), ("frequency", "positive")),
        (lambda: GridCurrent((0.0, 0.0), 0.1, np.zeros((1, 2, 2))), ("velocities", "(1, 2, 2)")),
        (lambda: GridCurrent((0.0, 0.0), 0.1, "current"), ("velocities", "numbers")),
        (lambda: GridCurrent((0.0, 0.0), 0.1, np.full((2, 2, 2), np.nan)), ("velocities", "finite")),
        (lambda: GridCurrent((0.0, np.inf), 0.1, np.zeros((2, 2, 2))), ("corner",)),
        (lambda: GridCurrent.from_function(swirl, (0.0, 0.0), (0.0, 1.0), 0.1), ("x", "spacing apart")),
        (lambda: GridCurrent.from_function(swirl, (0.0, 1e4), (0.0, 1e4), 0.1), ("points", "larger spacing")),
    ],
)
def test_bad_fluids_are_refused_with_a_sentence(make, words):
    with assert_refused(*words):
        make()


# A robot that is seen from a moving frame, in a current that moves likewise, moves as it does at home.


NUMERICS = {
    **{name: Numerics.preset(name) for name in ("fast", "balanced", "accurate", "chapter")},
    "sdirk3": Numerics("sdirk3", 10e-3),
    "loose": Numerics("implicit-midpoint", 5e-3, newton_tolerance=5e-4),
}
STILL = Water(1000.0, 1.0, 0.1, UniformCurrent(), 1.0)
"""Water with drag along limbs and added mass of its own."""
PARTS, FORESEEABLE = 100, 10
"""Pauses of a stroke, and those until which rounding has not grown to what is seen."""


def seen_from(boost: np.ndarray, scene: Scene, noise: float, shake: float = 0.0) -> tuple[np.ndarray, int]:
    """Positions during a stroke, seen from the frame [m], and the number of steps that were halved or cut.

    Positions have the shape (PARTS, n_robots, n_nodes, 2). boost: Velocity added to all motion [m/s]. noise, shake:
    Sizes of two random displacements of the nodes [m].
    """
    if scene.fluid is not None:
        scene = replace(scene, fluid=replace(scene.fluid, current=UniformCurrent(*boost)))
    simulator, rng = Simulator(scene, N_LANES), np.random.default_rng(0)
    moved, velocities, shaken = rng.standard_normal((3, N_LANES, scene.robot.n_nodes, 2))
    positions = scene.robot.nodes() + noise * moved + shake * shaken
    simulator.set_state(State(positions, 50.0 * noise * velocities + boost, np.zeros(N_LANES)))
    stroke = simulator.stroke_in_parts(rng.integers(-1, 2, (N_LANES, scene.robot.n_limbs)).astype(float), PARTS)
    way, report = [], None

    def swim():
        nonlocal report
        report = yield from stroke

    for time in swim():
        way.append(-boost * time + simulator.positions)
    assert np.median(report.status) == 0
    return np.array(way), int(report.halvings.sum() + report.energy_cuts.sum())


def assert_seen_alike(scene: Scene, noise: float = 1e-3) -> int:
    """Another frame moves robots no farther than shaking them by rounding does, in the median.

    Robots that ring wildly are chaotic. Returns the number of steps that were halved or cut.
    """
    home, needed = seen_from(np.zeros(2), scene, noise)
    moving, _ = seen_from(np.array([0.31, -0.17]), scene, noise)
    shaken, _ = seen_from(np.zeros(2), scene, noise, 1e-15)
    by_rounding, by_frame = (np.median(np.abs(other - home).max(axis=(2, 3)), axis=1) for other in (shaken, moving))
    assert np.all(by_frame[:FORESEEABLE] < 1e-13 + 1e3 * by_rounding[:FORESEEABLE])
    return needed


@pytest.mark.parametrize("numerics", NUMERICS)
@pytest.mark.parametrize("fluid", [STILL, None], ids=["water", "vacuum"])
def test_a_robot_moves_alike_in_every_frame(numerics, fluid):
    robot = Seastar(relaxation_time=None if fluid is None else 0.0)  # see NONE
    needed = assert_seen_alike(Scene(robot, fluid, numerics=NUMERICS[numerics]))
    # With a rigid hub no step of "fast" needs it in vacuum.
    assert needed > 0 or numerics in ("accurate", "chapter") or (fluid is None and numerics == "fast")


@pytest.mark.parametrize("numerics", ["fast", "balanced", "chapter"])
def test_a_loaded_robot_whose_limbs_touch_moves_alike_in_every_frame(numerics):
    """Dead loads do work on the frame's way, too."""
    robot, loads = Seastar(relaxation_time=1e-4), ((9, 2e-4, -1e-4), (20, 0.0, 3e-4))
    assert_seen_alike(Scene(robot, STILL, numerics=NUMERICS[numerics], loads=loads, contact=Contact()), 1e-4)
