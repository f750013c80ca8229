"""The rigid hub of the continuum: its energy has the slopes and the Hessian that Newton's method takes for it."""

import numpy as np
import pytest

from seastar_gym import Limb, Scene, Seastar, SmaPulse
from seastar_gym.der.potential import factorise
from seastar_gym.der.rods import make_work
from seastar_gym.der.stepping.stages import Stage
from seastar_gym.der.terms.clamp import assemble_clamp, clamp_energy, moved_clamp_energy, orientation
from seastar_gym.der.terms.hub import Actuation, set_natural_hub_angles
from seastar_gym.model.rods import make_rods
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simd.numpy_lanes import Lanes
from slopes import plain, rows

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


def potential(q: np.ndarray, q_hat: np.ndarray, v_hat: np.ndarray) -> tuple[float, float]:
    """(Phi, Newton decrement) [J] of a stage at q."""
    work = memory()
    work.q[:], work.q_hat[:], work.v_hat[:] = rows(q), rows(q_hat), rows(v_hat)
    stage = Stage(work.q_hat, work.v_hat, Lanes(GAMMA), Lanes(1.0 / GAMMA), False)
    phi, decrement, pivot = (plain(one)[0] for one in factorise.plain(RODS, work, stage, None))
    assert pivot > 0.0
    return phi, decrement


def test_the_newton_decrement_is_that_of_the_differences_of_the_potential():
    """One number that every part of gradient, Hessian and elimination goes into: g H^-1 g."""
    q_hat, v_hat = SHAPE + 1e-4 * RNG.standard_normal(SHAPE.shape), 0.02 * RNG.standard_normal(SHAPE.shape)
    size, step = SHAPE.size, 1e-6
    moves = step * np.eye(size).reshape(size, *SHAPE.shape)
    at = {}

    def phi(i: int, j: int, a: int, b: int) -> float:
        key = tuple(sorted([(i, a), (j, b)]))
        if key not in at:
            at[key] = potential(SHAPE + a * moves[i] + b * moves[j], q_hat, v_hat)[0]
        return at[key]

    gradient = np.array([phi(i, i, 1, 0) - phi(i, i, -1, 0) for i in range(size)]) / (2.0 * step)
    hessian = np.array(
        [[phi(i, j, 1, 1) - phi(i, j, 1, -1) - phi(i, j, -1, 1) + phi(i, j, -1, -1) for j in range(size)]
         for i in range(size)]
    ) / (4.0 * step**2)  # fmt: skip
    _, decrement = potential(SHAPE, q_hat, v_hat)
    assert decrement == pytest.approx(gradient @ np.linalg.solve(hessian, gradient), rel=1e-4)


def test_moments_are_the_slopes_of_the_energy_and_add_up_to_zero():
    work = memory()

    def energy(limb: int, turn: float) -> float:
        q, root = SHAPE - SHAPE[0], 1 + 3 * limb
        c, s = np.cos(turn), np.sin(turn)
        q[root] = c * q[root, 0] - s * q[root, 1], s * q[root, 0] + c * q[root, 1]
        return plain(clamp_energy.plain(RODS.clamp, RODS, work, rows(q)))[0]

    slopes = [(energy(limb, 1e-6) - energy(limb, -1e-6)) / 2e-6 for limb in range(3)]
    potential_work = memory()
    potential_work.q[:] = rows(SHAPE)
    stage = Stage(rows(SHAPE), rows(0.0 * SHAPE), Lanes(GAMMA), Lanes(1.0 / GAMMA), False)
    factorise.plain(RODS, potential_work, stage, None)
    moments = potential_work.hub_moment[:, 0]
    np.testing.assert_allclose(moments, slopes, rtol=1e-6, atol=1e-12)
    assert abs(moments.sum()) < 1e-14 * np.abs(moments).max() * 10.0
    assembled = plain(assemble_clamp.plain(RODS.clamp, RODS, potential_work, None))[0]
    assert assembled == pytest.approx(energy(0, 0.0), rel=1e-12)


def test_limbs_that_turn_as_a_whole_are_no_effort():
    work = memory(np.full((3, N_LANES), 0.7))
    assert plain(clamp_energy.plain(RODS.clamp, RODS, work, rows(ROBOT.nodes())))[0] < 1e-30
    still = memory(np.zeros((3, N_LANES)))
    assert plain(clamp_energy.plain(RODS.clamp, RODS, still, rows(ROBOT.nodes())))[0] < 1e-30


def test_what_moved_natural_directions_store_is_the_energy_of_the_robot_left_behind():
    work = memory()
    turned = Actuation(0.0 * TURNS, TURNS)
    moved = plain(moved_clamp_energy.plain(RODS.clamp, RODS, work, turned, Lanes(0.0), Lanes(1.0)))
    assert moved[0] == pytest.approx(
        plain(clamp_energy.plain(RODS.clamp, RODS, memory(), rows(ROBOT.nodes())))[0], rel=1e-12
    )


def test_a_hub_without_any_preference_has_an_orientation():
    assert [float(plain(one)) for one in orientation.plain(Lanes(0.0), Lanes(0.0))] == [1.0, 0.0]


def test_the_natural_direction_of_a_limb_turns_with_its_actuator():
    work = memory()
    angles = np.arctan2(work.hub_direction[1::2, 0], work.hub_direction[::2, 0])
    at_rest = 2.0 * np.pi * np.arange(3) / 3.0
    np.testing.assert_allclose(np.exp(1j * angles), np.exp(1j * (at_rest + TURNS[:, 0])), atol=1e-14)
    assert Scene(Seastar(discretisation="continuum"), actuator=SmaPulse(2.0)).actuator.peak_angle == 2.0
