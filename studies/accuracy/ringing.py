"""Ringing of limbs, and the error of schemes that damp it: large with the chapter's hub, small with a rigid one.

Writes `ringing.json` and `ringing.png`.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.gaits import PAIRS
from seastar_gym.model.rods import make_rods
from seastar_gym.scene import Numerics, Scene, Seastar
from seastar_gym.scene.robot import Discretisation
from seastar_gym.simulator import Simulator
from studies.accuracy.cases import STROKES
from studies.frame import Study
from studies.kept import rounded
from studies.style import COLOURS, DPI, INK, MM, MS, PERCENT, as_percent, subplots

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]

RINGING = "{1-,2+}"
EXACT = Numerics("implicit-midpoint", 0.05e-3, 1e-11)
SHOWN: tuple[tuple[str, Numerics, str, float], ...] = (
    ("converged", EXACT, INK, 1.4),
    ("implicit-midpoint 0.5 ms: keeps it", Numerics("implicit-midpoint", 0.5e-3), COLOURS["implicit-midpoint"], 1.2),
    ("sdirk2 0.5 ms: damps it", Numerics("sdirk2", 0.5e-3), "#ee9922", 1.4),
    ("sdirk2 20 ms", Numerics("sdirk2", 20e-3), COLOURS["sdirk2"], 1.4),
)
TITLES: dict[Discretisation, tuple[str, str, str]] = {
    "chapter": (
        "1. The chapter's hub: limbs ring lengthwise",
        "2. SDIRK2 damps the ringing",
        "3. Robots that do not ring swim too far",
    ),
    "continuum": (
        "4. A rigid hub: the same, without that ringing",
        "5. Lengthening is a sixth to a thirteenth",
        "6. At 0.5 ms no error is left of SDIRK2",
    ),
}
SAMPLES = 4000
"""Samples of a stroke, where the time steps are short enough."""


BEGIN, END = 0.42, 0.45
"""Part of the second stroke that is shown closely [s]."""
FROZEN = "converged, lengths frozen"
COMPARED = {
    "implicit midpoint, 0.5 ms": Numerics("implicit-midpoint", 0.5e-3),
    "implicit midpoint, 5 ms": Numerics("implicit-midpoint", 5e-3),
    "SDIRK2, 0.5 ms": Numerics("sdirk2", 0.5e-3),
    "SDIRK2, 20 ms": Numerics("sdirk2", 20e-3),
    "implicit Euler, 3 ms": Numerics("implicit-euler", 3e-3),
}
"""Rows of the table."""


def measure() -> dict[str, Any]:
    """All curves as plain data, by discretisation and setting, and the excess distances of the table [%]."""
    compared = {
        name: {each: rounded(float(excess(numerics, each)[-1])) for each in TITLES}
        for name, numerics in COMPARED.items()
    }
    return {"percent_after_ten_strokes": compared, **{each: curves(each) for each in TITLES}}


def table(results: Mapping[str, Any]) -> str:
    """Table in Markdown: excess distance after ten strokes."""
    rows = results["percent_after_ten_strokes"]
    lines = [
        f"| {name} | " + " | ".join(f"{row[each]:.2f} %" for each in TITLES) + " |" for name, row in rows.items()
    ]
    return "\n".join([f"| | {' | '.join(TITLES)} |", f"|---|{'---:|' * len(TITLES)}", *lines])


def curves(discretisation: Discretisation) -> dict[str, Any]:
    """Curves of a discretisation: velocities [mm/s], lengthening [mm/s] over time [s], and excess distances [%]."""
    found: dict[str, Any] = {}
    for name, numerics, _, _ in SHOWN:
        time, velocity, stretching = record(numerics, discretisation=discretisation)
        some = (time >= BEGIN - 0.02) & (time <= END + 0.02)
        thin = slice(None, None, max(1, len(time) // 200))
        found[name] = {
            "close_s": _rounded(time[some], 6),
            "velocity": _rounded(MM * velocity[some]),
            "time_s": _rounded(time[thin], 6),
            "lengthening": _rounded(MM * smoothed(stretching, time)[thin]),
            "excess": _rounded(excess(numerics, discretisation)),
        }
    if discretisation == "chapter":
        found[FROZEN] = {"excess": _rounded(excess(EXACT, discretisation, freeze_lengths=True))}
    return found


def _rounded(values: Floats, digits: int = 4) -> list[float]:
    return [rounded(float(value), digits) for value in values]


def draw(results: Mapping[str, Any], file: Path) -> None:
    """Picture of ringing limbs, its strength, and the excess distance swum, for several schemes and both hubs."""
    figure, rows = subplots(2, 3, figsize=(11.0, 5.9), sharex="col", sharey="col")
    for discretisation, row in zip(TITLES, rows, strict=True):
        draw_row(discretisation, results[discretisation], *row)
    rows[1, 1].legend(frameon=False, fontsize=8.5, loc="upper right")
    for axes, label in zip(rows[1], ("time in the stroke [ms]", "time in the stroke [s]", "strokes"), strict=True):
        axes.set_xlabel(label)
    figure.suptitle(f"What damped ringing costs: the pair {RINGING} of Fig. 13.8", x=0.01, ha="left")
    figure.savefig(file, dpi=DPI)


def draw_row(
    discretisation: Discretisation, found: Mapping[str, Any], close: Axes, strength: Axes, path: Axes
) -> None:
    """Draw one discretisation's panels."""
    strokes = np.arange(1.0, STROKES + 1.0)
    for name, _, colour, width in SHOWN:
        curve = found[name]
        close.plot(MS * np.array(curve["close_s"]), curve["velocity"], lw=width, color=colour)
        strength.semilogy(curve["time_s"], curve["lengthening"], color=colour, lw=width, label=name)
        path.plot(strokes, curve["excess"], "o-", ms=3.5, lw=width, color=colour)
    if FROZEN in found:
        frozen = found[FROZEN]["excess"]
        path.plot(strokes, frozen, "o--", ms=3.5, mfc="white", lw=1.4, color=INK)
        path.annotate(
            "converged, but every 2 ms the\nlengthwise ringing is taken out", (9, frozen[8]), (9.7, 1.0),
            ha="right", fontsize=8.5, color=INK, arrowprops={"arrowstyle": "-", "color": INK, "lw": 0.8},
        )  # fmt: skip
    close.set(xlim=(MS * BEGIN, MS * END), ylabel="middle node of limb 1 [mm/s]")
    strength.set(ylabel="lengthening, r.m.s. [mm/s]", ylim=(0.03, 100.0))
    path.set(ylabel="farther than converged", xticks=range(0, 11, 2))
    for axes, title in zip((close, strength, path), TITLES[discretisation], strict=True):
        axes.set_title(title, fontsize=10.5, loc="left")
    as_percent(path.yaxis)


def scene(numerics: Numerics, discretisation: Discretisation, relaxation_time: float | None = None) -> Scene:
    """The chapter's scene with these numerics; relaxation_time: That of a damped material [s], or None."""
    robot = Seastar(nodes_per_limb=10, discretisation=discretisation, relaxation_time=relaxation_time)
    return Scene(robot, numerics=numerics)


def record(
    numerics: Numerics, relaxation_time: float | None = None, discretisation: Discretisation = "chapter"
) -> tuple[Floats, Floats, Floats]:
    """Second stroke: times [s], velocity across limb 1 at its middle [m/s], r.m.s. lengthening speed of limbs [m/s]."""
    simulator = Simulator(scene(numerics, discretisation, relaxation_time), 1, threads=1)
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
    """Matrix from node velocities to the lengthening speeds of edges, limb by limb, shape (n_edges, 2 n_nodes)."""
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
def swum(numerics: Numerics, discretisation: Discretisation, freeze_lengths: bool = False) -> Floats:
    """Distances of the hub from the start at the ends of strokes [m], shape (STROKES,).

    freeze_lengths: Every 2 ms, remove the lengthening speed of all edges by impulses between their ends. Masses must be
        lumped for that, as the chapter's are.
    """
    simulator = Simulator(scene(numerics, discretisation), 1, threads=1)
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


def excess(numerics: Numerics, discretisation: Discretisation, freeze_lengths: bool = False) -> Floats:
    """Relative excess of the distance from the start over the converged robot's [%], shape (STROKES,).

    The converged robot has the same discretisation.
    """
    distances, exact = swum(numerics, discretisation, freeze_lengths), swum(EXACT, discretisation)
    return PERCENT * (distances / exact - 1.0)


def smoothed(values: Floats, time: Floats, window: float = 0.03) -> Floats:
    """Root mean square of values over a moving window of time [s]."""
    n = max(1, round(window / (time[-1] - time[-2])))
    ones = np.convolve(np.ones(len(values)), np.ones(n), mode="same")
    return np.sqrt(np.convolve(values**2, np.ones(n), mode="same") / ones)


STUDY = Study(
    "accuracy.ringing",
    lambda _, results: results.update(measure()),
    file="ringing.json",
    pictures={"ringing.png": draw},
    tables={"ringing": table},
)
