"""The chapter's Figs. 13.2 and 13.6 to 13.9, recomputed and written as PNG, and its statements beside the numbers.

Each swim is computed three times: with the chapter's setting, with its ten nodes converged in time, and with ten nodes
in the continuum's discretisation. The pictures show the first (orange) and the last (dark). The pairs of limbs swim
with 73 nodes, too. The statements are printed; distances and motions are written to `chapter.json`.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike, NDArray
from tqdm import tqdm

from seastar_gym import gaits
from seastar_gym.files import save_figure
from seastar_gym.gaits import STRAIGHT
from seastar_gym.scene import Numerics, Scene, Seastar
from seastar_gym.simulator import Simulator, SolverStatus
from studies.benchmark import real_time_factors
from studies.frame import Floats, Results, Study, rounded
from studies.pages import markdown, show
from studies.style import FAINT, INK, MM, MS, new_figure, subplots

REAL_TIME_FROM, ISSUES_FROM = 3e-3, 20e-3
"""Time steps [s] from which the chapter's code runs faster than real time, and from which it reports numerical issues.
"""
PAIRS = {name.replace(",", ", ").replace("-", "⁻").replace("+", "⁺"): command for name, command in gaits.PAIRS.items()}
BISECTORS = (36.0, 72.0, 108.0, 144.0)
"""Directions of the pairs' bisectors at rest, on the side that they swim to [degrees]."""
SIDE = gaits.SWIMMING_STROKES + gaits.RESTING_STROKES
"""Strokes on a side of the pentagon, swimming and resting."""
STEPS = np.array([0.1, 0.2, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 30.0, 40.0]) * 1e-3
"""Time steps of Fig. 13.9 [s]."""
BATCH = 64
"""Robots in the batch whose cost is measured."""
COLUMNS = ("its setting", "its ten nodes, converged", "continuum", "73 nodes")
"""Columns of values. Of the cost, the second is empty; the last has the pairs only."""

# Swims


@dataclass(frozen=True)
class Setting:
    """Robot and numerics of a swim, and their name in legends and tables."""

    name: str
    robot: Seastar
    numerics: Numerics

    @property
    def label(self) -> str:
        """Name in legends, with the numerics."""
        scheme = self.numerics.scheme.replace("-", " ").replace("euler", "Euler")
        return f"{self.name} ({scheme}, {MS * self.numerics.step:g} ms)"


THE_CHAPTERS, CONVERGED = Seastar(discretisation="chapter"), Numerics("implicit-midpoint", 0.25e-3)
SETTINGS = (
    Setting("the chapter's setting", THE_CHAPTERS, Numerics("implicit-euler", 3e-3)),
    Setting("its ten nodes, converged in time", THE_CHAPTERS, CONVERGED),
    Setting("continuum, ten nodes", Seastar(nodes_per_limb=10), CONVERGED),
)
"""The last is as far as infinitely many nodes to 0.01 % on the straight swim, and to 0.8 % for the pairs."""
LIMIT = Setting("continuum, 73 nodes", Seastar(nodes_per_limb=73), CONVERGED)
"""As far as infinitely many nodes to 0.02 %: pairs swim as far with 37 nodes to 0.04 %."""


@dataclass(frozen=True)
class Swim:
    """Recorded motion of the robots of one scene, sampled from rest.

    label: Name of the setting. commands: Of every stroke, shape (n_strokes, n_robots, n_limbs).
    time: Of the samples [s], shape (n,). positions [m], velocities [m/s]: Of nodes, shape (n, n_robots, n_nodes, 2).
    """

    label: str
    scene: Scene
    commands: Floats
    time: Floats
    positions: Floats
    velocities: Floats

    def hub(self, robot: int = 0) -> Floats:
        """Hub positions of a robot [m], shape (n, 2)."""
        return self.positions[:, robot, 0]

    def at(self, time: float) -> int:
        """Index of the first sample that is not before a time [s]."""
        return int(np.searchsorted(self.time, time - 1e-9))

    def at_strokes(self) -> NDArray[np.intp]:
        """Indices of the samples at rest and at the end of every stroke, shape (n_strokes + 1,)."""
        return np.searchsorted(self.time, np.arange(len(self.commands) + 1) * self.scene.actuator.period - 1e-9)

    def actuated(self, time: float) -> NDArray[np.bool_]:
        """Mask of the first robot's limbs that are rotated at a time [s], shape (n_limbs,)."""
        stroke, since = divmod(time + 1e-9, self.scene.actuator.period)
        turned = stroke < len(self.commands) and self.scene.actuator.delta_psi(since) > 1e-6
        active: NDArray[np.bool_] = turned & (self.commands[int(stroke) if turned else 0, 0] != 0.0)
        return active


def swim(setting: Setting, commands: ArrayLike, samples_per_stroke: int) -> Swim:
    """Simulate and record robots from rest; commands: shape (n_strokes, n_robots, n_limbs)."""
    commands, scene = np.asarray(commands, float), Scene(setting.robot, numerics=setting.numerics)
    simulator = Simulator(scene, commands.shape[1])
    samples = [(0.0, simulator.positions, simulator.velocities)]
    for stroke, command in enumerate(commands):
        for since in simulator.stroke_in_parts(command, samples_per_stroke):
            now = stroke * scene.actuator.period + since
            samples.append((now, simulator.positions, simulator.velocities))
        if simulator.failed.any():
            raise RuntimeError(SolverStatus.NOT_CONVERGED.sentence)
    times, positions, velocities = (np.array(values) for values in zip(*samples, strict=True))
    return Swim(setting.label, scene, commands, times, positions, velocities)


def stroke_motion(straight: Swim, stroke: int = -1) -> tuple[float, float, float, float]:
    """Motion of the hub along x in a stroke: (advance while heated, advance after that, return, time of return).

    stroke: Number of the stroke from 0, or from the end. Distances in [mm]; the time at which the hub turns back is in
    [s] from the stroke's start.
    """
    begins = straight.at_strokes()
    start, end = begins[:-1][stroke], begins[1:][stroke]
    x, since = MM * straight.hub()[start : end + 1, 0], straight.time[start : end + 1] - straight.time[start]
    heated = int(np.searchsorted(since, straight.scene.actuator.corners[1] - 1e-9))
    farthest = int(np.argmax(x))
    return x[heated] - x[0], x[farthest] - x[heated], x[farthest] - x[-1], float(since[farthest])


class Cost(NamedTuple):
    """Computing over simulated time of implicit Euler, by time step [s]; arrays of shape (n,).

    alone, in_batch: Of a single robot, and per robot of a batch. regularised: Whether Newton's matrix was indefinite in
    some steps and therefore regularised.
    """

    steps: Floats
    alone: Floats
    in_batch: Floats
    regularised: NDArray[np.bool_]


def needs_regularisation(scene: Scene) -> bool:
    """Whether Newton's matrix is indefinite in some step of ten strokes of the straight swim."""
    simulator = Simulator(scene)
    return any(simulator.stroke(STRAIGHT[None]).regularised[0] > 0 for _ in range(10))


def measure_cost(robot: Seastar, steps: Floats, seconds: float, progress: Callable[[], object] = lambda: None) -> Cost:
    """Measure Fig. 13.9; steps: Time steps [s], seconds: Duration of the measurement per point [s]."""
    rows = []
    for step in steps:
        scene = Scene(robot, numerics=Numerics("implicit-euler", float(step)))
        times = (1.0 / max(real_time_factors(scene, n, seconds)) for n in (1, BATCH))  # other work only adds time
        rows.append((step, *times, needs_regularisation(scene)))
        progress()
    steps, alone, in_batch, regularised = map(np.array, zip(*rows, strict=True))
    return Cost(steps, alone, in_batch, regularised)


# Statements


class Statement(NamedTuple):
    """A statement of the chapter and a quantity that it is about.

    values: In `unit`, of every setting of SETTINGS and perhaps of LIMIT; of costs, of either discretisation.
    """

    sentence: str
    quantity: str
    unit: str
    values: Sequence[float]


def straight_statements(swims: Sequence[Swim]) -> list[Statement]:
    """Statements about Fig. 13.6, the straight swim."""
    (first, *_), (heated, after, returned, turn) = (
        list(zip(*(stroke_motion(swim, stroke) for swim in swims), strict=True)) for stroke in (0, -1)
    )
    forward = "the robot swims forward during the actuating phase ..."
    back = "... but moves slightly backward in the cooling state"
    hubs = [MM * swim.hub() for swim in swims]
    return [
        Statement("the net motion of the robot is forward", "x after 10 strokes", "mm", [hub[-1, 0] for hub in hubs]),
        Statement(forward, "forward while heated, first stroke", "mm", first),
        Statement(forward, "forward while heated, 10th stroke", "mm", heated),
        Statement(forward, "forward after that", "mm", after),
        Statement(back, "backward", "mm", returned),
        Statement(back, "turns back at", "s", turn),
        Statement("no displacement along the Y-axis", "largest |y|", "mm", [np.abs(hub[:, 1]).max() for hub in hubs]),
    ]


def pentagon_statements(swims: Sequence[Swim]) -> list[Statement]:
    """Statements about Figs. 13.2 and 13.7, the pentagon."""
    corners = [MM * swim.hub()[swim.at_strokes()[::SIDE]] for swim in swims]
    sides = [np.hypot(*np.diff(each, axis=0).T) for each in corners]
    rests = [swim.at_strokes()[SIDE::SIDE] for swim in swims]
    begins = [MM * swim.hub()[swim.at_strokes()[gaits.SWIMMING_STROKES :: SIDE]] for swim in swims]
    coasts = [np.hypot(*(each[1:] - begin).T).mean() for each, begin in zip(corners, begins, strict=True)]
    speeds = [MM * np.hypot(*np.moveaxis(swim.velocities[r, 0], -1, 0)) for swim, r in zip(swims, rests, strict=True)]
    rest = "left unactuated for 5 s to bring the robot to a complete stop"
    same = "the same initial conditions for each straight component"
    return [
        Statement("regular pentagon", "mean side", "mm", [each.mean() for each in sides]),
        Statement(same, "longest minus shortest side", "mm", [np.ptp(each) for each in sides]),
        Statement("a closed path", "end to start", "mm", [np.hypot(*each[-1]) for each in corners]),
        Statement(rest, "hub coasts back in the rest", "mm", coasts),
        Statement(rest, "hub's speed after the rest", "mm/s", [each[:, 0].max() for each in speeds]),
        Statement(rest, "fastest node after the rest", "mm/s", [each.max() for each in speeds]),
    ]


def pair_statements(swims: Sequence[Swim]) -> list[Statement]:
    """Statements about Fig. 13.8, the pairs of limbs."""
    ends = [MM * swim.positions[-1, :, 0] for swim in swims]
    far = np.array([np.hypot(*end.T) for end in ends]).T
    off = [np.abs(np.degrees(np.arctan2(end[:, 1], end[:, 0])) - BISECTORS).max() for end in ends]
    order = "the maximum with limbs #1 and #4, a lower efficiency with #1 and #2"
    return [
        *(Statement(order, f"distance of {name}", "mm", row) for name, row in zip(PAIRS, far.tolist(), strict=True)),
        Statement(order, "distance of {1⁻, 3⁺} over that of {1⁻, 5⁺}", "", far[1] / far[3]),
        Statement("always moves along the bisector", "largest angle off it", "degrees", off),
    ]


def cost_statements(costs: Sequence[Cost]) -> list[Statement]:
    """Statements about Fig. 13.9, the cost of implicit Euler as in the chapter, in either discretisation."""
    at_3 = int(np.argmin(np.abs(costs[0].steps - REAL_TIME_FROM)))
    slopes = [np.polyfit(np.log(cost.steps), np.log(cost.in_batch), 1)[0] for cost in costs]
    firsts = [MS * cost.steps[cost.regularised].min(initial=np.inf) for cost in costs]
    faster, issues = "faster than real time when h is 3 ms or more", "numerical issues at h of 20 ms or more"
    return [
        Statement(faster, "real-time factor at 3 ms, one robot alone", "", [1.0 / cost.alone[at_3] for cost in costs]),
        Statement(faster, f"the same per robot of {BATCH}", "", [1.0 / cost.in_batch[at_3] for cost in costs]),
        Statement("time linearly scales with step size", "exponent of h", "", slopes),
        Statement(issues, "smallest h at which Newton's matrix is indefinite", "ms", firsts),
    ]


def as_table(statements: Iterable[Statement]) -> str:
    """Statements as a table in Markdown."""
    rows = []
    for sentence, quantity, unit, values in statements:
        shown = [f"{value:.4g} {unit}".rstrip() for value in values]
        shown = shown if len(shown) > 2 else [shown[0], "", *shown[1:]]
        rows.append([sentence, quantity, *shown, *[""] * (len(COLUMNS) - len(shown))])
    return markdown(["the chapter", "quantity", *COLUMNS], rows, (0, 1))


# Pictures

LIMB, ACTUATED = "#9aa1ab", "#1f4fd8"
ORANGE = "#e07b00"
CONTINUUM: dict[str, Any] = {"color": INK, "linestyle": "-", "linewidth": 1.3, "zorder": 2.2}
CHAPTER: dict[str, Any] = {"color": ORANGE, "linestyle": (0, (4, 2)), "linewidth": 1.3, "zorder": 2.4}
CONTINUUM_PATH: dict[str, Any] = {"color": INK, "linewidth": 2.4, "zorder": 3.5}
CHAPTER_PATH: dict[str, Any] = {"color": ORANGE, "linewidth": 1.1, "zorder": 3.6}
"""Line of the chapter's paths. It is solid, because a robot swims back and forth and dashes would overlap."""
PAIR_COLOURS = ("#0072b2", "#009e73", "#cc3d7a", "#8c6d1f")
PAIR_LABELS = ((42.0, 22.0), (26.0, 50.0), (-18.0, 60.0), (-46.0, 12.0))
"""Positions of the pairs' names [mm]."""
NUMBERS = 8.0
"""Distance of a limb's number from its tip [mm]."""
STRAIGHT_TIMES, PENTAGON_TIMES = (0.0, 2.2, 5.5, 10.0), (22.1, 72.1, 122.1, 172.1, 222.1)
"""Times of the snapshots in Figs. 13.6 and 13.2 [s]; in the latter in the middle of every side, when limbs are rotated
farthest."""


def draw_robot(axes: Axes, swim: Swim, time: float, beyond: float = NUMBERS) -> None:
    """Draw the robot at a time [s] on axes in mm, actuated limbs bold and blue, numbers that far beyond tips [mm]."""
    n = swim.scene.robot.nodes_per_limb
    nodes, active = MM * swim.positions[swim.at(time), 0], swim.actuated(time)
    for limb in range(swim.scene.robot.n_limbs):
        line = nodes[[0, *range(1 + limb * (n - 1), 1 + (limb + 1) * (n - 1))]]
        colour, width, level = (ACTUATED, 3.2, 4.0) if active[limb] else (LIMB, 1.8, 3.0)
        axes.plot(*line.T, color=colour, linewidth=width, solid_capstyle="round", zorder=level)
        x, y = line[-1] + beyond * (line[-1] - line[-2]) / np.hypot(*(line[-1] - line[-2]))
        axes.text(x, y, f"{limb + 1}", color=INK, fontsize=8, ha="center", va="center", zorder=6.0)
    axes.plot(*nodes[0], marker="o", markersize=4.5, color=INK, zorder=5.0)


def draw_straight(continuum: Swim, chapter: Swim, file: Path) -> None:
    """Fig. 13.6: snapshots, hub position and hub velocity of ten strokes of {2+,5-}."""
    figure = new_figure(9.0, 7.6)
    panels = figure.subplot_mosaic([["a1", "a2", "a3", "a4"], ["b"] * 4, ["c"] * 4], height_ratios=[1.15, 1.0, 1.0])
    for axes in panels.values():
        axes.grid(True)
    for name, time in zip(("a1", "a2", "a3", "a4"), STRAIGHT_TIMES, strict=True):
        axes = panels[name]
        draw_robot(axes, continuum, time, 2.0 * NUMBERS)
        axes.axvline(0.0, color=FAINT, linewidth=0.8, linestyle=":", zorder=1.0)
        axes.set(aspect="equal", xlim=(-120.0, 160.0), ylim=(-130.0, 130.0), title=f"({name})  t = {time:.1f} s")
        axes.set(xticks=[-100, 0, 100], yticks=[-100, 0, 100], xlabel="x [mm]")
    panels["a1"].set_ylabel("y [mm]")
    for name, continuum_values, chapter_values in (
        ("b", continuum.hub(), chapter.hub()),
        ("c", continuum.velocities[:, 0, 0], chapter.velocities[:, 0, 0]),
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
        f"The last stroke: {heated:.1f} mm forward while heated,\n{after:.1f} mm more until {turn:.2f} s "
        f"into the stroke, then {back:.1f} mm back"
    )
    panels["b"].set(ylabel="hub position [mm]", title=f"(b)  pink: limbs 2 and 5 are heated. {moves}", xlim=span)
    panels["c"].set(ylabel="hub velocity [mm/s]", xlabel="time [s]", title="(c)", xlim=span)
    panels["b"].legend(loc="upper left", fontsize=9)
    figure.align_ylabels([panels["b"], panels["c"]])
    save_figure(figure, file)


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
            (cost.in_batch, "s", "#009e73", f"per robot of a batch of {BATCH}"),
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


# The study


@dataclass(frozen=True)
class Options:
    """The chapter's figures and statements."""

    quick: bool = False
    """Swim with steps of 1 ms or more, and measure few costs."""


def pairs_table(results: Mapping[str, Any]) -> str:
    """Distances of the pairs in Markdown, a column for every setting."""
    columns = results["pairs_mm"]
    rows = zip(gaits.PAIRS, *columns.values(), strict=True)
    return markdown(["pair", *columns], [[name, *(f"{each:.2f}" for each in row)] for name, *row in rows])


def run(options: Options, results: Results) -> None:
    """Swim, write the figures, print the statements, and keep distances and motions."""
    out, pair_commands = results.folder, np.tile(list(PAIRS.values()), (10, 1, 1))
    shortest, seconds, steps = (1e-3, 0.0, STEPS[3::2]) if options.quick else (0.0, 0.5, STEPS)

    def swims(settings: Iterable[Setting], commands: ArrayLike, samples: int) -> list[Swim]:
        found = []
        for each in tqdm(list(settings), unit="swim"):
            numerics = replace(each.numerics, step=max(shortest, each.numerics.step))
            found.append(swim(replace(each, numerics=numerics), commands, samples))
        return found

    straight = swims(SETTINGS, np.tile(STRAIGHT, (10, 1, 1)), 200)
    draw_straight(straight[-1], straight[0], out / "fig_13_6.png")
    pentagon = swims(SETTINGS, gaits.pentagon_gait()[:, None], 20)
    draw_pentagon_snapshots(pentagon[-1], pentagon[0], out / "fig_13_2.png")
    draw_pentagon(pentagon[-1], pentagon[0], out / "fig_13_7a.png")
    pairs = swims((*SETTINGS, LIMIT), pair_commands, 50)
    draw_pairs(pairs[len(SETTINGS) - 1], pairs[0], list(PAIRS), out / "fig_13_8.png")
    with tqdm(total=2 * len(steps), unit="cost") as bar:
        costs = [measure_cost(robot, steps, seconds, bar.update) for robot in (THE_CHAPTERS, SETTINGS[-1].robot)]
    draw_cost(costs, out / "fig_13_9.png")
    statements = [straight_statements(straight), pentagon_statements(pentagon), pair_statements(pairs)]
    show(as_table([row for each in (*statements, cost_statements(costs)) for row in each]), "The chapter, and computed")
    ends = {swim.label: MM * swim.positions[-1, :, 0] for swim in pairs}
    results["pairs_mm"] = {label: [rounded(np.hypot(*end), 6) for end in each] for label, each in ends.items()}
    results["straight_mm"] = {
        swim.label: {
            name: [rounded(each, 6) for each in stroke_motion(swim, stroke)]
            for name, stroke in (("first", 0), ("10th", -1))
        }
        for swim in straight
    }


STUDY = Study(
    "chapter", run, Options, "chapter/chapter.json", Path("runs/chapter"), tables={"chapter pairs": pairs_table}
)
