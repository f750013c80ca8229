"""Picture and table of the designs: speed over everything that varies, and over the density by where the mass lies;
what the best robots are, and what they cost."""

from pathlib import Path
from typing import Any

import numpy as np

from seastar_gym.files import save_figure
from studies.pages import markdown
from studies.style import CYCLE, FAINT, INK, MM, subplots

COLOURS = {1.0: FAINT, 0.75: CYCLE[5], 0.5: CYCLE[0], 0.25: CYCLE[1]}
"""Colours of the tapers."""
RANGES = (
    ("robot.limb_length", MM, "limb length [mm]", False), ("actuator.peak_angle", 1.0, "peak angle [rad]", False),
    ("robot.youngs_modulus", 1e-6, "Young's modulus [MPa]", True),
)  # fmt: skip
"""What is drawn at random: its column, unit and name, and whether in the logarithm."""
GRIDS = (("n_limbs", 1.0, "number of limbs"), ("radius", MM, "mean radius of a limb [mm]"))
BINS = 24
TOP = 22.0
"""Largest speed of the axes [mm/s]."""
SHARES = (0, 1, 10, 25, 50, 75, 90, 99, 100)
"""Percentiles that tell of a distribution."""

ROBOTS = {
    "the chapter's": "the chapter's",
    "fastest": "fastest",
    "fastest in its lengths": "fastest in limb lengths per stroke",
    "fastest at the chapter's length and angle": "fastest of the chapter's length and angle",
    "fastest of them without taper": "fastest of these without taper",
}
"""Robots of the table, by their names in designs.json."""
CHAPTER = {
    "n_limbs": 5, "root_radius_mm": 1.6, "taper": 1.0, "limb_length_mm": 100.0, "youngs_modulus_MPa": 1.0,
    "peak_angle_rad": 0.628,
}  # fmt: skip


def robots(found: dict[str, Any]) -> str:
    """Table in Markdown of the best robots: speeds [mm/s] at three fidelities, and work and moment at `reference`."""
    head = [
        "robot", "limbs", "radius [mm]", "length [mm]", "modulus [MPa]", "angle [rad]", "`fast`", "`balanced`",
        "`reference`", "work [mJ]", "moment [mN m]",
    ]  # fmt: skip
    rows = []
    for name, label in ROBOTS.items():
        row = CHAPTER | found[name]
        root, tip = row["root_radius_mm"], row["taper"] * row["root_radius_mm"]
        radius = f"{root:g}" if row["taper"] == 1.0 else f"{root:g} to {tip:.3g}"
        rows.append([
            label, row["n_limbs"], radius, f"{row['limb_length_mm']:.0f}", f"{row['youngs_modulus_MPa']:.2g}",
            f"{row['peak_angle_rad']:.3f}", *(f"{speed:.2f}" for speed in row["mm_per_s"].values()),
            f"{row['mJ_per_stroke']['reference']:.3g}", f"{row['peak_mN_m']['reference']:.3g}",
        ])  # fmt: skip
    return markdown(head, rows)


def summary(table: Any) -> dict[str, Any]:
    """What the picture shows of all designs, as plain data: medians and 99th percentiles [mm/s], and distributions."""
    curves = {
        name: {str(taper): _envelope(table[table.taper == taper], name, unit, is_log) for taper in COLOURS}
        for name, unit, _, is_log in RANGES
    }
    spreads = {
        name: {
            str(round(unit * float(value), 6)): np.percentile(MM * each.speed.to_numpy(), SHARES).round(3).tolist()
            for value, each in table.groupby(name)
        }
        for name, unit, _ in GRIDS
    }
    return {"curves": curves, "percentiles": list(SHARES), "spreads": spreads}


def _envelope(some: Any, name: str, unit: float, is_log: bool) -> dict[str, list[float]]:
    """Median and 99th percentile of the speed [mm/s] in bins of a column."""
    x, y = unit * some[name].to_numpy(), MM * some.speed.to_numpy()
    edges = np.geomspace(x.min(), x.max(), BINS + 1) if is_log else np.linspace(x.min(), x.max(), BINS + 1)
    place = np.clip(np.digitize(x, edges) - 1, 0, BINS - 1)
    filled = [k for k in range(BINS) if (place == k).any()]
    return {
        "x": (0.5 * (edges[1:] + edges[:-1]))[filled].round(6).tolist(),
        **{f"{share}": [round(float(np.percentile(y[place == k], share)), 3) for k in filled] for share in (50, 99)},
    }


def draw(found: dict[str, Any], file: Path) -> None:
    """Write the picture."""
    figure, axes = subplots(2, 3, figsize=(9.6, 6.8))
    chapter, shown = found["the chapter's"]["mm_per_s"]["fast"], found["picture"]
    for ax, (name, _, label, is_log) in zip(axes[0], RANGES, strict=True):
        for taper, colour in COLOURS.items():
            curve = shown["curves"][name][str(taper)]
            ax.plot(curve["x"], curve["50"], color=colour, label=f"taper {taper:g}: median, and dotted 99th percentile")
            ax.plot(curve["x"], curve["99"], ":", color=colour)
        ax.axhline(chapter, color=INK, ls="--", lw=1, label="the chapter's robot")
        ax.set(xlabel=label, ylim=(0.0, TOP))
        if is_log:
            ax.set_xscale("log")
            ax.set_xticks([0.2, 0.5, 1.0, 2.0, 5.0], ["0.2", "0.5", "1", "2", "5"])
            ax.set_xticks([], minor=True)
    for ax, (name, _, label) in zip(axes[1], GRIDS, strict=False):
        _boxes(ax, shown["spreads"][name])
        ax.axhline(chapter, color=INK, ls="--", lw=1)
        ax.set(xlabel=label, ylim=(0.0, TOP))
    masses(axes[1, 2], found["masses"])
    for ax in axes[:, 0]:
        ax.set_ylabel("speed [mm/s]")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=2)
    save_figure(figure, file)


def _boxes(ax: Any, spreads: dict[str, list[float]]) -> None:
    """A line from the slowest design to the fastest, a box of the middle half and a mark at the median."""
    for place, values in enumerate(spreads.values()):
        low, _, _, quarter, middle, three_quarters, _, _, high = values
        ax.plot([place, place], [low, high], color=CYCLE[0], lw=1.2)
        ax.bar(place, three_quarters - quarter, 0.5, bottom=quarter, color=CYCLE[5], zorder=2)
        ax.plot(place, middle, "_", color=INK, ms=14, zorder=3)
    ax.set_xticks(range(len(spreads)), [f"{float(value):g}" for value in spreads])


def masses(ax: Any, found: dict[str, Any]) -> None:
    """Speed over density, by the share of mass in the half at the hub."""
    for (share, points), colour in zip(found.items(), CYCLE, strict=False):
        ax.semilogx(*np.array(points).T, color=colour, label=f"{100 * float(share):.0f} %")
    ax.axvline(1000.0, color=FAINT, lw=1.0, ls=":")
    ax.text(950.0, ax.get_ylim()[1], "water", color=INK, rotation=90, ha="right", va="top", fontsize="small")
    ax.set(xlabel="density of the limbs [kg/m³]", ylim=(0.0, None))
    ax.legend(title="mass in the half\nat the hub", fontsize="small", title_fontsize="small", loc="upper left")
