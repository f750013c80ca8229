"""Tables of the accuracy study, among them the one that comes with the package."""

import math
from pathlib import Path
from typing import Any, get_args

from seastar_gym.accuracy import Certificate, Setting, chapter
from seastar_gym.accuracy.certificate import CLASSES_VERSION
from seastar_gym.accuracy.measure import machine, rounded_up
from seastar_gym.accuracy.setting import physics
from seastar_gym.scene import Scene
from seastar_gym.scene.numerics import PRESETS
from seastar_gym.version import __version__
from studies.accuracy.cases import STROKES, gaits
from studies.accuracy.rows import UNSEEN, Column, Figures, Row, Study, fronts, path_front
from studies.accuracy.settings import Plan
from studies.frame import rounded, write_rows
from studies.pages import markdown

LARGEST_DOUBT = 3e-4
"""Largest path error of the limit itself, of each kind, with which results are stored."""


def summary(found: Study) -> list[tuple[str, Row]]:
    """Presets, by name, and the front of the path error, fastest first."""
    names = {setting: name for name, setting in PRESETS.items()}
    chosen = {row.resolution: row for row in path_front(found.rows)}
    chosen.update({row.resolution: row for row in found.rows if row.resolution in names})
    return [(names.get(row.resolution, ""), row) for row in sorted(chosen.values(), key=lambda row: -row.speed)]


COLUMNS = (
    "preset", "N", "scheme and step", "Newton tolerance", "space", "time", "path error", "any gait", "slow", "straight",
    "× real time",
)  # fmt: skip


def as_cells(name: str, row: Row) -> tuple[str, ...]:
    """Cells of one line of the summary; errors in per cent, speed as real-time factor."""
    space, time = row.sure_space.path, row.sure_time.path
    total = as_setting(row).errors.values()
    return (
        name, nodes_of(row), row.label, f"{row.resolution.numerics.newton_tolerance:.0e}",
        *(f"{rounded(100 * error, 2):g} %" if error else "-" for error in (space, time, *total)),
        f"{rounded(row.speed, 2):,.0f}",
    )  # fmt: skip


def nodes_of(row: Row) -> str:
    """Nodes per limb, and whose discretisation if not the continuum's."""
    discretisation, nodes = row.mesh
    return str(nodes) if discretisation == "continuum" else f"{nodes}, chapter's"


def facts(found: Study) -> list[str]:
    """Sentences about the limit that go below the table."""
    distances = ", ".join(f"{name} {1e3 * distance:.3f}" for name, distance in found.distances.items())
    doubts = ", ".join(f"{name}: {100 * each.path:.2g} %" for name, each in found.doubt.items())
    return [
        f"Limit: {1e3 * found.first_stroke:.4f} mm after one stroke straight on, and after ten {distances} mm.",
        f"Error of the limit itself, worst path: {doubts}.",
    ]


def as_markdown(found: Study) -> str:
    """Summary in Markdown."""
    table = markdown(COLUMNS, [as_cells(preset, row) for preset, row in summary(found)], (0, 2))
    return "\n".join([table, "", *facts(found), f"Speeds: one core of {machine()}."]) + "\n"


COSTS = ("iterations", "steps", "rejections", "halvings", "speed", "straight_speed")


def write_csv(found: Study, path: Path) -> None:
    """Write all columns of all settings; errors are fractions of the path's length unless the name has a unit.

    Columns of the error of space begin with `space_`, of the error of time with `time_`, and of the promised sum with
    `promise_`.
    """
    names = [name.replace("heading", "heading_deg") for name in Figures._fields]
    columns = get_args(Column)
    head = [
        "discretisation", "nodes_per_limb", "scheme", "step_s", "newton_tolerance", "path_tolerance", "damping",
        *(f"space_{name}" for name in names), *(f"time_{name}" for name in names),
        *(f"promise_{name.replace('heading', 'heading_deg')}" for name in columns), *COSTS,
    ]  # fmt: skip
    rows = []
    for row in found.rows:
        n = row.resolution.numerics
        adapted = "" if n.path_tolerance is None else n.path_tolerance
        key = [n.scheme, n.step, n.newton_tolerance, adapted, n.damping]
        sums = [row.promise(column) for column in columns]
        costs = [getattr(row, name) for name in COSTS]
        numbers = (*row.space, *row.time, *sums, *costs)
        rows.append([*row.mesh, *key, *(rounded(each, 5) if isinstance(each, float) else each for each in numbers)])
    write_rows(path, head, rows)


def as_setting(row: Row) -> Setting:
    """Setting of a row: errors rounded upwards to two digits, speed rounded to two digits."""
    discretisation, nodes_per_limb, numerics = row.resolution
    space, time = rounded_up(row.sure_space.path), rounded_up(row.sure_time.path)
    return Setting(
        nodes_per_limb, numerics.scheme, numerics.step, numerics.newton_tolerance,
        errors={
            "random": float(f"{space + time:.6g}"), "repeated": rounded_up(row.promise("gait")),
            "small": rounded_up(row.promise("slow")), "straight": rounded_up(row.promise("straight")),
        },
        typical=as_typical(row), space_error=space, time_error=time, speed=rounded(row.speed, 2),
        heading_error=rounded_up(row.promise("heading")), end_error=rounded_up(row.promise("end")),
        path_tolerance=numerics.path_tolerance, discretisation=discretisation, damping=numerics.damping,
    )  # fmt: skip


def as_typical(row: Row) -> dict[str, float]:
    """Median errors by class, rounded upwards to two digits; that of the straight swim, which is one, is its error.

    {} where some class was not measured.
    """
    found = row.typical
    kinds = {"random": found.random, "repeated": found.gait, "small": found.slow, "straight": row.promise("straight")}
    return {} if any(map(math.isnan, kinds.values())) else {name: rounded_up(error) for name, error in kinds.items()}


def measured_over(plan: Plan) -> dict[str, Any]:
    """Command sequences behind the package's table: how many of each kind, and with which confidence they bound."""
    n = plan.n_random
    sure = f"{1.0 - 0.95**n:.2f}"
    return {
        "command": "python -m studies.accuracy --store",
        "strokes": STROKES,
        "path_error": {"straight": 1, "pairs of Fig. 13.8": 4, "pentagon": 1, "random, ternary and continuous": n},
        "gait_error": {
            "repeated ternary, all that differ": len(gaits()), "repeated continuous": plan.n_gaits,
            "alternating, ternary and continuous": plan.n_gaits, "factor for those not measured": UNSEEN,
        },
        "slow_error": {"random, a tenth": plan.n_slow, "repeated continuous, a tenth": plan.n_gaits,
                       "factor for those not measured": UNSEEN},
        "confidence": f"With {sure} confidence, at most 5 % of random sequences exceed the largest of {n}.",
        "held_out": "Exceedances of sequences that no table used: python -m studies.accuracy.promises.",
    }  # fmt: skip


def store(found: Study, path: Path = chapter.STROKES) -> None:
    """Write the package's certificate, presets first; ValueError if the limit is in doubt."""
    for name, doubt in found.doubt.items():
        if not doubt.path <= LARGEST_DOUBT:
            raise ValueError(
                f"The limit is in doubt by {doubt.path:.1e} of the path ({name}), and {LARGEST_DOUBT:.0e} is allowed: "
                "nothing is stored."
            )
    by_resolution = {row.resolution: row for row in found.rows}
    first = {each: by_resolution[each] for each in PRESETS.values()}
    rows = first | {row.resolution: row for row in fronts(found.rows)}
    settings = {resolution: as_setting(row) for resolution, row in rows.items()}
    Certificate(
        physics(Scene()), tuple(settings.values()), ("random",), ("random", "repeated"), Plan().n_random,
        limit_error=rounded_up(settings[PRESETS["reference"]].space_error / 3.0), classes=CLASSES_VERSION,
        version=__version__, machine=machine(), measured_over=measured_over(Plan()),
    ).save(path)  # fmt: skip
