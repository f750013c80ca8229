"""The rigid hub of the continuum: its energy has the slopes and the Hessian that Newton's method takes for it."""

from dataclasses import replace

import numpy as np
import pytest

from seastar_gym import AlongLimb, Limb, Scene, Seastar, SmaPulse, Stiffening, Water
from seastar_gym.der.linear.star_solution import solve_again, substitute_star
from seastar_gym.der.potential import factorise
from seastar_gym.der.rods import Rods, Work, make_work
from seastar_gym.der.stepping.stages import Stage
from seastar_gym.der.terms.clamp import ELASTIC, add_clamps, clamp_energy, moved_clamp_energy, orientation
from seastar_gym.der.terms.damping import freeze_strains
from seastar_gym.der.terms.fluid import freeze_fluid
from seastar_gym.der.terms.hub import Actuation, set_natural_hub_angles
from seastar_gym.model.rods import make_rods
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simd.numpy_lanes import Lanes
from slopes import hessian, plain, rows

GAMMA = 1e-3
ROBOT = Seastar(3, 4, limbs=(Limb(radius=(2e-3, 1e-3)), Limb(length=0.08), Limb()), discretisation="continuum")
RODS = make_rods(Scene(ROBOT))
RNG = np.random.default_rng(0)
SHAPE = ROBOT.nodes() + 1e-4 * RNG.standard_normal((ROBOT.n_nodes, 2))
TURNS = np.tile([[0.3], [-0.5], [0.1]], N_LANES)


def memory(turns: np.ndarray = TURNS):
    work = make_work(RODS, 1)
    set_natural_hub_angles.plain(RODS, work, Actuation(0.0 * turns, turns), Lanes(1.0))
    return work


SCENES = {
    "plain": Scene(ROBOT),
    "damping": Scene(replace(ROBOT, relaxation_time=2e-3)),
    "damping that is none": Scene(replace(ROBOT, relaxation_time=0.0)),
    "drag along limbs": Scene(ROBOT, Water(tangential_drag_coefficient=0.1)),
    "added mass": Scene(ROBOT, Water(added_mass_coefficient=1.0)),
    "curved limbs, everything": Scene(
        replace(ROBOT, limbs=(Limb(natural_curvature=5.0), Limb(length=0.08), Limb()), relaxation_time=1e-3),
        Water(tangential_drag_coefficient=0.1, added_mass_coefficient=0.7),
    ),
    "bent along, stiff when hot": Scene(
        replace(ROBOT, along=AlongLimb(0.7, (1.0, 2.0, 0.5)), stiffening=Stiffening(2.0), relaxation_time=1e-3),
        actuator=SmaPulse(0.5),
    ),
    "one limb": Scene(Seastar(1, 4, discretisation="continuum"), actuator=SmaPulse(0.0)),
    "two limbs": Scene(Seastar(2, 3, discretisation="continuum"), Water(added_mass_coefficient=0.7)),
}


def eliminated(rods: Rods, q: np.ndarray, start: np.ndarray, v_hat: np.ndarray) -> tuple[Work, tuple]:
    """Memory and (Phi, Newton decrement, pivot) of a stage at q that began at `start`, where its fluid is frozen.

    q: Nodes of one robot, or of N_LANES.
    """
    work = make_work(rods, 1)
    work = work._replace(pivots=0.0 * work.q, root_pivots=np.zeros((2 * rods.n_limbs + 2, N_LANES)))
    turns = TURNS[: rods.n_limbs]
    set_natural_hub_angles.plain(rods, work, Actuation(0.0 * turns, turns), Lanes(1.0))
    work.q[:], work.q_hat[:], work.v_hat[:] = rows(start), rows(start), rows(v_hat)
    stage = Stage(work.q_hat, work.v_hat, Lanes(GAMMA), Lanes(1.0 / GAMMA), False)
    freeze_fluid.plain(rods, work)
    freeze_strains.plain(rods, work, work.q_hat)
    work.q[:] = rows(q)
    return work, plain(factorise.plain(rods, work, stage, None))


def potentials(rods: Rods, shapes: np.ndarray, start: np.ndarray, v_hat: np.ndarray) -> np.ndarray:
    """Phi [J] of many shapes, see `eliminated`."""
    groups = np.resize(shapes, (-(-len(shapes) // N_LANES), N_LANES, *start.shape))
    found = [eliminated(rods, group, start, v_hat)[1] for group in groups]
    assert all((pivot > 0.0).all() for _, _, pivot in found)
    return np.concatenate([phi for phi, *_ in found])[: len(shapes)]


def slopes(rods: Rods, shape: np.ndarray, start: np.ndarray, v_hat: np.ndarray, step: float) -> np.ndarray:
    """Derivatives of Phi in all entries of a shape."""
    moves = step * np.eye(shape.size).reshape(-1, *shape.shape)
    ahead, behind = (potentials(rods, shape + sign * moves, start, v_hat) for sign in (1.0, -1.0))
    return (ahead - behind) / (2.0 * step)


@pytest.mark.parametrize("name", SCENES)
def test_the_newton_decrement_is_that_of_the_differences_of_the_potential(name):
    """One number that every part of gradient, Hessian and elimination goes into: g H^-1 g."""
    robot, rods, rng = SCENES[name].robot, make_rods(SCENES[name]), np.random.default_rng(0)
    shape = robot.nodes() + 1e-4 * rng.standard_normal((robot.n_nodes, 2))
    start, v_hat = shape + 1e-4 * rng.standard_normal(shape.shape), 0.02 * rng.standard_normal(shape.shape)
    gradient = slopes(rods, shape, start, v_hat, 1e-6)
    curvature = hessian(lambda shapes: potentials(rods, shapes, start, v_hat), shape, 1e-6)
    _, (_, decrement, pivot) = eliminated(rods, shape, start, v_hat)
    assert pivot[0] > 0.0
    assert decrement[0] == pytest.approx(gradient @ np.linalg.solve(curvature, gradient), rel=2e-4)


@pytest.mark.parametrize("name", ["plain", "damping"])
def test_the_kept_elimination_solves_for_the_gradient_as_the_newton_step_did(name):
    rods, rng = make_rods(SCENES[name]), np.random.default_rng(1)
    start, v_hat = SHAPE + 1e-4 * rng.standard_normal(SHAPE.shape), 0.02 * rng.standard_normal(SHAPE.shape)
    gradient = slopes(rods, SHAPE, start, v_hat, 1e-7)
    work, _ = eliminated(rods, SHAPE, start, v_hat)
    step, again = np.zeros_like(work.q), np.zeros_like(work.q)
    substitute_star.plain(rods, work, step)
    solve_again.plain(rods, work, np.tile(gradient[:, None], N_LANES), again)
    np.testing.assert_allclose(again, step, rtol=0.0, atol=1e-5 * np.abs(step).max())


def test_moments_are_the_slopes_of_the_energy_and_add_up_to_zero():
    work = memory()

    def energy(limb: int, turn: float) -> float:
        q, root = SHAPE - SHAPE[0], 1 + 3 * limb
        c, s = np.cos(turn), np.sin(turn)
        q[root] = c * q[root, 0] - s * q[root, 1], s * q[root, 0] + c * q[root, 1]
        return plain(clamp_energy.plain(RODS, work, rows(q)))[0]

    slopes = [(energy(limb, 1e-6) - energy(limb, -1e-6)) / 2e-6 for limb in range(3)]
    potential_work = memory()
    potential_work.q[:] = rows(SHAPE)
    stage = Stage(rows(SHAPE), rows(0.0 * SHAPE), Lanes(GAMMA), Lanes(1.0 / GAMMA), False)
    factorise.plain(RODS, potential_work, stage, None)
    moments = potential_work.hub_moment[:, 0]
    np.testing.assert_allclose(moments, slopes, rtol=1e-6, atol=1e-12)
    assert abs(moments.sum()) < 1e-14 * np.abs(moments).max() * 10.0
    assembled = plain(add_clamps.plain(RODS, potential_work, potential_work.hub_direction, Lanes(1.0), None, ELASTIC))[
        0
    ]
    assert assembled == pytest.approx(energy(0, 0.0), rel=1e-12)


def test_limbs_that_turn_as_a_whole_are_no_effort():
    work = memory(np.full((3, N_LANES), 0.7))
    assert plain(clamp_energy.plain(RODS, work, rows(ROBOT.nodes())))[0] < 1e-30
    still = memory(np.zeros((3, N_LANES)))
    assert plain(clamp_energy.plain(RODS, still, rows(ROBOT.nodes())))[0] < 1e-30


def test_what_moved_natural_directions_store_is_the_energy_of_the_robot_left_behind():
    work = memory()
    turned = Actuation(0.0 * TURNS, TURNS)
    moved = plain(moved_clamp_energy.plain(RODS, work, turned, Lanes(0.0), Lanes(1.0)))
    assert moved[0] == pytest.approx(plain(clamp_energy.plain(RODS, memory(), rows(ROBOT.nodes())))[0], rel=1e-12)


def test_a_hub_without_any_preference_has_an_orientation():
    assert [float(plain(one)) for one in orientation.plain(Lanes(0.0), Lanes(0.0))] == [1.0, 0.0]


def test_the_natural_direction_of_a_limb_turns_with_its_actuator():
    work = memory()
    angles = np.arctan2(work.hub_direction[1::2, 0], work.hub_direction[::2, 0])
    at_rest = 2.0 * np.pi * np.arange(3) / 3.0
    np.testing.assert_allclose(np.exp(1j * angles), np.exp(1j * (at_rest + TURNS[:, 0])), atol=1e-14)
    assert Scene(Seastar(discretisation="continuum"), actuator=SmaPulse(2.0)).actuator.peak_angle == 2.0
