"""The oracles, of the chapter and of the continuum, keep the promises that the fast kernels are measured against."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest

import oracle
from continuum_oracle import Continuum, ContinuumShaped
from oracle import Array, Star
from slopes import rotated
from unlike import DIFFERENT, robot_and_star

HUBS = ("opening", "turning")
LIMBS = [1, 2, 3, 5, 12]
SOFT = {"youngs_modulus": 1.0, "rod_radius": 1.0}
"""So that stretching does not hide bending."""
DELTA_PSI = np.array([0.3, -0.5, 0.0, 0.2, -0.1])


def shaken(star: Star, size: float = 2e-3, seed: int = 0) -> Array:
    """Rest positions with every node moved at random by about ``size`` [m]."""
    return star.rest + size * np.random.default_rng(seed).standard_normal(star.rest.shape)


def random_velocities(star: Star, size: float = 0.1, seed: int = 1) -> Array:
    """Random node velocities of about ``size`` [m/s]."""
    return size * np.random.default_rng(seed).standard_normal(star.rest.shape)


def assert_derivative(
    function: Callable[[Array], Any], derivative: Array, x: Array, delta: float = 1e-7, share: float = 1e-6
) -> None:
    """Assert that ``derivative`` holds the derivatives of ``function`` at x to a share of the largest of them."""
    moves = delta * np.eye(x.size).reshape(x.size, *x.shape)
    quotients = [(function(x + move) - function(x - move)) / (2.0 * delta) for move in moves]
    expected = np.reshape(quotients, derivative.shape)
    np.testing.assert_allclose(derivative, expected, rtol=0.0, atol=share * np.abs(expected).max())


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


# Rest


@pytest.mark.parametrize(
    "star",
    [
        *(Star(n_limbs=n, nodes_per_limb=5, hub_hinge=hinge) for n in (3, 5, 6) for hinge in HUBS),
        *(Continuum(n, 4) for n in LIMBS), *(unlike_limbs(n) for n in LIMBS),
    ],
)  # fmt: skip
def test_a_robot_of_any_shape_rests_without_energy_and_without_force(star):
    still = np.zeros(star.n_limbs)
    assert oracle.elastic_energy(star, star.rest, still) < 1e-25
    assert np.abs(oracle.elastic_gradient(star, star.rest, still)).max() < (1e-12 if star.n_hub_hinges else 1e-11)


@pytest.mark.parametrize("star", [*(Star(nodes_per_limb=2, hub_hinge=h) for h in HUBS), Continuum(nodes_per_limb=2)])
def test_limbs_turned_by_delta_psi_and_all_of_them_by_any_angle_store_no_energy(star):
    limbs = zip(star.rest[1:], DELTA_PSI, strict=True)
    q = np.vstack([star.rest[:1], *(rotated(root[None], delta + 2.5) for root, delta in limbs)])
    assert oracle.elastic_energy(star, q, DELTA_PSI) < 1e-25


@pytest.mark.parametrize("spread", [0.3, 1.0, 2.5])
def test_the_hub_stores_the_sum_of_its_stiffnesses_less_the_length_of_their_resultant(spread):
    star, rng = unlike_limbs(5, 2, youngs_modulus=1.0), np.random.default_rng(0)
    turns, K = spread * rng.standard_normal(5), np.array([clamp.stiffness for clamp in star.clamps])
    expected = K.sum() - abs(np.sum(K * np.exp(1j * turns)))
    assert oracle.clamp_slopes(star, star.rest, turns)[0] == pytest.approx(expected, rel=1e-12)


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


# Derivatives


ELASTIC = [
    *(Star(nodes_per_limb=6, hub_hinge=hinge, **soft) for hinge in HUBS for soft in ({}, SOFT)),
    *(Continuum(5, 4, **soft) for soft in ({}, SOFT)),
    unlike_limbs(5),
    *(robot_and_star(name, 3)[1] for name in DIFFERENT),
]


@pytest.mark.parametrize("star", ELASTIC)
def test_elastic_gradient_and_hessian_are_derivatives(star):
    q, delta_psi = shaken(star), DELTA_PSI[: star.n_limbs]
    gradient, hessian = oracle.elastic_gradient(star, q, delta_psi), oracle.elastic_hessian(star, q, delta_psi)
    assert_derivative(lambda x: oracle.elastic_energy(star, x, delta_psi), gradient, q)
    assert_derivative(lambda x: oracle.elastic_gradient(star, x, delta_psi), hessian, q)


@pytest.mark.parametrize("star", [Star(), with_all_terms(nodes_per_limb=4, **SOFT)], ids=["chapter", "all terms"])
def test_drag_force_and_its_jacobian_are_derivatives(star):
    q, v = shaken(star, 1e-3), random_velocities(star)
    force, jacobian = oracle.drag_force(star, v, q), oracle.drag_jacobian(star, v, q)
    assert_derivative(lambda x: -oracle.drag_potential(star, x, q), force, v)
    assert_derivative(lambda x: oracle.drag_force(star, x, q), jacobian.T, v)
    assert not oracle.drag_jacobian(Star(), np.zeros_like(Star().rest)).any()


@pytest.mark.parametrize(
    "star", [with_all_terms(nodes_per_limb=4, **SOFT), *(Star(3, 3, hub_hinge=h, relaxation_time=4e-3) for h in HUBS)]
)
def test_damping_has_its_slopes_where_nothing_hides_them_and_knows_nothing_of_a_rotation(star):
    q_hat = shaken(star, 1e-3)
    q = q_hat + 1e-3 * random_velocities(star)
    potential, gradient, hessian = oracle.damping_potential(star, q, q_hat, 0.01)
    assert_derivative(lambda x: oracle.damping_potential(star, x, q_hat, 0.01)[0], gradient, q)
    assert_derivative(lambda x: oracle.damping_potential(star, x, q_hat, 0.01)[1], hessian, q)
    assert oracle.damping_potential(star, rotated(q_hat, 0.7) + [0.1, 0.2], q_hat, 0.01)[0] < 1e-12 * potential


@pytest.mark.parametrize(
    "star",
    [
        Star(nodes_per_limb=6),
        *(with_all_terms(n_limbs=n, nodes_per_limb=4) for n in (1, 2, 5)),
        *(with_all_terms(partial(unlike_limbs, n)) for n in (1, 2, 5)),
    ],
)
def test_incremental_potential_has_the_residual_as_gradient_and_its_jacobian_as_hessian(star):
    q_hat, v_hat, gamma, frozen = shaken(star, 1e-3), random_velocities(star), 0.01, shaken(star, 1e-3, seed=5)
    q, delta_psi = q_hat + gamma * random_velocities(star, seed=2), DELTA_PSI[: star.n_limbs]
    data = q_hat, v_hat, gamma, delta_psi, frozen
    gradient = oracle.incremental_gradient(star, q, *data)
    hessian = oracle.incremental_hessian(star, q, q_hat, gamma, delta_psi, frozen)
    assert_derivative(lambda x: oracle.incremental_potential(star, x, *data), gradient, q)
    assert_derivative(lambda x: oracle.incremental_gradient(star, x, *data), hessian, q)
