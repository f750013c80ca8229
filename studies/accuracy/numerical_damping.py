"""How much numerical damping: what `Numerics.damping` costs in accuracy, and what it saves.

Six undamped robots swim sequences of all classes with several meshes and steps of the implicit midpoint rule: without
damping, with several amounts of `Numerics.damping`, and with the material's instead, of a relaxation time of 0.002 of
the step, and of 10 µs whatever the step. Errors are of space and time together, against the undamped continuum, as in
`measure`. Long swims tell where the kinetic energy grows. Results
are ratios to the same setting without damping.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from seastar_gym.accuracy.commands import CLASSES, PROMISED, draw_classes
from seastar_gym.accuracy.endurance import energy_growth
from seastar_gym.accuracy.measure import errors, path_lengths, swim_all
from seastar_gym.accuracy.setting import LARGEST_GROWTH, at
from seastar_gym.scene import Numerics, Scene, Seastar
from seastar_gym.scene.numerics import Resolution
from studies.accuracy.page import markdown
from studies.accuracy.settings import MS
from studies.frame import InDocs, Results, Study

ROBOTS: dict[str, tuple[Scene, int]] = {
    "the chapter's": (Scene(), 16),
    "soft, E = 0.1 MPa": (Scene(Seastar(youngs_modulus=1e5)), 8),
    "stiff, E = 10 MPa": (Scene(Seastar(youngs_modulus=1e7)), 8),
    "thick, r = 3 mm": (Scene(Seastar(rod_radius=3e-3)), 8),
    "short, L = 5 cm": (Scene(Seastar(limb_length=0.05)), 8),
    "twelve limbs": (Scene(Seastar(12)), 5),
}
"""Scenes, and sequences per class."""
MESHES: dict[int, tuple[float, ...]] = {7: (5,), 12: (10, 5, 2), 19: (5, 2, 1)}
"""Time steps [ms] by nodes per limb."""
SHARES = (0.0, 0.001, 0.002, 0.003, 0.005, 0.007)
MATERIAL = {"material, 0.002 h": lambda step: 0.002 * step, "material, 10 µs": lambda _: 1e-5}
"""Relaxation times [s] of a step [s] by name: damping of the material in place of `Numerics.damping`."""
SHORT = Numerics("implicit-midpoint", 0.1 * MS, 1e-9)
LIMIT = Resolution("continuum", 37, SHORT)
SEED, STROKES = 11, 4
"""Seed of the sequences; and gaits of each kind in long swims."""


class Cell(NamedTuple):
    """An amount of damping by its name, and the scene with it."""

    name: str
    scene: Scene


def cells(scene: Scene) -> Iterator[Cell]:
    """A scene at all meshes, steps and amounts."""
    for nodes, steps in MESHES.items():
        for step in (each * MS for each in steps):
            bare = at(scene, Resolution("continuum", nodes, numerics(step, 0.0)))
            yield from (Cell(f"{each:g}", replace(bare, numerics=numerics(step, each))) for each in SHARES)
            for name, tau in MATERIAL.items():
                yield Cell(name, replace(bare, robot=replace(bare.robot, relaxation_time=tau(step))))


def numerics(step: float, damping: float) -> Numerics:
    """Numerics of a step [s]."""
    return Numerics("implicit-midpoint", step, 1e-5 if step >= 5 * MS else 1e-6, damping=damping)


def examine(name: str) -> list[dict[str, Any]]:
    """Numbers of all cells of a robot."""
    scene, samples = ROBOTS[name]
    commands, mine = draw_classes(samples, scene.robot.n_limbs, SEED), list(cells(scene))
    full = np.repeat([kind in PROMISED for kind in CLASSES], samples)
    fine = [at(scene, Resolution("continuum", nodes, SHORT)) for nodes in (LIMIT.nodes_per_limb, *MESHES)]
    limit, *swum = swim_all([*fine, *(each.scene for each in mine)], commands)
    lengths, short = path_lengths(scene, limit.hub), dict(zip(MESHES, swum, strict=False))
    rows = []
    for each, swims in zip(mine, swum[len(MESHES) :], strict=True):
        nodes = each.scene.robot.nodes_per_limb
        space, time = errors(short[nodes], limit, lengths).path, errors(swims, short[nodes], lengths).path
        error = (space + time)[full]
        rows.append({
            "nodes_per_limb": nodes, "step": each.scene.numerics.step, "damping": each.name,
            "largest_error": float(error.max()), "median_error": float(np.median(error)),
            "iterations": float(swims.newton_iterations.mean()),
            "energy_growth": energy_growth(each.scene, STROKES),
        })  # fmt: skip
    return rows


def table(results: dict[str, Any]) -> str:
    """Errors and iterations over those without damping, and where energy grows, by the amount of damping."""
    by_name: dict[str, list[tuple[dict[str, Any], dict[str, Any]]]] = {}
    for rows in results["robots"].values():
        bare = {(row["nodes_per_limb"], row["step"]): row for row in rows if row["damping"] == "0"}
        for row in rows:
            by_name.setdefault(row["damping"], []).append((row, bare[row["nodes_per_limb"], row["step"]]))
    lines = []
    for name, pairs in by_name.items():
        ratios = {
            column: np.array([row[column] / other[column] for row, other in pairs])
            for column in ("largest_error", "median_error", "iterations")
        }
        growing = sum(row["energy_growth"] > LARGEST_GROWTH for row, _ in pairs)
        means = {column: f"{np.exp(np.log(each).mean()):.2f}" for column, each in ratios.items()}
        of_chapters = max(row["largest_error"] / other["largest_error"] for row, other in pairs[: len(pairs) // 6])
        lines.append([
            name, means["largest_error"], f"{ratios['largest_error'].max():.2f}",
            f"{of_chapters:.2f}", means["median_error"], means["iterations"], f"{growing} of {len(pairs)}",
        ])  # fmt: skip
    head = ["damping", "worst error, mean ratio", "largest ratio", "largest, chapter's robot",
            "median error, mean ratio", "Newton iterations", "energy grows in"]  # fmt: skip
    return markdown(head, lines)


def run(_: InDocs, results: Results) -> None:
    """Measure the robots that are missing."""
    results.read()
    cells = {("robots", name): partial(examine, name) for name in ROBOTS}
    results.fill(cells, lambda rows: f"{len(rows)} rows")
    print(table(results))


STUDY = Study(
    "accuracy.numerical_damping", run, file="numerical_damping.json", tables={"numerical_damping": table}
)
