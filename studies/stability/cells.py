"""A cell of the atlas of stability: a scene at a time step, and how its robots fare.

Its robots make one stroke of random commands (for peak angles: of all 243 commands), from rest or rattled. Strokes of
more than MOST_STEPS steps are cut short: the pulse ramps as fast as the chapter's, and turns back after MOST_STEPS/10
steps. Two more runs, without commands, in the cell's fluid and in vacuum, of rattled robots look at the energy after
every step.
"""

import itertools
import math
import time
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene import Numerics, Scene, SmaPulse, Water
from seastar_gym.scene.numerics import SchemeName
from seastar_gym.simulator import Simulator, State, StrokeReport
from seastar_gym.simulator.schedule import step_times
from studies.stability.cases import Case, Sweep

Floats = NDArray[np.float64]

MOST_STEPS = 2000
"""Of a stroke."""


ENERGY_STEPS = 100
"""Time steps of a run without commands."""


ROBOTS = 8
"""In a cell, but for peak angles: there one for every command."""


RATTLED = 0.1
"""Velocities [m/s] of the robots whose energy is looked at, where a cell does not say otherwise."""


REFERENCE_STEPS = 10_000
"""Of a stroke by the implicit midpoint rule; half as many must agree with it to AGREEMENT of the path."""


AGREEMENT = 0.01


@dataclass(frozen=True)
class Cell:
    """A cell of the atlas, and a line of the CSV.

    refused: The sentence with which the scene was refused, if it was; the rest is then empty.
    failed: Robots whose status was not CONVERGED, or whose state was not finite, in any of the runs.
    iterations: Newton iterations per time step of `step`, on average over the stroke and its robots.
    repairs, backtracks, halvings, energy_cuts: See StrokeReport; all robots together.
    folded: Robots whose opening angles do not add up to a full turn after the stroke: a hub hinge went through its
        pole.
    strain, speed: Largest at the stroke's end. opening_angle: Smallest, see StrokeReport.
    growth, growth_in_vacuum: Largest growth of a robot's energy in one step without commands, over its energy (or a
        billionth of its first one, if that is more). gain, gain_in_vacuum: Largest energy over the first, less 1.
    error: Distance of the hub from that of the converged run at the end of heating and at the stroke's end, root mean
        square over robots, over that of the hub's way there; NaN where there is no converged run.
    """

    sweep: str
    value: float | None
    step: float
    refused: str = ""
    robots: int = 0
    steps: int = 0
    failed: int = 0
    iterations: float = math.nan
    repairs: int = 0
    backtracks: int = 0
    halvings: int = 0
    energy_cuts: int = 0
    folded: int = 0
    opening_angle: float = math.nan
    strain: float = math.nan
    speed: float = math.nan
    growth: float = math.nan
    growth_in_vacuum: float = math.nan
    gain: float = math.nan
    gain_in_vacuum: float = math.nan
    error: float = math.nan
    seconds: float = 0.0


def stroke_duration(step: float) -> float:
    """Of a cell's stroke [s]: the chapter's, or MOST_STEPS steps if that is less."""
    return min(1.0, MOST_STEPS * step)


def make_scene(case: Case, numerics: Numerics, duration: float) -> Scene:
    """The case's scene; a stroke that is cut short ramps as fast as a whole one."""
    whole = Scene(case.robot, case.fluid, SmaPulse(case.peak_angle), numerics)
    return replace(whole, actuator=SmaPulse(case.peak_angle * duration, 0.1 * duration, 0.9 * duration))


def commands_of(case: Case) -> Floats:
    """Commands of the robots of a case, shape (n_robots, n_limbs)."""
    n_limbs = case.robot.n_limbs
    if case.all_commands:
        return np.array(list(itertools.product((0.0, 1.0, -1.0), repeat=n_limbs)))
    commands = np.random.default_rng(1).integers(-1, 2, (ROBOTS, n_limbs)).astype(float)
    commands[0] = [0.0, 1.0, 0.0, 0.0, -1.0]
    return commands


def rattle(simulator: Simulator, speed: float, shift: float) -> None:
    """Give all nodes random velocities and shifts, the same in every cell, see Case."""
    rng, state = np.random.default_rng(2), simulator.get_state()
    shifts = rng.uniform(-1.0, 1.0, state.positions.shape) * shift * simulator.scene.robot.edge_length
    velocities = rng.standard_normal(state.positions.shape) * speed
    simulator.set_state(State(state.positions + shifts, velocities, state.time))


def swim(case: Case, numerics: Numerics, duration: float) -> tuple[Simulator, Floats, StrokeReport]:
    """A stroke of a case's robots: them, the way of their hubs to the end of heating and of the stroke [m], the report.

    The way has shape (2, n_robots, 2).
    """
    commands = commands_of(case)
    simulator = Simulator(make_scene(case, numerics, duration), len(commands), threads=1)
    rattle(simulator, case.speed, case.shift)
    begin, hubs = simulator.hub_position(), {}
    stroke = simulator.stroke_in_parts(commands, 10)
    while True:
        try:
            hubs[round(next(stroke) / duration, 6)] = simulator.hub_position()
        except StopIteration as finished:
            return simulator, np.array([hubs[0.1], hubs[1.0]]) - begin, finished.value


def converged_way(case: Case, duration: float) -> Floats | None:
    """The way that a cell's error is measured from, or None if finer steps do not agree on one."""
    ways = []
    for steps in (REFERENCE_STEPS, REFERENCE_STEPS // 2):
        _, way, report = swim(case, Numerics("implicit-midpoint", duration / steps), duration)
        if report.status.any():
            return None
        ways.append(way)
    return ways[0] if way_error(ways[1], ways[0]) <= AGREEMENT else None


def way_error(way: Floats, converged: Floats) -> float:
    """See Cell.error."""
    size = float(np.sqrt(np.mean(converged**2)))
    return float(np.sqrt(np.mean((way - converged) ** 2))) / size if size > 0.0 else math.nan


def largest_strain(simulator: Simulator) -> float:
    """Of all edges: |length over natural length - 1|."""
    robot, nodes = simulator.scene.robot, simulator.positions
    limbs = nodes[:, 1:].reshape(len(nodes), robot.n_limbs, -1, 2)
    hubs = np.broadcast_to(nodes[:, None, :1], (len(nodes), robot.n_limbs, 1, 2))
    lengths = np.linalg.norm(np.diff(np.concatenate([hubs, limbs], axis=2), axis=2), axis=-1)
    return float(np.abs(lengths / robot.edge_length - 1.0).max())


def count_folded(simulator: Simulator) -> int:
    """See Cell.folded."""
    roots = simulator.positions[:, 1 :: simulator.scene.robot.nodes_per_limb - 1] - simulator.positions[:, :1]
    directions = np.arctan2(roots[..., 1], roots[..., 0])
    angles = np.remainder(np.roll(directions, -1, axis=1) - directions + np.pi, 2.0 * np.pi) - np.pi
    return int((np.abs(angles.sum(axis=1) - 2.0 * np.pi) > 1.0).sum())


def energy_growth(case: Case, numerics: Numerics, fluid: Water | None) -> tuple[float, float, int]:
    """(growth, gain, failed robots) of rattled robots without commands, see Cell."""
    half = 0.5 * ENERGY_STEPS * numerics.step
    simulator = Simulator(Scene(case.robot, fluid, SmaPulse(0.0, half, half), numerics), ROBOTS, threads=1)
    rattle(simulator, case.speed if case.speed or case.shift else RATTLED, case.shift)
    energies = [simulator.elastic_energy() + simulator.kinetic_energy()]
    for _ in simulator.stroke_in_parts(np.zeros((ROBOTS, case.robot.n_limbs)), ENERGY_STEPS):
        energies.append(simulator.elastic_energy() + simulator.kinetic_energy())
    energy = np.array(energies)
    growth = np.diff(energy, axis=0) / np.maximum(energy[:-1], 1e-9 * energy[0])
    lost = simulator.failed | ~np.isfinite(energy).all(axis=0)
    return float(growth.max()), float((energy / energy[0]).max()) - 1.0, int(lost.sum())


def run_cell(sweep: Sweep, value: float | None, step: float, scheme: SchemeName, converged: Floats | None) -> Cell:
    """Measure one cell; converged: what converged_way gave."""
    start, case, numerics = time.perf_counter(), sweep.case(value), Numerics(scheme, step)
    try:
        simulator, way, report = swim(case, numerics, stroke_duration(step))
    except ValueError as refusal:
        return Cell(sweep.name, value, step, refused=str(refusal))
    finite = np.isfinite(simulator.positions).all(axis=(1, 2)) & np.isfinite(simulator.velocities).all(axis=(1, 2))
    in_fluid, in_vacuum = energy_growth(case, numerics, case.fluid), energy_growth(case, numerics, None)
    steps = count_steps(simulator.scene)
    return Cell(
        sweep.name, value, step, "", simulator.n_robots, steps,
        failed=int((report.status.astype(bool) | ~finite).sum()) + in_fluid[2] + in_vacuum[2],
        iterations=float(report.newton_iterations.mean()) / steps,
        repairs=int(report.repairs.sum()), backtracks=int(report.backtracks.sum()),
        halvings=int(report.halvings.sum()), energy_cuts=int(report.energy_cuts.sum()), folded=count_folded(simulator),
        opening_angle=float(report.smallest_opening_angle.min()), strain=largest_strain(simulator),
        speed=float(np.linalg.norm(simulator.velocities, axis=-1).max()),
        growth=in_fluid[0], growth_in_vacuum=in_vacuum[0], gain=in_fluid[1], gain_in_vacuum=in_vacuum[1],
        error=math.nan if converged is None else way_error(way, converged), seconds=time.perf_counter() - start,
    )  # fmt: skip


def count_steps(scene: Scene) -> int:
    """Time steps of a stroke that needs no halving."""
    return len(step_times(scene.actuator.corners, scene.numerics.step)) - 1
