"""Actuators that act along limbs: natural curvature, stiffness, and the energy that moving them stores."""

import numpy as np
import pytest

import oracle
from along_oracle import Bent
from seastar_gym import AlongLimb, Limb, Scene, Seastar, SmaPulse, Stiffening
from seastar_gym.lanes.plain import Lanes
from seastar_gym.lanes.registers import N_LANES
from seastar_gym.model import make_rods
from seastar_gym.rods.bundles import make_work
from seastar_gym.rods.terms.along import add_moved_energy, hyperbolic_tangent
from seastar_gym.rods.terms.hub import Actuation, set_natural_hub_angles
from slopes import plain

PEAK, RATIO, CURVATURES = 1.1, 2.5, (4.0, 0.0, -3.0)
PROFILE = (1.0, 3.0, 0.5)
ROBOT = Seastar(
    3, 5, limbs=tuple(Limb(natural_curvature=k) for k in CURVATURES),
    along=AlongLimb(0.8, PROFILE), stiffening=Stiffening(RATIO, 0.4, 0.1),
)  # fmt: skip
RODS = make_rods(Scene(ROBOT, actuator=SmaPulse(PEAK)))
STAR = Bent(
    3, 5, directions=(0.0, 2.0 * np.pi / 3.0, 4.0 * np.pi / 3.0), lengths=(0.1,) * 3, radii=((1.6e-3,) * 2,) * 3,
    moduli=((1e6,) * 2,) * 3, curvatures=CURVATURES, share=0.8, ratio=RATIO, middle=0.4, width=0.1, peak=PEAK,
    profile=lambda s: np.interp(s, (0.0, 0.5, 1.0), PROFILE),
)  # fmt: skip
BEGIN, END = np.array([0.2, -1.0, 0.0]), np.array([0.9, -0.4, 0.5])


def actuation(begin: np.ndarray, end: np.ndarray) -> Actuation:
    return Actuation(*(np.tile(turns[:, None], N_LANES) for turns in (begin, end)))


def memory(turns: np.ndarray):
    work = make_work(RODS, 1)
    set_natural_hub_angles(RODS, work, actuation(0.0 * turns, turns), Lanes(1.0))
    return work


# Logistic stiffening


def test_the_hyperbolic_tangent_is_numpys():
    x = np.concatenate([np.linspace(-25.0, 25.0, 2001), [0.0, 1e-9, -1e-9]])
    np.testing.assert_allclose(plain(hyperbolic_tangent(Lanes(x))), np.tanh(x), rtol=2e-15, atol=0.0)


# Profiles


@pytest.mark.parametrize("profile", [1.0, (1.0, 0.0), PROFILE, (0.0, 1.0, 2.0, 1.0, 0.0, -0.2), (1.0, *(0.0,) * 9)])
@pytest.mark.parametrize("nodes", [2, 5, 11])
def test_hinges_turn_by_the_hat_functions_of_the_profile(profile, nodes):
    points = profile if isinstance(profile, tuple) else (profile, profile)
    star = Bent(1, nodes, share=0.6, profile=lambda s: np.interp(s, np.linspace(0.0, 1.0, len(points)), points))
    found = AlongLimb(0.6, profile).hinge_shares(nodes)
    np.testing.assert_allclose(found, star.shares, rtol=0.0, atol=1e-9)


# Energy


def test_what_moving_natural_curvature_stores_is_the_energy_of_the_hinges_left_behind():
    work = memory(0.0 * END)
    moved = plain(add_moved_energy(RODS, work, actuation(BEGIN, END), Lanes(0.0), Lanes(1.0), 0.0))
    begin, end = STAR.at(BEGIN), STAR.at(END)
    expected = sum(
        0.5 * max(f) / f[1] * EI * dl * (oracle.curvature(b, dl) - oracle.curvature(a, dl)) ** 2
        for a, b, EI, dl, f in zip(
            begin.inner_angles, end.inner_angles, end.hinge_EI, end.hinge_dl,
            np.repeat(np.stack([begin.factors, end.factors], axis=1), 3, axis=0), strict=True,
        )
    )  # fmt: skip
    np.testing.assert_allclose(moved, expected, rtol=1e-9)
    np.testing.assert_allclose(work.EI_kappa_bar, memory(END).EI_kappa_bar, rtol=1e-14)
