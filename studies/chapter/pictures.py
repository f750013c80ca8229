"""Pictures of the chapter's figures from recorded swims. matplotlib is imported only where something is drawn.

A figure that depends on discretisation and numerics shows the continuum (dark) beside the chapter's setting (orange).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from seastar_gym.files import save_figure
from seastar_gym.scene import SmaPulse
from studies.frame import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes

from studies.chapter import ISSUES_FROM, REAL_TIME_FROM
from studies.chapter.statements import stroke_motion
from studies.chapter.swims import Cost, Swim
from studies.style import FAINT, INK, MM, MS, new_figure, subplots

LIMB, ACTUATED = "#9aa1ab", "#1f4fd8"
PLUS, MINUS = "#d62728", "#1f4fd8"
ORANGE = "#e07b00"
CONTINUUM: dict[str, Any] = {"color": INK, "linestyle": "-", "linewidth": 1.3, "zorder": 2.2}
CHAPTER: dict[str, Any] = {"color": ORANGE, "linestyle": (0, (4, 2)), "linewidth": 1.3, "zorder": 2.4}
CONTINUUM_PATH: dict[str, Any] = {"color": INK, "linewidth": 2.4, "zorder": 3.5}
CHAPTER_PATH: dict[str, Any] = {"color": ORANGE, "linewidth": 1.1, "zorder": 3.6}
"""Line of the chapter's paths. It is solid, because a robot swims back and forth and dashes would overlap."""
PAIR_COLOURS = ("#0072b2", "#009e73", "#cc3d7a", "#8c6d1f")


def draw_robot(axes: Axes, swim: Swim, time: float) -> None:
    """Draw the robot at a time [s] on axes in mm, with actuated limbs bold and blue."""
    n = swim.scene.robot.nodes_per_limb
    nodes, active = MM * swim.positions[swim.at(time), 0], swim.actuated(time)
    for limb in range(swim.scene.robot.n_limbs):
        line = nodes[[0, *range(1 + limb * (n - 1), 1 + (limb + 1) * (n - 1))]]
        colour, width, level = (ACTUATED, 3.2, 4.0) if active[limb] else (LIMB, 1.8, 3.0)
        axes.plot(*line.T, color=colour, linewidth=width, solid_capstyle="round", zorder=level)
    axes.plot(*nodes[0], marker="o", markersize=4.5, color=INK, zorder=5.0)


def draw_pulse(actuator: SmaPulse, file: Path) -> None:
    """Fig. 13.5b: rotation of limbs #2 and #5 over one actuation period."""
    figure, axes = subplots(figsize=(5.6, 3.6))
    heating, period, peak = actuator.heating_time, actuator.period, actuator.peak_angle
    corners = np.array(actuator.corners)
    axes.plot(corners, actuator.delta_psi(corners), color=PLUS, label="limb 2")
    axes.plot(corners, -actuator.delta_psi(corners), color=MINUS, linestyle="--", label="limb 5")
    axes.set(xlabel="time t [s]", ylabel="rotation δψ [rad]", xlim=(0.0, period), ylim=(-1.5 * peak, 1.65 * peak))
    axes.set_xticks([0.0, heating, *np.arange(0.2, period, 0.2), period])
    axes.set_yticks([-peak, 0.0, peak], [f"−{peak:.3f}\n(−π/5)", "0", f"{peak:.3f}\n(π/5)"])
    for begin, end, text in ((0.0, heating, f"Δt₁ = {heating:g} s\nheated"), (heating, period, "Δt₂ = 0.9 s\ncools")):
        axes.annotate(
            "", (begin, 1.12 * peak), (end, 1.12 * peak),
            arrowprops={"arrowstyle": "<->", "color": FAINT, "shrinkA": 0, "shrinkB": 0},
        )  # fmt: skip
        place = max(0.5 * (begin + end), 0.1)
        axes.text(place, 1.2 * peak, text, ha="center", va="bottom", color=INK, fontsize=9)
    axes.legend(loc="lower right")
    save_figure(figure, file)


STRAIGHT_TIMES = (0.0, 2.2, 5.5, 10.0)
"""Times of the snapshots in Fig. 13.6 [s]."""


def draw_straight(continuum: Swim, chapter: Swim, file: Path) -> None:
    """Fig. 13.6: snapshots, hub position and hub velocity of ten strokes of {2+,5-}."""
    figure = new_figure(9.0, 7.6)
    panels = figure.subplot_mosaic([["a1", "a2", "a3", "a4"], ["b"] * 4, ["c"] * 4], height_ratios=[1.15, 1.0, 1.0])
    for axes in panels.values():
        axes.grid(True)
    for name, time in zip(("a1", "a2", "a3", "a4"), STRAIGHT_TIMES, strict=True):
        axes = panels[name]
        draw_robot(axes, continuum, time)
        axes.axvline(0.0, color=FAINT, linewidth=0.8, linestyle=":", zorder=1.0)
        axes.set(aspect="equal", xlim=(-100.0, 155.0), ylim=(-115.0, 115.0), title=f"({name})  t = {time:.1f} s")
        axes.set(xticks=[-100, 0, 100], yticks=[-100, 0, 100], xlabel="x [mm]")
    panels["a1"].set_ylabel("y [mm]")
    for name, continuum_values, chapter_values in (
        ("b", continuum.hub(), chapter.hub()),
        ("c", continuum.hub_velocity(), chapter.hub_velocity()),
    ):
        axes = panels[name]
        axes.plot(continuum.time, MM * continuum_values[:, 0], **CONTINUUM, label=f"x, {continuum.label}")
        axes.plot(chapter.time, MM * chapter_values[:, 0], **CHAPTER, label=f"x, {chapter.label}")
        axes.plot(continuum.time, MM * continuum_values[:, 1], color=ACTUATED, linewidth=1.3, label="y, both")
        for stroke in range(len(continuum.commands)):
            begin = stroke * continuum.scene.actuator.period
            heating = begin, begin + continuum.scene.actuator.corners[1]
            axes.axvspan(*heating, color="#f7e3e1", linewidth=0, zorder=0.5)
        axes.set_xticks(range(11))
    span = (0.0, continuum.time[-1])
    heated, after, back, turn = stroke_motion(continuum)
    moves = (
        f"The last stroke: {MM * heated:.1f} mm forward while heated,\n{MM * after:.1f} mm more until {turn:.2f} s "
        f"into the stroke, then {MM * back:.1f} mm back"
    )
    panels["b"].set(ylabel="hub position [mm]", title=f"(b)  pink: limbs 2 and 5 are heated. {moves}", xlim=span)
    panels["c"].set(ylabel="hub velocity [mm/s]", xlabel="time [s]", title="(c)", xlim=span)
    panels["b"].legend(loc="upper left", fontsize=9)
    figure.align_ylabels([panels["b"], panels["c"]])
    save_figure(figure, file)


PENTAGON_TIMES = (22.1, 72.1, 122.1, 172.1, 222.1)
"""Times of the snapshots in Fig. 13.2 [s]: in the middle of every side, when limbs are rotated farthest."""


def draw_pentagon_snapshots(continuum: Swim, chapter: Swim, file: Path) -> None:
    """Fig. 13.2: the robot on its way around the pentagon."""
    figure, axes = subplots(figsize=(6.6, 7.0))
    axes.plot(*MM * continuum.hub().T, **CONTINUUM_PATH, label=f"hub, {continuum.label}")
    axes.plot(*MM * chapter.hub().T, **CHAPTER_PATH, label=f"hub, {chapter.label}")
    for time in PENTAGON_TIMES:
        draw_robot(axes, continuum, time)
        hub, ahead = (continuum.hub()[continuum.at(t)] for t in (time, time + 10.0))
        heading = np.arctan2(*(ahead - hub)[::-1])
        free = 78.0 * np.array([np.cos(heading - np.pi / 6.0), np.sin(heading - np.pi / 6.0)])  # between two limbs
        axes.annotate(
            f"{time:.1f} s", MM * hub, MM * hub + free, color=INK, fontsize=10, ha="center", va="center", zorder=6.0
        )
    axes.plot([], [], color=ACTUATED, linewidth=3.2, label="actuated limbs")
    axes.set(aspect="equal", xlabel="x [mm]", ylabel="y [mm]", ylim=(-108.0, 355.0))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_ticks(range(-100, 301, 100))
    axes.legend(loc="upper left", fontsize=9)
    save_figure(figure, file)


def draw_pentagon(continuum: Swim, chapter: Swim, file: Path) -> None:
    """Fig. 13.7a: the hub's path around the pentagon."""
    figure, axes = subplots(figsize=(6.4, 6.4))
    for swim, look in ((continuum, CONTINUUM_PATH), (chapter, CHAPTER_PATH)):
        path = MM * swim.hub()
        axes.plot(*path.T, **look, label=f"{swim.label}: sides of {np.hypot(*path[swim.at(50.0)]):.1f} mm")
    path = MM * continuum.hub()
    corners = path[[continuum.at(50.0 * k) for k in range(5)]]
    middle = corners.mean(axis=0)
    for k, corner in enumerate(corners):
        axes.plot(*corner, marker="o", color=INK, markersize=6, zorder=3.7)
        beside = tuple(28.0 * (middle - corner) / np.hypot(*(corner - middle)))
        axes.annotate(f"{50 * k} s", tuple(corner), beside, textcoords="offset points", color=INK, ha="center",
                      va="center")  # fmt: skip
    for k, name in enumerate(("{2⁺, 5⁻}", "{3⁺, 1⁻}", "{4⁺, 2⁻}", "{5⁺, 3⁻}", "{1⁺, 4⁻}")):
        side = 0.5 * (corners[k] + corners[(k + 1) % 5])
        x, y = side + 0.25 * (middle - side)
        axes.text(x, y, name, color=INK, ha="center", va="center")
    spur = path[: continuum.at(50.0), 0].max() - corners[1, 0]
    note = (
        f"spurs at the corners: strokes carry the hub forth and back,\nthe last of a side {spur:.0f} mm beyond its end"
    )
    axes.text(-80.0, -37.0, note, color=INK, fontsize=9, va="center")
    axes.set(aspect="equal", xlabel="x [mm]", ylabel="y [mm]", xlim=(-85.0, 240.0), ylim=(-50.0, 305.0))
    axes.legend(loc="upper center", fontsize=9)
    save_figure(figure, file)


def signal_curves(swim: Swim, limb: int) -> tuple[Floats, Floats, Floats]:
    """(time [s], positive rotation [rad], negative rotation [rad]) of a limb at all corners of its pulses."""
    actuator = swim.scene.actuator
    corners = np.array(actuator.corners)
    time = (np.arange(len(swim.commands))[:, None] * actuator.period + corners).ravel()
    rotation = (swim.commands[:, 0, limb, None] * actuator.delta_psi(corners)).ravel()
    return time, np.maximum(rotation, 0.0), np.minimum(rotation, 0.0)


ZOOM = (43.0, 53.0)
"""Interval of the pentagon that is shown in detail [s]."""


def draw_pentagon_signals(swim: Swim, file: Path) -> None:
    """Fig. 13.7b: the actuation signals of the pentagon."""
    n_limbs, peak = swim.scene.robot.n_limbs, swim.scene.actuator.peak_angle
    figure, panels = subplots(n_limbs, 2, figsize=(9.6, 5.8), sharex="col", sharey=True, width_ratios=[2.0, 1.0])
    for limb, row in enumerate(panels):
        time, plus, minus = signal_curves(swim, limb)
        for axes, width in zip(row, (0.5, 1.4), strict=True):
            for values, colour, dashes in ((plus, PLUS, "-"), (minus, MINUS, (0, (3, 1.2)))):
                pulses = np.where(np.abs(np.gradient(values)) + np.abs(values) > 0.0, values, np.nan)
                axes.fill_between(time, values, color=colour, alpha=0.15, linewidth=0)
                axes.plot(time, pulses, color=colour, linestyle=dashes, linewidth=width)
            axes.axhline(0.0, color=FAINT, linewidth=0.6, zorder=0.9)
            axes.set(ylim=(-1.25 * peak, 1.25 * peak))
        row[0].set_ylabel(f"limb {limb + 1}\nδψ [rad]")
        row[0].set_yticks([-peak, 0.0, peak], ["−π/5", "0", "π/5"])
        row[0].axvspan(*ZOOM, color="#e3e8ee", linewidth=0, zorder=0.5)
    panels[0, 0].set(xlim=(0.0, 250.0), title="red, solid: anti-clockwise (+)     blue, dashed: clockwise (−)")
    panels[0, 1].set(xlim=ZOOM, title="the shaded ten seconds")
    for axes in panels[-1]:
        axes.set_xlabel("time [s]")
    panels[0, 0].set_xticks(range(0, 251, 25))
    save_figure(figure, file)


PAIR_LABELS = ((42.0, 22.0), (26.0, 50.0), (-18.0, 60.0), (-46.0, 12.0))
"""Positions of the pairs' names [mm]."""


def draw_pairs(continuum: Swim, chapter: Swim, names: Sequence[str], file: Path) -> None:
    """Fig. 13.8: paths of ten strokes by each pair of limbs; names: Names of the pairs, one per robot."""
    robot = continuum.scene.robot
    figure, (left, right) = subplots(1, 2, figsize=(9.0, 4.6), width_ratios=[1.05, 1.0])
    for limb, tip in enumerate(MM * robot.nodes()[robot.nodes_per_limb - 1 :: robot.nodes_per_limb - 1]):
        left.plot([0.0, tip[0]], [0.0, tip[1]], color="#dfe3e8", linewidth=4.0, solid_capstyle="round", zorder=1.0)
        left.text(1.07 * tip[0], 1.07 * tip[1], str(limb + 1), color=FAINT, ha="center", va="center")
    note = "a dot per stroke\ncircle, (): the chapter's setting"
    left.text(0.01, 0.01, note, transform=left.transAxes, color=INK, fontsize=8.5)
    for number, (name, colour, place) in enumerate(zip(names, PAIR_COLOURS, PAIR_LABELS, strict=True)):
        path, other = MM * continuum.hub(number), MM * chapter.hub(number)
        distance, others = np.hypot(*path[-1]), np.hypot(*other[-1])
        ahead = path[-1] / distance
        left.plot(*path.T, color=colour, linewidth=1.2, zorder=2.0)
        left.plot(*path[continuum.at_strokes()].T, color=colour, linestyle="", marker="o", markersize=4.0, zorder=3.0)
        left.plot(*other[-1], color=colour, marker="o", markersize=6.0, markerfacecolor="none", zorder=3.1)
        left.text(*place, f"{name}\n{distance:.1f} mm\n({others:.1f} mm)", color=colour, zorder=4.0, va="center",
                  ha="left" if place[0] > 0.0 else "right")  # fmt: skip
        right.plot(continuum.time, path @ ahead, color=colour, linewidth=1.3)
        right.plot(chapter.time, other @ ahead, **{**CHAPTER, "color": colour, "linewidth": 1.0})
    left.set(aspect="equal", xlabel="x [mm]", ylabel="y [mm]", xlim=(-98.0, 112.0), ylim=(-108.0, 108.0))
    right.set(xlabel="time [s]", ylabel="hub along the bisector [mm]", xlim=(0.0, continuum.time[-1]))
    right.set_ylim(0.0, 60.0)
    right.plot([], [], color=INK, linewidth=1.3, label=continuum.label)
    right.plot([], [], **{**CHAPTER, "color": INK, "linewidth": 1.0}, label=chapter.label)
    right.legend(fontsize=9, loc="upper left")
    save_figure(figure, file)


def draw_cost(costs: Sequence[Cost], file: Path) -> None:
    """Fig. 13.9: computing time over simulated time, against the time step.

    costs: Of the chapter's discretisation and the continuum's.
    """
    figure, axes = subplots(figsize=(7.2, 5.0))
    steps, issues, real_time = MS * costs[0].steps, MS * ISSUES_FROM, MS * REAL_TIME_FROM
    line = np.array([steps.min(), issues])
    axes.axvspan(issues, 1.3 * steps.max(), color="#fbeedd", linewidth=0, zorder=0.5)
    axes.axhline(1.0, color=FAINT, linewidth=0.8)
    axes.loglog(line, real_time / line, **CHAPTER, label="the chapter: proportional to 1/h, real time at 3 ms")
    axes.plot(real_time, 1.0, marker="D", color=ORANGE, zorder=3.0)
    for cost, name, dashes in zip(costs, ("its discretisation", "continuum"), ("-", (0, (2, 2))), strict=True):
        for values, marker, colour, robots in (
            (cost.alone, "o", "#0072b2", "one robot alone"),
            (cost.in_batch, "s", "#009e73", f"per robot of a batch of {cost.n_robots}"),
        ):
            axes.loglog(steps, values, color=colour, linestyle=dashes, marker=marker, label=f"ours, {name}, {robots}")
            axes.loglog(steps[cost.regularised], values[cost.regularised], color=colour, marker=marker, linestyle="",
                        markerfacecolor="w", zorder=3.0)  # fmt: skip
    axes.plot([], [], color=INK, marker="o", linestyle="", markerfacecolor="w",
              label="open: Newton's matrix regularised in some steps")  # fmt: skip
    axes.text(steps.min(), 1.15, "real time", va="bottom", color=INK, fontsize=9)
    axes.text(1.06 * issues, 2.0, "the chapter:\nnumerical\nissues", va="bottom", color="#9a5a00", fontsize=9)
    axes.set(xlabel="time step h [ms]", ylabel="computing time over simulated time",
             xlim=(0.8 * steps.min(), 1.3 * steps.max()), ylim=(0.004 * costs[0].in_batch.min(), 60.0))  # fmt: skip
    ticks = [tick for tick in (0.1, 0.3, 1.0, 3.0, 10.0, 20.0, 40.0) if steps.min() <= tick <= steps.max()]
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.minorticks_off()
    axes.legend(fontsize=8.5, loc="lower left")
    save_figure(figure, file)
