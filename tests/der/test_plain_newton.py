"""Safeguards do nothing to robots that need none: the simulator's stroke has the bits of plain Newton."""

import numpy as np
import pytest

from seastar_gym import Numerics, Scene, Seastar, Simulator
from seastar_gym.der.potential import factorise
from seastar_gym.der.stepping.newton import take_step
from seastar_gym.der.stepping.report import NEWTON_ITERATIONS, REPORT_ROWS
from seastar_gym.der.stepping.schemes import SCHEMES
from seastar_gym.der.stepping.skip_last import EASY, LATE, quadratic_length
from seastar_gym.der.stepping.stages import begin_stage, end_stage, end_step
from seastar_gym.der.stepping.stroke import advance
from seastar_gym.der.terms.hub import set_natural_hub_angles
from seastar_gym.model.rods import make_limits, make_rods
from seastar_gym.simd.compilation import entry_point, inlined_kernel
from seastar_gym.simd.lanes import any_lane, borrow, load, load_number, select, splat, store
from seastar_gym.simd.rows import aligned_rows, to_rows
from seastar_gym.simulator.schedule import step_times

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
