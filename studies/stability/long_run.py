"""Long runs: of random commands, and of gaits in which the implicit midpoint rule may gather energy."""

import time
from dataclasses import dataclass, fields, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.table import Table
from tqdm import tqdm

from seastar_gym.accuracy.endurance import LONG, energy_growths
from seastar_gym.scene import Numerics, Scene, Seastar
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.simulator import Simulator
from studies.stability.cells import largest_strain

Floats = NDArray[np.float64]

SAMPLES = 8
"""Commands that are repeated, and pairs of commands that are swum in turn: 17 gaits with the fastest one."""


@dataclass(frozen=True)
class LongRun:
    """Results of many strokes of random commands.

    failed: Number of failed robots.
    regularised, halvings, energy_cuts: Counts of StrokeReport, summed over strokes and robots.
    strain, speed: Largest strain of an edge and largest speed of a node [m/s] at the end of a stroke.
    strain_late, speed_late: Largest strain and speed [m/s] in the last tenth of the strokes.
    farthest: Largest distance of a hub from its start at the end of the run [m].
    seconds: Elapsed time of the run [s].
    """

    strokes: int
    robots: int
    failed: int
    iterations_per_stroke: float
    regularised: int
    halvings: int
    energy_cuts: int
    strain: float
    strain_late: float
    speed: float
    speed_late: float
    farthest: float
    seconds: float


def long_run(
    strokes: int = 10_000,
    robots: int = 256,
    fidelity: Fidelity = "fast",
    threads: int | None = None,
    progress: bool = True,
) -> LongRun:
    """Simulate strokes of random commands, drawn for every robot and stroke."""
    scene = Scene(Seastar(nodes_per_limb=10), numerics=Numerics.preset(fidelity))
    simulator = Simulator(scene, robots, threads)
    rng, start = np.random.default_rng(0), time.perf_counter()
    iterations, regularised, halvings, cuts, strain, speed = np.zeros((6, strokes))
    for k in tqdm(range(strokes), unit="stroke", disable=not progress):
        report = simulator.stroke(rng.integers(-1, 2, (robots, simulator.scene.robot.n_limbs)))
        iterations[k], regularised[k] = report.newton_iterations.mean(), report.regularised.sum()
        halvings[k], cuts[k] = report.halvings.sum(), report.energy_cuts.sum()
        strain[k], speed[k] = largest_strain(simulator), np.linalg.norm(simulator.velocities, axis=-1).max()
    late = -max(1, strokes // 10)
    return LongRun(
        strokes=strokes, robots=robots, failed=int(simulator.failed.sum()),
        iterations_per_stroke=float(iterations.mean()), regularised=int(regularised.sum()),
        halvings=int(halvings.sum()),
        energy_cuts=int(cuts.sum()), strain=float(strain.max()), strain_late=float(strain[late:].max()),
        speed=float(speed.max()), speed_late=float(speed[late:].max()),
        farthest=float(np.linalg.norm(simulator.hub_position(), axis=-1).max()), seconds=time.perf_counter() - start,
    )  # fmt: skip


def long_table(run: LongRun) -> Table:
    """Results of a long run as a table for the terminal."""
    table = Table("quantity", "value", title="Long run of random commands")
    for one in fields(LongRun):
        table.add_row(one.name.replace("_", " "), f"{getattr(run, one.name):.5g}")
    return table


class Resonance(NamedTuple):
    """Setting of the implicit midpoint rule. step: [s]. stiffness: Factor of the chapter's Young's modulus."""

    nodes: int
    step: float
    stiffness: float = 1.0


RESONANCES = (
    *(Resonance(nodes, 5e-3) for nodes in (7, 10, 12, 18, 19, 20, 22)),
    *(Resonance(19, step) for step in (4e-3, 2.5e-3)),
    *(Resonance(nodes, step, 10.0) for step in (5e-3, 2e-3, 1e-3) for nodes in (7, 10, 13, 19)),
    *(Resonance(nodes, 5e-3, 0.1) for nodes in (7, 10, 13, 19)),
)


def growths(setting: Resonance, strokes: int = LONG) -> Floats:
    """Largest kinetic energy at the ends of the last strokes over that of the first, for each gait; the fastest first.

    strokes: Length of the swims.
    """
    robot = Seastar(nodes_per_limb=setting.nodes)
    robot = replace(robot, youngs_modulus=setting.stiffness * robot.youngs_modulus)
    scene = Scene(robot, numerics=Numerics("implicit-midpoint", setting.step))
    return energy_growths(scene, SAMPLES, strokes=strokes)


def growth_table(settings: tuple[Resonance, ...] = RESONANCES, strokes: int = LONG) -> Table:
    """By how much the kinetic energy of long swims grows, as a table for the terminal."""
    table = Table("nodes", "step", "stiffness", "fastest gait", "median", "largest", title="Growth of kinetic energy")
    for setting in tqdm(settings, unit="setting"):
        found = growths(setting, strokes)
        numbers = (f"{each:.3g}" for each in (found[0], np.median(found), found.max()))
        table.add_row(str(setting.nodes), f"{1e3 * setting.step:g} ms", f"x {setting.stiffness:g}", *numbers)
    return table
