"""Stretching (13.2): energy, tension and stiffness of an edge."""

import numpy as np

from seastar_gym import Scene, Seastar
from seastar_gym.der.terms.stretching import stretching_energy, tension
from seastar_gym.model.rods import make_rods
from seastar_gym.simd.numpy_lanes import Lanes
from slopes import plain, slope

ROBOT = Seastar(nodes_per_limb=4)
RODS = make_rods(Scene(ROBOT))
LENGTHS = ROBOT.edge_length * np.linspace(0.5, 1.5, 11)
EA = ROBOT.youngs_modulus * np.pi * ROBOT.rod_radius**2


def pull(length):
    return plain(tension.plain(RODS, 1, Lanes(length)))


def energy(length):
    return plain(stretching_energy.plain(RODS, 1, Lanes(pull(length))))


def test_energy_is_that_of_the_chapter():
    np.testing.assert_allclose(
        energy(LENGTHS), 0.5 * EA * (LENGTHS / ROBOT.edge_length - 1.0) ** 2 * ROBOT.edge_length, rtol=1e-9, atol=1e-18
    )


def test_tension_is_the_slope_of_the_energy_and_stiffness_that_of_the_tension():
    np.testing.assert_allclose(pull(LENGTHS), slope(energy, LENGTHS, 1e-3), rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(RODS.stretching.EA_over_l[1], slope(pull, LENGTHS, 1e-3), rtol=1e-9)


def test_an_edge_of_its_natural_length_neither_pulls_nor_stores():
    assert abs(pull(ROBOT.edge_length)) < 1e-14 and energy(ROBOT.edge_length) < 1e-28


def test_the_longer_of_two_edges_pulls_more():
    assert np.all(np.diff(pull(LENGTHS)) > 0.0)
