"""Cost of each term of a scene.

Scenes that differ from the chapter's in one term take turns to swim straight, and the scene with contact also presses
two limbs together. Each stroke is compared with the chapter's scene in the same round, so that other work of the
machine affects both alike. Prints a table, and writes `terms.csv`.
"""

import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from seastar_gym.gaits import STRAIGHT
from seastar_gym.scene import AlongLimb, Body, Contact, Limb, Numerics, Scene, Seastar, Stiffening, relaxation_time
from seastar_gym.scene.currents import GridCurrent, ShearCurrent, UniformCurrent, Vortex
from seastar_gym.scene.fluid import Water
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simulator import Simulator
from studies.frame import Results, Study, write_rows
from studies.pages import markdown, show

PRESSING = np.array([1.0, -1.0, 0.0, 0.0, 0.0])
"""Command that presses limbs 1 and 2 together."""
ROUNDS = 40
"""Strokes of every scene."""
GROUPS = 8
"""Lane groups in the batch. All robots do the same, so no lane waits for another."""
SILICONE = relaxation_time(0.1, 10.0)
"""Relaxation time [s] of a soft silicone, loss factor 0.1 at 10 Hz."""
THE_CHAPTERS = "the chapter's scene"


def swirl(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Velocity of a cellular current [m/s] at positions x, y [m]."""
    return 0.02 * np.sin(10.0 * x) * np.cos(10.0 * y), -0.02 * np.cos(10.0 * x) * np.sin(10.0 * y)


def scenes() -> dict[str, Scene]:
    """Compared scenes by name: the chapter's first, then each with one more term, then all terms together."""
    n_robots = GROUPS * N_LANES
    damped = Seastar(relaxation_time=SILICONE)
    everything = Water(
        tangential_drag_coefficient=0.02, added_mass_coefficient=1.0, current=GridCurrent.from_function(
            swirl, (-1.0, 1.0), (-1.0, 1.0), 0.02
        ),
    )  # fmt: skip
    fluids = {
        "no fluid": None,
        "drag along limbs": Water(tangential_drag_coefficient=0.02),
        "uniform current": Water(current=UniformCurrent(0.01, 0.0)),
        "shear": Water(current=ShearCurrent(0.1)),
        "vortex": Water(current=Vortex(0.01, 0.2, 0.2)),
        "current on a grid": Water(current=everything.current),
        "added mass": Water(added_mass_coefficient=1.0),
    }
    found = {
        THE_CHAPTERS: Scene(),
        **{name: Scene(fluid=fluid) for name, fluid in fluids.items()},
        "material damping": Scene(damped),
        "bent along the limbs": Scene(Seastar(along=AlongLimb())),
        "bent along, stiff when hot": Scene(Seastar(along=AlongLimb(), stiffening=Stiffening())),
        "a disc for a body": Scene(Seastar(body=Body(radius=0.02))),
        "a rectangle for a body": Scene(Seastar(body=Body.rectangle(0.06, 0.03))),
        "joints of the limbs": Scene(Seastar(limbs=(Limb(joint_stiffness=2e-4),) * 5)),
        "contact, limbs apart": Scene(contact=Contact()),
        "a rectangle for a body, contact": Scene(Seastar(body=Body.rectangle(0.06, 0.03)), contact=Contact()),
        "numbers of each robot": Scene(Seastar(youngs_modulus=np.full(n_robots, 1e6))),
        "all of these": Scene(replace(damped, youngs_modulus=np.full(n_robots, 1e6)), everything),
        "all, a body, bent along, contact": Scene(
            replace(
                damped,
                youngs_modulus=np.full(n_robots, 1e6),
                along=AlongLimb(),
                stiffening=Stiffening(),
                body=Body.rectangle(0.06, 0.03),
            ),
            everything,
            contact=Contact(),
        ),
    }
    return {name: in_ten_nodes(scene) for name, scene in found.items()}


def in_ten_nodes(scene: Scene) -> Scene:
    """Scene with the nodes and steps of the chapter, in the continuum's discretisation."""
    return replace(scene, robot=replace(scene.robot, nodes_per_limb=10), numerics=Numerics())


@dataclass(frozen=True)
class Cost:
    """Cost of a scene relative to the chapter's.

    iterations: Newton iterations per time step.
    seconds: Median processor time per robot and Newton iteration [s].
    per_iteration: Median over rounds of the time per iteration, relative to the chapter's scene.
    quartiles: Lower and upper quartile of that ratio.
    per_stroke: Median over rounds of the time per stroke, relative to the chapter's scene.
    """

    name: str
    iterations: float
    seconds: float
    per_iteration: float
    quartiles: tuple[float, float]
    per_stroke: float


def measure(compared: dict[str, Scene], rounds: int, command: np.ndarray = STRAIGHT) -> list[Cost]:
    """Measure the costs of scenes relative to the first one; command: Command of all robots in all strokes."""
    n_robots = GROUPS * N_LANES
    commands = np.tile(command, (n_robots, 1))
    simulators = [Simulator(scene, n_robots, threads=1) for scene in compared.values()]
    for simulator in simulators:
        simulator.stroke(commands)
    seconds, iterations, steps = np.zeros((3, len(simulators), rounds))
    for k in range(rounds):
        for i, simulator in enumerate(simulators):
            start = time.thread_time()
            report = simulator.stroke(commands)
            seconds[i, k] = (time.thread_time() - start) / n_robots
            iterations[i, k], steps[i, k] = report.newton_iterations[0], report.steps[0]
    per_iteration = seconds / iterations
    ratios, strokes = per_iteration / per_iteration[0], seconds / seconds[0]
    costs = []
    for i, name in enumerate(compared):
        low, middle, high = np.percentile(ratios[i], [25, 50, 75])
        costs.append(
            Cost(
                name=name,
                iterations=float(iterations[i].sum() / steps[i].sum()),
                seconds=float(np.median(per_iteration[i])),
                per_iteration=float(middle),
                quartiles=(float(low), float(high)),
                per_stroke=float(np.median(strokes[i])),
            )
        )
    return costs


def as_table(costs: list[Cost]) -> str:
    """Costs as a table in Markdown."""
    rows = [
        [cost.name, f"{cost.iterations:.2f}", f"{1e6 * cost.seconds:.3f}",
         "x {:.2f} ({:.2f} to {:.2f})".format(cost.per_iteration, *cost.quartiles), f"x {cost.per_stroke:.2f}"]
        for cost in costs
    ]  # fmt: skip
    head = ["scene", "iterations per step", "µs per robot and iteration", "time per iteration", "per stroke"]
    return markdown(head, rows)


def run(results: Results) -> None:
    """Measure the costs, print them and write them as CSV."""
    costs = measure(scenes(), ROUNDS)
    touching = {THE_CHAPTERS: Scene(), "contact, a pair of limbs pressed together": Scene(contact=Contact())}
    touching = {name: in_ten_nodes(scene) for name, scene in touching.items()}
    costs += measure(touching, ROUNDS, PRESSING)[1:]
    show(as_table(costs), "Cost of terms, implicit Euler at 3 ms, one core")
    rows = ([c.name, c.iterations, c.seconds, c.per_iteration, *c.quartiles, c.per_stroke] for c in costs)
    names = ["name", "iterations", "seconds", "per_iteration", "low", "high", "per_stroke"]
    write_rows(results.out / "terms.csv", names, rows)


STUDY = Study("speed.terms", run, out=Path("runs/terms"))
