"""When the last Newton step is left out: every condition alone."""

from types import SimpleNamespace

import numpy as np
import pytest

from hubs import TEN
from seastar_gym import Scene, Seastar
from seastar_gym.der.rods import make_work
from seastar_gym.der.stepping.scales import PREDICTABLE_STRAIN, SLENDER
from seastar_gym.der.stepping.skip_last import (
    CURVATURE,
    EASY,
    FORESEEABLE_T,
    LATE,
    can_skip,
    largest_hub_t,
    quadratic_length,
)
from seastar_gym.model.rods import make_rods
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simd.numpy_lanes import Lanes
from slopes import plain
from touching import touching_limbs

ROBOT = TEN
RODS = make_rods(Scene(ROBOT))
EDGE = ROBOT.limb_length / 9
WORK = make_work(RODS, 1)
ENERGY = PREDICTABLE_STRAIN * ROBOT.youngs_modulus * np.pi * ROBOT.rod_radius**2 * 5 * ROBOT.limb_length
"""Joule: the strain energy up to which steps are predictable."""


def foreseen(iterations=1.0, setbacks=0.0, phi=0.0, move=0.99e-5, tolerated=1e-10, t=1.0):
    """Whether the next step is left out, of one robot in all lanes, the last hub hinge of which has this t."""
    WORK.hub_t[:] = 0.5
    WORK.hub_t[-1] = t
    numbers = map(Lanes, (iterations, setbacks, phi, move, tolerated))
    mask = plain(can_skip.plain(RODS, WORK, *numbers))
    assert mask.all() == mask.any()
    return bool(mask.all())


@pytest.mark.parametrize(
    "inside, outside",
    [
        ({}, {"move": 1.01e-5}),
        ({"iterations": EASY, "move": 0.99e-5 / np.sqrt(LATE)}, {"iterations": EASY, "move": 1.01e-5 / np.sqrt(LATE)}),
        ({"iterations": EASY - 1.0}, {"iterations": EASY + 1.0, "move": 1e-9}),
        ({"setbacks": 0.0}, {"setbacks": 1.0}),
        ({"phi": 0.99 * ENERGY}, {"phi": 1.01 * ENERGY}),
        ({"t": 0.99 * FORESEEABLE_T}, {"t": FORESEEABLE_T}),
        ({}, {"move": np.nan}),
        ({}, {"phi": np.nan}),
    ],
)
def test_a_step_is_left_out_up_to_every_threshold_and_not_beyond(inside, outside):
    assert foreseen(**inside) and not foreseen(**outside)


def test_limbs_that_touch_are_not_predictable():
    touching = touching_limbs(apart=3)
    touching.work.contact.touching[0] = np.arange(N_LANES) >= 3
    numbers = map(Lanes, (1.0, 0.0, 0.0, 1e-9, 1.0))
    mask = plain(can_skip.plain(touching.rods, touching.work, *numbers))
    np.testing.assert_array_equal(mask, np.arange(N_LANES) < 3)


def length(gamma: float, **robot: float) -> float:
    rods = make_rods(Scene(Seastar(nodes_per_limb=10, **robot)))
    return float(np.max(plain(quadratic_length.plain(rods, SimpleNamespace(gamma=Lanes(gamma))))))


def test_the_foreseeable_length_of_light_edges_is_a_fraction_of_the_shortest():
    assert length(1e-9) == pytest.approx(EDGE / CURVATURE)
    assert length(1e-9, limb_length=0.2) == pytest.approx(2.0 * EDGE / CURVATURE)


@pytest.mark.parametrize("radius, share", [(1e-5, 1.0), (1e-3, (EDGE / 1e-3) ** 2 / SLENDER)])
def test_the_foreseeable_length_shrinks_with_the_square_of_the_step_the_less_the_thicker_edges_are(radius, share):
    gamma = 0.1
    rate = share * ROBOT.youngs_modulus / ROBOT.density / EDGE**2
    assert length(gamma, rod_radius=radius) == pytest.approx(EDGE / (CURVATURE + rate * gamma**2))


def test_the_largest_hub_t_is_found_whichever_hinge_has_it():
    work = make_work(RODS, 1)
    work.hub_t[:] = np.random.default_rng(0).standard_normal(work.hub_t.shape)
    np.testing.assert_array_equal(plain(largest_hub_t.plain(RODS, work)), work.hub_t.max(axis=0))
