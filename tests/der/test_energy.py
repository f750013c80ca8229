"""Elastic and kinetic energy of a robot: at rest, in motion, turned, mirrored, loaded."""

import numpy as np
import pytest

import oracle
from hubs import HUBS
from seastar_gym import AlongLimb, Body, Limb, Scene, Seastar, SmaPulse, Stiffening
from seastar_gym.der.body.body import place_roots
from seastar_gym.der.energy import elastic_energy, energies, fill_moments
from seastar_gym.der.rods import make_work
from seastar_gym.der.terms.hub import Actuation, set_natural_hub_angles
from seastar_gym.der.terms.inertia import kinetic_energy
from seastar_gym.model.rods import make_rods
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simd.numpy_lanes import Lanes
from seastar_gym.simd.plain import plain_kernels
from slopes import gradient, plain, rotated, rows
from stages import random_shape, robot_and_star

ROBOT, STAR = robot_and_star(5, 4)
RNG = np.random.default_rng(0)
SHAPE = random_shape(STAR, 0.3, 0.05, RNG)
TURNS = RNG.uniform(-0.2, 0.2, 5)
EVERY_HUB = pytest.mark.parametrize("hub", HUBS)


def energy(q: np.ndarray, delta_psi=TURNS, hub: str = "rigid") -> float:
    """Elastic energy [J] with limbs turned by their actuators."""
    rods = make_rods(Scene(robot_and_star(5, 4, hub)[0], actuator=SmaPulse(0.2)))
    turns = np.tile(np.asarray(delta_psi)[:, None], N_LANES)
    work = make_work(rods, 1)
    set_natural_hub_angles.plain(rods, work, Actuation(turns, turns), Lanes(1.0))
    return float(plain(elastic_energy.plain(rods, work, rows(q)))[0])


@EVERY_HUB
def test_elastic_energy_is_that_of_the_oracle(hub):
    _, star = robot_and_star(5, 4, hub)
    assert energy(SHAPE, hub=hub) == pytest.approx(oracle.elastic_energy(star, SHAPE, TURNS), rel=1e-12)


@EVERY_HUB
def test_a_robot_at_rest_stores_nothing(hub):
    assert energy(STAR.rest, np.zeros(5), hub) < 1e-25


@EVERY_HUB
def test_where_a_robot_lies_and_how_it_is_turned_stores_nothing(hub):
    assert energy(rotated(SHAPE, 1.3) + [0.2, -0.5], hub=hub) == pytest.approx(energy(SHAPE, hub=hub), rel=1e-10)


@EVERY_HUB
def test_a_mirrored_robot_stores_the_same(hub):
    """Limbs 2 and 5, 3 and 4 change places, and turn the other way."""
    limbs = np.array([0, 4, 3, 2, 1])
    nodes = np.concatenate([[0], *(3 * limb + np.arange(1, 4) for limb in limbs)])
    mirrored = energy(SHAPE[nodes] * [1.0, -1.0], -TURNS[limbs], hub)
    assert mirrored == pytest.approx(energy(SHAPE, hub=hub), rel=1e-10)


@EVERY_HUB
def test_internal_forces_neither_push_nor_turn_the_robot(hub):
    force = gradient(lambda q: energy(q.reshape(-1, 2), hub=hub), SHAPE.ravel(), 1e-6).reshape(-1, 2)
    spin = SHAPE[:, 0] * force[:, 1] - SHAPE[:, 1] * force[:, 0]
    size = np.abs(force).max()
    np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-6 * size)
    assert abs(spin.sum()) < 1e-6 * size * 0.1


@EVERY_HUB
def test_kinetic_energy_is_that_of_the_oracle_of_the_velocities_that_a_frame_sees(hub):
    robot, star = robot_and_star(5, 4, hub)
    v, frame = RNG.standard_normal(SHAPE.shape), (0.3, -0.7)
    found = plain(kinetic_energy.plain(make_rods(Scene(robot)), rows(v), frame))[0]
    assert found == pytest.approx(oracle.kinetic_energy(star, v - frame), rel=1e-13)


ACTUATED = {
    "rigid hub": Seastar(3, 4),
    "limbs bent": Seastar(3, 4, limbs=tuple(Limb(natural_curvature=k) for k in (4.0, 0.0, -3.0))),
    "bent along": Seastar(3, 4, along=AlongLimb(0.7, (1.0, 3.0, 0.5))),
    "bent along and stiffer": Seastar(3, 4, along=AlongLimb(0.7), stiffening=Stiffening(2.5, 0.4, 0.1)),
    "stiffer only": Seastar(3, 4, stiffening=Stiffening(2.5, 0.4, 0.1)),
    "body": Seastar(3, 4, body=Body(radius=0.02)),
    "opening": Seastar(4, 4, hub_hinge="opening", discretisation="chapter"),
    "turning": Seastar(5, 4, hub_hinge="turning", discretisation="chapter"),
    "one hub hinge": Seastar(2, 4, hub_hinge="turning", discretisation="chapter"),
}  # fmt: skip


@pytest.mark.parametrize("name", ACTUATED)
def test_the_moment_that_resists_an_actuator_is_the_slope_of_the_energy_in_its_rotation(name):
    robot = ACTUATED[name]
    rods, rng = make_rods(Scene(robot, actuator=SmaPulse(0.3))), np.random.default_rng(0)
    q = rows(robot.nodes() + 2e-3 * rng.standard_normal((robot.n_nodes, 2)))
    if robot.has_body:
        q = np.vstack([q, np.full((1, N_LANES), 2e-3), np.zeros((1 + 2 * robot.n_limbs, N_LANES))])
        place_roots.plain(rods, q)
    work, turns = make_work(rods, 1), rng.uniform(-0.2, 0.2, robot.n_limbs)

    def actuation(turns):
        return Actuation(*(np.tile(turns[:, None], N_LANES) for _ in range(2)))

    def energy(turns):
        set_natural_hub_angles.plain(rods, work, actuation(turns), Lanes(0.0))
        return plain(elastic_energy.plain(rods, work, q))[0]

    moments = np.zeros((robot.n_limbs, N_LANES))
    fill_moments.plain(rods, work, actuation(turns), q, moments)
    np.testing.assert_allclose(moments[:, 0], gradient(energy, turns, 1e-3), rtol=1e-6)


def test_energies_of_a_state_are_those_of_its_shape_and_of_its_velocities_in_the_laboratory():
    rods, v = make_rods(Scene(ROBOT, actuator=SmaPulse(0.2))), RNG.standard_normal(SHAPE.shape)
    turns, (elastic, kinetic) = np.tile(TURNS[:, None], N_LANES), np.zeros((2, 1, N_LANES))
    actuation = Actuation(np.zeros_like(turns), turns)
    plain_kernels()(energies)(rods, make_work(rods, 1), actuation, rows(SHAPE), rows(v), elastic, kinetic)
    np.testing.assert_allclose(elastic, energy(SHAPE), rtol=1e-13)
    np.testing.assert_allclose(kinetic, oracle.kinetic_energy(STAR, v), rtol=1e-13)
