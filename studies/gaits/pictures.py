"""Pictures of the study of gaits: speed by direction, speed over heat, and speed over the lag."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from studies.style import CYCLE, DPI, FAINT, INK, new_figure, subplots

COLOURS = {"synchronous": FAINT, "from rest": CYCLE[0], "re-heated": CYCLE[1]}
LABELS = {
    "synchronous": "strokes of the chapter, one a second",
    "from rest": "limbs at times of their own, from rest",
    "re-heated": "re-heated before they are cold",
}


def draw_directions(results: dict[str, Any], file: Path) -> None:
    """Speed by direction; the sector of 36 degrees is repeated by turns and mirror images."""
    figure = new_figure(5.6, 5.4)
    axes: Any = figure.add_subplot(projection="polar")
    sector = np.radians(results["directions_deg"])
    for name, speeds in results["mm_per_s_by_direction"].items():
        angles = np.concatenate([k * 0.4 * np.pi + sign * sector for k in range(5) for sign in (1, -1)]) % (2 * np.pi)
        order = np.argsort(angles)
        closed = np.append(order, order[0])
        axes.plot(angles[closed], np.tile(speeds, 10)[closed], color=COLOURS[name], lw=2, label=LABELS[name])
    axes.set_rlim(0.0, 11.0)
    axes.set_rticks([2, 4, 6, 8, 10])
    axes.set_rlabel_position(90)
    axes.tick_params(labelsize=9)
    axes.set_title("speed [mm/s] by the direction of the swim; 0° is along limb 1")
    figure.legend(loc="outside lower center", ncols=1)
    figure.savefig(file, dpi=DPI)


def draw_front(results: dict[str, Any], file: Path) -> None:
    """Speed over joules per metre: enumerated gaits, the front, and named gaits."""
    figure, axes = subplots(1, 1, figsize=(6.8, 4.8))
    cloud, best = np.array(results["front"]["cloud"]), np.array(results["front"]["front"])
    axes.plot(*cloud.T, ".", ms=2, color="0.75", zorder=1, label="gaits of a second from rest (a sample)")
    axes.step(*best.T, where="post", color=INK, lw=1.2, zorder=2, label="nothing that was found beats these in both")
    axes.plot(*best.T, ".", color=INK, ms=4, zorder=2)
    priced = [each["fast"] for each in results["evolved"] if each["actuator"] == "wires"]
    axes.plot(
        [each["joules_per_m"] for each in priced], [each["mm_per_s"] for each in priced], "D", ms=5,
        color=COLOURS["re-heated"], zorder=3, label="evolved; wires are heated again while warm",
    )  # fmt: skip
    for name, side, down in (
        ("synchronous", 1, 11), ("one at a time", -1, -4), ("lag 0.6", 1, 11), ("thrifty", -1, -4),
        ("thriftier", -1, 4),
    ):  # fmt: skip
        each = results["named"][name]["fast"]
        axes.plot(each["joules_per_m"], each["mm_per_s"], "o", color=COLOURS["from rest"], zorder=4)
        axes.annotate(
            name, (each["joules_per_m"], each["mm_per_s"]), xytext=(7 * side, -down), textcoords="offset points",
            ha="left" if side > 0 else "right", fontsize=9, color=COLOURS["from rest"],
        )  # fmt: skip
    axes.set(xlim=(150.0, 900.0), ylim=(0.0, 11.0), xlabel="electric energy per metre [J/m]", ylabel="speed [mm/s]")
    axes.plot([], [], "o", color=COLOURS["from rest"], label="named gaits (the table)")
    figure.legend(loc="outside upper left", ncols=2)
    figure.savefig(file, dpi=DPI)


def draw_lag(results: dict[str, Any], file: Path) -> None:
    """Speed of the lagged pairs over their lag."""
    figure, axes = subplots(1, 1, figsize=(6.4, 4.2))
    lag = results["lag"]
    for (name, speeds), colour in zip(list(lag.items())[1:], CYCLE, strict=False):
        axes.plot(lag["lag_s"], speeds, ".-", color=colour, label=name)
    synchronous = results["named"]["synchronous"]["fast"]["mm_per_s"]
    axes.axhline(
        synchronous, color=FAINT, ls="--", lw=1, label="for comparison: the chapter's\nstrokes, the pairs in turn"
    )
    axes.set(
        xlabel="lag [s] of the pair {3+,4-} behind {2+,5-}; both are heated once a second", ylabel="speed [mm/s]",
        xlim=(0.0, 1.0), ylim=(0.0, 10.5),
    )  # fmt: skip
    axes.legend(loc="upper left", ncols=2)
    figure.savefig(file, dpi=DPI)
