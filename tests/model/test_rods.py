"""Coefficients of rods are the chapter's; those of the continuum: tests/rods/test_terms.py."""

import math

import numpy as np
import pytest

from oracle import Star
from seastar_gym import Limb, Numerics, Scene, Seastar, SmaPulse, Water
from seastar_gym.model import make_limits, make_rods
from seastar_gym.scene.numerics import ADAPTATION, MOST_ITERATIONS, MOST_ITERATIONS_PER_STEP


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
    for vacuum in (None, Water(density=0.0), Water(drag_coefficient=0.0)):
        rods_in_vacuum = make_rods(Scene(fluid=vacuum))
        assert not rods_in_vacuum.drag.any() and not rods_in_vacuum.middle_drag.any()
    assert len(rods.stretching.EA) == len(star.edges) and len(rods.bending.EI_over_dl) == len(star.hinges)


@pytest.mark.parametrize("nodes", [2, 3, 5, 10])
def test_kinetic_energy_is_positive_however_limbs_taper(nodes):
    """Coarse limbs of very different radii once had a negative one."""
    rng = np.random.default_rng(nodes)
    for _ in range(50):
        limbs = tuple(Limb(radius=tuple(10.0 ** rng.uniform(-4, -2, rng.integers(2, 6)))) for _ in range(3))
        rods = make_rods(Scene(Seastar(n_limbs=3, nodes_per_limb=nodes, limbs=limbs)))
        matrix = np.diag(rods.mass.copy())  # lumped masses, less what edges have less
        for e, mu in enumerate(rods.edge_mass):
            matrix[np.ix_(*[[0 if e % (nodes - 1) == 0 else e, e + 1]] * 2)] -= mu * np.array(
                [[1.0, -1.0], [-1.0, 1.0]]
            )
        assert matrix.sum() == pytest.approx(rods.mass.sum())
        assert np.linalg.eigvalsh(matrix).min() > 0.0


def test_limits_are_in_limb_lengths_and_in_steps_begun():
    numerics = Numerics("implicit-midpoint", 0.3, newton_tolerance=1e-6, max_iterations=17, path_tolerance=0.01)
    limits = make_limits(Scene(Seastar(limb_length=0.2), actuator=SmaPulse(0.3, 0.5, 1.5), numerics=numerics))
    assert limits.tolerance == pytest.approx(0.2e-6) and limits.max_iterations == 17 and limits.adaptive
    assert limits.most_iterations == MOST_ITERATIONS + 7 * MOST_ITERATIONS_PER_STEP
    assert limits.error_rate == pytest.approx(0.2 / 2.0 * (0.01 / ADAPTATION[0]) ** ADAPTATION[1])
    fixed = make_limits(Scene(numerics=Numerics("implicit-midpoint", 0.01)))
    assert not fixed.adaptive and fixed.error_rate == 0.0
