"""What the damping of a soft silicone changes: `python -m studies.scenes.damping`.

The chapter's rods are not damped: they ring until the water has taken it, and ringing limbs feel more drag, so only
steps that follow the ringing swim right, see `accuracy`. This study gives the rods the Kelvin-Voigt damping of a
typical silicone, and looks at the ringing, at how far the pairs of Fig. 13.8 swim, and at the time step and speed that
1 % of error then needs. Errors are of the hub's path as in `accuracy`, each material against its own converged paths.

Prints a table, and writes `damping.csv` and one picture.
"""

from __future__ import annotations

import argparse
import csv
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from tqdm import tqdm

from seastar_gym.command import run_command
from seastar_gym.gaits import PAIRS
from seastar_gym.scene import Numerics
from seastar_gym.scene.numerics import SchemeName
from studies.accuracy.cases import Cases, Swim, errors, joined, random_sequences, swim, swims
from studies.speed.terms import SILICONE

Floats = NDArray[np.float64]

MATERIALS: dict[str, float | None] = {"undamped": None, "silicone": SILICONE}
STEPS: dict[SchemeName, tuple[float, ...]] = {
    "implicit-euler": (20, 10, 5, 3, 2, 1, 0.5),
    "sdirk2": (20, 10, 5, 2, 1, 0.5),
    "sdirk3": (20, 10, 5, 2, 1, 0.5),
    "implicit-midpoint": (20, 10, 5, 2, 1, 0.5, 0.25),
}
"""h [ms]."""
TOLERANCE = 1e-7
"""Newton tolerance of the settings."""
WANTED = 0.01
"""Path error."""


@dataclass(frozen=True)
class Plan:
    """How much is computed. converged: Schemes and steps [s] that have to agree. shortest: Step of a setting [ms]."""

    n_random: int = 16
    converged: tuple[tuple[SchemeName, float], ...] = (("sdirk3", 2e-5), ("implicit-midpoint", 2e-5))
    shortest: float = 0.0


QUICK = Plan(n_random=3, converged=(("sdirk3", 2e-4), ("implicit-midpoint", 2e-4)), shortest=2.0)


@dataclass(frozen=True)
class Row:
    """A material at a setting: largest path error, and simulated over computing seconds on one core."""

    material: str
    scheme: SchemeName
    step: float
    path_error: float
    speed: float


@dataclass(frozen=True)
class Study:
    """rows: All settings. agreement: Path difference of the converged solutions, by material.

    pairs: Distance that the pairs of Fig. 13.8 swim in ten strokes, converged, by material [m].
    """

    rows: list[Row]
    agreement: dict[str, float]
    pairs: dict[str, Floats]


def timed(cases: Cases, numerics: Numerics, tau: float | None) -> tuple[Swim, float]:
    """A swim, and simulated over computing seconds."""
    swim(cases.first(1), numerics, relaxation_time=tau)  # compiles, if it has to
    start = time.thread_time()
    swum = swim(cases, numerics, relaxation_time=tau)
    return swum, len(cases) * len(cases.commands) / (time.thread_time() - start)


def study(plan: Plan, progress: bool = True) -> Study:
    """Everything but the picture."""
    cases = joined(swims(), random_sequences(plan.n_random, np.random.default_rng(0)))
    settings = [(scheme, h) for scheme, steps in STEPS.items() for h in steps if h >= plan.shortest]
    rows: list[Row] = []
    agreement: dict[str, float] = {}
    pairs: dict[str, Floats] = {}
    with tqdm(total=len(MATERIALS) * (len(settings) + len(plan.converged)), disable=not progress, unit="swim") as bar:
        for material, tau in MATERIALS.items():
            found = []
            for scheme, step in plan.converged:
                found.append(swim(cases, Numerics(scheme, step, 1e-11), threads=None, relaxation_time=tau))
                bar.update()
            # The midpoint rule is the better one where nothing is damped.
            exact = found[-1]
            agreement[material] = float(errors(found[0], exact).path.max())
            pairs[material] = np.linalg.norm(exact.hub[-1, 1 : 1 + len(PAIRS)], axis=-1)
            for scheme, h in settings:
                swum, speed = timed(cases, Numerics(scheme, 1e-3 * h, TOLERANCE), tau)
                rows.append(Row(material, scheme, 1e-3 * h, float(errors(swum, exact).path.max()), speed))
                bar.update()
    return Study(rows, agreement, pairs)


def of(rows: Sequence[Row], material: str, scheme: SchemeName) -> list[Row]:
    """Rows of a material and a scheme, the longest step first."""
    mine = [row for row in rows if (row.material, row.scheme) == (material, scheme)]
    return sorted(mine, key=lambda row: -row.step)


def good_enough(rows: Sequence[Row]) -> Row | None:
    """The longest step from which on all shorter ones keep the wanted error, too; rows longest first."""
    kept = [all(shorter.path_error <= WANTED for shorter in rows[k:]) for k in range(len(rows))]
    return rows[kept.index(True)] if any(kept) else None


def as_table(found: Study) -> Table:
    """What 1 % of error needs."""
    table = Table(title=f"The longest step whose path error is below {100 * WANTED:g} %, and its speed on one core")
    table.add_column("scheme")
    for material in MATERIALS:
        table.add_column(f"{material}: step [ms]", justify="right")
        table.add_column("x real time", justify="right")
    for scheme in STEPS:
        cells = []
        for material in MATERIALS:
            row = good_enough(of(found.rows, material, scheme))
            cells += ["none tried", "-"] if row is None else [f"{1e3 * row.step:g}", f"{row.speed:,.0f}"]
        table.add_row(scheme, *cells)
    return table


def facts(found: Study) -> list[str]:
    """What the table does not say."""
    lines = [
        f"{material}: the converged solutions agree to {error:.0e} of the path."
        for material, error in found.agreement.items()
    ]
    change = found.pairs["silicone"] / found.pairs["undamped"] - 1.0
    pairs = ", ".join(f"{name} {100 * part:+.2g} %" for name, part in zip(PAIRS, change, strict=True))
    return [*lines, f"Damped, the pairs of Fig. 13.8 swim farther or less far by {pairs}."]


def draw(found: Study, file: Path) -> None:
    """Ringing, pairs, and errors over the step."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    from studies.accuracy.pictures import (
        COLOURS,
        DPI,
        FAINT,
        INK,
        as_numbers,
        as_percent,
        record,
        smoothed,
        subplots,
    )

    figure, (ring, pairs, front) = subplots(1, 3, figsize=(13.5, 4.6))
    styles: dict[str, dict[str, Any]] = {"undamped": {"color": INK}, "silicone": {"color": "#3366aa"}}
    for material, tau in MATERIALS.items():
        t, _, stretching = record(Numerics("implicit-midpoint", 1e-4, 1e-10), tau)
        ring.semilogy(t, 1e3 * smoothed(stretching, t), lw=1.3, label=material, **styles[material])
        offset = 0.38 * list(MATERIALS).index(material) - 0.19
        pairs.bar(np.arange(len(PAIRS)) + offset, 1e3 * found.pairs[material], 0.36, **styles[material])
    ring.set(xlabel="time in the stroke [s]", ylabel="lengthening speed of limbs, r.m.s. [mm/s]")
    ring.set_title("1. How limbs ring lengthwise, pair {1-,2+}", fontsize=10.5, loc="left")
    ring.legend(frameon=False, fontsize=8.5)
    pairs.set_xticks(np.arange(len(PAIRS)), list(PAIRS))
    pairs.set_ylabel("distance after ten strokes, converged [mm]")
    pairs.set_title("2. How far the pairs of Fig. 13.8 swim", fontsize=10.5, loc="left")
    for scheme in STEPS:
        for material, line in (("undamped", ":"), ("silicone", "-")):
            mine = of(found.rows, material, scheme)
            front.loglog(
                [1e3 * row.step for row in mine], [100.0 * row.path_error for row in mine], f"o{line}", ms=3.5, lw=1.3,
                color=COLOURS[scheme], label=scheme if material == "silicone" else None,
            )  # fmt: skip
    front.axhline(100.0 * WANTED, color=FAINT, lw=0.9, ls="--")
    front.set(xlabel="time step h [ms]", ylabel="largest path error")
    front.set_title("3. Errors: silicone solid, undamped dotted", fontsize=10.5, loc="left")
    as_percent(front.yaxis)
    as_numbers(front.xaxis)
    front.legend(frameon=False, fontsize=8.5)
    figure.savefig(file, dpi=DPI)
    plt.close(figure)


def main() -> None:
    """Compute, print, write."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="fewer swims and longer steps, in a fraction of the time")
    parser.add_argument("--out", type=Path, default=Path("runs/damping"), help="folder for CSV and picture")
    options = parser.parse_args()
    found = study(QUICK if options.quick else Plan())
    options.out.mkdir(parents=True, exist_ok=True)
    with (options.out / "damping.csv").open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, list(Row.__dataclass_fields__))
        writer.writeheader()
        writer.writerows(map(asdict, found.rows))
    draw(found, options.out / "damping.png")
    console = Console()
    console.print(as_table(found))
    for fact in facts(found):
        console.print(fact)
    console.print(f"Written: {options.out / 'damping.csv'}, {options.out / 'damping.png'}")


if __name__ == "__main__":
    run_command(main)
