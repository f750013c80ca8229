"""Swims of the chapter's figures as plain data: the hub throughout, and the whole robot at a few times."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from seastar_gym import gaits
from seastar_gym.scene import Scene
from studies.chapter.pictures import PENTAGON_TIMES
from studies.chapter.statements import PAIRS, stroke_motion
from studies.chapter.swims import QUICK, SETTINGS, Floats, Swim
from studies.frame import rounded
from studies.pages import markdown
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
    settings = [each.coarser(step) for each in SETTINGS for step in (0.0, QUICK)]
    setting = next(each for each in settings if each.label == data["setting"])
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
