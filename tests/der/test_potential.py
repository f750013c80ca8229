"""The kernels agree with the dense oracle: potential, gradient and Hessian of a stage, whole stages and steps."""

import numpy as np
import pytest

import oracle
from continuum_oracle import Continuum
from hubs import HUBS, TEN
from seastar_gym import Numerics, Scene, Seastar, Simulator, SmaPulse, UniformCurrent, Water
from seastar_gym.der.geometry import edge_geometry, positive_part
from seastar_gym.der.motion import node_motion
from seastar_gym.der.potential import coupling, elastic_slopes, node_slopes
from seastar_gym.der.rods import make_work
from seastar_gym.der.stepping.stages import Stage
from seastar_gym.der.terms.load import load_power, nodal_load
from seastar_gym.model.rods import make_rods
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simd.numpy_lanes import Lanes, Mask
from slopes import NO_RODS, gradient, plain, symmetric
from stages import RandomStages, random_shape, robot_and_star, rods_of
from strokes import finished

SHAPES = [(5, 10), (5, 2), (3, 3), (4, 4), (6, 5), (12, 3)]  # n_limbs, nodes_per_limb
FEW = [(1, 4), (2, 3), (3, 2)]


# Every shape with every hub in water, and the chapter's shape in vacuum.
VARIANTS = [(*shape, hub, True) for shape in SHAPES for hub in HUBS] + [(5, 10, hub, False) for hub in HUBS]


# Potential, gradient, Hessian


@pytest.mark.parametrize("gamma", [1e-3, 1e-2])
@pytest.mark.parametrize("n_limbs, nodes_per_limb, hub, fluid", [*VARIANTS, *((*few, "rigid", True) for few in FEW)])
def test_potential_and_newton_direction_are_those_of_the_oracle(n_limbs, nodes_per_limb, hub, fluid, gamma):
    robot, star = robot_and_star(n_limbs, nodes_per_limb, hub, fluid)
    stages = RandomStages(star, gamma, bend=0.05)
    found = stages.run(rods_of(robot, fluid))
    stages.assert_agree(found, 1e-10 if (n_limbs, nodes_per_limb) in FEW else 1e-11)
    np.testing.assert_allclose(found.moved, -found.direction, rtol=0.0, atol=1e-16)
    np.testing.assert_allclose(found.largest, np.linalg.norm(found.direction, axis=2).max(axis=1), rtol=1e-14)


@pytest.mark.parametrize("hub", HUBS)
def test_newton_direction_of_wildly_bent_robots_is_as_good_as_their_matrix_allows(hub):
    """Limbs turned by more than a quarter from where a rigid hub would have them, too."""
    robot, star = robot_and_star(hub=hub)
    stages = RandomStages(star, 1e-3, bend=0.8, stretch=0.1, speed=1.0)
    found, turns = stages.run(rods_of(robot)), []
    for lane in range(N_LANES):
        hessian = stages.hessian(lane)
        direction = np.linalg.solve(hessian, stages.gradient(lane).ravel()).reshape(-1, 2)
        error = np.abs(found.direction[lane] - direction).max() / np.abs(direction).max()
        assert error < 1e-14 * np.linalg.cond(hessian)
        if hub == "rigid":
            turns.append(oracle.clamp_turns(star, stages.q[lane], stages.delta_psi[lane]))
    assert hub != "rigid" or np.abs(turns).max() > np.pi / 2.0


@pytest.mark.parametrize("hub", HUBS)
@pytest.mark.parametrize("convex", [0.0, 1.0])
def test_potential_falls_along_the_newton_direction_at_the_rate_of_the_decrement(hub, convex):
    robot, star = robot_and_star(hub=hub)
    stages, rods = RandomStages(star, 0.01), rods_of(robot)
    found = stages.run(rods, convex)
    move = 1e-3 * found.direction
    ahead = stages.run(rods, q=stages.q - move)
    behind = stages.run(rods, q=stages.q + move)
    assert np.all(found.decrement > 0.0)
    np.testing.assert_allclose((ahead.phi - behind.phi) / 2e-3, -found.decrement, rtol=1e-4)


@pytest.mark.parametrize("hub", HUBS)
@pytest.mark.parametrize("gamma", [3e-3, 4e-3, 5e-3])
def test_smallest_pivot_is_positive_exactly_where_the_hessian_is_positive_definite(hub, gamma):
    robot, star = robot_and_star(nodes_per_limb=4, hub=hub)
    definite = []
    for seed in range(64 // N_LANES):
        stages = RandomStages(star, gamma, bend=0.3, stretch=0.02, seed=seed)
        found = stages.run(rods_of(robot))
        smallest = [np.linalg.eigvalsh(stages.hessian(lane))[0] for lane in range(N_LANES)]
        np.testing.assert_array_equal(found.pivot > 0.0, np.array(smallest) > 0.0)
        definite += list(found.pivot > 0.0)
    assert 0 < sum(definite) < len(definite)


@pytest.mark.parametrize("hub", HUBS)
def test_repaired_matrix_is_the_sum_of_the_convex_parts_and_is_always_positive_definite(hub):
    robot, star = robot_and_star(nodes_per_limb=5, hub=hub)
    stages = RandomStages(star, 0.05, bend=0.8, stretch=0.2, speed=1.0)
    found = stages.run(rods_of(robot), convex=1.0)
    assert np.all(found.pivot > 0.0)
    assert not all(np.linalg.eigvalsh(stages.hessian(lane))[0] > 0.0 for lane in range(N_LANES))
    for lane in range(N_LANES):
        stages.assert_step(found, lane, stages.convex_hessian(lane), 1e-9)


def test_a_matrix_that_is_not_a_number_does_not_pass_for_positive_definite():
    robot, star = robot_and_star(nodes_per_limb=4)
    for node in range(star.n_nodes):
        stages = RandomStages(star, 1e-3)
        stages.q[1, node] = np.nan
        found = stages.run(rods_of(robot))
        assert not found.pivot[1] > 0.0
        others = np.arange(N_LANES) != 1
        assert np.all(found.pivot[others] > 0.0) and np.isfinite(found.direction[others]).all()


def scaled(part, **scales):
    """A term's coefficients, some of them times a number per lane."""
    return part._replace(**{name: getattr(part, name)[:, None] * scale for name, scale in scales.items()})


def test_every_robot_may_have_coefficients_of_its_own():
    robot = Seastar(nodes_per_limb=4)
    shared = make_rods(Scene(robot=robot))
    stiffness, weight = np.linspace(0.5, 2.0, N_LANES), np.linspace(1.0, 3.0, N_LANES)
    own = shared._replace(
        mass=shared.mass[:, None] * weight,
        edge_mass=shared.edge_mass[:, None] * weight,
        stretching=scaled(shared.stretching, EA=stiffness, EA_over_l=stiffness, l_over_EA=1.0 / stiffness),
        bending=scaled(shared.bending, EI_over_dl=stiffness, dl_over_EI=1.0 / stiffness),
    )
    stages = RandomStages(Continuum(nodes_per_limb=4), 0.01)
    for lane in range(N_LANES):
        star = Continuum(nodes_per_limb=4, youngs_modulus=1e6 * stiffness[lane], density=1000.0 * weight[lane])
        stages.star = star
        stages.assert_step(stages.run(own), lane, stages.hessian(lane), 1e-11)


# Energies


@pytest.mark.parametrize("n_limbs, nodes_per_limb, hub, fluid", VARIANTS)
def test_energies_are_those_of_the_oracle(n_limbs, nodes_per_limb, hub, fluid):
    robot, star = robot_and_star(n_limbs, nodes_per_limb, hub, fluid)
    simulator = Simulator(Scene(robot=robot, actuator=SmaPulse(peak_angle=0.1)), n_robots=3)
    rng = np.random.default_rng(0)
    q = np.array([random_shape(star, 0.3, 0.05, rng) for _ in range(3)])
    v = rng.standard_normal(q.shape)
    simulator.set_state((q, v, np.zeros(3)))
    still = np.zeros(n_limbs)
    np.testing.assert_allclose(
        simulator.elastic_energy(), [oracle.elastic_energy(star, x, still) for x in q], rtol=1e-12
    )
    np.testing.assert_allclose(simulator.kinetic_energy(), [oracle.kinetic_energy(star, x) for x in v], rtol=1e-13)


def test_elastic_energy_within_a_stroke_is_that_of_the_present_actuation():
    simulator, star = Simulator(Scene(TEN, numerics=Numerics(step=0.01)), n_robots=2), Continuum()
    commands = np.array([[0.0, 1.0, 0.0, 0.0, -1.0], [0.3, 0.0, 0.0, -0.7, 0.0]])
    for time in simulator.stroke_in_parts(commands, 10):
        delta_psi = commands * oracle.pulse(round(time, 9))
        expected = [oracle.elastic_energy(star, q, d) for q, d in zip(simulator.positions, delta_psi, strict=True)]
        np.testing.assert_allclose(simulator.elastic_energy(), expected, rtol=1e-9, atol=1e-16)


# Steps

TIGHT = 1e-13


@pytest.mark.parametrize("hub", HUBS)
def test_stages_where_plain_newton_diverges_end_at_a_minimum_of_the_oracles_potential(hub):
    """Velocities of 1 m/s at h = 10 ms, as in tests/test_oracle.py: line search and convex matrix do the work."""
    h, n_robots = 0.01, 12
    robot, star = robot_and_star(hub=hub)
    actuator = SmaPulse(peak_angle=0.0, heating_time=h, cooling_time=h)
    numerics = Numerics("implicit-euler", h, newton_tolerance=TIGHT, max_iterations=500)
    simulator = Simulator(Scene(robot=robot, actuator=actuator, numerics=numerics), n_robots)
    v_hat = np.random.default_rng(0).standard_normal((n_robots, star.n_nodes, 2))
    simulator.set_state((np.tile(star.rest, (n_robots, 1, 1)), v_hat, np.zeros(n_robots)))
    stroke = simulator.stroke_in_parts(np.zeros((n_robots, 5)), 2)
    next(stroke)
    q, v = simulator.positions, simulator.velocities
    _, report = finished(stroke)
    whole = report.halvings == 0
    assert whole.sum() >= n_robots // 6
    assert report.regularised[whole].min() > 0 and report.backtracks.sum() > 0
    for k in np.flatnonzero(whole):
        phi = oracle.incremental_potential(star, star.rest + h * v_hat[k], star.rest, v_hat[k], h, np.zeros(5))
        assert oracle.incremental_potential(star, q[k], star.rest, v_hat[k], h, np.zeros(5)) < phi
        residual = oracle.incremental_gradient(star, q[k], star.rest, v_hat[k], h, np.zeros(5))
        inertia = star.masses[:, None] * (v[k] - v_hat[k]) / h
        np.testing.assert_allclose(residual, 0.0, atol=1e-9 * np.abs(inertia).max())
        assert np.linalg.eigvalsh(oracle.incremental_hessian(star, q[k], star.rest, h, np.zeros(5)))[0] > 0.0


# The parts of a stage's potential: nodes, edges and hinges have the gradients and Hessians of their energies.


GAMMA, NODE, EDGE = 0.01, 5, 4
ROBOT = Seastar(nodes_per_limb=4, relaxation_time=4e-3)
EVERYTHING = make_rods(
    Scene(
        ROBOT, Water(950.0, 1.3, 0.1, UniformCurrent(0.3, -0.2), 0.8), numerics=Numerics(), loads=((NODE, 1e-3, -2e-3),)
    )
)
NOTHING_BUT_LIMBS = make_rods(Scene(Seastar(nodes_per_limb=4, relaxation_time=0.0), None))
RNG = np.random.default_rng(0)
EDGES = ROBOT.edge_length * np.array([[0.8], [0.6]]) + 4e-3 * RNG.standard_normal((2, N_LANES))


def stage_of(rods):
    """Memory and a stage from random states, with random normals, added mass, current and strains."""
    work = make_work(rods, 1)
    for rows in (work.normals, work.added_mass, work.current, work.tension, work.bending, work.v_hat):
        if rows is not None:
            rows[:] = 0.1 * RNG.standard_normal(rows.shape)
    return work, Stage(work.q_hat, work.v_hat, Lanes(GAMMA), Lanes(1.0 / GAMMA), False)


@pytest.mark.parametrize("rods", [EVERYTHING, NOTHING_BUT_LIMBS], ids=["everything", "limbs"])
def test_a_node_has_the_slopes_of_its_inertia_drag_and_load(rods):
    work, stage = stage_of(rods)

    def slopes(q):
        work.q[2 * NODE : 2 * NODE + 2] = q
        motion, push = node_motion.plain(work, stage, NODE), (Lanes(0.0), Lanes(0.0))
        energy, force, hessian = node_slopes.plain(rods, work, stage, NODE, motion, push)
        return plain(energy), np.array(plain(force)), symmetric(hessian)

    q = GAMMA * RNG.standard_normal((2, N_LANES))
    _, force, hessian = slopes(q)
    np.testing.assert_allclose(force, gradient(lambda q: slopes(q)[0], q, 1e-5), rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(hessian, gradient(lambda q: slopes(q)[1], q, 1e-5), rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("rods", [EVERYTHING, NOTHING_BUT_LIMBS], ids=["everything", "limbs"])
def test_an_edge_has_the_slopes_of_its_stretching_and_of_the_moments_that_turn_it(rods):
    """Energy E_s + mu theta + sigma (theta - theta_0)^2/2, with the net moment mu and stiffness sigma of its hinges."""
    work, stage = stage_of(rods)
    mu, sigma = 1e-4 * RNG.standard_normal(N_LANES), 1e-3 * RNG.random(N_LANES)
    theta_0 = np.arctan2(EDGES[1], EDGES[0])

    def slopes(e):
        edge = edge_geometry.plain(np.array([0.0 * e[0], 0.0 * e[1], *e]), 0, 1)
        energy, force, hessian = elastic_slopes.plain(rods, work, stage, EDGE, edge, Lanes(mu), Lanes(sigma), None)
        turn = np.arctan2(e[1], e[0]) - theta_0
        softer = sigma * turn * np.array([-e[1], e[0]]) / (e**2).sum(axis=0)
        return plain(energy) + mu * turn, np.array(plain(force)), symmetric(hessian), softer

    _, force, hessian, _ = slopes(EDGES)
    np.testing.assert_allclose(force, gradient(lambda e: slopes(e)[0], EDGES, 1e-5), rtol=1e-6, atol=1e-8)
    columns = gradient(lambda e: slopes(e)[1] + slopes(e)[3], EDGES, 1e-5)
    np.testing.assert_allclose(hessian, columns, rtol=1e-5, atol=1e-4)


def test_the_convex_part_of_an_edge_is_never_negative():
    work, stage = stage_of(NOTHING_BUT_LIMBS)
    edge = edge_geometry.plain(np.array([0.0 * EDGES[0], 0.0 * EDGES[1], *(0.7 * EDGES)]), 0, 1)
    args = NOTHING_BUT_LIMBS, work, stage, EDGE, edge, Lanes(1e-3), Lanes(0.0)
    smallest = [
        np.linalg.eigvalsh(symmetric(elastic_slopes.plain(*args, convex)[2]).transpose(2, 0, 1)).min()
        for convex in (None, Mask(np.ones(N_LANES, bool)))
    ]
    assert smallest[0] < 0.0 and smallest[1] > -1e-9


def test_a_hinge_couples_its_edges_by_the_product_of_their_directions_slopes():
    a, b = (edge_geometry.plain(np.array([0.0 * e[0], 0.0 * e[1], *e]), 0, 1) for e in (EDGES, EDGES[::-1]))
    turned = [np.array([-plain(e[6]), plain(e[5])]) for e in (b, a)]
    found = np.array(plain(coupling.plain(Lanes(0.7), b, a))).reshape(2, 2, -1)
    np.testing.assert_allclose(found, 0.7 * turned[0][:, None] * turned[1], rtol=1e-12)


def test_positive_part_is_zero_for_what_is_not_positive():
    np.testing.assert_array_equal(plain(positive_part.plain(Lanes(np.array([2.0, 0.0, -3.0])))), [2.0, 0.0, 0.0])


def test_a_load_has_its_power_and_none_is_none():
    assert plain(nodal_load.plain(EVERYTHING, NODE)) == (1e-3, -2e-3)
    assert plain(load_power.plain(EVERYTHING, NODE, Lanes(3.0), Lanes(1.0))) == pytest.approx(1e-3)
    assert plain(nodal_load.plain(NO_RODS, NODE)) == (0.0, 0.0)
    assert plain(load_power.plain(NO_RODS, NODE, Lanes(3.0), Lanes(1.0))) == 0.0
