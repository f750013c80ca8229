"""The chapter's Figs. 13.2 and 13.5b to 13.9, recomputed and written as PNG.

Each swim is computed three times: with the chapter's setting, with its ten nodes converged in time, and with ten nodes
in the continuum's discretisation. The pictures show the first and the last. The pairs of limbs swim with 73 nodes, too.
The chapter's statements are printed beside the numbers, and written to `statements.csv`. What the pictures and tables
of docs/ show is written to `chapter.json`.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from seastar_gym import gaits
from seastar_gym.gaits import STRAIGHT
from seastar_gym.scene import Scene, SmaPulse
from studies.chapter import pictures
from studies.chapter.pictures import PENTAGON_TIMES
from studies.chapter.statements import (
    PAIRS,
    Statement,
    as_table,
    cost_statements,
    pair_statements,
    pentagon_statements,
    straight_statements,
    stroke_motion,
    write_csv,
)
from studies.chapter.swims import CONTINUUM, LIMIT, SETTINGS, THE_CHAPTERS, Swim, measure_cost, swim
from studies.frame import Floats, Results, Study, rounded
from studies.pages import markdown, show
from studies.style import MM

UNIT = 1e-6
"""Length that counts as one in the data [m]."""


def pentagon_commands() -> Floats:
    """Commands round the pentagon, shape (n_strokes, 1, n_limbs)."""
    return gaits.pentagon_gait()[:, None]


def pair_commands() -> Floats:
    """Commands of the pairs of Fig. 13.8, a robot each, shape (10, n_pairs, n_limbs)."""
    return np.tile(list(PAIRS.values()), (10, 1, 1))


def as_data(swim: Swim, times: Sequence[float] = ()) -> dict[str, Any]:
    """A swim as plain data. times: When all nodes are kept [s]."""
    first = swim.time[1 : swim.at_strokes()[1] + 1]
    hubs = np.rint(swim.positions[:, :, 0] / UNIT).astype(int)
    nodes = [np.rint(swim.positions[swim.at(time), 0] / UNIT).astype(int) for time in times]
    return {
        "setting": swim.label,
        "times_of_a_stroke_s": [round(float(time), 6) for time in first],
        "hub_x": hubs[..., 0].T.tolist(),
        "hub_y": hubs[..., 1].T.tolist(),
        "robots": {f"{time:g}": each.T.tolist() for time, each in zip(times, nodes, strict=True)},
    }


def from_data(data: Mapping[str, Any], commands: Floats) -> Swim:
    """A swim of which the hub is known, and all nodes at some times; other nodes and velocities are NaN."""
    setting = next(each for each in SETTINGS if each.label == data["setting"])
    scene = Scene(setting.robot, numerics=setting.numerics)
    starts = np.arange(len(commands))[:, None] * scene.actuator.period
    time = np.append(0.0, (starts + np.array(data["times_of_a_stroke_s"])).ravel())
    positions = np.full((len(time), commands.shape[1], scene.robot.n_nodes, 2), np.nan)
    positions[:, :, 0] = UNIT * np.stack([np.transpose(data["hub_x"]), np.transpose(data["hub_y"])], axis=-1)
    swim = Swim(setting.label, scene, commands, time, positions, np.full_like(positions, np.nan))
    for at, nodes in data["robots"].items():
        positions[swim.at(float(at)), 0] = UNIT * np.transpose(nodes)
    return swim


def distances(pairs: Sequence[Swim]) -> dict[str, list[float]]:
    """Distances of the pairs after their strokes [mm], by the setting's label."""
    return {swim.label: [rounded(MM * np.hypot(*end), 6) for end in swim.positions[-1, :, 0]] for swim in pairs}


def motions(straight: Sequence[Swim]) -> dict[str, dict[str, list[float]]]:
    """Motion of the hub in the first and last stroke, by the setting's label: `stroke_motion` in [mm] and [s]."""
    units = np.array([MM, MM, MM, 1.0])
    return {
        swim.label: {
            name: [rounded(each, 6) for each in units * stroke_motion(swim, number)]
            for name, number in (("first", 0), (f"{len(swim.commands)}th", -1))
        }
        for swim in straight
    }


def pairs_table(results: Mapping[str, Any]) -> str:
    """Distances of the pairs in Markdown, a column for every setting."""
    columns = results["pairs_mm"]
    rows = zip(gaits.PAIRS, *columns.values(), strict=True)
    return markdown(["pair", *columns], [[name, *(f"{each:.2f}" for each in row)] for name, *row in rows])


def strokes_table(results: Mapping[str, Any]) -> str:
    """Motion of the hub in the first and the last stroke in Markdown."""
    head = [
        "setting", "stroke", "forward while heated, 0.1 s [mm]", "forward after that [mm]", "until [s]", "back [mm]",
        "left [mm]",
    ]  # fmt: skip
    rows = [
        [label, stroke, *(f"{each:.1f}" for each in (heated, after)), f"{turn:.2f}",
         *(f"{each:.1f}" for each in (back, heated + after - back))]
        for label, strokes in results["straight_mm"].items()
        for stroke, (heated, after, back, turn) in strokes.items()
    ]  # fmt: skip
    return markdown(head, rows, (0, 1))


def as_results(straight: Sequence[Swim], pentagon: Sequence[Swim], pairs: Sequence[Swim]) -> dict[str, Any]:
    """What the pictures and tables of docs/ show: all settings, and the swims in the continuum and with the chapter's.

    straight, pentagon: Swims of every setting of SETTINGS. pairs: Of these and of the limit.
    """
    return {
        "unit_m": UNIT,
        "pairs_mm": distances(pairs),
        "straight_mm": motions(straight),
        "pentagon": {
            "continuum": as_data(pentagon[-1], PENTAGON_TIMES), "chapter": as_data(pentagon[0])
        },
        "pairs": {"continuum": as_data(pairs[len(SETTINGS) - 1]), "chapter": as_data(pairs[0])},
    }  # fmt: skip


def swims_of(results: Mapping[str, Any], what: str) -> tuple[Swim, Swim]:
    """Swims in the continuum and with the chapter's setting; what: "pentagon" or "pairs"."""
    commands = pentagon_commands() if what == "pentagon" else pair_commands()
    return from_data(results[what]["continuum"], commands), from_data(results[what]["chapter"], commands)


STEPS = np.array([0.1, 0.2, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 30.0, 40.0]) * 1e-3
"""Time steps of Fig. 13.9 [s]."""
SECONDS = 0.5
"""Time for which a cost is measured [s]."""


def make_figures(out: Path) -> tuple[list[Statement], dict[str, Any]]:
    """Compute all swims, write the figures that docs/ lacks into a folder; returns the statements and what is kept."""
    out.mkdir(parents=True, exist_ok=True)
    bar = tqdm(total=3 + 2 * len(STEPS), unit="part")
    actuator = SmaPulse()
    pictures.draw_pulse(actuator, out / "fig_13_5b.png")

    bar.set_description("straight swim")
    straight = [swim(setting, np.tile(STRAIGHT, (10, 1, 1)), 200) for setting in SETTINGS]
    pictures.draw_straight(straight[-1], straight[0], out / "fig_13_6.png")
    statements = straight_statements(straight)
    bar.update()

    bar.set_description("pentagon")
    pentagon = [swim(setting, pentagon_commands(), 20) for setting in SETTINGS]
    pictures.draw_pentagon_signals(pentagon[-1], out / "fig_13_7b.png")
    statements += pentagon_statements(pentagon)
    bar.update()

    bar.set_description("pairs")
    pairs = [swim(setting, pair_commands(), 50) for setting in (*SETTINGS, LIMIT)]
    statements += pair_statements(pairs)
    bar.update()

    bar.set_description("time steps")
    costs = [measure_cost(robot, STEPS, SECONDS, bar.update) for robot in (THE_CHAPTERS, CONTINUUM.robot)]
    pictures.draw_cost(costs, out / "fig_13_9.png")
    bar.close()
    return statements + cost_statements(costs), as_results(straight, pentagon, pairs)


def run(results: Results) -> None:
    """Swim, write the figures and the statements, and print the statements."""
    statements, found = make_figures(results.out)
    write_csv(statements, results.out / "statements.csv")
    show(as_table(statements), "Statements of the chapter, and computed values")
    results.update(found)


STUDY = Study(
    "chapter",
    run,
    file="chapter/chapter.json",
    out=Path("runs/chapter"),
    pictures={
        "fig_13_2.png": lambda found, file: pictures.draw_pentagon_snapshots(*swims_of(found, "pentagon"), file),
        "fig_13_7a.png": lambda found, file: pictures.draw_pentagon(*swims_of(found, "pentagon"), file),
        "fig_13_8.png": lambda found, file: pictures.draw_pairs(*swims_of(found, "pairs"), list(PAIRS), file),
    },
    tables={"chapter pairs": pairs_table, "chapter strokes": strokes_table},
)
