"""Cost of the solver's safeguards for a robot that does not need them: `python -m studies.stability --cost`.

Compares strokes by the simulator's kernel with the same strokes by plain Newton in one run. Plain Newton is made of the
same parts, but without line search, regularised matrix, energy guard, substeps, status and report. These strokes need
none of them and end in the same bits either way, so only the time differs. The report's smallest opening angle (six
roots, five divisions) takes 1 % of a short step, and the masks over its writes 0.3 %; the guard does not run. The
layout of code and numbers in memory changes the time by more than that in either direction, so compare several
processes.
"""

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from seastar_gym.der.potential import factorise
from seastar_gym.der.stepping.foresight import EASY, LATE, foreseeable_length
from seastar_gym.der.stepping.newton import take_step
from seastar_gym.der.stepping.report import NEWTON_ITERATIONS, REPORT_ROWS
from seastar_gym.der.stepping.schemes import SCHEMES
from seastar_gym.der.stepping.stages import begin_stage, end_stage, end_step
from seastar_gym.der.stepping.stroke import advance
from seastar_gym.der.terms.hub import set_natural_hub_angles
from seastar_gym.model.rods import make_limits, make_rods
from seastar_gym.scene import Numerics, Scene, Seastar
from seastar_gym.simd.compilation import entry_point, inlined_kernel
from seastar_gym.simd.lanes import any_lane, borrow, load, load_number, select, splat, store
from seastar_gym.simd.rows import aligned_rows, to_rows
from seastar_gym.simulator import Simulator
from seastar_gym.simulator.schedule import step_times

Floats = NDArray[np.float64]

SETTINGS = (
    Numerics("implicit-euler", 3e-3),
    Numerics("sdirk2", 20e-3),
    Numerics("implicit-midpoint", 5e-3),
)
ROBOTS = 64
"""Robots of the compared strokes."""


@inlined_kernel
def newton(rods, work, stage, tolerance, iteration_limit):
    """Plain Newton (13.11): full steps without safeguards until one is below the tolerance; returns the iterations."""
    one, zero = splat(1.0), splat(0.0)
    iterations, running = zero, zero < one
    quadratic_length = foreseeable_length(rods, stage)
    while any_lane(running):
        factorise(rods, work, stage, None)
        move = take_step(rods, work, running, None, zero)
        iterations += select(running, one, zero)
        late = select(iterations < EASY, one, LATE)
        foreseen = (iterations <= EASY) & (late * move * move <= tolerance * quadratic_length)
        running = running & ~((move <= tolerance) | foreseen) & (iterations < iteration_limit)
    return iterations


@entry_point
def advance_plainly(rods, work, scheme, actuation, q, v, a, peaks, times, shape, report, limits):
    """Stroke of `seastar_gym.der.stepping.stroke.advance` without safeguards; reports Newton iterations only."""
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


class Pair:
    """One stroke that either kernel repeats, in the chapter's scene with these numerics."""

    def __init__(self, numerics: Numerics):
        self.scene = Scene(Seastar(nodes_per_limb=10), numerics=numerics)
        simulator = Simulator(self.scene, ROBOTS, threads=1)
        commands = np.random.default_rng(0).integers(-1, 2, (4, ROBOTS, self.scene.robot.n_limbs)).astype(float)
        for command in commands[:-1]:
            simulator.stroke(command)
        self.start = simulator.q.copy(), simulator.v.copy()
        self.peaks = to_rows(commands[-1])
        self.q, self.v, self.memory = simulator.q, simulator.v, simulator.memory[0]
        n_groups, rows, lanes = self.q.shape
        scheme = self.scheme = SCHEMES[numerics.scheme]
        self.a = aligned_rows(n_groups, (rows + 1) * scheme.n_stages + 2, lanes)
        self.failed, self.report = np.zeros((n_groups, 1, lanes)), np.zeros((n_groups, len(REPORT_ROWS), lanes))
        self.rods, self.limits = make_rods(self.scene), make_limits(self.scene)
        self.times = step_times(self.scene.actuator.corners, numerics.step)
        self.shape = np.asarray(self.scene.actuator.delta_psi(self.times))
        self.no_effort = np.zeros((len(self.q), 0, self.q.shape[-1]))

    def seconds(self, safeguarded: bool) -> float:
        """Processor time of the stroke [s]; leaves the final state in `q` and `v` and the counts in `report`."""
        self.q[:], self.v[:] = self.start
        self.a[:], self.report[:] = 0.0, 0.0
        work, actuation = self.memory
        begin = time.thread_time()
        if safeguarded:
            advance(
                self.rods, work, self.scheme, SCHEMES["implicit-euler"], actuation, self.q, self.v, self.a, self.peaks,
                self.times, self.shape, self.failed, self.report, self.limits, self.no_effort,
            )  # fmt: skip
        else:
            advance_plainly(
                self.rods, work, self.scheme, actuation, self.q, self.v, self.a, self.peaks, self.times, self.shape,
                self.report, self.limits,
            )  # fmt: skip
        return time.thread_time() - begin


@dataclass(frozen=True)
class Cost:
    """Cost of the safeguards with one setting.

    plain: Median processor time of a stroke by plain Newton, per robot and time step [s].
    ratio: Median over rounds of the time with safeguards over the time of plain Newton.
    quartiles: Lower and upper quartile of that ratio.
    """

    numerics: Numerics
    plain: float
    ratio: float
    quartiles: tuple[float, float]


def measure_cost(numerics: Numerics, pairs: int = 12, rounds: int = 20) -> Cost:
    """Measure the cost from strokes by either kernel in turn; each kernel comes first in every other round.

    The place of the numbers in memory changes times by some per cent, so several pairs are measured side by side.
    """
    durations, benches = np.zeros((pairs, rounds, 2)), [Pair(numerics) for _ in range(pairs)]
    for bench, own in zip(benches, durations, strict=True):
        bench.seconds(True), bench.seconds(False)
        for k in range(rounds):
            for safeguarded in (k % 2 == 0, k % 2 == 1):
                own[k, int(safeguarded)] = bench.seconds(safeguarded)
    low, middle, high = np.percentile(durations[..., 1] / durations[..., 0], [25, 50, 75])
    steps = len(benches[0].times) - 1
    return Cost(numerics, float(np.median(durations[..., 0])) / ROBOTS / steps, middle, (low, high))


def cost_table(costs: list[Cost]) -> Table:
    """Costs as a table for the terminal."""
    table = Table(title="Cost of the safeguards for robots that do not need them")
    table.add_column("scheme, step", no_wrap=True)
    for name in ("plain Newton, per step", "with safeguards", "middle half of the rounds"):
        table.add_column(name, justify="right")
    for cost in costs:
        table.add_row(
            f"{cost.numerics.scheme}, {1e3 * cost.numerics.step:g} ms", f"{1e6 * cost.plain:.3f} µs",
            f"{100.0 * (cost.ratio - 1.0):+.1f} %",
            " ... ".join(f"{100.0 * (one - 1.0):+.1f}" for one in cost.quartiles) + " %",
        )  # fmt: skip
    return table
