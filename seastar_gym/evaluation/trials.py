"""Many swims of every agent, on named and random paths, nominal and disturbed: means with confidence intervals.

Random paths have random headings. The disturbed pentagon is there for the scripted gait, which knows no other path.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from seastar_gym.controllers.contract import Policy
from seastar_gym.controllers.learned import camera_of
from seastar_gym.envs.options import make_scene
from seastar_gym.evaluation.results import MEANS, Row, number, statistics, text_table
from seastar_gym.evaluation.swim import CURRENT_DIRECTIONS, DISTURBANCES, swim_many
from seastar_gym.files import Row as CsvRow
from seastar_gym.files import read_table
from seastar_gym.scene import Scene
from seastar_gym.scene.numerics import PRESETS, Fidelity, Resolution

NOMINAL: tuple[str, ...] = ("pentagon", "square", "triangle", "figure-eight")
SETS = ("nominal", "random", "pentagon")
"""Sets of swims: the named paths undisturbed; random paths under every disturbance; the pentagon under every one."""
OWN = "its own"
"""Name of the fidelity of a robot whose mesh and numerics are those of none."""

COLUMNS = {
    "path": "path",
    "disturbance": "disturbance",
    "agent": "agent",
    "fidelity": "fidelity",
    "swims": "swims",
    "success_rate": "success [%]",
    "strokes_to_finish": "strokes or decisions\nto finish",
    "simulated_time_s": "time [s]\nto finish",
    "mean_cross_track_error_mm": "mean cross-track\nerror [mm]",
    "limbs_heated_per_metre": "limbs heated\nper metre [1/m]",
    "energy_per_metre_J": "energy\nper metre [J/m]",
}
"""Titles of the columns, by the names of the CSV's."""
MEASURED = ("success_rate", *MEANS)
"""Those with confidence intervals."""


def trials(
    agents: Mapping[str, Policy],
    sets: Sequence[str] = SETS,
    swims: int = 1000,
    *,
    fidelity: Fidelity = "balanced",
    seed: int = 0,
    decision_period: float | None = None,
    threads: int | None = None,
    max_strokes: int | None = None,
    scene: Scene | None = None,
    say: Callable[[str], None] = print,
) -> list[Row]:
    """Rows of the results, one for every set of swims and agent.

    say: Function that is told of an agent that fails in a set. ValueError where all do.

    swims: Number of random paths of every set. seed: Of paths, headings and disturbances, the same for every agent.
    decision_period: Time between decisions [s]. None means a stroke. threads: Of the simulator; None means one for
    every processor. max_strokes: Time limit [decisions]; None means that of 400 s. scene: Robot with its numerics. None
    means the chapter's at `fidelity`.
    """
    robot = make_scene(None, fidelity, decision_period) if scene is None else scene
    named, rows, failed = fidelity if scene is None else fidelity_of(scene), list[Row](), list[str]()
    for path, label, n_swims in _sets(sets, swims, robot.robot.n_limbs):
        for agent, policy in agents.items():
            try:
                found = swim_many(
                    agent, policy, path, n_swims, robot, DISTURBANCES[label], seed=seed, threads=threads,
                    decision_period=decision_period, max_strokes=max_strokes, **camera_of(policy),
                )  # fmt: skip
            except ValueError as wrong:
                failed.append(f"{agent} does not swim {path}, {label}: {wrong}")
                say(failed[-1])
                continue
            row: Row = {"path": path, "disturbance": label, "agent": agent, "fidelity": named, "swims": n_swims}
            for name, numbers in statistics(found).items():
                row |= dict(zip((name, f"{name}_low", f"{name}_high"), numbers, strict=True))
            rows.append(row)
    if failed and not rows:
        raise ValueError(failed[0])
    return rows


def fidelity_of(scene: Scene) -> str:
    """Name of the fidelity whose mesh and numerics a scene has, or `OWN`."""
    own = Resolution(scene.robot.discretisation, scene.robot.nodes_per_limb, scene.numerics)
    return next((name for name, resolution in PRESETS.items() if resolution == own), OWN)


def _sets(asked: Sequence[str], swims: int, n_limbs: int) -> list[tuple[str, str, int]]:
    """Path, disturbance and number of swims of every set that was asked for.

    The disturbed pentagon is swum for every combination of a current's direction and a weak limb.
    """
    nominal = [(path, "none", 1) for path in NOMINAL]
    random = [("random", name, swims) for name in DISTURBANCES]
    pentagon = [("pentagon", name, n_limbs * CURRENT_DIRECTIONS) for name in DISTURBANCES if name != "none"]
    known = {"nominal": nominal, "random": random, "pentagon": pentagon}
    return [one for name in asked for one in known[name]]


def as_text(rows: Sequence[Row], decision_period: float | None = None) -> str:
    """Table of trials, for a terminal."""
    unit = "strokes" if decision_period is None else f"decisions of {decision_period:g} s"
    titles = [title.replace("strokes or decisions", unit) for title in COLUMNS.values()]
    return text_table(titles, [[_cell(row, name) for name in COLUMNS] for row in map(as_shown, rows)])


def _cell(row: Row, name: str) -> str:
    low, high = row.get(f"{name}_low"), row.get(f"{name}_high")
    return number(row[name]) + ("" if low is None else f" [{number(low)}, {number(high)}]")


def as_shown(row: Row) -> Row:
    """A row with rates in per cent, and None for NaN: no swim arrived."""
    shown = dict(row)
    for name, value in row.items():
        if isinstance(value, float):
            shown[name] = None if np.isnan(value) else 100.0 * value if "rate" in name else value
    return shown


def read_trials(file: Path) -> list[Row]:
    """The CSV of trials. ValueError: it is none."""
    names, lines = read_table(file)
    if not lines or not set(COLUMNS) <= set(names):
        raise ValueError(f"{file} is not what trials write.")
    return [_read(names, line) for line in lines]


def _read(names: tuple[str, ...], line: CsvRow) -> Row:
    line.require_fields(len(names))
    row: dict[str, Any] = dict(zip(names, line.fields, strict=True))
    measured = [name + end for name in MEASURED for end in ("", "_low", "_high")]
    numbers = line._replace(fields=tuple(row[name] for name in measured)).numbers(missing=("nan",))
    return {name: row[name] for name in COLUMNS} | dict(zip(measured, numbers, strict=True))
