"""Material damping: stress and stiffness are derivatives of gamma R, and rigid motions are not damped."""

from dataclasses import replace

import numpy as np
import pytest

import oracle
from hubs import HUBS
from seastar_gym import Scene, SmaPulse
from seastar_gym.der.rods import make_work
from seastar_gym.der.terms.damping import damped_energy, damped_stiffness, damped_stress, freeze_strains
from seastar_gym.model.rods import make_rods
from seastar_gym.simd.numpy_lanes import Lanes
from slopes import NO_RODS, plain, rotated, rows, slope
from stages import random_shape, robot_and_star

TAU, GAMMA, EA, LENGTH = 4e-3, 0.01, 8.0, 0.03
RODS, HAT = NO_RODS._replace(damping=np.array([TAU])), np.array([[0.3]])
STRAINS = np.linspace(-0.2, 0.2, 9)


def parts(strain, natural: float = 0.0):
    """(energy with gamma R, stress) of an edge whose strain was HAT/EA when the stage began."""
    elastic = EA * (strain - natural)
    stress, kept = Lanes(elastic), Lanes(EA * natural)
    compliance, energy = Lanes(LENGTH / EA), Lanes(0.5 * LENGTH / EA * elastic**2)
    frozen = RODS, HAT, 0, Lanes(1.0 / GAMMA)
    return plain(
        (damped_energy.plain(*frozen, stress, kept, compliance, energy), damped_stress.plain(*frozen, stress, kept))
    )


@pytest.mark.parametrize("natural", [0.0, 0.05])
def test_stress_is_the_slope_of_the_energy_and_stiffness_that_of_the_stress(natural):
    stress = parts(STRAINS, natural)[1]
    np.testing.assert_allclose(stress * LENGTH, slope(lambda x: parts(x, natural)[0], STRAINS, 1e-3), atol=1e-10)
    stiffness = plain(damped_stiffness.plain(RODS, Lanes(1.0 / GAMMA), Lanes(EA)))
    np.testing.assert_allclose(stiffness, slope(lambda x: parts(x, natural)[1], STRAINS, 1e-3), rtol=1e-9)


def test_stress_is_that_of_kelvin_and_voigt():
    rate = (STRAINS - HAT[0, 0] / EA) / GAMMA
    np.testing.assert_allclose(parts(STRAINS)[1], EA * (STRAINS + TAU * rate), rtol=1e-12)


def test_a_strain_that_stays_is_not_damped_wherever_the_natural_one_goes():
    for natural in (0.0, 0.05):
        energy, stress = parts(HAT[0] / EA, natural)
        np.testing.assert_allclose(stress, HAT[0] - EA * natural, rtol=1e-13)
        np.testing.assert_allclose(energy, 0.5 * LENGTH / EA * stress**2, rtol=1e-12)


def test_without_damping_everything_stays_what_it_is():
    one = Lanes(1.0)
    assert damped_stress.plain(NO_RODS, None, 0, one, one, one) is one
    assert damped_energy.plain(NO_RODS, None, 0, one, one, one, one, one) is one
    assert damped_stiffness.plain(NO_RODS, one, one) is one


@pytest.mark.parametrize("hub", HUBS)
def test_strains_are_the_same_after_a_rigid_motion_and_those_of_the_oracle(hub):
    robot, star = robot_and_star(3, 4, hub)
    rods = make_rods(Scene(replace(robot, relaxation_time=TAU), actuator=SmaPulse(0.1)))
    hinges = np.ones(9, bool)
    hinges[::3] = hub != "rigid"  # clamps keep directions, see clamp.py
    q = random_shape(star, 0.3, 0.02, np.random.default_rng(4))
    found = []
    for nodes in (q, rotated(q, 0.8) + [0.2, -0.1]):
        work = make_work(rods, 1)
        freeze_strains.plain(rods, work, rows(nodes))
        found.append(np.concatenate([work.tension, work.bending[hinges]])[:, 0])
    np.testing.assert_allclose(found[1], found[0], rtol=1e-9, atol=1e-9)
    strains = [strain for _, strain, _, _ in oracle.strains(star, q)]
    np.testing.assert_allclose(work.tension[:, 0], star.EA * np.array(strains[:9]), rtol=1e-9)
    np.testing.assert_allclose(np.sort(work.bending[hinges, 0]), star.EI * np.sort(strains[9:]), rtol=1e-9)
