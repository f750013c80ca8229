"""Elastic and kinetic energy of a robot: at rest, in motion, turned, mirrored, loaded."""

import numpy as np
import pytest

import oracle
from hubs import HUBS, TEN
from seastar_gym import AlongLimb, Body, Limb, Scene, Seastar, SmaPulse, Stiffening
from seastar_gym.der.body.body import place_roots
from seastar_gym.der.energy import elastic_energy, energies, fill_moments
from seastar_gym.der.potential import factorise
from seastar_gym.der.rods import make_work
from seastar_gym.der.stepping.momentum import LOST, correct_momentum, move_as_a_whole
from seastar_gym.der.stepping.newton import take_step
from seastar_gym.der.stepping.schemes import SCHEMES
from seastar_gym.der.stepping.stages import Stage
from seastar_gym.der.terms.hub import Actuation, set_natural_hub_angles
from seastar_gym.der.terms.inertia import kinetic_energy
from seastar_gym.model.rods import make_rods
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simd.numpy_lanes import Lanes, Mask
from seastar_gym.simd.plain import plain_kernels
from slopes import gradient, nodes, plain, rotated, rows
from stages import RandomStages, random_shape, robot_and_star, rods_of, turn_limbs
from touching import touching_limbs

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


# The whole robot's own Newton step: it balances the momentum, and moves nobody who was not asked for.


GAMMA = 5e-3


def pushed(star, q: np.ndarray, q_hat: np.ndarray, v_hat: np.ndarray, gamma: float) -> np.ndarray:
    """What inertia and drag leave unbalanced of the whole robot [N]."""
    v = (q - q_hat) / gamma
    return star.masses @ (v - v_hat) / gamma - oracle.drag_force(star, v).sum(axis=0)


def moved(hub: str, fluid: bool, robots: np.ndarray, times: int = 1):
    """(unbalanced forces before and after [N], positions before and after)."""
    robot, star = robot_and_star(5, 4, hub, fluid)
    rods, rng = rods_of(robot, fluid), np.random.default_rng(0)
    work = make_work(rods, 1)
    work.q[:], work.v_hat[:] = 1e-3 * rng.standard_normal((2, *work.q.shape))
    stage = Stage(work.q_hat, work.v_hat, Lanes(GAMMA), Lanes(1.0 / GAMMA), False)

    def unbalanced() -> np.ndarray:
        states = zip(nodes(work.q), nodes(work.q_hat), nodes(work.v_hat), strict=True)
        return np.array([np.hypot(*pushed(star, *state, GAMMA)) for state in states])

    before, q = unbalanced(), nodes(work.q)
    for _ in range(times):
        move_as_a_whole.plain(rods, work, SCHEMES["implicit-euler"], 0, stage, Mask(robots))
    return before, unbalanced(), q, nodes(work.q)


EVERYONE = np.ones(N_LANES, bool)


@pytest.mark.parametrize("hub", HUBS[:2])
@pytest.mark.parametrize("fluid, times, left", [(False, 1, 1e-13), (True, 1, 0.2), (True, 5, 1e-9)])
def test_in_vacuum_one_move_balances_the_momentum_and_in_a_fluid_moves_are_those_of_newtons_method(
    fluid, times, left, hub
):
    before, after, _, _ = moved(hub, fluid, EVERYONE, times)
    assert np.all(after < left * before)


def test_all_nodes_of_the_chosen_robots_move_alike_and_nobody_else_does():
    chosen = np.arange(N_LANES) % 2 == 0
    _, _, before, after = moved("rigid", True, chosen)
    np.testing.assert_array_equal(after[~chosen], before[~chosen])
    moves = (after - before)[chosen]
    assert np.all(np.linalg.norm(moves[:, 0], axis=1) > 0.0)
    np.testing.assert_allclose(moves, np.broadcast_to(moves[:, :1], moves.shape), rtol=1e-9, atol=1e-15)


def settled(fluid: bool, gamma: float = GAMMA):
    """(star, stages, positions before and after) with the last robot not asked for."""
    robot, star = robot_and_star(5, 4, fluid=fluid)
    scene = Scene(robot, actuator=SmaPulse(0.1)) if fluid else Scene(robot, None, SmaPulse(0.1))
    rods, stages = make_rods(scene), RandomStages(star, gamma, bend=0.05)
    work = make_work(rods, 1)
    work.q[:], work.q_hat[:], work.v_hat[:] = rows(stages.q), rows(stages.q_hat), rows(stages.v_hat)
    stage = Stage(work.q_hat, work.v_hat, Lanes(gamma), Lanes(1.0 / gamma), False)
    robots = Mask(np.arange(N_LANES) < N_LANES - 1)
    correct_momentum.plain(rods, work, SCHEMES["implicit-euler"], 0, stage, work.q_hat, work.v_hat, gamma, robots)
    return star, stages, nodes(work.q)


def test_in_vacuum_one_step_balances_the_momentum_and_bends_no_limb():
    star, stages, q = settled(fluid=False)
    moves = q - stages.q
    np.testing.assert_array_equal(moves[-1], 0.0)
    np.testing.assert_allclose(moves, np.broadcast_to(moves[:, :1], moves.shape), rtol=0.0, atol=1e-16)
    for lane in range(N_LANES - 1):
        change = (q[lane] - stages.q_hat[lane]) / GAMMA - stages.v_hat[lane]
        assert np.abs(star.masses @ change).max() < 1e-13 * star.masses.sum()
        assert np.abs(oracle.incremental_gradient(star, q[lane], *stages.data(lane)).sum(axis=0)).max() < 1e-10


def test_in_a_fluid_steps_that_leave_digits_enough_stay_what_they_are():
    rate = float(make_rods(Scene(TEN)).scales.stiffness_ratio[0])
    assert rate * GAMMA**2 < LOST
    _, stages, q = settled(fluid=True)
    np.testing.assert_array_equal(q, stages.q)
    gamma = 1.1 * np.sqrt(LOST / float(make_rods(Scene(robot_and_star(5, 4)[0])).scales.stiffness_ratio[0]))
    star, stages, q = settled(fluid=True, gamma=gamma)
    for lane in range(N_LANES - 1):
        before, after = (
            np.abs(oracle.incremental_gradient(star, x[lane], *stages.data(lane)).sum(axis=0)).max()
            for x in (stages.q, q)
        )
        assert after < before


def test_what_contact_pushed_when_it_was_last_asked_moves_no_robot_as_a_whole():
    """As long as others in the lanes go on, contact is asked again where a robot has arrived already."""
    found = []
    for force in (0.0, 1.0):
        limbs = touching_limbs()
        limbs.work.contact.force[:] = force * np.random.default_rng(1).standard_normal(limbs.work.q.shape)
        move_as_a_whole.plain(limbs.rods, limbs.work, SCHEMES["implicit-euler"], 0, limbs.stage, Mask(EVERYONE))
        found.append(limbs.work.q.copy())
    np.testing.assert_array_equal(*found)


def test_where_momentum_begins_to_be_settled_in_a_fluid_rounding_is_some_1e_10_of_a_newton_step():
    """Measured with limbs of three edges and in vacuum, where nothing else is left of the momentum."""
    robot, star = robot_and_star(5, 4, fluid=False)
    rods, rate = rods_of(robot, fluid=False), float(rods_of(robot).scales.stiffness_ratio[0])
    gamma = np.sqrt(LOST / rate)
    stages, work = RandomStages(star, gamma, bend=1e-3, stretch=1e-6, speed=1e-3), make_work(rods, 1)
    work.q[:], work.q_hat[:] = rows(stages.q), rows(stages.q_hat)
    turn_limbs(work, star, stages.delta_psi)
    stage = Stage(work.q_hat, work.v_hat, Lanes(gamma), Lanes(1.0 / gamma), False)
    factorise.plain(rods, work, stage, None)
    move = plain(take_step.plain(rods, work, Mask(EVERYONE), None, Lanes(0.0)))
    states = zip(nodes(work.q), nodes(work.q_hat), nodes(work.v_hat), strict=True)
    forces = np.array([np.hypot(*pushed(star, *state, gamma)) for state in states])
    shift = forces * gamma**2 / rods.mass.sum()
    assert 3e-11 < (shift / move).max() < 1e-9
