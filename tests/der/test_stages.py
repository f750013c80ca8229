"""Time steps: first guesses, results, errors, and intervals that every robot covers in its own steps."""

import numpy as np
import pytest

from seastar_gym import Numerics, Scene, Seastar, SmaPulse
from seastar_gym.der.rods import make_work
from seastar_gym.der.stepping.interval import cover_interval, note_hub_angles
from seastar_gym.der.stepping.report import COVERED, HALVINGS, REPORT_ROWS, SMALLEST_HUB_T, STEPS
from seastar_gym.der.stepping.schemes import SCHEMES
from seastar_gym.der.stepping.stages import (
    Stage,
    begin_stage,
    end_stage,
    end_step,
    forget_accelerations,
    step_error,
    store_share,
)
from seastar_gym.der.terms.hub import Actuation
from seastar_gym.model.rods import make_limits, make_rods
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simd.numpy_lanes import Lanes, Mask
from slopes import plain, rows

ROBOT = Seastar(5, 3)
SCENE = Scene(ROBOT, actuator=SmaPulse(0.3))
RODS, SIZE = make_rods(SCENE), 2 * ROBOT.n_nodes
RNG = np.random.default_rng(0)
H = 0.01
EVERYONE = Mask(np.ones(N_LANES, bool))


@pytest.mark.parametrize("scheme", SCHEMES)
def test_every_scheme_is_exact_for_nodes_that_fall(scheme):
    """With constant accelerations in memory the first guess is the parabola, and so is the step's result."""
    tableau, work = SCHEMES[scheme], make_work(RODS, SCHEMES[scheme].n_stages)
    q_0, v_0, a_0 = RNG.standard_normal((3, SIZE, N_LANES))
    q, v, n = q_0.copy(), v_0.copy(), tableau.n_stages
    a = np.concatenate([np.tile(a_0, (n, 1)), np.ones((n + 2, N_LANES))])
    for k in range(n):
        stage = begin_stage.plain(RODS, work, tableau, k, q, v, a, Lanes(H))
        if k < n - 1:
            end_stage.plain(RODS, work, tableau, k, stage, a, EVERYONE)
    end_step.plain(RODS, work, tableau, stage, q, v, a, Lanes(H), EVERYONE)
    np.testing.assert_allclose(v, v_0 + H * a_0, rtol=1e-12, atol=1e-12)
    exact = q_0 + H * v_0 + H**2 * a_0 * (1.0 if scheme == "implicit-euler" else 0.5)
    np.testing.assert_allclose(q, exact, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(a[n * SIZE : n * SIZE + n], 1.0, rtol=1e-8)


def test_a_step_that_is_not_accepted_changes_no_bit():
    tableau, work = SCHEMES["sdirk2"], make_work(RODS, 2)
    (q, v), a = RNG.standard_normal((2, SIZE, N_LANES)), np.zeros((2 * SIZE + 4, N_LANES))
    before, chosen = (q.copy(), v.copy()), np.arange(N_LANES) % 2 == 0
    stage = begin_stage.plain(RODS, work, tableau, 1, q, v, a, Lanes(H))
    work.q[:] += 1.0
    end_step.plain(RODS, work, tableau, stage, q, v, a, Lanes(H), Mask(chosen))
    for now, then in zip((q, v), before, strict=True):
        np.testing.assert_array_equal(now[:, ~chosen], then[:, ~chosen])
        assert np.all(now[:, chosen] != then[:, chosen])
    accelerations = a[SIZE : 2 * SIZE]  # of the last stage, kept for the next step's first guess
    assert accelerations[:, chosen].all() and not accelerations[:, ~chosen].any()


def test_the_share_of_an_acceleration_is_kept_from_zero_to_one():
    a, along = np.full((1, 4), 9.0), np.array([0.5, -0.5, 3.0, 0.5])
    store_share.plain(a, 0, Lanes(along), Lanes(np.ones(4)), Mask([True, True, True, False]))
    np.testing.assert_array_equal(a[0], [0.5, 0.0, 1.0, 9.0])


def test_robots_that_had_to_halve_forget_their_accelerations():
    a = np.ones((SIZE + 3, N_LANES))
    forget_accelerations.plain(RODS, SCHEMES["implicit-euler"], a, Mask(np.arange(N_LANES) == 1))
    assert not a[: SIZE + 1, 1].any() and a[: SIZE + 1, 0].all() and a[SIZE + 1 :].all()


def test_the_error_of_a_step_is_that_of_the_midpoint_rule_on_a_cubic():
    """Accelerations that change by h j from one step of length h to the next give the error h^3 j/12."""
    jerk, work = RNG.standard_normal((SIZE, N_LANES)), make_work(RODS, 1)
    last, gamma = 0.3 * jerk, 0.5 * H
    work.q[:] = gamma**2 * (last + H * jerk)
    stage = Stage(0.0 * work.q, 0.0 * work.q, Lanes(gamma), Lanes(1.0 / gamma), True)
    error = plain(step_error.plain(RODS, work, stage, last, Lanes(H), Lanes(H)))
    largest = np.linalg.norm(jerk.reshape(-1, 2, N_LANES), axis=1).max(axis=0)
    np.testing.assert_allclose(error, H**3 * largest / 12.0, rtol=1e-9)


def test_the_smallest_hub_angle_is_kept():
    report = np.zeros((len(REPORT_ROWS), N_LANES))
    report[SMALLEST_HUB_T] = np.inf
    asked = np.arange(N_LANES) > 0
    note_hub_angles.plain(RODS, rows(ROBOT.nodes()), Mask(asked), report)
    assert np.isinf(report[SMALLEST_HUB_T, 0])
    note_hub_angles.plain(RODS, rows(ROBOT.nodes()), Mask(~asked), report)
    np.testing.assert_allclose(report[SMALLEST_HUB_T], np.tan(np.pi / 5.0), rtol=1e-12)
    note_hub_angles.plain(RODS, 2.0 * rows(ROBOT.nodes()), Mask(asked), report)
    np.testing.assert_allclose(report[SMALLEST_HUB_T], np.tan(np.pi / 5.0), rtol=1e-12)


@pytest.mark.parametrize("scheme", ["implicit-euler", "implicit-midpoint"])
def test_a_robot_in_trouble_halves_alone_and_covers_the_interval_to_the_last_bit(scheme):
    """The last robot begins with edges that fly apart; the others are at rest, and stay there in one step."""
    tableau, limits = SCHEMES[scheme], make_limits(Scene(ROBOT, numerics=Numerics(scheme, H, max_iterations=6)))
    work, still = make_work(RODS, tableau.n_stages), Actuation(*np.zeros((2, 5, N_LANES)))
    q, v = rows(ROBOT.nodes()), np.zeros((SIZE, N_LANES))
    v[:, -1] = 2.0 * RNG.standard_normal(SIZE)
    a, report = np.zeros(((SIZE + 1) * tableau.n_stages + 2, N_LANES)), np.zeros((len(REPORT_ROWS), N_LANES))
    args = RODS, work, tableau, SCHEMES["implicit-euler"], still, q, v, a, H, EVERYONE, limits, report
    arrived = plain(cover_interval.plain(*args))
    assert arrived.all()
    assert report[HALVINGS, -1] > 0 and not report[HALVINGS, :-1].any()
    np.testing.assert_array_equal(report[STEPS, :-1], 1.0)
    np.testing.assert_array_equal(report[COVERED], H)
    np.testing.assert_allclose(q[:, :-1], rows(ROBOT.nodes())[:, :-1], rtol=0.0, atol=1e-12)
