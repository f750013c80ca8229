"""Natural angles of hub hinges (13.13), as limbs are turned in the course of an interval."""

import numpy as np
import pytest

import oracle
from seastar_gym import Scene, Seastar, SmaPulse
from seastar_gym.der.rods import make_work
from seastar_gym.der.terms.hub import Actuation, set_natural_hub_angles
from seastar_gym.model.rods import make_rods
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simd.numpy_lanes import Lanes

BEGIN, END = np.random.default_rng(0).uniform(-0.3, 0.3, (2, 5, N_LANES))


def natural_curvatures(begin, end, fraction: float, hub_hinge: str = "opening") -> np.ndarray:
    """kappa_bar [1/m] of the hub hinges, shape (5, N_LANES)."""
    robot = Seastar(5, 4, hub_hinge=hub_hinge, discretisation="chapter")
    rods = make_rods(Scene(robot, actuator=SmaPulse(0.3)))
    work = make_work(rods, 1)
    set_natural_hub_angles.plain(rods, work, Actuation(begin, end), Lanes(fraction))
    return work.hub_EI_kappa_bar / oracle.Star(5, 4).EI


@pytest.mark.parametrize("hub_hinge", ["opening", "turning"])
@pytest.mark.parametrize("fraction", [0.0, 0.3, 1.0])
def test_natural_angles_follow_the_limbs_linearly_in_time(fraction, hub_hinge):
    star = oracle.Star(5, 4, hub_hinge=hub_hinge)
    found = natural_curvatures(BEGIN, END, fraction, hub_hinge)
    for lane in range(N_LANES):
        delta_psi = BEGIN[:, lane] + fraction * (END[:, lane] - BEGIN[:, lane])
        angles = oracle.natural_angles(star, delta_psi)[-5:]
        np.testing.assert_allclose(found[:, lane], 2.0 * np.tan(angles / 2.0) / star.edge_length, rtol=1e-12)


def test_limbs_that_turn_alike_change_nothing():
    still = np.zeros((5, N_LANES))
    np.testing.assert_allclose(
        natural_curvatures(still + 0.2, still + 0.2, 0.5), natural_curvatures(still, still, 0.5), rtol=1e-14
    )


def test_at_both_ends_of_an_interval_the_other_end_does_not_matter():
    np.testing.assert_array_equal(natural_curvatures(BEGIN, END, 0.0), natural_curvatures(BEGIN, 0.0 * END, 0.0))
