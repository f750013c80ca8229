"""How a tangent grows: whether the derivative of a swim stays small enough to be used.

Every swim is made by three robots side by side. One differs from the first by random velocities of 1e-7 m/s at the
start, one by pulses of the first stroke that are smaller by a share of 1e-7. What they differ by later, over that
share, is a tangent of the swim. Its growth is the root mean square of the nodes' differences after some strokes, over
that after the first. "Shape" is the same of positions as the robot itself sees them, from the hub and along its
heading. Newton's tolerance is 1e-12 limb lengths. A fourth robot, with pulses that are smaller by 1e-6, tells whether
differences are tangents.

A cost is the processor time of derivatives over that of the swim, of one robot alone on one processor, once everything
is compiled: the shortest of some trials.

Writes growth and costs as JSON, and a picture of the growth. Run it again to fill in what is missing.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np

from seastar_gym.controllers.learned import bundled_file, load
from seastar_gym.envs.commands import to_commands
from seastar_gym.files import save_figure
from seastar_gym.gaits import PAIRS, STRAIGHT, lagged_gait, pentagon_gait, timed
from seastar_gym.gradients import differentiate, record
from seastar_gym.scene import Contact, Scene, SmaWires, Vortex, Water
from seastar_gym.scene.per_robot import at, side_by_side, with_numbers
from seastar_gym.simulator import Simulator
from studies.frame import Floats, Results, Study, rounded
from studies.pages import markdown
from studies.speed.strokes import repeat
from studies.style import CYCLE, INK, subplots

Commands = Callable[[int, int, np.random.Generator], Floats]

STROKES, SWIMS = 100, 32
SMALL, LARGER = 1e-7, 1e-6
NEWTON_TOLERANCE = 1e-12
SHOWN = (10, 100)
"""Strokes of the table."""
LIMIT = 10.0
"""Growth up to which whole swims are differentiated."""
OTHERS = {"random, in a vortex": CYCLE[1], "random, vacuum": CYCLE[3]}
"""Cases whose tangents grow, and their colours."""
TANGENTS = ("start", "pulse")


class Case(NamedTuple):
    """Scene, commands of n strokes of n swims, shape (n_decisions, n_swims, 5), and decisions per second."""

    scene: Scene
    commands: Commands
    every: int = 1


def signs(strokes: int, swims: int, rng: np.random.Generator) -> Floats:
    """Random commands of -1, 0 and 1."""
    return rng.integers(-1, 2, (strokes, swims, 5)).astype(float)


def shares(strokes: int, swims: int, rng: np.random.Generator) -> Floats:
    """Random commands from -1 to 1."""
    return rng.uniform(-1.0, 1.0, (strokes, swims, 5))


def repeated(strokes: int, swims: int, rng: np.random.Generator) -> Floats:
    """A random command of every swim, again and again."""
    return np.repeat(signs(1, swims, rng), strokes, axis=0)


def gaits(strokes: int, swims: int, rng: np.random.Generator) -> Floats:
    """The straight swim, the pairs of Fig. 13.8 and the pentagon."""
    pentagon = np.resize(pentagon_gait(), (strokes, 1, 5))
    same = np.repeat(np.array([[STRAIGHT, *PAIRS.values()]]), strokes, axis=0)
    return np.concatenate([same, pentagon], axis=1)


def lagged(decisions: int, swims: int, rng: np.random.Generator) -> Floats:
    """The lagged gait and, as decisions, the straight swim."""
    seconds = decisions // 5
    straight = timed(np.tile(STRAIGHT, (seconds, 1)), 0.2)
    return np.stack([np.tile(lagged_gait(0.2), (seconds, 1)), straight], axis=1)


def of_policy(decision_period: float | None) -> Commands:
    """What the bundled policy commands on random paths, one after the other, to be swum open loop."""

    def commands(decisions: int, swims: int, rng: np.random.Generator) -> Floats:
        timed = {} if decision_period is None else {"decision_period": decision_period}
        name = "SeastarSwim-v0" if decision_period is None else "SeastarSwimTimed-v0"
        options: dict[str, Any] = {"path": "random", "actions": "pairs", **timed}
        batch = gym.make_vec(name, swims, vectorization_mode="vector_entry_point", **options)
        policy, (seen, _) = load(bundled_file(decision_period)), batch.reset(seed=0)
        state, begins, told = None, np.ones(swims, bool), []
        for _ in range(decisions):
            actions, state = policy.predict(seen, state=state, episode_start=begins, deterministic=True)
            told.append(to_commands("pairs", 5, actions, swims))
            seen, _, terminated, truncated, _ = batch.step(actions)
            begins = terminated | truncated
        return np.array(told)

    return commands


WIRES = replace(Scene(), actuator=SmaWires())
CASES: dict[str, Case] = {
    "random commands of -1, 0, 1": Case(Scene(), signs),
    "random shares": Case(Scene(), shares),
    "a random command, repeated": Case(Scene(), repeated),
    "gaits of the chapter": Case(Scene(), gaits),
    "bundled policy": Case(Scene(), of_policy(None)),
    "wires: random, every 0.2 s": Case(WIRES, signs, 5),
    "wires: gaits, every 0.2 s": Case(WIRES, lagged, 5),
    "wires: bundled policy, every 0.2 s": Case(WIRES, of_policy(0.2), 5),
    "random, discretisation of the chapter": Case(Scene.preset("chapter"), signs),
    "random, contact": Case(replace(Scene(), contact=Contact()), signs),
    "random, added mass, little drag along": Case(
        Scene(fluid=Water(tangential_drag_coefficient=0.1, added_mass_coefficient=1.0)), signs
    ),
    "random, in a vortex": Case(Scene(fluid=Water(current=Vortex(0.02, 0.1, 0.0, 0.05))), signs),
    "random, vacuum": Case(Scene(fluid=None), signs),
}
"""Cases of the study."""


def seen_by_robot(simulator: Simulator) -> Floats:
    """Node positions from the hub and along the robot's heading [m], shape (n_robots, n_nodes, 2)."""
    c, s = np.cos(simulator.heading())[:, None], np.sin(simulator.heading())[:, None]
    x, y = np.moveaxis(simulator.positions - simulator.hub_position()[:, None], -1, 0)
    return np.stack([c * x + s * y, c * y - s * x], axis=-1)


def rms(differences: Floats) -> Floats:
    """Root mean square over the nodes, shape (n_robots,)."""
    return np.asarray(np.sqrt(np.square(differences).sum(axis=-1).mean(axis=-1)))


def growth(case: Case, strokes: int, swims: int, seed: int = 0) -> dict[str, Any]:
    """Growth of both tangents after every stroke, shape (strokes, n_swims) each, and what tells whether they are such.

    nonlinearity: Largest relative difference of tangents by the two sizes of difference, of the hub and all swims.
    troubled: Share of the swims with a halved or a guarded step.
    """
    rng = np.random.default_rng(seed)
    given = case.commands(strokes * case.every, swims, rng)
    n = given.shape[1]
    numerics = replace(case.scene.numerics, newton_tolerance=NEWTON_TOLERANCE)
    simulator = Simulator(replace(case.scene, numerics=numerics), 4 * n, threads=1)
    state = simulator.get_state()
    state.velocities[n : 2 * n] += SMALL * rng.standard_normal(state.velocities[:n].shape)
    simulator.set_state(state)
    factors = np.repeat([1.0, 1.0, 1.0 - SMALL, 1.0 - LARGER], n)[:, None]
    found: dict[str, list[Floats]] = {f"{tangent} {of}": [] for tangent in TANGENTS for of in ("nodes", "shape")}
    nonlinearity, troubled = np.zeros(n), np.zeros(n, bool)
    for stroke in range(strokes):
        for command in given[stroke * case.every : (stroke + 1) * case.every]:
            told = np.tile(command, (4, 1)) * (factors if stroke == 0 else 1.0)
            report = simulator.advance(1.0 / case.every, told)
            troubled |= (report.halvings + report.energy_cuts > 0).reshape(4, n).any(axis=0)
        for of, places in (("nodes", simulator.positions), ("shape", seen_by_robot(simulator))):
            first, start, pulse, larger = places.reshape(4, n, *places.shape[1:])
            found[f"start {of}"].append(rms(start - first))
            found[f"pulse {of}"].append(rms(pulse - first))
            if of == "nodes":
                off = rms((larger - first) * (SMALL / LARGER) - (pulse - first)) / np.maximum(rms(pulse - first), 1e-15)
                nonlinearity = np.maximum(nonlinearity, off)
    moved = found["pulse nodes"][0] > 0.0  # swims whose first command is zero have no pulse
    grown = {name: np.array(values)[:, moved] / values[0][moved] for name, values in found.items()}
    return {**grown, "nonlinearity": nonlinearity[moved], "troubled": troubled}


def as_data(found: dict[str, Any]) -> dict[str, Any]:
    """Medians and worst growth as plain data."""
    curves = {
        name: {
            "median": [rounded(float(value), 3) for value in np.median(values, axis=1)],
            "worst": [rounded(float(value), 3) for value in values.max(axis=1)],
        }
        for name, values in found.items()
        if name not in ("nonlinearity", "troubled")
    }
    return {
        **curves,
        "swims": int(found["pulse nodes"].shape[1]),
        "nonlinearity": rounded(float(found["nonlinearity"].max()), 2),
        "troubled": rounded(float(found["troubled"].mean()), 2),
    }


SWUM, TRIALS = 20, 3
"""Strokes of a swim whose derivatives are timed, and how often."""
NUMBERS = [
    "fluid.drag_coefficient", "robot.youngs_modulus", "robot.density", "fluid.density", "robot.rod_radius",
    "robot.limb_length", "actuator.peak_angle",
]  # fmt: skip
UNKNOWNS: dict[str, list[str]] = {
    "1 number": NUMBERS[:1],
    "7 numbers": NUMBERS,
    "100 commands": ["commands"],
    "112 velocities": ["velocities"],
    "all of these": [*NUMBERS, "commands", "velocities"],
}
"""Unknowns of swims of SWUM strokes."""


def processor_time(run: Callable[[], Any]) -> float:
    """Shortest processor time of some trials [s], after a first one that may compile."""
    return min(repeat(run, 0.0, TRIALS, time.process_time))


def swim_alone(scene: Scene, commands: Floats) -> None:
    """Swim with robots side by side. commands: Shape (n_strokes, n_robots, 5)."""
    simulator = Simulator(scene, commands.shape[1], threads=1)
    for command in commands:
        simulator.stroke(command)


def by_differences(scene: Scene, commands: Floats, names: list[str]) -> None:
    """Central differences in numbers of the scene, or in all commands, by robots side by side."""
    if names == ["commands"]:
        told = np.repeat(commands[:, None], 2 * commands.size, axis=1)
        for k, (stroke, limb) in enumerate(np.ndindex(*commands.shape)):
            told[stroke, 2 * k : 2 * k + 2, limb] += [-1e-5, 1e-5]
        swim_alone(scene, told)
        return
    factors = (1.0 - 1e-5, 1.0 + 1e-5)
    pairs = [with_numbers(scene, {name: at(scene, name) * factor}) for name in names for factor in factors]
    swim_alone(side_by_side(pairs), np.repeat(commands[:, None], len(pairs), axis=1))


def cost(names: list[str]) -> dict[str, float]:
    """Processor time of derivatives of the last place of the hub, in swims."""
    scene, commands = Scene(), 0.99 * shares(SWUM, 1, np.random.default_rng(0))[:, 0]
    alone = processor_time(lambda: swim_alone(scene, commands[:, None]))
    slopes = np.zeros((SWUM + 1, 2))
    slopes[-1, 0] = 1.0
    found = {
        "gradient": processor_time(lambda: record(scene, commands).gradient({"hub": slopes}, names)),
        "dual lanes": processor_time(lambda: differentiate(scene, commands, names)),
    }
    if names == ["commands"] or set(names) <= set(NUMBERS):
        found["differences"] = processor_time(lambda: by_differences(scene, commands, names))
    return {"swim_ms": rounded(1e3 * alone, 3)} | {name: rounded(each / alone, 3) for name, each in found.items()}


def cost_table(results: Mapping[str, Any]) -> str:
    """Table of costs in Markdown."""
    ways = ("gradient", "dual lanes", "differences")
    costs = results["cost"].items()
    rows = [[name, *(f"{found[way]:.2g}" if way in found else "" for way in ways)] for name, found in costs]
    return markdown(["unknowns", *ways], rows)


def run(results: Results) -> None:
    """Measure all cases and costs that are missing."""
    cases = {
        ("growth", name): partial(lambda case: as_data(growth(case, STROKES, SWIMS)), CASES[name]) for name in CASES
    }
    costs = {("cost", name): partial(cost, names) for name, names in UNKNOWNS.items()}
    results.fill(cases | costs, lambda found: f"{found.get('gradient', found.get('swims'))}")


def cases_of(results: Mapping[str, Any]) -> dict[str, Any]:
    """Growth by the names of cases."""
    return {name: results["growth"][name] for name in CASES if name in results["growth"]}


def largest(case: Mapping[str, Any], of: str) -> Floats:
    """Growth of the worst swim after every stroke, of the larger of both tangents."""
    return np.max([case[f"{tangent} {of}"]["worst"] for tangent in TANGENTS], axis=0)


def table(results: Mapping[str, Any]) -> str:
    """Table of growth in Markdown."""
    rows = []
    for name, case in cases_of(results).items():
        worst, shape = largest(case, "nodes"), largest(case, "shape")
        above = np.flatnonzero(worst > LIMIT)
        cells = [*(f"{worst[n - 1]:.2g}" for n in SHOWN), above[0] + 1 if above.size else "-"]
        rows.append([name, *cells, f"{shape[SHOWN[0] - 1]:.1g}"])
    strokes = (f"after {n}" for n in SHOWN)
    return markdown(["swims", *strokes, f"above {LIMIT:.0f} from stroke", f"shape after {SHOWN[0]}"], rows)


def draw(results: Mapping[str, Any], path: Path) -> None:
    """Picture of the growth of the worst swims over strokes."""
    figure, axes = subplots(1, 2, figsize=(9.0, 4.0), sharey=True)
    for axis, of, title in zip(axes, ("nodes", "shape"), ("Positions of the nodes", "Shape"), strict=True):
        for name, case in cases_of(results).items():
            growth_of_case = largest(case, of)
            colour = OTHERS.get(name, CYCLE[0])
            axis.loglog(np.arange(1, len(growth_of_case) + 1), growth_of_case, color=colour, lw=1.2, alpha=0.8)
        axis.axhline(LIMIT, color=INK, lw=0.8, ls=":")
        axis.set_title(title, loc="left")
        axis.set_xlabel("strokes")
    axes[0].set_ylabel("tangent over that after the first stroke")
    axes[0].text(10, 1e6, "vacuum", color=OTHERS["random, vacuum"], ha="right")
    axes[0].text(3, 3e1, "in a vortex", color=OTHERS["random, in a vortex"])
    axes[0].text(3, 1e-2, "in water at rest: all others", color=CYCLE[0])
    save_figure(figure, path)


STUDY = Study(
    "gradients", run, file="gradients/gradients.json", pictures={"gradients.png": draw},
    tables={"gradients growth": table, "gradients cost": cost_table},
    settings=lambda: {
        "strokes": STROKES, "swims": SWIMS, "newton_tolerance": NEWTON_TOLERANCE, "timed_strokes": SWUM,
    },
)  # fmt: skip
