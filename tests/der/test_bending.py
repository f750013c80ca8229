"""Bending (13.3): energy of a hinge, and its slopes in the turning angle phi."""

import numpy as np
import pytest

from seastar_gym import Scene, Seastar
from seastar_gym.der.terms.bending import bending_energy, bending_slopes, moment
from seastar_gym.model.rods import make_rods
from seastar_gym.simd.numpy_lanes import Lanes, Mask
from slopes import plain, slope

ROBOT = Seastar(nodes_per_limb=4)
RODS, HINGE = make_rods(Scene(ROBOT)), 1
EI, DL = ROBOT.youngs_modulus * np.pi * ROBOT.rod_radius**4 / 4.0, 13.0 / 12.0 * ROBOT.edge_length
ANGLES = np.linspace(-2.5, 2.5, 21)


def parts(phi, kappa_bar: float, convex=None):
    """(energy, slope, second slope) of a hinge."""
    t = Lanes(np.tan(0.5 * phi))
    bent = moment.plain(RODS, None, HINGE, t, Lanes(EI * kappa_bar))
    slopes = bending_slopes.plain(Lanes(RODS.bending.EI_over_dl[HINGE]), t, bent, convex)
    return plain((bending_energy.plain(RODS, None, HINGE, bent), *slopes))


@pytest.mark.parametrize("kappa_bar", [0.0, 30.0, -50.0])
def test_energy_is_that_of_the_chapter(kappa_bar):
    kappa = 2.0 * np.tan(0.5 * ANGLES) / DL
    np.testing.assert_allclose(parts(ANGLES, kappa_bar)[0], 0.5 * EI * (kappa - kappa_bar) ** 2 * DL, rtol=1e-11)


@pytest.mark.parametrize("kappa_bar", [0.0, 30.0, -50.0])
def test_slopes_are_the_derivatives_of_the_energy_in_the_angle(kappa_bar):
    _, first, second = parts(ANGLES, kappa_bar)
    size = np.abs(first).max()
    np.testing.assert_allclose(first, slope(lambda phi: parts(phi, kappa_bar)[0], ANGLES, 1e-3), atol=1e-7 * size)
    np.testing.assert_allclose(second, slope(lambda phi: parts(phi, kappa_bar)[1], ANGLES, 1e-3), atol=1e-6 * size)


def test_the_convex_part_is_never_negative_and_all_there_is_without_moment():
    everyone = Mask(np.ones(len(ANGLES), bool))
    for kappa_bar in (0.0, 200.0, -200.0):
        _, first, second = parts(ANGLES, kappa_bar)
        _, same, convex = parts(ANGLES, kappa_bar, everyone)
        np.testing.assert_array_equal(same, first)
        assert np.all(convex > 0.0)
        np.testing.assert_allclose(second - convex, first * np.tan(0.5 * ANGLES), rtol=0.0, atol=1e-9)
    assert parts(ANGLES, 200.0)[2].min() < 0.0


def test_only_the_robots_in_the_mask_lose_the_second_part():
    some = np.arange(len(ANGLES)) % 2 == 0
    _, _, mixed = parts(ANGLES, 100.0, Mask(some))
    convex, full = parts(ANGLES, 100.0, Mask(some | True))[2], parts(ANGLES, 100.0)[2]
    np.testing.assert_array_equal(mixed, np.where(some, convex, full))


def test_a_mirrored_hinge_stores_the_same_and_turns_back():
    energy, first, second = parts(ANGLES, 40.0)
    mirrored = parts(-ANGLES, -40.0)
    np.testing.assert_array_equal(mirrored[0], energy)
    np.testing.assert_array_equal(mirrored[1], -first)
    np.testing.assert_array_equal(mirrored[2], second)
