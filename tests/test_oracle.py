"""The oracle keeps the promises that the fast kernels are measured against."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

import oracle
from oracle import Array, Star

HUBS = ("opening", "turning")
STRAIGHT = (0.0, 1.0, 0.0, 0.0, -1.0)
DELTA_PSI = (0.3, -0.5, 0.0, 0.2, -0.1)


def shaken(star: Star, size: float = 2e-3, seed: int = 0) -> Array:
    """Rest positions with every node moved at random by about ``size`` [m]."""
    return star.rest + size * np.random.default_rng(seed).standard_normal(star.rest.shape)


def random_velocities(star: Star, size: float = 0.1, seed: int = 1) -> Array:
    """Random node velocities of about ``size`` [m/s]."""
    return size * np.random.default_rng(seed).standard_normal(star.rest.shape)


def difference_quotients(function: Callable[[Array], Any], x: Array, delta: float) -> Array:
    """Central differences of ``function`` in every entry of x: shape (x.size, *result.shape)."""
    moves = delta * np.eye(x.size).reshape(x.size, *x.shape)
    return np.array([(function(x + move) - function(x - move)) / (2.0 * delta) for move in moves])


def assert_derivative(
    function: Callable[[Array], Any], derivative: Array, x: Array, delta: float = 1e-7, share: float = 1e-6
) -> None:
    """Assert that ``derivative`` holds the derivatives of ``function`` at x to a share of the largest of them."""
    expected = difference_quotients(function, x, delta).reshape(derivative.shape)
    np.testing.assert_allclose(derivative, expected, rtol=0.0, atol=share * np.abs(expected).max())


def turn(x: Array, angle: float) -> Array:
    """Vectors x, shape (n, 2), turned anti-clockwise by ``angle`` [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return x @ np.array([[c, s], [-s, c]])


def few_steps(
    star: Star, command: ArrayLike, q: Array, v: Array, n_steps: int = 5, scheme: str = "implicit-euler"
) -> Array:
    """Positions after the first steps of 10 ms of a stroke."""
    for k in range(n_steps):
        q, v = oracle.step(star, q, v, 0.01 * k, 0.01, command, scheme)
    return q


# Topology and masses


def test_chapter_robot_has_46_nodes_45_edges_and_45_hinges():
    star = Star()
    assert (star.n_nodes, len(star.edges), len(star.hinges)) == (46, 45, 45)
    assert np.linalg.norm(star.rest[star.node(3, 9)]) == pytest.approx(0.1)


def test_lumped_masses_add_up_to_the_mass_of_five_limbs():
    star = Star()
    assert star.masses.sum() == pytest.approx(5 * 0.1 * np.pi * 1.6e-3**2 * 1000.0)
    assert star.masses[0] == pytest.approx(2.5 * star.masses[1])


@pytest.mark.parametrize("hub_hinge", HUBS)
@pytest.mark.parametrize("n_limbs", [3, 5, 6])
def test_rest_shape_stores_no_energy_and_feels_no_force(hub_hinge, n_limbs):
    star = Star(n_limbs=n_limbs, nodes_per_limb=5, hub_hinge=hub_hinge)
    assert oracle.elastic_energy(star, star.rest, np.zeros(n_limbs)) < 1e-25
    assert np.abs(oracle.elastic_gradient(star, star.rest, np.zeros(n_limbs))).max() < 1e-12


def test_one_bent_hinge_stores_the_energy_of_its_curvature():
    star = Star(n_limbs=3, nodes_per_limb=3)
    q = star.rest.copy()
    q[2] = q[1] + turn(q[2:3] - q[1], 0.4)[0]
    kappa = 2.0 * np.tan(0.2) / 0.05
    assert oracle.elastic_energy(star, q, np.zeros(3)) == pytest.approx(0.5 * star.EI * kappa**2 * 0.05)


def test_a_hub_whose_limbs_turned_by_delta_psi_stores_no_energy():
    star = Star(nodes_per_limb=2)
    q = star.rest.copy()
    q[2], q[5] = turn(q[2:3], 0.3)[0], turn(q[5:6], -0.2)[0]
    for hub_hinge in HUBS:
        assert oracle.elastic_energy(Star(nodes_per_limb=2, hub_hinge=hub_hinge), q, (0, 0.3, 0, 0, -0.2)) < 1e-25


# Derivatives


@pytest.mark.parametrize("hub_hinge", HUBS)
def test_elastic_gradient_is_the_derivative_of_the_energy(hub_hinge):
    star = Star(hub_hinge=hub_hinge, nodes_per_limb=6)
    q = shaken(star)
    gradient = oracle.elastic_gradient(star, q, DELTA_PSI)
    assert_derivative(lambda x: oracle.elastic_energy(star, x, DELTA_PSI), gradient, q)


@pytest.mark.parametrize("hub_hinge", HUBS)
def test_elastic_hessian_is_the_derivative_of_the_gradient(hub_hinge):
    star = Star(hub_hinge=hub_hinge, nodes_per_limb=6)
    q = shaken(star)
    hessian = oracle.elastic_hessian(star, q, DELTA_PSI)
    assert_derivative(lambda x: oracle.elastic_gradient(star, x, DELTA_PSI), hessian, q)
    np.testing.assert_allclose(hessian, hessian.T, rtol=0.0, atol=1e-12 * np.abs(hessian).max())


@pytest.mark.parametrize("hub_hinge", HUBS)
def test_bending_derivatives_hold_where_stretching_does_not_hide_them(hub_hinge):
    star = Star(hub_hinge=hub_hinge, nodes_per_limb=6, youngs_modulus=1.0, rod_radius=1.0)
    q = star.rest + 0.2 * (shaken(star, 1e-2) - star.rest)
    gradient, hessian = oracle.elastic_gradient(star, q, DELTA_PSI), oracle.elastic_hessian(star, q, DELTA_PSI)
    assert star.EI / star.edge_length**2 > 100.0 * star.EA
    assert_derivative(lambda x: oracle.elastic_energy(star, x, DELTA_PSI), gradient, q)
    assert_derivative(lambda x: oracle.elastic_gradient(star, x, DELTA_PSI), hessian, q)


def test_drag_force_is_minus_the_derivative_of_its_potential():
    star = Star()
    v = random_velocities(star)
    assert_derivative(lambda x: -oracle.drag_potential(star, x), oracle.drag_force(star, v), v)


def test_drag_jacobian_is_the_derivative_of_the_force_and_zero_at_rest():
    star = Star()
    v = random_velocities(star)
    assert_derivative(lambda x: oracle.drag_force(star, x), oracle.drag_jacobian(star, v).T, v)
    assert not oracle.drag_jacobian(star, np.zeros_like(v)).any()


def test_drag_of_a_straight_limb_moved_sideways_is_that_of_a_cylinder():
    star = Star()
    force = oracle.drag_force(star, np.tile([0.0, 0.2], (46, 1))).sum(axis=0)
    np.testing.assert_allclose(force, [0.0, -0.5 * 1000.0 * 1.0 * 3.2e-3 * 0.5 * 0.2**2])


def test_incremental_potential_has_the_residual_as_gradient_and_its_jacobian_as_hessian():
    star, gamma = Star(nodes_per_limb=6), 0.01
    q_hat, v_hat = shaken(star), random_velocities(star)
    q = q_hat + gamma * random_velocities(star, seed=2)
    gradient = oracle.incremental_gradient(star, q, q_hat, v_hat, gamma, DELTA_PSI)
    hessian = oracle.incremental_hessian(star, q, q_hat, gamma, DELTA_PSI)
    assert_derivative(lambda x: oracle.incremental_potential(star, x, q_hat, v_hat, gamma, DELTA_PSI), gradient, q)
    assert_derivative(lambda x: oracle.incremental_gradient(star, x, q_hat, v_hat, gamma, DELTA_PSI), hessian, q)


# Stages, conservation, symmetry


def test_a_stage_balances_the_forces_of_13_9_where_plain_newton_diverges():
    star, h, still = Star(), 0.01, np.zeros(5)
    v_hat = random_velocities(star, 1.0, seed=0)
    q_plain = star.rest + h * v_hat
    for _ in range(60):
        gradient = oracle.incremental_gradient(star, q_plain, star.rest, v_hat, h, still)
        hessian = oracle.incremental_hessian(star, q_plain, star.rest, h, still)
        update = np.linalg.solve(hessian, gradient.ravel()).reshape(-1, 2)
        q_plain = q_plain - update
    assert np.abs(update).max() > 0.1 * star.limb_length

    q, v = oracle.stage(star, star.rest, v_hat, h, still)
    inertia = star.masses[:, None] * (v - v_hat) / h
    force = oracle.drag_force(star, v) - oracle.elastic_gradient(star, q, still)
    np.testing.assert_allclose(inertia, force, rtol=0.0, atol=1e-11 * np.abs(inertia).max())


@pytest.mark.parametrize("scheme", oracle.TABLEAUS)
def test_momentum_and_angular_momentum_without_fluid(scheme):
    star = Star(nodes_per_limb=5, drag_coefficient=0.0)
    q, v = star.rest, random_velocities(star, 0.02)
    m = star.masses[:, None]
    before, spin = (m * v).sum(axis=0), np.sum(m[:, 0] * (q[:, 0] * v[:, 1] - q[:, 1] * v[:, 0]))
    for k in range(3):
        q, v = oracle.step(star, q, v, 0.01 * k, 0.01, (0, 1, 0, 0, -1), scheme)
    np.testing.assert_allclose((m * v).sum(axis=0), before, rtol=0.0, atol=1e-13 * np.abs(m * v).sum())
    if scheme == "implicit-midpoint":
        assert np.sum(m[:, 0] * (q[:, 0] * v[:, 1] - q[:, 1] * v[:, 0])) == pytest.approx(spin, rel=1e-9)


@pytest.mark.parametrize("drag_coefficient", [0.0, 1.0])
def test_energy_never_grows_in_an_unactuated_implicit_euler_run(drag_coefficient):
    star = Star(nodes_per_limb=5, drag_coefficient=drag_coefficient)
    q, v = star.rest, random_velocities(star, 0.05)
    energies = [oracle.kinetic_energy(star, v)]
    for k in range(10):
        q, v = oracle.step(star, q, v, 0.005 * k, 0.005, np.zeros(5), "implicit-euler")
        energies.append(oracle.kinetic_energy(star, v) + oracle.elastic_energy(star, q, np.zeros(5)))
    assert np.all(np.diff(energies) < 0.0)


@pytest.mark.parametrize("hub_hinge", HUBS)
def test_commanding_the_next_limb_turns_the_swim_by_72_degrees(hub_hinge):
    star = Star(hub_hinge=hub_hinge)
    command, v = np.array([1.0, -0.5, 0.0, 0.2, 0.0]), np.zeros_like(star.rest)
    q = few_steps(star, command, star.rest, v)
    q_next = few_steps(star, np.roll(command, 1), star.rest, v)
    limbs = np.roll(q[1:].reshape(5, 9, 2), 1, axis=0).reshape(-1, 2)
    turned = turn(np.vstack([q[:1], limbs]), 2.0 * np.pi / 5.0)
    assert np.abs(q - star.rest).max() > 1e-3
    np.testing.assert_allclose(q_next, turned, rtol=0.0, atol=1e-13)


@pytest.mark.parametrize("hub_hinge", HUBS)
def test_the_mirrored_command_mirrors_the_swim(hub_hinge):
    star = Star(hub_hinge=hub_hinge)
    command, v = np.array([1.0, -0.5, 0.0, 0.2, 0.0]), np.zeros_like(star.rest)
    q = few_steps(star, command, star.rest, v)
    q_mirrored = few_steps(star, -command[[0, 4, 3, 2, 1]], star.rest, v)
    limbs = q[1:].reshape(5, 9, 2)[[0, 4, 3, 2, 1]].reshape(-1, 2)
    np.testing.assert_allclose(q_mirrored, np.vstack([q[:1], limbs]) * [1.0, -1.0], rtol=0.0, atol=1e-13)


# Time


@pytest.mark.parametrize(
    ("scheme", "order"),
    [
        ("implicit-euler", 1),
        ("sdirk2", 2),
        ("sdirk3", 3),
        ("implicit-midpoint", 2),
    ],
)
def test_a_scheme_converges_with_the_order_it_claims(scheme, order):
    star = Star(n_limbs=3, nodes_per_limb=3, youngs_modulus=1e4)

    def end(n_steps: int) -> Array:
        q, v, h = star.rest, np.tile([0.05, 0.02], (star.n_nodes, 1)), 0.08 / n_steps
        for k in range(n_steps):
            q, v = oracle.step(star, q, v, k * h, h, (0.2, -0.2, 0.1), scheme)
        return q

    coarse, middle, fine = end(32), end(64), end(128)
    measured = np.log2(np.linalg.norm(coarse - middle) / np.linalg.norm(middle - fine))
    assert measured == pytest.approx(order, abs=0.2)


def test_pulse_is_the_ramp_of_figure_13_5b():
    times = [0.0, 0.05, 0.1, 0.55, 1.0, 1.05]
    np.testing.assert_allclose([oracle.pulse(t) / np.pi for t in times], [0.0, 0.1, 0.2, 0.1, 0.0, 0.1], atol=1e-12)


@pytest.mark.parametrize("h", [0.003, 0.01, 0.02, 0.03, 0.25])
def test_steps_cover_the_stroke_and_end_on_its_corners(h):
    starts, lengths = np.array(oracle.stroke_steps(h)).T
    ends = starts + lengths
    np.testing.assert_allclose(starts[1:], ends[:-1], rtol=0.0, atol=1e-14)
    assert starts[0] == 0.0
    assert ends[-1] == pytest.approx(1.0, abs=1e-14)
    assert np.min(np.abs(ends - 0.1)) < 1e-14
    assert lengths.min() > 0.0
    assert lengths.max() <= h * (1.0 + 1e-9)


# An independent code's figure

PUBLISHED_HUB_X = {
    # time [s]: hub x [m] of dismech-rods in its planar mode, of DDG_Tutorial_Fast's 2d_curve
    0.01: (1.461746457414e-04, 1.461746457414e-04),
    0.10: (4.998152229393e-03, 4.998152232297e-03),
    0.50: (1.483099680202e-02, 1.483099635702e-02),
    1.00: (4.544118750321e-03, 4.544119890300e-03),
}
"""Outputs of two published C++ codes of the chapter's authors' groups, which know nothing of this one.

Straight swim {2+,5-} from rest, implicit Euler, h = 10 ms, ramp taken at the end of a step, drag (13.8), hub hinges by
their turning angle, Newton to a force residual of 1e-8: hence their own disagreement of 3e-7.
"""


def test_first_stroke_agrees_with_two_published_codes_and_stays_on_the_axis():
    star = Star(hub_hinge="turning")
    q, v, hub = star.rest, np.zeros_like(star.rest), {}
    for t, h in oracle.stroke_steps(0.01):
        q, v = oracle.step(star, q, v, t, h, STRAIGHT, "implicit-euler")
        hub[round(t + h, 2)] = q[0]
    for t, figures in PUBLISHED_HUB_X.items():
        np.testing.assert_allclose(hub[t][0], figures, rtol=4e-7)
    assert max(abs(y) for _, y in hub.values()) < 1e-14
