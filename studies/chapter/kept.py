"""Swims of the chapter's figures as plain data: the hub throughout, and the whole robot at a few times."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from seastar_gym.gaits import pentagon_gait
from seastar_gym.scene import Scene
from studies.chapter.pictures import PENTAGON_TIMES
from studies.chapter.statements import PAIRS
from studies.chapter.swims import SETTINGS, Floats, Swim

UNIT = 1e-6
"""Length that counts as one in the data [m]."""


def pentagon_commands() -> Floats:
    """Commands round the pentagon, shape (n_strokes, 1, n_limbs)."""
    return pentagon_gait()[:, None]


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


def from_data(kept: Mapping[str, Any], commands: Floats) -> Swim:
    """A swim of which the hub is known, and all nodes at some times; other nodes and velocities are NaN."""
    setting = next(each for each in SETTINGS if each.label == kept["setting"])
    scene = Scene(setting.robot, numerics=setting.numerics)
    starts = np.arange(len(commands))[:, None] * scene.actuator.period
    time = np.append(0.0, (starts + np.array(kept["times_of_a_stroke_s"])).ravel())
    positions = np.full((len(time), commands.shape[1], scene.robot.n_nodes, 2), np.nan)
    positions[:, :, 0] = UNIT * np.stack([np.transpose(kept["hub_x"]), np.transpose(kept["hub_y"])], axis=-1)
    swim = Swim(setting.label, scene, commands, time, positions, np.full_like(positions, np.nan))
    for at, nodes in kept["robots"].items():
        positions[swim.at(float(at)), 0] = UNIT * np.transpose(nodes)
    return swim


def kept(pentagon: Sequence[Swim], pairs: Sequence[Swim]) -> dict[str, Any]:
    """What the pictures of docs/ show of the swims in the continuum and with the chapter's setting."""
    return {
        "unit_m": UNIT,
        "pentagon": {
            "continuum": as_data(pentagon[-1], PENTAGON_TIMES), "chapter": as_data(pentagon[0])
        },
        "pairs": {"continuum": as_data(pairs[-1]), "chapter": as_data(pairs[0])},
    }  # fmt: skip


def swims_of(results: Mapping[str, Any], what: str) -> tuple[Swim, Swim]:
    """Swims in the continuum and with the chapter's setting; what: "pentagon" or "pairs"."""
    commands = pentagon_commands() if what == "pentagon" else pair_commands()
    return from_data(results[what]["continuum"], commands), from_data(results[what]["chapter"], commands)
