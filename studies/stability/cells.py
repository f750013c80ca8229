"""A cell of the atlas of stability: measurements of a scene at a time step.

Its robots make one stroke of random commands (for peak angles: of all 243 commands), from rest or from a random initial
state. Strokes of more than MOST_STEPS steps are cut short: the pulse ramps as fast as the chapter's and turns back
after MOST_STEPS/10 steps. Two more runs without commands, one in the cell's fluid and one in vacuum, record the energy
of randomly moving robots after every step.
"""

import itertools
import math
import time
from dataclasses import dataclass, replace

import numpy as np

from seastar_gym.scene import Numerics, Scene, SmaPulse, Water
from seastar_gym.scene.numerics import SchemeName
from seastar_gym.simulator import Simulator, State, StrokeReport
from seastar_gym.simulator.pauses import completed
from seastar_gym.simulator.schedule import step_times
from studies.frame import Floats
from studies.stability.cases import Case, Sweep

MOST_STEPS = 2000
"""Largest number of time steps of a stroke."""
ENERGY_STEPS = 100
"""Number of time steps of a run without commands."""
ROBOTS = 8
"""Number of robots in a cell. Cells of peak angles have one for every command instead."""
ENERGY_RUN_SPEED = 0.1
"""Standard deviation of the initial velocities [m/s] in the energy runs of cases without initial motion."""
REFERENCE_STEPS = 10_000
"""Number of steps of the converged stroke, which the implicit midpoint rule computes."""
AGREEMENT = 0.01
"""Largest relative difference of the converged path from the one with half as many steps."""


@dataclass(frozen=True)
class Cell:
    """A cell of the atlas, and a line of the CSV.

    refused: Sentence with which the scene was refused, or empty. The other numbers of a refused cell are empty.
    robots, steps: Number of robots, and of nominal time steps in the stroke.
    failed: Number of robots whose status was not CONVERGED, or whose state was not finite, in any of the runs.
    iterations: Newton iterations per nominal time step, averaged over the stroke and its robots.
    regularised, backtracks, halvings, energy_cuts: Counts of StrokeReport, summed over robots.
    folded: Number of robots whose opening angles do not add up to a full turn after the stroke, because a hub hinge
        passed through pi.
    opening_angle: Smallest opening angle of a hub hinge [rad], see StrokeReport.
    strain, speed: Largest strain of an edge and largest speed of a node [m/s] at the stroke's end.
    growth, growth_in_vacuum: Largest relative growth of a robot's energy in one step without commands. Energies below
        a billionth of the initial one count as that billionth.
    gain, gain_in_vacuum: Largest energy of a robot over its initial energy, less 1.
    error: Distance of the hub from the converged one, relative to the hub's displacement: root mean squares over
        robots, at the end of heating and at the stroke's end. NaN where there is no converged run.
    seconds: Elapsed time of the cell's runs [s].
    """

    sweep: str
    value: float | None
    step: float
    refused: str = ""
    robots: int = 0
    steps: int = 0
    failed: int = 0
    iterations: float = math.nan
    regularised: int = 0
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
    """Duration of a cell's stroke [s]: the chapter's, or MOST_STEPS steps if that is less."""
    return min(1.0, MOST_STEPS * step)


def make_scene(case: Case, numerics: Numerics, duration: float) -> Scene:
    """Scene of a case; a stroke that is cut short ramps as fast as a whole one."""
    whole = Scene(case.robot, case.fluid, SmaPulse(case.peak_angle), numerics)
    return replace(whole, actuator=SmaPulse(case.peak_angle * duration, 0.1 * duration, 0.9 * duration))


def commands_of(case: Case) -> Floats:
    """Commands of a case's robots, shape (n_robots, n_limbs)."""
    n_limbs = case.robot.n_limbs
    if case.all_commands:
        return np.array(list(itertools.product((0.0, 1.0, -1.0), repeat=n_limbs)))
    commands = np.random.default_rng(1).integers(-1, 2, (ROBOTS, n_limbs)).astype(float)
    commands[0] = [0.0, 1.0, 0.0, 0.0, -1.0]
    return commands


def disturb(simulator: Simulator, speed: float, shift: float) -> None:
    """Add random velocities [m/s] and shifts [edge lengths] to all nodes, from the same random numbers in all cells."""
    rng, state = np.random.default_rng(2), simulator.get_state()
    shifts = rng.uniform(-1.0, 1.0, state.positions.shape) * shift * simulator.scene.robot.edge_length
    velocities = rng.standard_normal(state.positions.shape) * speed
    simulator.set_state(State(state.positions + shifts, velocities, state.time))


def swim(case: Case, numerics: Numerics, duration: float) -> tuple[Simulator, Floats, StrokeReport]:
    """Simulate a stroke of a case's robots: (simulator, hub displacements, report).

    The displacements [m] have shape (2, n_robots, 2): at the end of heating, and at the end of the stroke.
    """
    commands = commands_of(case)
    simulator = Simulator(make_scene(case, numerics, duration), len(commands), threads=1)
    disturb(simulator, case.speed, case.shift)
    begin, hubs = simulator.hub_position(), {}

    def look(time: float) -> None:
        hubs[round(time / duration, 6)] = simulator.hub_position()

    report = completed(simulator.stroke_in_parts(commands, 10), look)
    return simulator, np.array([hubs[0.1], hubs[1.0]]) - begin, report


def converged_displacements(case: Case, duration: float) -> Floats | None:
    """Converged hub displacements of a case [m], see `swim`, or None if two fine time steps do not agree on them."""
    found = []
    for steps in (REFERENCE_STEPS, REFERENCE_STEPS // 2):
        _, displacements, report = swim(case, Numerics("implicit-midpoint", duration / steps), duration)
        if report.status.any():
            return None
        found.append(displacements)
    return found[0] if displacement_error(found[1], found[0]) <= AGREEMENT else None


def displacement_error(displacements: Floats, converged: Floats) -> float:
    """Relative error of hub displacements, see `Cell.error`; NaN if the converged hub does not move."""
    size = float(np.sqrt(np.mean(converged**2)))
    return float(np.sqrt(np.mean((displacements - converged) ** 2))) / size if size > 0.0 else math.nan


def largest_strain(simulator: Simulator) -> float:
    """Largest |length / natural length - 1| of all edges of all robots."""
    robot, nodes = simulator.scene.robot, simulator.positions
    limbs = nodes[:, 1:].reshape(len(nodes), robot.n_limbs, -1, 2)
    hubs = np.broadcast_to(nodes[:, None, :1], (len(nodes), robot.n_limbs, 1, 2))
    lengths = np.linalg.norm(np.diff(np.concatenate([hubs, limbs], axis=2), axis=2), axis=-1)
    return float(np.abs(lengths / robot.edge_length - 1.0).max())


def count_folded(simulator: Simulator) -> int:
    """Number of robots with a hub hinge that passed through pi, see `Cell.folded`."""
    roots = simulator.positions[:, 1 :: simulator.scene.robot.nodes_per_limb - 1] - simulator.positions[:, :1]
    directions = np.arctan2(roots[..., 1], roots[..., 0])
    angles = np.remainder(np.roll(directions, -1, axis=1) - directions + np.pi, 2.0 * np.pi) - np.pi
    return int((np.abs(angles.sum(axis=1) - 2.0 * np.pi) > 1.0).sum())


def energy_growth(case: Case, numerics: Numerics, fluid: Water | None) -> tuple[float, float, int]:
    """(growth, gain, number of failed robots) of randomly moving robots without commands, see `Cell`."""
    half = 0.5 * ENERGY_STEPS * numerics.step
    simulator = Simulator(Scene(case.robot, fluid, SmaPulse(0.0, half, half), numerics), ROBOTS, threads=1)
    disturb(simulator, case.speed if case.speed or case.shift else ENERGY_RUN_SPEED, case.shift)
    energies = [simulator.elastic_energy() + simulator.kinetic_energy()]
    for _ in simulator.stroke_in_parts(np.zeros((ROBOTS, case.robot.n_limbs)), ENERGY_STEPS):
        energies.append(simulator.elastic_energy() + simulator.kinetic_energy())
    energy = np.array(energies)
    growth = np.diff(energy, axis=0) / np.maximum(energy[:-1], 1e-9 * energy[0])
    lost = simulator.failed | ~np.isfinite(energy).all(axis=0)
    return float(growth.max()), float((energy / energy[0]).max()) - 1.0, int(lost.sum())


def run_cell(sweep: Sweep, value: float | None, step: float, scheme: SchemeName, converged: Floats | None) -> Cell:
    """Measure one cell; converged: the result of `converged_displacements` for its case and duration."""
    start, case, numerics = time.perf_counter(), sweep.case(value), Numerics(scheme, step)
    try:
        simulator, displacements, report = swim(case, numerics, stroke_duration(step))
    except ValueError as refusal:
        return Cell(sweep.name, value, step, refused=str(refusal))
    finite = np.isfinite(simulator.positions).all(axis=(1, 2)) & np.isfinite(simulator.velocities).all(axis=(1, 2))
    in_fluid, in_vacuum = energy_growth(case, numerics, case.fluid), energy_growth(case, numerics, None)
    steps = count_steps(simulator.scene)
    return Cell(
        sweep.name, value, step, "", simulator.n_robots, steps,
        failed=int((report.status.astype(bool) | ~finite).sum()) + in_fluid[2] + in_vacuum[2],
        iterations=float(report.newton_iterations.mean()) / steps,
        regularised=int(report.regularised.sum()), backtracks=int(report.backtracks.sum()),
        halvings=int(report.halvings.sum()), energy_cuts=int(report.energy_cuts.sum()), folded=count_folded(simulator),
        opening_angle=float(report.smallest_opening_angle.min()), strain=largest_strain(simulator),
        speed=float(np.linalg.norm(simulator.velocities, axis=-1).max()),
        growth=in_fluid[0], growth_in_vacuum=in_vacuum[0], gain=in_fluid[1], gain_in_vacuum=in_vacuum[1],
        error=math.nan if converged is None else displacement_error(displacements, converged),
        seconds=time.perf_counter() - start,
    )  # fmt: skip


def count_steps(scene: Scene) -> int:
    """Number of nominal time steps of a stroke, without substeps."""
    return len(step_times(scene.actuator.corners, scene.numerics.step)) - 1
