"""What speed costs: the best robots of the search at their work, swum with contact, and a front of speed over work.

The fastest within limits of work and moment, and the thriftiest at given speeds, are found at `fast` (search.py) and
swim again at `reference`, with limbs that touch. Robots that are to keep a limit, or a speed, get the size with which
they do so there. Writes front.json and front.png.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from seastar_gym.executors.processes import Processes
from seastar_gym.files import save_figure
from seastar_gym.scene import Contact, Scene
from studies.designs import space
from studies.designs.search import CHANGED, SIMULATED, SPEEDS, Limit, Row, fastest, grown, search, thriftiest
from studies.designs.space import MEASURED, Body, swum
from studies.frame import Results, Study, rounded
from studies.pages import markdown
from studies.style import INK, MM, subplots

Table = dict[str, Any]
FACTORS = (0.3, 1.0, 3.0, 10.0, 30.0, 100.0)
"""Limits of the work per stroke, over that of the chapter's robot."""
OWN = Limit(0.0776e-3 * MEASURED, 0.1e-3)
"""Work [J] and peak moment [N m] of the chapter's robot in the measured strokes, at `reference`."""
CHAPTER, AT_WORK, THRIFTIEST, FASTEST = (
    "the chapter's", "fastest at its work and peak moment", "thriftiest at its speed", "fastest",
)  # fmt: skip


def scene_of(row: Row) -> Scene:
    """Scene of a robot of the search, with contact."""
    body = Body(int(row["n_limbs"]), float(row["radius"]), float(row["taper"]))
    length, modulus, angle = (float(row[name]) for name in CHANGED)
    return space.scene_of(body, length, modulus, angle, Contact())


def at_reference(scene: Scene) -> dict[str, float]:
    """Columns of a robot's results at `reference`."""
    return swum(scene, fidelity="reference")


def sized(row: Row, limit: Limit) -> Row:
    """A robot of the size with which it is within a limit at `reference`, with contact."""
    found = at_reference(scene_of(row))
    size = min((limit.work / found["work"]) ** 0.2, (limit.moment / found["peak_moment"]) ** 0.2)
    return row if np.isinf(size) else grown(row, size)


def as_fast(row: Row, speed: float) -> Row:
    """A robot of the size with which it is as fast as that [m/s] at `reference`, with contact."""
    return grown(row, speed / at_reference(scene_of(row))["speed"])


def told(scene: Scene) -> Table:
    """What a robot is, and what it does and costs at `reference`, with contact."""
    robot, found = scene.robot, at_reference(scene)
    return {
        "n_limbs": robot.n_limbs, "radius_mm": [rounded(MM * radius) for radius in radii(scene)],
        "limb_length_mm": rounded(MM * robot.limb_length), "youngs_modulus_MPa": rounded(1e-6 * robot.youngs_modulus),
        "peak_angle_rad": rounded(float(scene.actuator.peak_angle)), "mm_per_s": rounded(MM * found["speed"]),
        "mJ_per_stroke": rounded(MM / MEASURED * found["work"]), "peak_mN_m": rounded(MM * found["peak_moment"]),
        "J_per_metre": rounded(found["work"] / MEASURED / found["speed"]),
        "smallest_opening_angle_rad": rounded(found["smallest_opening_angle"]),
    }  # fmt: skip


def radii(scene: Scene) -> tuple[float, float]:
    """Radius of root and tip [m]."""
    radius = scene.robot.limbs[0].radius if scene.robot.limbs else scene.robot.rod_radius
    root, tip = radius if isinstance(radius, tuple) else (radius, radius)
    return root, tip


def run(results: Results) -> None:
    """Search, and swim the best again."""
    chapter = replace(Scene.preset("fast"), contact=Contact())
    limits = {factor: Limit(factor * OWN.work) for factor in FACTORS}
    speed = at_reference(chapter)["speed"]
    table = search((*limits.values(), OWN), results.out, Processes())
    scenes = {
        CHAPTER: chapter,
        AT_WORK: scene_of(sized(fastest(table, OWN), OWN)),
        THRIFTIEST: scene_of(as_fast(thriftiest(table, speed), speed)),
        FASTEST: scene_of(fastest(table)),
    }
    results["simulated"] = SIMULATED
    results["robots"] = {name: told(scene) for name, scene in scenes.items()}
    results["front"] = [told(scene_of(thriftiest(table, speed))) for speed in SPEEDS.tolist()]
    results["by_work"] = [[factor, told(scene_of(fastest(table, limit)))] for factor, limit in limits.items()]


SHOWN = {THRIFTIEST: "least work at its speed"}
"""Names of robots in the table that differ from those in the file."""


def robots(results: Table) -> str:
    """Table in Markdown of the robots."""
    head = [
        "robot", "limbs", "radius [mm]", "length [mm]", "modulus [MPa]", "angle [rad]", "speed [mm/s]", "work [mJ]",
        "moment [mN m]",
    ]  # fmt: skip
    rows = []
    for name, row in results["robots"].items():
        root, tip = row["radius_mm"]
        rows.append([
            SHOWN.get(name, name), row["n_limbs"], f"{root:.3g} to {tip:.3g}", f"{row['limb_length_mm']:.3g}",
            f"{row['youngs_modulus_MPa']:.2g}", f"{row['peak_angle_rad']:.3f}", f"{row['mm_per_s']:.2f}",
            f"{row['mJ_per_stroke']:.3g}", f"{row['peak_mN_m']:.3g}",
        ])  # fmt: skip
    return markdown(head, rows)


def by_work(results: Table) -> str:
    """Table in Markdown of the fastest robots that do with some times the work of the chapter's."""
    rows = results["by_work"]
    head = ["work per stroke at most, of the chapter's", *(f"{factor:g}" for factor, _ in rows)]
    return markdown(head, [["fastest [mm/s]", *(f"{row['mm_per_s']:.2f}" for _, row in rows)]])


LABELS = {
    CHAPTER: ("the chapter's robot", (-6, 6), "right"), AT_WORK: ("fastest at its work\nand moment", (8, -20), "left"),
    THRIFTIEST: ("thriftiest\nat its speed", (8, -16), "left"), FASTEST: ("fastest", (-6, 6), "right"),
}  # fmt: skip
"""Texts in the picture, where they stand [points], and their side of the mark."""


def draw(results: Table, file: Path) -> None:
    """Picture: work per metre over speed."""
    figure, ax = subplots(1, 1, figsize=(6.4, 4.2))
    points = [*results["front"], results["robots"][FASTEST]]
    ax.loglog([row["mm_per_s"] for row in points], [row["J_per_metre"] for row in points], "o-", ms=3)
    for name, row in results["robots"].items():
        text, place, side = LABELS[name]
        ax.plot(row["mm_per_s"], row["J_per_metre"], "o" if name == CHAPTER else "s", color=INK)
        ax.annotate(text, (row["mm_per_s"], row["J_per_metre"]), place, textcoords="offset points", ha=side, fontsize=8)
    ax.set(xlabel="speed [mm/s]", ylabel="work per metre [J/m]", xlim=(2.5, 20.0), ylim=(1e-4, 0.5))
    ticks = (3, 5, 10, 20)
    ax.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    ax.set_xticks([], minor=True)
    save_figure(figure, file)


STUDY = Study(
    "designs.front", run, file="designs/front.json", out=Path("runs/front"), pictures={"front.png": draw},
    tables={"front robots": robots, "front by_work": by_work}, packages=("pandas", "pyarrow"),
)  # fmt: skip
