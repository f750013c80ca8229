"""Picture of the designs: speed over everything that varies, and over the density by where the mass lies."""

from pathlib import Path
from typing import Any

import numpy as np

from studies.style import DPI, FAINT, INK, subplots

MM = 1e3
COLOURS = {1.0: "#999999", 0.75: "#88aacc", 0.5: "#3366aa", 0.25: "#cc7a00"}
BINS = 24
TOP = 22.0
"""Largest speed of the axes [mm/s]."""


def draw(found: dict[str, Any], table: Any, file: Path) -> None:
    """Write the picture."""
    figure, axes = subplots(2, 3, figsize=(11.0, 6.6))
    chapter = found["the chapter's"]["mm_per_s"]["fast"]
    ranges = (
        ("robot.limb_length", MM, "limb length [mm]", False), ("actuator.peak_angle", 1.0, "peak angle [rad]", False),
        ("robot.youngs_modulus", 1e-6, "Young's modulus [MPa]", True),
    )  # fmt: skip
    for ax, (name, unit, label, is_log) in zip(axes[0], ranges, strict=True):
        for taper, colour in COLOURS.items():
            some = table[table.taper == taper]
            envelope(ax, unit * some[name].to_numpy(), MM * some.speed.to_numpy(), is_log, colour, f"{taper:g}")
        ax.axhline(chapter, color=FAINT, ls="--", lw=1)
        ax.set(xlabel=label, ylabel="speed [mm/s]", ylim=(0.0, TOP))
        if is_log:
            ax.set_xticks([0.2, 0.5, 1.0, 2.0, 5.0], ["0.2", "0.5", "1", "2", "5"])
            ax.set_xticks([], minor=True)
    axes[0, 2].text(0.21, chapter - 1.0, "the chapter's robot", fontsize=8, color=FAINT)
    axes[0, 0].legend(
        frameon=False,
        fontsize=8,
        title="tip over root: median, and 99th percentile (dotted)",
        title_fontsize=8,
        loc="upper left",
        ncols=4,
    )
    for ax, name, unit, label in (
        (axes[1, 0], "n_limbs", 1.0, "number of limbs"), (axes[1, 1], "radius", MM, "mean radius [mm]"),
    ):  # fmt: skip
        values = sorted(table[name].unique())
        ax.violinplot(
            [MM * table[table[name] == value].speed.to_numpy() for value in values],
            np.arange(len(values)), showmedians=True, widths=0.8,
        )  # fmt: skip
        ax.axhline(chapter, color=FAINT, ls="--", lw=1)
        ax.set_xticks(np.arange(len(values)), [f"{unit * value:g}" for value in values])
        ax.set(xlabel=label, ylabel="speed [mm/s]", ylim=(0.0, TOP))
    masses(axes[1, 2], found["masses"])
    figure.savefig(file, dpi=DPI)


def envelope(ax: Any, x: Any, y: Any, is_log: bool, colour: str, label: str) -> None:
    """Median and 99th percentile of y in bins of x."""
    edges = np.geomspace(x.min(), x.max(), BINS + 1) if is_log else np.linspace(x.min(), x.max(), BINS + 1)
    place = np.clip(np.digitize(x, edges) - 1, 0, BINS - 1)
    middle = 0.5 * (edges[1:] + edges[:-1])
    for share, style in ((50, "-"), (99, ":")):
        ax.plot(middle, [np.percentile(y[place == k], share) for k in range(BINS)], style, color=colour,
                label=label if share == 50 else None)  # fmt: skip
    if is_log:
        ax.set_xscale("log")


def masses(ax: Any, found: dict[str, Any]) -> None:
    """Speed over density, by the share of mass in the half at the hub."""
    shades = np.linspace(0.1, 0.85, len(found))
    for (share, points), shade in zip(found.items(), shades, strict=True):
        ax.semilogx(*np.array(points).T, color=(shade, 0.4, 1.0 - shade), label=f"{100 * float(share):.0f} %")
    ax.axvline(1000.0, color=INK, lw=0.6, ls=":")
    ax.set(xlabel="density of the limbs [kg/m³]", ylabel="speed [mm/s]")
    ax.legend(frameon=False, fontsize=8, title="limb's mass in the half\nat the hub", title_fontsize=8)
