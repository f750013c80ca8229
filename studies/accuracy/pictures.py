"""Pictures of the accuracy study: work against precision, convergence, and why damped ringing costs accuracy."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.gaits import PAIRS
from seastar_gym.model.rods import make_rods
from seastar_gym.scene import Numerics
from seastar_gym.simulator import Simulator
from studies.accuracy.cases import STROKES, scene_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from studies.accuracy.rows import Row, Study

Floats = NDArray[np.float64]

COLOURS = {
    "implicit-euler": "#cc7a00",
    "sdirk2": "#cc3355",
    "sdirk3": "#8844aa",
    "implicit-midpoint": "#3366aa",
    "adapted": "#118855",
}
INK, FAINT = "#1b1f26", "#80868f"
MM, MS, PERCENT = 1e3, 1e3, 100.0
DPI = 130


def kind_of(numerics: Numerics) -> str:
    """Key of COLOURS."""
    return numerics.scheme if numerics.path_tolerance is None else "adapted"


def draw_all(found: Study, folder: Path) -> list[Path]:
    """Write all pictures; returns where."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    paths = []
    for name, draw in (("work_precision", work_precision), ("convergence", convergence), ("ringing", ringing)):
        figure: Figure = draw(found)
        paths.append(folder / f"{name}.png")
        figure.savefig(paths[-1], dpi=DPI)
        plt.close(figure)
    return paths


def subplots(*shape: int, **keywords: Any) -> tuple[Figure, Any]:
    """Empty axes in the study's style."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(*shape, layout="constrained", **keywords)
    for each in np.ravel(axes):
        each.grid(True, which="major", color="0.92", lw=0.8)
        each.set_axisbelow(True)
        each.spines[["top", "right"]].set_visible(False)
    return figure, axes


def as_percent(axis: Any) -> None:
    """Tick labels such as 0.1 %."""
    axis.set_major_formatter(lambda value, _: f"{value:g} %")


def as_numbers(axis: Any) -> None:
    """Tick labels such as 0.1 and 10,000."""
    axis.set_major_formatter(lambda value, _: f"{value:,.0f}" if value >= 1.0 else f"{value:g}")


# --- work against precision ------------------------------------------------------------------------------------------


def work_precision(found: Study) -> Figure:
    """Error over speed of all settings, the front, the presets and the chapter's two steps."""
    figure, axes = subplots(1, 2, figsize=(12.5, 5.6), sharey=True)
    rows = [row for row in found.rows if row.nodes_per_limb == 10]
    panels: tuple[tuple[str, str, str, str], ...] = (
        ("path", "path_promise", "speed", "Worst of pairs, pentagon and random commands; mixed batch"),
        ("straight", "straight_promise", "straight_speed", "Straight swim {2+, 5-} alone; batch of straight swims"),
    )
    for each, (error, promise, speed, title) in zip(axes, panels, strict=True):
        _draw_settings(each, rows, lambda row: getattr(row, error), lambda row: getattr(row, speed))  # noqa: B023
        _draw_front(each, rows, lambda row: getattr(row, promise), lambda row: getattr(row, speed))  # noqa: B023
        _mark(each, rows, lambda row: getattr(row, promise), lambda row: getattr(row, speed))  # noqa: B023
        each.set(xscale="log", yscale="log", xlabel="simulated over computing seconds, one core  (faster →)")
        each.set_title(title, fontsize=10.5, loc="left")
        as_numbers(each.xaxis)
    axes[0].set(ylabel="path error over 10 strokes, of the path's length", ylim=(0.004, 80.0))
    as_percent(axes[0].yaxis)
    axes[0].legend(frameon=False, fontsize=8.5, loc="upper left", ncols=2)
    figure.suptitle("What speed costs: every dot is a scheme, a time step and a Newton tolerance", x=0.01, ha="left")
    return figure


RowNumber = Callable[["Row"], float]


def _draw_settings(axes: Axes, rows: Sequence[Row], error: RowNumber, speed: RowNumber) -> None:
    for kind, colour in COLOURS.items():
        mine = [row for row in rows if kind_of(row.numerics) == kind]
        name = "implicit-midpoint, adapted steps" if kind == "adapted" else kind
        x, y = [speed(row) for row in mine], [PERCENT * error(row) for row in mine]
        axes.plot(x, y, "o", ms=3.6, mew=0, alpha=0.45, color=colour, label=name)


def _draw_front(axes: Axes, rows: Sequence[Row], error: RowNumber, speed: RowNumber) -> None:
    from studies.accuracy.rows import front

    best = front(rows, error, speed)
    x, y = np.array([(speed(row), PERCENT * error(row)) for row in best]).T
    axes.plot(x, y, drawstyle="steps-pre", color=INK, lw=1.3, label="front: the least error that can be promised")


def _mark(axes: Axes, rows: Sequence[Row], error: RowNumber, speed: RowNumber) -> None:
    """The presets, and the chapter's steps."""
    from matplotlib.patheffects import withStroke

    from studies.accuracy.rows import presets

    by_numerics = {row.numerics: row for row in rows}
    marks = [(f'"{name}"', by_numerics[n], "s") for name, n in presets().items() if name != "chapter"]
    for step in (3e-3, 20e-3):
        row = by_numerics.get(Numerics("implicit-euler", step))
        if row is not None:
            marks.append((f"the chapter's scheme, {MS * step:g} ms", row, "*"))
    for name, row, marker in marks:
        x, y, chapter = speed(row), PERCENT * error(row), marker == "*"
        axes.plot(x, y, marker, ms=12 if chapter else 7, color=COLOURS[kind_of(row.numerics)], mec=INK, mew=1.0)
        left = chapter or row.numerics.path_tolerance is not None
        axes.annotate(
            name, (x, y), (10, 9) if chapter else (-6 if left else 6, -14), textcoords="offset points", fontsize=8.5,
            color=INK, ha="right" if left else "left", path_effects=[withStroke(linewidth=2.5, foreground="white")],
        )  # fmt: skip


# --- convergence -----------------------------------------------------------------------------------------------------


def convergence(found: Study) -> Figure:
    """Error over h for the straight swim and the worst case, and over N."""
    figure, (straight, worst, space) = subplots(1, 3, figsize=(13.5, 4.6))
    fixed = [row for row in found.rows if row.nodes_per_limb == 10 and row.numerics.path_tolerance is None]
    tightest_last = sorted(fixed, key=lambda row: -row.numerics.newton_tolerance)
    rows = list({(row.numerics.scheme, row.numerics.step): row for row in tightest_last}.values())
    for axes, error, title in (
        (straight, "straight", "Time step: straight swim"),
        (worst, "path", "Time step: worst of pairs and random commands"),
    ):
        for kind, colour in list(COLOURS.items())[:4]:
            points = sorted(
                (MS * row.numerics.step, PERCENT * getattr(row, error)) for row in rows if row.numerics.scheme == kind
            )
            axes.loglog(*np.array(points).T, "o-", ms=4, lw=1.4, color=colour, label=kind)
        axes.set(xlabel="time step h [ms]", ylim=(0.001, 40.0))
        axes.set_title(title, fontsize=10.5, loc="left")
    _slopes(straight, (0.25, 20.0), {1: 1.3e-1, 2: 2.0e-3})
    for axes in (straight, worst):
        as_percent(axes.yaxis)
        as_numbers(axes.xaxis)
    straight.set_ylabel("path error against h → 0, same N")
    straight.legend(frameon=False, fontsize=8.5, loc="upper left")
    edges = np.array([each.nodes_per_limb - 1 for each in found.space])
    for error, colour, name in (("path", INK, "worst path"), ("straight", FAINT, "straight swim")):
        values = PERCENT * np.array([getattr(each, error) for each in found.space])
        space.loglog(edges + 1, values, "o-", ms=4, lw=1.4, color=colour, label=name)
    ten = next(each for each in found.space if each.nodes_per_limb == 10)
    space.annotate(
        "the chapter's N = 10", (10, PERCENT * ten.straight), (0, -30), textcoords="offset points", fontsize=8.5,
        ha="center", arrowprops={"arrowstyle": "-", "color": FAINT},
    )  # fmt: skip
    space.set(xlabel="nodes per limb N", ylabel="path error against N → ∞, h → 0")
    space.set_xticks(edges + 1, [str(n + 1) for n in edges])
    space.set_yticks([0.5, 1, 2, 5, 10, 20, 50])
    space.minorticks_off()
    as_percent(space.yaxis)
    space.set_title("Resolution of the limbs", fontsize=10.5, loc="left")
    space.legend(frameon=False, fontsize=8.5)
    return figure


def _slopes(axes: Axes, ends: tuple[float, float], orders: dict[int, float]) -> None:
    """Dashed lines error = c h^order."""
    for order, c in orders.items():
        h = np.array(ends)
        axes.loglog(h, c * h**order, "--", lw=0.9, color=FAINT)
        axes.annotate(f"order {order}", (h[1], c * h[1] ** order), (4, 0), textcoords="offset points", fontsize=8,
                      color=FAINT, va="center", annotation_clip=False)  # fmt: skip


# --- ringing ---------------------------------------------------------------------------------------------------------

RINGING = "{1-,2+}"
EXACT = Numerics("implicit-midpoint", 0.05e-3, 1e-11)
SHOWN: tuple[tuple[str, Numerics, str, float], ...] = (
    ("converged", EXACT, INK, 1.4),
    ("implicit-midpoint 0.5 ms: keeps it", Numerics("implicit-midpoint", 0.5e-3), COLOURS["implicit-midpoint"], 1.2),
    ("sdirk2 0.5 ms: damps it", Numerics("sdirk2", 0.5e-3), "#ee9922", 1.4),
    ("sdirk2 20 ms", Numerics("sdirk2", 20e-3), COLOURS["sdirk2"], 1.4),
)
SAMPLES = 4000
"""Of a stroke, where the steps are short enough."""


def ringing(found: Study) -> Figure:
    """What a limb does within a stroke, how much it rings, and how far robots then swim."""
    figure, (close, strength, path) = subplots(1, 3, figsize=(13.5, 4.7))
    begin, end = 0.42, 0.45
    for name, numerics, colour, width in SHOWN:
        time, velocity, stretching = record(numerics)
        some = (time >= begin - 0.02) & (time <= end + 0.02)
        close.plot(MS * time[some], MM * velocity[some], lw=width, color=colour)
        strength.semilogy(time, MM * smoothed(stretching, time), color=colour, lw=width, label=name)
        path.plot(*excess(swum(numerics)), "o-", ms=3.5, lw=width, color=colour)
    strokes, frozen = excess(swum(EXACT, freeze_lengths=True))
    path.plot(strokes, frozen, "o--", ms=3.5, mfc="white", lw=1.4, color=INK)
    path.annotate(
        "converged, but every 2 ms the\nlengthwise ringing is taken out", (9, frozen[8]),
        (-12, 14), textcoords="offset points", ha="right", fontsize=8.5, color=INK,
    )  # fmt: skip
    close.set(xlim=(MS * begin, MS * end), ylim=(2, 18), xlabel="time in the stroke [ms]")
    close.set_ylabel("speed of a node in the middle of limb 1 [mm/s]")
    close.set_title("1. Limbs ring lengthwise, at hundreds of hertz", fontsize=10.5, loc="left")
    strength.set(
        xlabel="time in the stroke [s]", ylabel="lengthening speed of limbs, r.m.s. [mm/s]", ylim=(0.03, 100.0)
    )
    strength.set_title("2. SDIRK2 damps the ringing, the midpoint rule keeps it", fontsize=10.5, loc="left")
    strength.legend(frameon=False, fontsize=8.5, loc="upper right")
    path.set(xlabel="strokes", ylabel="farther from the start than the converged robot", xticks=range(0, 11, 2))
    path.set_title("3. Robots that do not ring swim too far", fontsize=10.5, loc="left")
    as_percent(path.yaxis)
    figure.suptitle(f"Why damped ringing costs accuracy: the pair {RINGING} of Fig. 13.8", x=0.01, ha="left")
    return figure


def record(numerics: Numerics, relaxation_time: float | None = None) -> tuple[Floats, Floats, Floats]:
    """Times [s], velocity across limb 1 in its middle [m/s], r.m.s. lengthening speed of limbs [m/s]; second stroke."""
    simulator = Simulator(scene_of(numerics, relaxation_time=relaxation_time), 1, threads=1)
    command = PAIRS[RINGING][None]
    simulator.stroke(command)
    time, velocity, stretching = [], [], []
    for t in simulator.stroke_in_parts(command, min(SAMPLES, round(1.0 / numerics.step))):
        time.append(t)
        velocity.append(simulator.velocities[0, 5, 1])
        limbs = (lengthening(simulator) @ simulator.velocities.ravel()).reshape(5, -1).sum(axis=1)
        stretching.append(np.sqrt(np.mean(limbs**2)))
    return np.array(time), np.array(velocity), np.array(stretching)


def lengthening(simulator: Simulator) -> Floats:
    """Matrix from node velocities to the lengthening speeds of the edges of one robot, limb by limb."""
    nodes = simulator.positions[0]
    heads = np.arange(1, len(nodes))
    tails = np.where((heads - 1) % ((len(nodes) - 1) // 5) == 0, 0, heads - 1)
    directions = nodes[heads] - nodes[tails]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    matrix = np.zeros((len(heads), len(nodes), 2))
    edges = np.arange(len(heads))
    matrix[edges, heads], matrix[edges, tails] = directions, -directions
    return matrix.reshape(len(heads), -1)


@cache
def swum(numerics: Numerics, freeze_lengths: bool = False) -> Floats:
    """Distances of the hub from the start at the ends of strokes [m].

    freeze_lengths: Every 2 ms take out what lengthens edges, by impulses between the ends of the edges.
    """
    simulator = Simulator(scene_of(numerics), 1, threads=1)
    masses = np.repeat(make_rods(simulator.scene).mass, 2)
    distances = []
    for _ in range(STROKES):
        for _ in simulator.stroke_in_parts(PAIRS[RINGING][None], 500 if freeze_lengths else 1):
            if freeze_lengths:
                rates = lengthening(simulator)
                v = simulator.v[0, :, 0]
                v -= np.linalg.solve((rates / masses) @ rates.T, rates @ v) @ (rates / masses)
        distances.append(np.hypot(*simulator.hub_position()[0]))
    return np.array(distances)


def excess(distances: Floats) -> tuple[Floats, Floats]:
    """Strokes, and by how many per cent of its path a robot is farther from the start than the converged one."""
    exact = swum(EXACT)
    return np.arange(1.0, STROKES + 1.0), PERCENT * (distances / exact - 1.0)


def smoothed(values: Floats, time: Floats, window: float = 0.03) -> Floats:
    """Root mean square over a window of time [s]."""
    n = max(1, round(window / (time[-1] - time[-2])))
    ones = np.convolve(np.ones(len(values)), np.ones(n), mode="same")
    return np.sqrt(np.convolve(values**2, np.ones(n), mode="same") / ones)
