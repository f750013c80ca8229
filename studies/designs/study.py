"""Simulates 102,480 robots, swims the fastest again at finer settings, and writes designs.json and designs.png.

Limb length, radius, stiffness, taper, number of limbs and peak angle vary; all swim {2+, n-}, eight strokes from rest,
of which the last five count, at `fast`, and are ranked by speed; front.py ranks by work. The scene of the fastest is
written to fastest.json, for `certify`. Results are kept in folders of OUT, so that the command goes on after an
interrupt.
"""

import json
from pathlib import Path
from typing import Any

from tqdm import tqdm

from seastar_gym.executors import Executor
from seastar_gym.executors.processes import Processes
from seastar_gym.scene import Scene, Seastar, SmaPulse
from seastar_gym.sweep.designs import Sweep
from seastar_gym.sweep.result_files import read_results
from seastar_gym.sweep.run import Progress
from studies.designs import space
from studies.designs.pictures import draw, robots, summary
from studies.designs.search import counting
from studies.designs.space import (
    BODIES,
    MEASURED,
    SPREADS,
    Body,
    all_designs,
    at_the_chapters,
    inner_half,
    masses,
    run_all,
    swum,
)
from studies.frame import Results, Study
from studies.style import MM

Table = dict[str, Any]
CHECKS = ("fast", "balanced", "reference")
"""Fidelities at which the winners swim."""
MEASURES = {"mm_per_s": ("speed", MM), "mJ_per_stroke": ("work", 1e3 / MEASURED), "peak_mN_m": ("peak_moment", 1e3)}
"""What is told of a robot: a column of results, and its factor."""


def results(sweep: Sweep, folder: Path, executor: Executor) -> Any:
    """Results of a sweep as a pandas.DataFrame; what is missing in the folder is simulated."""
    with tqdm(total=sweep.n_batches, unit="batch") as bar:

        def progress(tally: Progress) -> None:
            bar.update(tally.done + tally.kept - bar.n)

        run_all(sweep.batches(), folder, executor, progress)
    table = read_results(folder).to_pandas()
    if "robot" in table and table.robot.isin(BODIES).all():
        for name in Body._fields:
            table[name] = [getattr(BODIES[label], name) for label in table.robot]
    return table


def scene_of(row: Any) -> Scene:
    """Scene of a design."""
    chapter = {
        "robot.limb_length": Seastar().limb_length, "robot.youngs_modulus": Seastar().youngs_modulus,
        "actuator.peak_angle": SmaPulse().peak_angle,
    }  # fmt: skip
    length, modulus, angle = (float(row.get(name, number)) for name, number in chapter.items())
    return space.scene_of(BODIES[row["robot"]], length, modulus, angle)


def at_all_fidelities(scene: Scene) -> Table:
    """MEASURES of a robot at CHECKS, and its work per metre at the last [J/m]."""
    rows = [swum(scene, fidelity=fidelity) for fidelity in CHECKS]
    found: Table = {
        measure: {fidelity: round(factor * row[name], 5) for fidelity, row in zip(CHECKS, rows, strict=True)}
        for measure, (name, factor) in MEASURES.items()
    }
    return {**found, "J_per_metre": round(found["mJ_per_stroke"][CHECKS[-1]] / found["mm_per_s"][CHECKS[-1]], 4)}


def winner(row: Any) -> Table:
    """A design in numbers, its speeds and its work."""
    scene = scene_of(row)
    body, found = BODIES[row["robot"]], at_all_fidelities(scene)
    length, speed = scene.robot.limb_length, found["mm_per_s"][CHECKS[-1]]
    return {
        "n_limbs": body.n_limbs, "mean_radius_mm": MM * body.radius, "taper": body.taper,
        "root_radius_mm": round(MM * body.profile[0], 2), "limb_length_mm": round(MM * length, 1),
        "youngs_modulus_MPa": round(1e-6 * scene.robot.youngs_modulus, 3),
        "peak_angle_rad": round(float(scene.actuator.peak_angle), 3),
        "smallest_opening_angle_rad": round(float(row["smallest_opening_angle"]), 2),
        **found, "limb_lengths_per_stroke": round(speed / MM / length, 3), "strokes_per_metre": round(MM / speed, 1),
    }  # fmt: skip


def quantiles(table: Any, name: str) -> Table:
    """Median, 99th percentile and largest speed [mm/s] for the values of a column."""
    groups = table.groupby(name).speed
    return {
        str(value): [round(MM * float(number), 2) for number in (each.median(), each.quantile(0.99), each.max())]
        for value, each in groups
    }


def study(folder: Path, executor: Executor) -> tuple[Table, Any]:
    """Run the study; returns its results as plain data, and the table of all designs."""
    designs = results(all_designs(), folder / "designs", executor)
    sound = designs[designs.status == 0]
    table = counting(sound)
    same = results(at_the_chapters(), folder / "chapter", executor)
    same = counting(same)
    mass = results(masses(), folder / "masses", executor)
    relative = table.speed / table["robot.limb_length"]
    uniform = same[same.taper == 1.0]
    return {
        "designs": len(designs), "failed": len(designs) - len(sound), "count": len(table),
        "the chapter's": at_all_fidelities(Scene.preset("fast")),
        "fastest": winner(table.loc[table.speed.idxmax()]),
        "fastest in its lengths": winner(table.loc[relative.idxmax()]),
        "fastest at the chapter's length and angle": winner(same.loc[same.speed.idxmax()]),
        "fastest of them without taper": winner(uniform.loc[uniform.speed.idxmax()]),
        "speeds_mm_per_s": {name: quantiles(table, name) for name in ("n_limbs", "radius", "taper")},
        "masses": masses_by_taper(mass),
    }, table  # fmt: skip


def masses_by_taper(mass: Any) -> Table:
    """Speed [mm/s] over density [kg/m^3], by the share of mass in the half at the hub."""
    return {
        f"{inner_half(taper):.2f}": [
            [round(float(density), 1), round(MM * float(speed), 3)]
            for density, speed in sorted(zip(each["robot.density"], each.speed, strict=True))
        ]
        for taper in SPREADS
        for each in [mass[mass.robot == str(taper)]]
    }


def swim_all(results: Results) -> None:
    """Swim what is missing, and write the scene of the fastest."""
    found, table = study(results.out, Processes())
    results.update(found, picture=summary(table))
    fastest = scene_of(table.loc[table.speed.idxmax()])
    (results.out / "fastest.json").write_text(json.dumps(fastest.to_dict()) + "\n", encoding="utf-8")
    print(json.dumps(found, indent=1))


STUDY = Study(
    "designs",
    swim_all,
    file="designs/designs.json",
    out=Path("runs/designs"),
    pictures={"designs.png": draw},
    tables={"designs robots": robots},
    packages=("pandas", "pyarrow"),
)
