"""A robot some of whose limbs press each other, for kernels in plain Python."""

from types import SimpleNamespace

import numpy as np

from oracle import Star
from seastar_gym import Contact, Scene, Seastar, SmaPulse
from seastar_gym.lanes.plain import Lanes
from seastar_gym.lanes.registers import N_LANES
from seastar_gym.model import make_rods
from seastar_gym.rods.bundles import make_work
from seastar_gym.rods.contact.pairs import freeze_contact
from seastar_gym.rods.step import Stage
from seastar_gym.rods.terms.hub import Actuation, set_natural_hub_angles
from seastar_gym.scene.robot import Discretisation
from slopes import rotated, rows

GAMMA = 2e-4


def touching_limbs(discretisation: Discretisation = "continuum") -> SimpleNamespace:
    """Limbs 1 and 2 of five lie along each other."""
    robot, star = Seastar(5, 4, discretisation=discretisation), Star(5, 4)
    rods = make_rods(Scene(robot, actuator=SmaPulse(0.1), contact=Contact()))
    q_0, rng = np.tile(star.rest, (N_LANES, 1, 1)), np.random.default_rng(0)
    q = q_0.copy()
    for limb, turn in ((0, 0.62), (1, -0.62)):
        own = slice(3 * limb + 1, 3 * limb + 4)
        q[:, own] = rotated(q[:, own], turn)
    q += 2e-4 * rng.standard_normal(q.shape)
    work = make_work(rods, 1)
    work.q[:], work.q_hat[:], work.v_hat[:] = rows(q), rows(q - 1e-4), 0.1 * rng.standard_normal(work.q.shape)
    still = np.zeros((5, N_LANES))
    set_natural_hub_angles(rods, work, Actuation(still, still), Lanes(1.0))
    stage = Stage(work.q_hat, work.v_hat, Lanes(GAMMA), Lanes(1.0 / GAMMA), False)
    freeze_contact(rods, work, stage, rows(q_0))
    return SimpleNamespace(rods=rods, work=work, stage=stage, q_0=rows(q_0))
