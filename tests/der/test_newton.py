"""Newton's method on a stage: it ends where the potential is least, and leaves alone whom it was not asked for."""

from types import SimpleNamespace

import numpy as np
import pytest

import oracle
from seastar_gym import Contact, Numerics, Scene, Seastar, Simulator, SmaPulse, Water
from seastar_gym.der.contact.contact import SLOT_ROWS
from seastar_gym.der.geometry import larger
from seastar_gym.der.potential import factorise
from seastar_gym.der.rods import make_work
from seastar_gym.der.stepping.newton import minimise, move_node, step_scale, take_step
from seastar_gym.der.stepping.report import NEWTON_ITERATIONS, REPORT_ROWS
from seastar_gym.der.stepping.schemes import SCHEMES
from seastar_gym.der.stepping.skip_last import EASY, LATE, quadratic_length
from seastar_gym.der.stepping.stages import Stage, begin_stage, end_stage, end_step
from seastar_gym.der.stepping.stroke import advance
from seastar_gym.der.terms.hub import set_natural_hub_angles
from seastar_gym.model.rods import make_limits, make_rods
from seastar_gym.simd.compilation import entry_point, inlined_kernel
from seastar_gym.simd.lanes import N_LANES, any_lane, borrow, load, load_number, select, splat, store
from seastar_gym.simd.numpy_lanes import Lanes, Mask
from seastar_gym.simd.rows import aligned_rows, to_rows
from seastar_gym.simulator.schedule import step_times
from slopes import nodes, plain, rows
from stages import RandomStages, robot_and_star, rods_of, turn_limbs

ROBOT, STAR = robot_and_star(5, 4)
RODS, GAMMA = rods_of(ROBOT), 5e-3
EVERYONE = np.ones(N_LANES, bool)


def minimised(active=EVERYONE, tolerance=1e-13, limit=60.0, speed=0.05, bend=0.05, gamma=GAMMA):
    stages, work = RandomStages(STAR, gamma, bend=bend, speed=speed), make_work(RODS, 1)
    work.q[:], work.q_hat[:], work.v_hat[:] = rows(stages.q), rows(stages.q_hat), rows(stages.v_hat)
    turn_limbs(work, STAR, stages.delta_psi)
    stage = Stage(work.q_hat, work.v_hat, Lanes(gamma), Lanes(1.0 / gamma), False)
    found = minimise.plain(RODS, work, stage, Mask(active), Lanes(tolerance), Lanes(limit))
    converged, phi, iterations, regularised, backtracks = plain(found)
    return SimpleNamespace(
        stages=stages, q=nodes(work.q), converged=converged, phi=phi, iterations=iterations, regularised=regularised,
        backtracks=backtracks, length=plain(quadratic_length.plain(RODS, stage)),
    )  # fmt: skip


def test_it_ends_at_a_minimum_of_the_oracles_potential():
    found = minimised()
    assert found.converged.all()
    for lane in range(N_LANES):
        data = found.stages.data(lane)
        residual = oracle.incremental_gradient(STAR, found.q[lane], *data)
        before = oracle.incremental_gradient(STAR, found.stages.q[lane], *data)
        assert np.abs(residual).max() < 1e-9 * np.abs(before).max()
        hessian = oracle.incremental_hessian(STAR, found.q[lane], data[0], GAMMA, data[3])
        assert np.linalg.eigvalsh(hessian)[0] > 0.0


def test_a_step_that_can_be_foreseen_is_left_out_and_would_have_been_as_small_as_asked():
    tolerance = 1e-7
    loose, tight = minimised(tolerance=tolerance, bend=0.01), minimised(bend=0.01)
    assert loose.iterations.sum() < tight.iterations.sum()
    assert np.linalg.norm(loose.q - tight.q, axis=2).max() < tolerance


def test_robots_that_are_not_active_keep_their_bits_and_cost_no_iteration():
    active = np.arange(N_LANES) % 2 == 0
    found, all_of_them = minimised(active), minimised()
    np.testing.assert_array_equal(found.q[active], all_of_them.q[active])
    np.testing.assert_array_equal(found.q[~active], found.stages.q[~active])
    assert not found.iterations[~active].any() and not found.converged[~active].any()


def test_nobody_takes_more_iterations_than_allowed():
    found = minimised(limit=2.0, speed=1.0, bend=0.5)
    assert found.iterations.max() == 2.0 and not found.converged.all()


def test_wild_robots_are_helped_by_convex_matrices_or_shorter_steps_and_arrive():
    found = minimised(speed=1.0, bend=0.5, limit=500.0, gamma=0.05)
    assert found.converged.all() and np.all(found.regularised + found.backtracks > 0.0)


def test_a_node_moves_by_its_new_step_or_back_along_its_last():
    work = make_work(RODS, 1)
    stepping, shortening = Mask(np.arange(N_LANES) == 0), Mask(np.arange(N_LANES) == 1)
    work.step[2], work.step[3] = 0.4, 0.2
    scale = step_scale.plain(stepping, shortening, Lanes(0.5))
    squared = plain(move_node.plain(work, 1, (Lanes(-1.0), Lanes(0.5)), shortening, scale))
    np.testing.assert_array_equal(work.q[2:4, :3], [[1.0, -0.2, 0.0], [-0.5, -0.1, 0.0]])
    np.testing.assert_allclose(squared[:3], [1.25, 0.05, 0.0])


def test_nothing_is_foreseen_further_than_edges_are_long():
    assert 0.0 < minimised().length < STAR.edge_length


def test_larger_is_the_larger():
    np.testing.assert_array_equal(plain(larger.plain(Lanes(np.array([1.0, 3.0])), Lanes(2.0))), [2.0, 3.0])


@pytest.mark.parametrize("lane", [0, N_LANES - 1])
def test_a_robot_whose_state_is_not_a_number_does_not_converge_and_stops_nobody(lane):
    work, stages = make_work(RODS, 1), RandomStages(STAR, GAMMA, bend=0.05)
    work.q[:], work.q_hat[:], work.v_hat[:] = rows(stages.q), rows(stages.q_hat), rows(stages.v_hat)
    turn_limbs(work, STAR, stages.delta_psi)
    work.q[5, lane] = np.nan
    stage = Stage(work.q_hat, work.v_hat, Lanes(GAMMA), Lanes(1.0 / GAMMA), False)
    converged = plain(minimise.plain(RODS, work, stage, Mask(EVERYONE), Lanes(1e-10), Lanes(60.0))[0])
    np.testing.assert_array_equal(converged, np.arange(N_LANES) != lane)


# Safeguards do nothing to robots that need none: the simulator's stroke has the bits of plain Newton.


ROBOTS = 64


@inlined_kernel
def newton(rods, work, stage, tolerance, iteration_limit):
    """Plain Newton (13.11): full steps until one is below the tolerance; returns the iterations."""
    one, zero = splat(1.0), splat(0.0)
    iterations, running = zero, zero < one
    length = quadratic_length(rods, stage)
    while any_lane(running):
        factorise(rods, work, stage, None)
        move = take_step(rods, work, running, None, zero)
        iterations += select(running, one, zero)
        late = select(iterations < EASY, one, LATE)
        foreseen = (iterations <= EASY) & (late * move * move <= tolerance * length)
        running = running & ~((move <= tolerance) | foreseen) & (iterations < iteration_limit)
    return iterations


@entry_point
def advance_plainly(rods, work, scheme, actuation, q, v, a, peaks, times, shape, report, limits):
    """Stroke of `advance` without line search, regularised matrix, guard, substeps and status."""
    rods_rows, memory, rotation, tableau = borrow(rods), borrow(work), borrow(actuation), borrow(scheme)
    zero, last, tolerance = splat(0.0), scheme.n_stages - 1, load(borrow(limits).tolerance, 0)
    everyone = zero < splat(1.0)
    for group in range(q.shape[0]):
        q_rows, v_rows, a_rows, peak_rows = borrow(q[group]), borrow(v[group]), borrow(a[group]), borrow(peaks[group])
        report_rows = borrow(report[group])
        for k in range(times.shape[0] - 1):
            for limb in range(rods.n_limbs):
                peak = load(peak_rows, limb)
                store(rotation.delta_psi_start, limb, peak * shape[k])
                store(rotation.delta_psi_end, limb, peak * shape[k + 1])
            h = splat(times[k + 1] - times[k])
            for i in range(scheme.n_stages):
                stage = begin_stage(rods_rows, memory, tableau, i, q_rows, v_rows, a_rows, h)
                set_natural_hub_angles(rods_rows, memory, rotation, zero + load_number(tableau.c, i))
                n = newton(rods_rows, memory, stage, tolerance, 1.0 * limits.max_iterations)
                store(report_rows, NEWTON_ITERATIONS, load(report_rows, NEWTON_ITERATIONS) + n)
                if i < last:
                    end_stage(rods_rows, memory, tableau, i, stage, a_rows, everyone)
                else:
                    end_step(rods_rows, memory, tableau, stage, q_rows, v_rows, a_rows, h, everyone)


@pytest.mark.parametrize(
    "numerics", [Numerics("implicit-euler", 3e-3), Numerics("sdirk2", 20e-3), Numerics("implicit-midpoint", 5e-3)],
    ids=lambda numerics: numerics.scheme,
)  # fmt: skip
def test_the_safeguards_change_no_bit_of_a_stroke_that_needs_none(numerics):
    scene, scheme = Scene(Seastar(nodes_per_limb=10), numerics=numerics), SCHEMES[numerics.scheme]
    simulator = Simulator(scene, ROBOTS, threads=1)
    *before, commands = np.random.default_rng(0).integers(-1, 2, (4, ROBOTS, 5)).astype(float)
    for command in before:
        simulator.stroke(command)
    rods, limits, (work, actuation) = make_rods(scene), make_limits(scene), simulator.memory[0]
    n_groups, rows, lanes = simulator.q.shape
    times = step_times(scene.actuator.corners, numerics.step)
    shape, peaks = np.asarray(scene.actuator.delta_psi(times)), to_rows(commands)
    ends = []
    for safeguarded in (True, False):
        q, v = simulator.q.copy(), simulator.v.copy()
        a = aligned_rows(n_groups, (rows + 1) * scheme.n_stages + 2, lanes)
        report = np.zeros((n_groups, len(REPORT_ROWS), lanes))
        if safeguarded:
            failed, no_effort = np.zeros((n_groups, 1, lanes)), np.zeros((n_groups, 0, lanes))
            advance(
                rods, work, scheme, SCHEMES["implicit-euler"], actuation, q, v, a, peaks, times, shape, 0, failed,
                report, limits, no_effort,
            )  # fmt: skip
        else:
            advance_plainly(rods, work, scheme, actuation, q, v, a, peaks, times, shape, report, limits)
        ends.append((q, v, report[:, NEWTON_ITERATIONS]))
    for one, other in zip(*ends, strict=True):
        np.testing.assert_array_equal(one, other)
    assert not np.array_equal(ends[0][0], simulator.q)


# Scales of a robot and sizes of its memory: which steps are looked at, and how many pairs of nodes may be near.


THICK = Seastar(4, 5, limb_length=0.08, rod_radius=2e-3, density=1200.0, youngs_modulus=5e5)
EDGE, AREA = 0.02, np.pi * 2e-3**2
DEFAULT_RODS = make_rods(Scene(THICK, Water(900.0, 1.5)))


def test_drag_takes_more_than_a_step_creates_up_to_a_share_of_the_predictable_energy():
    """Drag of a limb that moves by its length over its inertia: 1/2 rho_f C_d 2 r l/(rho A)."""
    share = 0.5 * 900.0 * 1.5 * 2.0 * 2e-3 * 0.08 / (1200.0 * AREA)
    assert share > 1.0 and DEFAULT_RODS.scales.damped == pytest.approx(DEFAULT_RODS.scales.predictable)
    thin_water = make_rods(Scene(THICK, Water(9.0, 1.5))).scales
    assert thin_water.damped == pytest.approx(float(DEFAULT_RODS.scales.predictable[0]) * 0.01 * share)


def test_edges_are_stiffer_than_inertia_by_the_square_of_their_number_and_of_the_speed_of_sound_over_their_length():
    """Most at the tips, which have half an edge; in vacuum every step is looked at."""
    rate = 5e5 / (1200.0 * EDGE**2) * 2.0 * 4**2
    assert DEFAULT_RODS.scales.stiffness_ratio == pytest.approx(rate)
    vacuum = make_rods(Scene(THICK, None)).scales
    assert vacuum.stiffness_ratio == np.inf and vacuum.damped == 0.0
    assert not vacuum.held and make_rods(Scene(THICK, held_nodes=(0,))).scales.held


@pytest.mark.parametrize("edges, near", [(23, 23), (24, 24), (25, 3)])
def test_every_node_has_room_for_all_edges_of_another_limb_or_for_three_where_they_are_many(edges, near):
    rods = make_rods(Scene(Seastar(5, edges + 1), actuator=SmaPulse(0.1), contact=Contact()))
    work, nodes = make_work(rods, 1).contact, 2 * rods.contact.n_pairs * edges
    assert work.share == nodes * near
    assert len(work.slots) == SLOT_ROWS * nodes * min(edges, near * N_LANES)
