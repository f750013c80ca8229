"""Coefficients of rods are the chapter's; those of the continuum: tests/simulator/test_oracle_steps.py."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from oracle import Star
from seastar_gym import (
    GridCurrent,
    Limb,
    Numerics,
    Scene,
    Seastar,
    ShearCurrent,
    SmaPulse,
    UniformCurrent,
    Vortex,
    Water,
)
from seastar_gym.der.terms.current import current_velocity
from seastar_gym.model.currents import current_rows
from seastar_gym.model.rods import make_limits, make_rods
from seastar_gym.scene.numerics import ADAPTATION, MOST_ITERATIONS, MOST_ITERATIONS_PER_STEP
from seastar_gym.simd.numpy_lanes import Lanes
from slopes import plain


@given(
    n_limbs=st.integers(3, 12), nodes_per_limb=st.integers(2, 40), limb_length=st.floats(0.01, 1.0),
    rod_radius=st.floats(1e-4, 1e-2), density=st.floats(100.0, 1e4),
)  # fmt: skip
def test_total_mass_is_that_of_the_limbs(n_limbs, nodes_per_limb, limb_length, rod_radius, density):
    robot = Seastar(n_limbs, nodes_per_limb, limb_length, rod_radius, density=density)
    mass = make_rods(Scene(robot=robot, actuator=SmaPulse(peak_angle=0.1))).mass
    assert mass.shape == (robot.n_nodes,)
    assert mass.sum() == pytest.approx(n_limbs * limb_length * math.pi * rod_radius**2 * density, rel=1e-12)


@pytest.mark.parametrize("hub_hinge", ["opening", "turning"])
def test_coefficients_are_the_oracles(hub_hinge):
    values = {"n_limbs": 4, "nodes_per_limb": 6, "limb_length": 0.2, "rod_radius": 2e-3, "youngs_modulus": 3e5}
    robot = Seastar(**values, density=1200.0, hub_hinge=hub_hinge, discretisation="chapter")
    water = Water(density=900.0, drag_coefficient=1.3)
    star = Star(**values, density=1200.0, hub_hinge=hub_hinge, fluid_density=900.0, drag_coefficient=1.3)
    rods = make_rods(Scene(robot, water, SmaPulse(peak_angle=0.1)))
    np.testing.assert_allclose(rods.mass, star.masses, rtol=1e-14)
    np.testing.assert_allclose(rods.drag, star.drag, rtol=1e-14)
    np.testing.assert_allclose(rods.stretching.EA, star.EA, rtol=1e-14)
    np.testing.assert_allclose(rods.stretching.EA_over_l * rods.stretching.l_over_EA, 1.0, rtol=1e-14)
    np.testing.assert_allclose(rods.stretching.EA_over_l, star.EA / star.edge_length, rtol=1e-14)
    np.testing.assert_allclose(rods.bending.EI_over_dl, star.EI / star.edge_length, rtol=1e-14)
    np.testing.assert_allclose(rods.bending.EI_over_dl * rods.bending.dl_over_EI, 1.0, rtol=1e-14)
    assert rods.hub.side == {"opening": 1.0, "turning": -1.0}[hub_hinge]
    assert rods.hub.angle == pytest.approx(math.pi / 2 if hub_hinge == "opening" else -math.pi / 2)
    assert len(rods.stretching.EA) == len(star.edges) and len(rods.bending.EI_over_dl) == len(star.hinges)


@pytest.mark.parametrize("fluid", [None, Water(density=0.0), Water(drag_coefficient=0.0)])
def test_vacuum_has_no_drag(fluid):
    rods = make_rods(Scene(fluid=fluid))
    assert not rods.drag.any() and not rods.middle_drag.any()


def mass_matrix(scene):
    """Of one direction [kg], from lumped masses less what edges have less; shape (n_nodes, n_nodes)."""
    rods = make_rods(scene)
    matrix, edges = np.diag(rods.mass.copy()), scene.robot.nodes_per_limb - 1
    for e, mu in enumerate(rods.edge_mass):
        ends = np.ix_(*[[0 if e % edges == 0 else e, e + 1]] * 2)
        matrix[ends] -= mu * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return matrix


@pytest.mark.parametrize("nodes", [2, 3, 5, 10])
def test_kinetic_energy_is_positive_however_limbs_taper(nodes):
    """Coarse limbs of very different radii once had a negative one."""
    rng = np.random.default_rng(nodes)
    for _ in range(50):
        limbs = tuple(Limb(radius=tuple(10.0 ** rng.uniform(-4, -2, rng.integers(2, 6)))) for _ in range(3))
        scene = Scene(Seastar(n_limbs=3, nodes_per_limb=nodes, limbs=limbs))
        matrix = mass_matrix(scene)
        assert matrix.sum() == pytest.approx(make_rods(scene).mass.sum())
        assert np.linalg.eigvalsh(matrix).min() > 0.0


def test_edges_of_one_radius_keep_a_sixth_of_their_mass():
    scene = Scene()
    rods, robot = make_rods(scene), scene.robot
    a_sixth = robot.density * np.pi * robot.rod_radius**2 * robot.limb_length / (robot.nodes_per_limb - 1) / 6.0
    np.testing.assert_allclose(rods.edge_mass, a_sixth, rtol=1e-12)


# Currents and the solver's limits are those of the scene, in numbers that kernels read.


X, Y = np.random.default_rng(0).uniform(-0.3, 0.3, (2, 9))
ALONG = -X * np.sin(0.7) + Y * np.cos(0.7)
FROM_CENTRE = np.array([-(Y + 0.2), X - 0.1]) / ((X - 0.1) ** 2 + (Y + 0.2) ** 2 + 0.07**2)
CURRENTS = {
    "uniform": (UniformCurrent(0.02, -0.03), np.outer([0.02, -0.03], np.ones(9))),
    "shear": (ShearCurrent(0.4, 0.7), 0.4 * ALONG * np.array([[np.cos(0.7)], [np.sin(0.7)]])),
    "vortex": (Vortex(0.3, 0.1, -0.2, 0.07), 0.3 / (2.0 * np.pi) * FROM_CENTRE),
    "grid": (
        GridCurrent.from_function(lambda x, y: (2.0 * x - y, x + 3.0 * y), (-0.4, 0.4), (-0.5, 0.4), 0.1),
        np.array([2.0 * X - Y, X + 3.0 * Y]),
    ),
}


@pytest.mark.parametrize("name", CURRENTS)
def test_a_current_flows_everywhere_as_its_formula_says(name):
    current, expected = CURRENTS[name]
    found = plain(current_velocity.plain(current_rows(current), Lanes(X), Lanes(Y)))
    for component, velocity in zip(found, expected, strict=True):
        np.testing.assert_allclose(np.broadcast_to(component, 9), velocity, rtol=1e-12, atol=1e-15)


def test_limits_are_in_limb_lengths_and_in_steps_begun():
    numerics = Numerics("implicit-midpoint", 0.3, newton_tolerance=1e-6, max_iterations=17, path_tolerance=0.01)
    limits = make_limits(Scene(Seastar(limb_length=0.2), actuator=SmaPulse(0.3, 0.5, 1.5), numerics=numerics))
    assert limits.tolerance == pytest.approx(0.2e-6) and limits.max_iterations == 17 and limits.adaptive
    assert limits.most_iterations == MOST_ITERATIONS + 7 * MOST_ITERATIONS_PER_STEP
    assert limits.error_rate == pytest.approx(0.2 / 2.0 * (0.01 / ADAPTATION[0]) ** ADAPTATION[1])
    fixed = make_limits(Scene(numerics=Numerics("implicit-midpoint", 0.01)))
    assert not fixed.adaptive and fixed.error_rate == 0.0
