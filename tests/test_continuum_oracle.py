"""The oracle of the continuum's discretisation keeps the promises that the kernels are measured against."""

import numpy as np
import pytest
from numpy.typing import ArrayLike

import oracle
from continuum_oracle import Continuum, ContinuumShaped
from oracle import Array, Star
from test_oracle import assert_derivative, few_steps, random_velocities, shaken, turn

LIMBS = [1, 2, 3, 5, 12]
DELTA_PSI = np.array([0.3, -0.5, 0.0, 0.2, -0.1])
COMMAND = np.array([1.0, -0.5, 0.0, 0.2, 0.0])


def unlike_limbs(n_limbs: int = 4, nodes_per_limb: int = 4, **terms) -> ContinuumShaped:
    """Limbs unevenly spread, of different lengths, tapered, graded and curved."""
    j = np.arange(n_limbs)
    return ContinuumShaped(
        n_limbs, nodes_per_limb, directions=tuple(5.0 * j / n_limbs), lengths=tuple(0.06 + 0.01 * j),
        radii=tuple((2e-3, 1e-3 + 1e-4 * k) for k in j), moduli=tuple((1e6, 8e5 + 1e5 * k) for k in j),
        curvatures=tuple(4.0 * (-1.0) ** j), **terms,
    )  # fmt: skip


def with_all_terms(star: type[Star] = Continuum, **shape) -> Star:
    """A star with drag and mass of its own along limbs, in a shear, damped and loaded."""
    return star(
        drag_coefficient=1.3, tangential_drag_coefficient=0.2, added_mass_coefficient=0.8, relaxation_time=4e-3,
        current=lambda places: 0.4 * places[:, ::-1] * [1.0, 0.0], gravity=(0.1, -9.81), density=1100.0,
        loads=((3, 1e-3, 2e-3),), **shape,
    )  # fmt: skip


# Rest, hub


@pytest.mark.parametrize("star", [*(Continuum(n, 4) for n in LIMBS), *(unlike_limbs(n) for n in LIMBS)])
def test_a_robot_of_any_shape_rests_without_energy_and_without_force(star):
    still = np.zeros(star.n_limbs)
    assert oracle.elastic_energy(star, star.rest, still) < 1e-25
    assert np.abs(oracle.elastic_gradient(star, star.rest, still)).max() < 1e-11


def test_a_curved_limb_rests_on_the_arc_that_leaves_the_hub_along_its_direction():
    star = unlike_limbs(3, 6)
    for limb, (direction, turn_of_edge) in enumerate(zip(star.directions, star.natural_turns, strict=True)):
        radius = star.edge_lengths[star.edge(limb, 0)] / (2.0 * np.sin(0.5 * turn_of_edge))
        centre = radius * np.array([-np.sin(direction), np.cos(direction)])
        nodes = star.rest[[star.node(limb, i) for i in range(6)]]
        np.testing.assert_allclose(np.linalg.norm(nodes - centre, axis=1), abs(radius), rtol=1e-13)
        assert radius == pytest.approx(1.0 / star.curvatures[limb], rel=1e-3)


def test_limbs_turned_by_delta_psi_and_all_of_them_by_any_angle_store_no_energy():
    star = Continuum(nodes_per_limb=2)
    q = np.vstack([star.rest[:1], [turn(star.rest[k + 1 : k + 2], d + 2.5)[0] for k, d in enumerate(DELTA_PSI)]])
    assert oracle.elastic_energy(star, q, DELTA_PSI) < 1e-25


@pytest.mark.parametrize("spread", [0.3, 1.0, 2.5])
def test_the_hub_stores_the_sum_of_its_stiffnesses_less_the_length_of_their_resultant(spread):
    star, rng = unlike_limbs(5, 2, youngs_modulus=1.0), np.random.default_rng(0)
    turns, K = spread * rng.standard_normal(5), np.array([clamp.stiffness for clamp in star.clamps])
    expected = K.sum() - abs(np.sum(K * np.exp(1j * turns)))
    assert oracle.clamp_slopes(star, star.rest, turns)[0] == pytest.approx(expected, rel=1e-12)


def test_a_limb_alone_is_held_by_nothing_and_two_by_one_spring_after_the_other():
    for n_limbs, expected in ((1, 0.0), (2, 0.5)):
        star, size = Continuum(n_limbs, 2), 1e-4
        q = star.rest.copy()
        q[1] = turn(q[1:2], size)[0]
        K = 2.4 * star.EI / star.edge_length
        found = oracle.elastic_energy(star, q, np.zeros(n_limbs))
        assert found == pytest.approx(0.5 * expected * K * size**2, rel=1e-6, abs=1e-25)


# Integrals along an edge


def test_uniform_limbs_have_the_mass_and_the_added_mass_of_linear_finite_elements():
    star = Continuum(1, 5, added_mass_coefficient=0.8, fluid_density=900.0)
    along, across = np.zeros((5, 5)), np.zeros((5, 5))
    element = np.array([[2.0, 1.0], [1.0, 2.0]]) / 6.0
    per_edge = np.pi * star.rod_radius**2 * star.edge_length
    for i in range(4):
        along[i : i + 2, i : i + 2] += 1000.0 * per_edge * element
        across[i : i + 2, i : i + 2] += (1000.0 + 0.8 * 900.0) * per_edge * element
    found = oracle.mass_matrix(star, star.rest)
    np.testing.assert_allclose(found[0::2, 0::2], along, rtol=1e-13, atol=1e-18)
    np.testing.assert_allclose(found[1::2, 1::2], across, rtol=1e-13, atol=1e-18)


@pytest.mark.parametrize("tangential", [None, 0.2])
@pytest.mark.parametrize("axis, coefficient", [(0, 0.2), (1, 1.3)])
def test_drag_of_a_limb_whose_velocity_grows_linearly_has_its_exact_potential(tangential, axis, coefficient):
    """Simpson's rule integrates cubes exactly: the mean of |v|^3 is v^3/4."""
    star = Continuum(1, 5, drag_coefficient=1.3, tangential_drag_coefficient=tangential)
    v = np.zeros((5, 2))
    v[:, axis] = 0.3 * star.rest[:, 0] / 0.1
    C = 1.3 if tangential is None else coefficient
    exact = 0.5 * 1000.0 * C * 2.0 * star.rod_radius * 0.1 * 0.3**3 / 4.0 / 3.0
    assert oracle.drag_potential(star, v, star.rest) == pytest.approx(exact, rel=1e-12)


def test_total_mass_and_added_mass_are_those_of_the_chapter():
    terms = {"added_mass_coefficient": 0.8}
    pushed = np.tile([0.3, -0.1], Star(nodes_per_limb=4).n_nodes)
    matrices = [oracle.mass_matrix(star, star.rest) for star in (Continuum(5, 4, **terms), Star(5, 4, **terms))]
    np.testing.assert_allclose(*(pushed @ matrix @ pushed for matrix in matrices), rtol=1e-13)


# Derivatives


@pytest.mark.parametrize("star", [Continuum(5, 4), unlike_limbs(5)], ids=["alike", "unlike"])
@pytest.mark.parametrize("soft", [False, True])
def test_elastic_gradient_and_hessian_are_derivatives(star, soft):
    if soft:  # so that stretching does not hide bending
        star = Continuum(5, 4, youngs_modulus=1.0, rod_radius=1.0)
    q = shaken(star, 1e-3)
    assert_derivative(
        lambda x: oracle.elastic_energy(star, x, DELTA_PSI), oracle.elastic_gradient(star, q, DELTA_PSI), q
    )
    hessian = oracle.elastic_hessian(star, q, DELTA_PSI)
    assert_derivative(lambda x: oracle.elastic_gradient(star, x, DELTA_PSI), hessian, q)
    np.testing.assert_allclose(hessian, hessian.T, rtol=0.0, atol=1e-12 * np.abs(hessian).max())


@pytest.mark.parametrize("n_limbs", [1, 2, 5])
@pytest.mark.parametrize("shaped", [False, True])
def test_the_potential_with_all_terms_has_its_gradient_and_its_hessian(n_limbs, shaped):
    if shaped:
        star = with_all_terms(lambda **terms: unlike_limbs(n_limbs, **terms))
    else:
        star = with_all_terms(n_limbs=n_limbs, nodes_per_limb=4)
    delta_psi = DELTA_PSI[:n_limbs]
    q_hat, v_hat, gamma, frozen = shaken(star, 1e-3), random_velocities(star), 0.01, shaken(star, 1e-3, seed=5)
    q = q_hat + gamma * random_velocities(star, seed=2)
    data = q_hat, v_hat, gamma, delta_psi, frozen
    gradient = oracle.incremental_gradient(star, q, *data)
    hessian = oracle.incremental_hessian(star, q, q_hat, gamma, delta_psi, frozen)
    assert_derivative(lambda x: oracle.incremental_potential(star, x, *data), gradient, q)
    assert_derivative(lambda x: oracle.incremental_gradient(star, x, *data), hessian, q)


def test_damping_and_drag_have_their_slopes_where_nothing_hides_them():
    star = with_all_terms(nodes_per_limb=4, youngs_modulus=1.0, rod_radius=1.0)
    q_hat, v = shaken(star, 1e-3), random_velocities(star)
    q = q_hat + 1e-3 * v
    _, gradient, hessian = oracle.damping_potential(star, q, q_hat, 0.01)
    assert_derivative(lambda x: oracle.damping_potential(star, x, q_hat, 0.01)[0], gradient, q)
    assert_derivative(lambda x: oracle.damping_potential(star, x, q_hat, 0.01)[1], hessian, q)
    force, jacobian = oracle.drag_force(star, v, q), oracle.drag_jacobian(star, v, q)
    assert_derivative(lambda x: -oracle.drag_potential(star, x, q), force, v)
    assert_derivative(lambda x: oracle.drag_force(star, x, q), jacobian, v)


def test_damping_knows_nothing_of_a_rotation():
    star = with_all_terms(nodes_per_limb=4)
    q_hat = shaken(star, 1e-3)
    potential, gradient, _ = oracle.damping_potential(star, turn(q_hat, 0.7) + [0.1, 0.2], q_hat, 0.01)
    assert potential < 1e-20
    assert np.abs(gradient).max() < 1e-8


# Conservation


def momenta(star: Star, q: Array, v: Array) -> tuple[Array, float]:
    """Linear momentum of the lumped masses [kg m/s], and angular momentum with that of the edges [kg m^2/s]."""
    m = star.masses
    spin = float(m @ (q[:, 0] * v[:, 1] - q[:, 1] * v[:, 0]))
    for (tail, head), mu in zip(star.edges, star.edge_mass, strict=True):
        e, w = q[head] - q[tail], v[head] - v[tail]
        spin -= mu * (e[0] * w[1] - e[1] * w[0])
    return m @ v, spin


@pytest.mark.parametrize("star", [Continuum(5, 4, drag_coefficient=0.0), unlike_limbs(5, drag_coefficient=0.0)])
@pytest.mark.parametrize("scheme", oracle.TABLEAUS)
def test_momentum_and_angular_momentum_without_fluid(scheme, star):
    q, v = star.rest, random_velocities(star, 0.02)
    before, spin = momenta(star, q, v)
    for k in range(3):
        q, v = oracle.step(star, q, v, 0.01 * k, 0.01, (0, 1, 0, 0, -1), scheme)
    after, spin_after = momenta(star, q, v)
    np.testing.assert_allclose(after, before, rtol=0.0, atol=1e-13 * np.abs(star.masses[:, None] * v).sum())
    if scheme == "implicit-midpoint":
        assert spin_after == pytest.approx(spin, rel=1e-8)


@pytest.mark.parametrize("terms", [{"drag_coefficient": 0.0}, {}, {"relaxation_time": 1e-3}])
def test_energy_never_grows_in_an_unactuated_implicit_euler_run(terms):
    star = unlike_limbs(4, **terms)
    q, v = star.rest, random_velocities(star, 0.05)
    energies = [oracle.kinetic_energy(star, v)]
    for k in range(8):
        q, v = oracle.step(star, q, v, 0.005 * k, 0.005, np.zeros(4), "implicit-euler")
        energies.append(oracle.kinetic_energy(star, v) + oracle.elastic_energy(star, q, np.zeros(4)))
    assert np.all(np.diff(energies) < 0.0)


def test_a_held_node_stays_and_a_load_pulls_the_others():
    star = Continuum(3, 3, held_nodes=(0, 1), loads=((2, 0.0, 1e-4),), drag_coefficient=0.0)
    q, _ = oracle.step(star, star.rest, np.zeros_like(star.rest), 0.0, 0.01, np.zeros(3), "implicit-euler")
    np.testing.assert_array_equal(q[:2], star.rest[:2])
    assert q[2, 1] > 1e-5


# Symmetry


def limbs_moved(q: Array, order: ArrayLike) -> Array:
    """Nodes of a robot of five limbs with its limbs in another order."""
    return np.vstack([q[:1], q[1:].reshape(5, -1, 2)[np.asarray(order)].reshape(-1, 2)])


@pytest.mark.parametrize(
    "terms", [{}, {"tangential_drag_coefficient": 0.2, "added_mass_coefficient": 0.8, "relaxation_time": 1e-3}]
)
def test_commanding_the_next_limb_turns_the_swim_by_72_degrees_and_mirrored_commands_mirror_it(terms):
    star = Continuum(nodes_per_limb=5, **terms)
    v, mirror = np.zeros_like(star.rest), [0, 4, 3, 2, 1]
    q = few_steps(star, COMMAND, star.rest, v, 3)
    assert np.abs(q - star.rest).max() > 5e-4
    turned = turn(limbs_moved(q, [4, 0, 1, 2, 3]), 2.0 * np.pi / 5.0)
    np.testing.assert_allclose(few_steps(star, np.roll(COMMAND, 1), star.rest, v, 3), turned, rtol=0.0, atol=1e-13)
    mirrored = limbs_moved(q, mirror) * [1.0, -1.0]
    np.testing.assert_allclose(few_steps(star, -COMMAND[mirror], star.rest, v, 3), mirrored, rtol=0.0, atol=1e-13)


# Time


@pytest.mark.parametrize(
    ("scheme", "order"), [("implicit-euler", 1), ("sdirk2", 2), ("sdirk3", 3), ("implicit-midpoint", 2)]
)
def test_a_scheme_converges_with_the_order_it_claims(scheme, order):
    star = Continuum(n_limbs=3, nodes_per_limb=3, youngs_modulus=1e4)

    def end(n_steps: int) -> Array:
        q, v, h = star.rest, np.tile([0.05, 0.02], (star.n_nodes, 1)), 0.08 / n_steps
        for k in range(n_steps):
            q, v = oracle.step(star, q, v, k * h, h, (0.2, -0.2, 0.1), scheme)
        return q

    coarse, middle, fine = end(32), end(64), end(128)
    measured = np.log2(np.linalg.norm(coarse - middle) / np.linalg.norm(middle - fine))
    assert measured == pytest.approx(order, abs=0.2)
