"""The guard's parts: cuts keep the momenta; hinges that go through their poles are seen."""

from types import SimpleNamespace

import numpy as np
import pytest

import oracle
from continuum_oracle import Continuum
from currents import CURRENTS, velocity
from hubs import TEN
from oracle import Star
from seastar_gym import Scene, SmaPulse, Water
from seastar_gym.lanes.plain import Lanes, Mask
from seastar_gym.lanes.registers import N_LANES
from seastar_gym.model import make_rods
from seastar_gym.rods.bundles import make_work
from seastar_gym.rods.guard import (
    LARGEST_CUT,
    come_to_rest,
    hold_to_energy,
    restore,
    rigid_motion,
    save,
    through_poles,
)
from seastar_gym.rods.step import SCHEMES
from seastar_gym.rods.terms.fluid import freeze_fluid
from slopes import nodes, plain, rotated, rows
from stages import EVERYONE, robot_and_star, turn_limbs

STAR = Continuum()
RODS = make_rods(Scene(TEN, actuator=SmaPulse(0.5)))


TERMS = {"tangential_drag_coefficient": 0.2, "added_mass_coefficient": 0.7}
STREAM = Continuum(**TERMS, current=lambda places: velocity("vortex", places))
STREAM_RODS = make_rods(Scene(TEN, Water(current=CURRENTS["vortex"], **TERMS), SmaPulse(0.5)))
FRAME = np.random.default_rng(6).uniform(-1.0, 1.0, (2, N_LANES))
"""Velocity that every lane is seen from [m/s]."""
SEEN_FROM = Lanes(FRAME[0]), Lanes(FRAME[1])


def moving_robots(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Bent robots away from the origin that fly, spin and ring: (q, v), shape (N_LANES, n_nodes, 2)."""
    rng = np.random.default_rng(seed)
    shape = (N_LANES, STAR.n_nodes, 2)
    q = STAR.rest + 1e-3 * rng.standard_normal(shape) + 0.3
    return q, 0.2 * rng.standard_normal(shape) + [0.5, -0.2] + 2.0 * (q - 0.3) @ [[0.0, 1.0], [-1.0, 0.0]]


def inertia(star: Star, lane_q: np.ndarray) -> np.ndarray:
    """Mass matrix of robot and fluid carried along, shape (n_nodes, 2, n_nodes, 2)."""
    return oracle.mass_matrix(star, lane_q).reshape(star.n_nodes, 2, star.n_nodes, 2)


def held(share: float, largest_cut: float = LARGEST_CUT, robots: Mask = EVERYONE, star: Star = STAR) -> SimpleNamespace:
    """Robots held to their potential energy, that of their rigid motion, and `share` of the rest, seen from FRAME."""
    q, v = moving_robots()
    rods = RODS if star is STAR else STREAM_RODS
    state, work = (rows(q), rows(v)), make_work(rods, 1)
    turn_limbs(rods, work, np.zeros(5))
    work.q[:] = state[0]
    freeze_fluid(rods, work)

    def kinetic_energies(velocities: np.ndarray) -> np.ndarray:
        seen = velocities - FRAME.T[:, None]
        each = zip(q, seen, strict=True)
        return np.array([0.5 * np.einsum("nd,ndme,me", one, inertia(star, at), one) for at, one in each])

    rigid, kinetic = plain(rigid_motion(rods, work, *state, SEEN_FROM)[5]), kinetic_energies(v)
    potential = np.array([oracle.elastic_energy(STAR, one, np.zeros(5)) for one in q])
    allowed = rigid + share * (kinetic - rigid)
    args = rods, work, SCHEMES["implicit-midpoint"], *state, Lanes(0.01), SEEN_FROM, robots, Lanes(potential + allowed)
    refused, cut = plain(hold_to_energy(*args, Lanes(largest_cut)))
    np.testing.assert_array_equal(nodes(state[0]), q)
    after = nodes(state[1])
    return SimpleNamespace(
        q=q, v=v, after=after, rigid=rigid, refused=refused, cut=cut, allowed=allowed, kinetic=kinetic_energies(after)
    )  # fmt: skip


def rigid_motions(q: np.ndarray) -> np.ndarray:
    """Along x, along y, and about the centre of mass, shape (3, n_nodes, 2)."""
    r = q - STAR.masses @ q / STAR.masses.sum()
    motions = np.zeros((3, *q.shape))
    motions[0, :, 0], motions[1, :, 1], motions[2] = 1.0, 1.0, np.stack([-r[:, 1], r[:, 0]], axis=1)
    return motions


STARS = pytest.mark.parametrize("star", [STAR, STREAM], ids=["alone", "with added mass"])


# Cuts


@STARS
@pytest.mark.parametrize("share, largest_cut", [(0.995, LARGEST_CUT), (0.2, 1.0)])
def test_a_small_excess_or_any_at_the_last_halving_is_cut_and_the_momenta_stay(star, share, largest_cut):
    """Those of the robot and of fluid that moves along; robots that are not held keep their bits."""
    chosen = np.arange(N_LANES) % 2 == 1
    found = held(share, largest_cut, Mask(chosen), star)
    np.testing.assert_array_equal(found.cut, chosen)
    np.testing.assert_array_equal(found.after[~chosen], found.v[~chosen])
    assert not found.refused.any()
    np.testing.assert_allclose(found.kinetic[chosen], found.allowed[chosen], rtol=1e-9)
    for q, v, cut in zip(found.q, found.v, found.after, strict=True):
        carried = np.einsum("and,ndme->ame", rigid_motions(q), inertia(star, q)).reshape(3, -1)
        np.testing.assert_allclose(carried @ cut.ravel(), carried @ v.ravel(), rtol=1e-12)
    assert np.abs(found.after - found.v)[chosen].max() > 1e-4


@STARS
def test_a_robot_that_comes_to_rest_keeps_its_momenta_and_the_energy_of_its_rigid_motion(star):
    """Robots that are not asked keep their bits, and so does one in a point, which has no rigid motion."""
    q, v = moving_robots()
    chosen, in_a_point = np.arange(N_LANES) % 2 == 1, 1
    q[in_a_point] = 0.25
    rods, state = RODS if star is STAR else STREAM_RODS, (rows(q), rows(v))
    work = make_work(rods, 1)
    work.q[:] = state[0]
    freeze_fluid(rods, work)
    rests = chosen & (np.arange(N_LANES) != in_a_point)
    np.testing.assert_array_equal(plain(come_to_rest(rods, work, *state, Mask(chosen))), rests)
    after = nodes(state[1])
    np.testing.assert_array_equal(after[~rests], v[~rests])
    for at, before, rest in zip(q[rests], v[rests], after[rests], strict=True):
        rigid, mass = rigid_motions(at), inertia(star, at).reshape(before.size, before.size)
        carried = rigid.reshape(3, -1) @ mass
        np.testing.assert_allclose(carried @ rest.ravel(), carried @ before.ravel(), rtol=1e-12)
        assert np.linalg.matrix_rank([*rigid.reshape(3, -1), rest.ravel()], tol=1e-9) == 3


# Poles


def turned_about(q: np.ndarray, node: int, nodes: slice, angle: float) -> np.ndarray:
    """The robot with some nodes turned about another one by an angle [rad]."""
    result = np.array(q)
    result[nodes] = q[node] + rotated(q[nodes] - q[node], angle)
    return result


TIP, LIMB = (3, slice(4, 10)), (0, slice(1, 10))
"""What turns about which node: the end of limb 1 about a hinge within it, and limb 1 about the hub."""
TURNS = [
    ("rigid", TIP, 0, 170, False),
    ("rigid", TIP, -60, -170, False),
    ("rigid", TIP, 160, 200, True),
    ("rigid", TIP, 60, 190, True),
    ("rigid", TIP, -60, -200, True),
    ("rigid", LIMB, 60, 200, False),  # a clamp has no pole
    ("opening", TIP, 0, 170, False),
    ("opening", TIP, 160, 170, False),
    ("opening", TIP, 160, 200, True),
    ("opening", TIP, -160, -200, True),
    ("opening", LIMB, 0, 100, False),  # from 72 degrees, on either side of limb 1
    ("opening", LIMB, 60, 80, False),
    ("opening", LIMB, 100, 120, True),
    ("turning", LIMB, 50, 70, False),
    ("turning", LIMB, 50, 80, True),
    ("turning", LIMB, -60, -90, True),
]


@pytest.mark.parametrize("scheme", ["implicit-euler", "sdirk2"])
@pytest.mark.parametrize("hub, part, before, after, through", TURNS)
def test_a_hinge_that_turned_through_its_pole_is_seen_and_the_robot_put_back(hub, part, before, after, through, scheme):
    """The last lane holds a robot that nobody asks about."""
    rods, tableau = make_rods(Scene(robot_and_star(hub=hub)[0], actuator=SmaPulse(0.5))), SCHEMES[scheme]
    q, q_1 = (turned_about(STAR.rest, *part, np.radians(angle)) for angle in (before, after))
    v = np.ones((N_LANES, STAR.n_nodes, 2))
    q_rows, v_rows, asked = rows(q), rows(v), np.arange(N_LANES) < N_LANES - 1
    work = make_work(rods, tableau.n_stages)
    save(rods, work, tableau, q_rows, v_rows)
    q_rows[:], v_rows[:] = rows(q_1), 0.0
    found = through_poles(rods, work, q_rows, Mask(asked))
    restore(rods, work, tableau, q_rows, v_rows, found)
    np.testing.assert_array_equal(plain(found), asked & through)
    back = (asked & through)[:, None, None]
    np.testing.assert_array_equal(nodes(q_rows), np.where(back, q, q_1))
    np.testing.assert_array_equal(nodes(v_rows), np.where(back, v, 0.0))
