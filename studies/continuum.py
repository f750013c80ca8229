"""Errors of space: how far the hub is from where it is with infinitely many nodes.

Every scene swims ten strokes from rest with some commands, repeated, in both discretisations and with more and more
nodes per limb. The error is the hub's largest distance, at ends of strokes, from that of the continuum's discretisation
with 73 nodes, as a fraction of that path's length; of all commands the worst. Time steps of 1 ms add about the same
error to both, which cancels. Orders are slopes of a line through the logarithms of errors and edge lengths.

Writes the errors as JSON and a picture.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple, get_args

import numpy as np
from tqdm import tqdm

from seastar_gym.accuracy.measure import path_lengths
from seastar_gym.files import save_figure
from seastar_gym.gaits import PAIRS, STRAIGHT
from seastar_gym.scene import Contact, Limb, Numerics, Scene, Seastar, SmaPulse, Vortex, Water
from seastar_gym.scene.robot import Discretisation
from seastar_gym.simulator import Simulator
from studies.frame import Floats, Results, Study, rounded
from studies.pages import markdown
from studies.style import CYCLE, PERCENT, as_percent, subplots

TAU = 5e-3
"""Relaxation time of the damping [s] that keeps orders of convergence clean: undamped limbs ring for the whole swim."""

UNEQUAL = (Limb(radius=(2e-3, 1e-3)), Limb(length=0.08), Limb(), Limb(youngs_modulus=(2e6, 5e5)), Limb())
"""A tapered limb, a short one, and one that softens towards its tip."""

ROBOTS: dict[str, dict[str, Any]] = {
    "undamped": {"relaxation_time": None},
    "three limbs": {"n_limbs": 3},
    "twelve limbs": {"n_limbs": 12},
    "unequal, tapered limbs": {"limbs": UNEQUAL},
    "curved limbs": {"limbs": (Limb(natural_curvature=6.0),) * 5},
    "soft limbs": {"youngs_modulus": 2e5},
}
"""What robots have that differ from the chapter's with damping."""

PARTS: dict[str, dict[str, Any]] = {
    "three limbs": {"actuator": SmaPulse(0.4)},  # hub hinges of the chapter allow no more
    "vortex": {"fluid": Water(current=Vortex(1e-4))},
    "drag along limbs": {"fluid": Water(tangential_drag_coefficient=0.1)},
    "added mass": {"fluid": Water(added_mass_coefficient=1.0)},
    "contact": {"contact": Contact()},
    "contact, layer of 10 mm": {"contact": Contact(layer=10e-3)},
}
"""Other parts of a scene than the robot."""

NAMES = tuple(dict.fromkeys(("damped", *ROBOTS, *PARTS)))


def scene(name: str, discretisation: Discretisation, nodes_per_limb: int, step: float = 1e-3) -> Scene:
    """Scene of that name, with the implicit midpoint rule at a step [s] that leaves errors of space alone."""
    robot = {"relaxation_time": TAU} | ROBOTS.get(name, {})
    return Scene(
        Seastar(nodes_per_limb=nodes_per_limb, discretisation=discretisation, **robot),
        numerics=Numerics("implicit-midpoint", step),
        **PARTS.get(name, {}),
    )


NODES = (6, 10, 19, 37)
REFERENCE_NODES = 73
FITTED = (10, 19, 37)
"""Numbers of nodes that the order is fitted to."""
STROKES = 10
LUMPED = "added mass, lumped"
"""What the continuum's discretisation is without the consistent part of added mass."""


class Row(NamedTuple):
    """Errors of a scene in one discretisation, for each of NODES, as fractions of the path; order: Fitted order."""

    name: str
    discretisation: str
    errors: Floats
    order: float


def commands(n_limbs: int) -> Floats:
    """Repeated commands, shape (n, n_limbs): those of the chapter for five limbs, else two opposed limbs."""
    if n_limbs == 5:
        more = [[1.0, 0.0, -1.0, 0.5, 0.0], [-1.0, 1.0, 1.0, -1.0, 0.0]]
        return np.array([STRAIGHT, *PAIRS.values(), *more])
    pairs = np.zeros((2, n_limbs))
    pairs[0, [1, -1]] = pairs[1, [0, -1]] = 1.0, -1.0
    return pairs


def swim(name: str, discretisation: Discretisation, nodes_per_limb: int, lumped: bool = False) -> Floats:
    """Hub at the ends of strokes [m], shape (STROKES, n_commands, 2); lumped: without the consistent added mass."""
    swum = scene(name, discretisation, nodes_per_limb)
    each = commands(swum.robot.n_limbs)
    simulator, hub = Simulator(swum, len(each), threads=1), []
    edge_added_mass = simulator.coefficients.rods(0).edge_added_mass
    if lumped and edge_added_mass is not None:
        edge_added_mass[:] = 0.0
    for _ in range(STROKES):
        if simulator.stroke(each).status.any():
            return np.full((STROKES, len(each), 2), np.nan)
        hub.append(simulator.hub_position())
    return np.array(hub)


def error(hub: Floats, reference: Floats) -> float:
    """Largest distance of the hub from the reference over the length of its path, of all commands the worst."""
    return float((np.linalg.norm(hub - reference, axis=-1).max(axis=0) / path_lengths(Scene(), reference)).max())


def order(errors: Floats) -> float:
    """Slope of log error over log edge length, for the numbers of nodes in FITTED."""
    fitted = [NODES.index(n) for n in FITTED]
    return float(np.polyfit(-np.log(np.subtract(FITTED, 1)), np.log(errors[fitted]), 1)[0])


def measure(names: tuple[str, ...] = NAMES) -> list[Row]:
    """Rows of scenes, two each and one for lumped added mass."""
    rows = []
    for name in tqdm(names, unit="scene"):
        reference = swim(name, "continuum", REFERENCE_NODES)
        kinds = [(name, discretisation, False) for discretisation in get_args(Discretisation)]
        for label, discretisation, lumped in [*kinds, *([(LUMPED, "continuum", True)] if name == "added mass" else [])]:
            errors = np.array([error(swim(name, discretisation, n, lumped), reference) for n in NODES])
            rows.append(Row(label, discretisation, errors, order(errors)))
    return rows


def as_data(rows: list[Row]) -> dict[str, Any]:
    """Rows as plain data."""
    plain = [
        {**row._asdict(), "errors": [rounded(each) for each in row.errors], "order": round(row.order, 4)}
        for row in rows
    ]
    return {"nodes_per_limb": list(NODES), "rows": plain}


def rows_of(results: Mapping[str, Any]) -> list[Row]:
    """Rows from plain data."""
    return [Row(**{**row, "errors": np.array(row["errors"])}) for row in results["rows"]]


TOLD = (10, 37)
"""Nodes per limb of the table."""


def table(results: Mapping[str, Any]) -> str:
    """Errors [%] and orders of all scenes in Markdown, both discretisations side by side."""
    kinds = ("continuum", "chapter")
    head = [f"{kind}, N = {n}" if n == TOLD[0] else str(n) for kind in kinds for n in (*TOLD, "order")]
    lines = []
    found = {(row.name, row.discretisation): row for row in rows_of(results)}
    for name in dict.fromkeys(name for name, _ in found):
        rows = [found.get((name, kind)) for kind in kinds]
        lines.append([name, *(cell for row in rows for cell in _cells(row))])
    return markdown(["scene", *head], lines)


def _cells(row: Row | None) -> list[str]:
    if row is None:
        return [""] * (len(TOLD) + 1)
    errors = dict(zip(NODES, row.errors, strict=True))
    return [*(f"{PERCENT * errors[n]:.2g}" for n in TOLD), f"{row.order:.1f}"]


def draw(rows: list[Row], path: Path) -> None:
    """Picture of errors over nodes, one line per scene; colours tell the discretisations apart."""
    figure, axes = subplots(figsize=(6.4, 4.8))
    colours = {"chapter": CYCLE[1], "continuum": CYCLE[0]}
    label: dict[str, Any] = {"transform": axes.transAxes, "ha": "right", "fontweight": "bold"}
    for discretisation, colour in colours.items():
        lines = [row.errors for row in rows if row.discretisation == discretisation and row.name != LUMPED]
        for errors in lines:
            axes.loglog(NODES, PERCENT * errors, "-", color=colour, lw=0.8, alpha=0.5)
        middle = np.exp(np.mean(np.log(lines), axis=0))
        axes.loglog(NODES, PERCENT * middle, "o-", color=colour, lw=2.2)
    axes.text(0.98, 0.95, "chapter's discretisation", color=colours["chapter"], **label)
    axes.text(0.45, 0.06, "continuum's discretisation", color=colours["continuum"], **label)
    touching = next((row.errors for row in rows if row.name == "contact" and row.discretisation == "continuum"), None)
    if touching is not None:
        axes.annotate("limbs that touch", (NODES[2], PERCENT * touching[2]), xytext=(6, 6),
                      textcoords="offset points", color=colours["continuum"], fontsize=9)  # fmt: skip
    axes.set_xticks(NODES, [str(n) for n in NODES])
    axes.minorticks_off()
    as_percent(axes.yaxis)
    axes.set_xlabel("nodes per limb")
    axes.set_ylabel("largest error of the hub's path")
    axes.set_title("A line per scene, thick lines their geometric mean", loc="left")
    save_figure(figure, path)


def run(results: Results) -> str | None:
    """Measure all scenes."""
    rows = measure()
    results.update(as_data(rows))
    failed = not all(math.isfinite(row.order) for row in rows)
    return "The solver failed in a scene, see the empty errors." if failed else None


STUDY = Study(
    "continuum",
    run,
    file="accuracy/continuum.json",
    pictures={"continuum.png": lambda results, file: draw(rows_of(results), file)},
    tables={"continuum": table},
)
