"""Effect of the damping of a soft silicone on ringing, distances and errors.

The chapter's rods are undamped and ring until the drag has taken up the energy. Ringing limbs feel more drag, so a swim
is accurate only with time steps that resolve the ringing. This study gives the rods the Kelvin-Voigt damping of a soft
silicone. It measures the ringing, the distances that the pairs of Fig. 13.8 swim, and the time step and speed at an
error of 1 %. Errors are those of the accuracy study, each material against its own converged paths.

Prints a table, and writes `damping.json`, `damping.csv` and one picture.
"""

from __future__ import annotations

import csv
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from tqdm import tqdm

from seastar_gym.accuracy.measure import Swims, errors, path_lengths, swim
from seastar_gym.accuracy.setting import at
from seastar_gym.command import run_command
from seastar_gym.gaits import PAIRS
from seastar_gym.scene import Numerics, Scene, Seastar
from seastar_gym.scene.numerics import Resolution, SchemeName
from seastar_gym.simulator import Simulator
from studies.accuracy.cases import Cases, joined, random_sequences, swims
from studies.kept import keep, rounded
from studies.parser import study_parser
from studies.provenance import provenance
from studies.speed.terms import SILICONE

Floats = NDArray[np.float64]

MATERIALS: dict[str, float | None] = {"undamped": None, "silicone": SILICONE}
STEPS: dict[SchemeName, tuple[float, ...]] = {
    "implicit-euler": (20, 10, 5, 3, 2, 1, 0.5),
    "sdirk2": (20, 10, 5, 2, 1, 0.5),
    "sdirk3": (20, 10, 5, 2, 1, 0.5),
    "implicit-midpoint": (20, 10, 5, 2, 1, 0.5, 0.25),
}
"""Time steps of every scheme [ms]."""
TOLERANCE = 1e-7
"""Newton tolerance of the settings."""
SAMPLES = 500
"""Points of a curve of ringing, about."""
PAIRS_STROKES, PAIRS_STEP = 10, 0.25e-3
"""Strokes of the pairs of Fig. 13.8, and their time step [s]."""
WANTED = 0.01
"""Path error that a setting has to keep, as a fraction of the path's length."""


@dataclass(frozen=True)
class Plan:
    """Size of the study.

    n_random: Number of random sequences.
    converged: Schemes and time steps [s] whose solutions have to agree.
    shortest: Shortest time step of a setting [ms].
    nodes: Nodes per limb of the pairs of Fig. 13.8. With 73 distances are those of infinitely many to 0.02 %.
    """

    n_random: int = 16
    converged: tuple[tuple[SchemeName, float], ...] = (("sdirk3", 2e-5), ("implicit-midpoint", 2e-5))
    shortest: float = 0.0
    nodes: int = 73


QUICK = Plan(n_random=3, converged=(("sdirk3", 2e-4), ("implicit-midpoint", 2e-4)), shortest=2.0, nodes=19)


@dataclass(frozen=True)
class Row:
    """A material with a scheme and a time step [s]: its largest path error, and its real-time factor on one core."""

    material: str
    scheme: SchemeName
    step: float
    path_error: float
    speed: float


@dataclass(frozen=True)
class Study:
    """Results of the study.

    rows: One row per material and setting.
    agreement: Largest path difference of the converged solutions, by material.
    pairs: Distances that the pairs of Fig. 13.8 swim in ten strokes, with many nodes, by material [m].
    ringing: Times in a stroke [s] and lengthening speeds of limbs [m/s], shape (2, n), by material.
    """

    rows: list[Row]
    agreement: dict[str, float]
    pairs: dict[str, Floats]
    ringing: dict[str, Floats]


def scene(numerics: Numerics, tau: float | None) -> Scene:
    """The chapter's robot with a relaxation time tau [s]."""
    return at(Scene(Seastar(relaxation_time=tau)), Resolution("continuum", 10, numerics))


def timed(cases: Cases, numerics: Numerics, tau: float | None) -> tuple[Swims, float]:
    """Swim with a relaxation time tau [s], and its real-time factor."""
    swim(scene(numerics, tau), cases.first(1).commands)  # compiles the kernels for this scene outside the timing
    start = time.thread_time()
    swum = swim(scene(numerics, tau), cases.commands)
    return swum, len(cases) * len(cases.commands) / (time.thread_time() - start)


def study(plan: Plan, progress: bool = True) -> Study:
    """Run the whole study; drawing is left to the caller."""
    cases = joined(swims(), random_sequences(plan.n_random, np.random.default_rng(0)))
    settings = [(scheme, h) for scheme, steps in STEPS.items() for h in steps if h >= plan.shortest]
    rows: list[Row] = []
    agreement: dict[str, float] = {}
    pairs: dict[str, Floats] = {}
    ringing = {material: ring(tau) for material, tau in MATERIALS.items()}
    with tqdm(total=len(MATERIALS) * (len(settings) + len(plan.converged)), disable=not progress, unit="swim") as bar:
        for material, tau in MATERIALS.items():
            found = []
            for scheme, step in plan.converged:
                found.append(swim(scene(Numerics(scheme, step, 1e-11), tau), cases.commands))
                bar.update()
            # The midpoint rule is the more accurate reference for undamped rods.
            exact = found[-1]
            lengths = path_lengths(Scene(), exact.hub)
            agreement[material] = float(errors(found[0], exact, lengths).path.max())
            pairs[material] = pair_distances(tau, plan.nodes)
            for scheme, h in settings:
                swum, speed = timed(cases, Numerics(scheme, 1e-3 * h, TOLERANCE), tau)
                rows.append(Row(material, scheme, 1e-3 * h, float(errors(swum, exact, lengths).path.max()), speed))
                bar.update()
    return Study(rows, agreement, pairs, ringing)


def pair_distances(tau: float | None, nodes: int) -> Floats:
    """Distances that the pairs swim in ten strokes with a relaxation time tau [s], in [m], shape (n_pairs,)."""
    robot = Seastar(nodes_per_limb=nodes, relaxation_time=tau)
    simulator = Simulator(Scene(robot, numerics=Numerics("implicit-midpoint", PAIRS_STEP)), len(PAIRS))
    for _ in range(PAIRS_STROKES):
        simulator.stroke(list(PAIRS.values()))
    return np.linalg.norm(simulator.hub_position(), axis=-1)


def ring(tau: float | None) -> Floats:
    """Times in a stroke [s] and smoothed lengthening speeds of limbs [m/s], shape (2, n)."""
    from studies.accuracy.ringing import record, smoothed

    t, _, stretching = record(Numerics("implicit-midpoint", 1e-4, 1e-10), tau)
    return np.array([t, smoothed(stretching, t)])[:, :: max(1, len(t) // SAMPLES)]


def as_data(found: Study, command: str) -> dict[str, Any]:
    """Results as plain data, with where they come from."""
    return {
        **provenance(command),
        "rows": [asdict(row) for row in found.rows],
        "agreement": found.agreement,
        "pairs_m": {material: distances.tolist() for material, distances in found.pairs.items()},
        "ringing": {
            material: [[rounded(number) for number in numbers] for numbers in curve]
            for material, curve in found.ringing.items()
        },
    }


def from_data(results: Mapping[str, Any]) -> Study:
    """Results from plain data."""
    pairs, ringing = ({name: np.array(numbers) for name, numbers in results[k].items()} for k in ("pairs_m", "ringing"))
    return Study([Row(**row) for row in results["rows"]], results["agreement"], pairs, ringing)


def rows_of(rows: Sequence[Row], material: str, scheme: SchemeName) -> list[Row]:
    """Rows of one material and scheme, the longest time step first."""
    mine = [row for row in rows if (row.material, row.scheme) == (material, scheme)]
    return sorted(mine, key=lambda row: -row.step)


def good_enough(rows: Sequence[Row]) -> Row | None:
    """Row with the longest step that keeps the wanted error and whose shorter steps all keep it; None if there is none.

    rows: Rows of one material and scheme, the longest step first.
    """
    kept = [all(shorter.path_error <= WANTED for shorter in rows[k:]) for k in range(len(rows))]
    return rows[kept.index(True)] if any(kept) else None


def as_table(found: Study) -> Table:
    """Table of the time steps and speeds that keep the wanted error."""
    table = Table(title=f"The longest step whose path error is below {100 * WANTED:g} %, and its speed on one core")
    table.add_column("scheme")
    for material in MATERIALS:
        table.add_column(f"{material}: step [ms]", justify="right")
        table.add_column("x real time", justify="right")
    for scheme in STEPS:
        cells = []
        for material in MATERIALS:
            row = good_enough(rows_of(found.rows, material, scheme))
            cells += ["none tried", "-"] if row is None else [f"{1e3 * row.step:g}", f"{row.speed:,.0f}"]
        table.add_row(scheme, *cells)
    return table


NAMES = {
    "implicit-euler": "implicit Euler",
    "sdirk2": "SDIRK2",
    "sdirk3": "SDIRK3",
    "implicit-midpoint": "implicit midpoint",
}
"""Schemes as the page calls them."""


def as_markdown(found: Study) -> str:
    """Table of the page: the longest steps that keep the wanted error, and their speeds on one core."""
    lines = [
        "| scheme | " + " | ".join(f"{material}: longest step | x real time" for material in MATERIALS) + " |",
        "|---|" + "---:|---:|" * len(MATERIALS),
    ]
    for scheme, steps in STEPS.items():
        cells = []
        for material in MATERIALS:
            row = good_enough(rows_of(found.rows, material, scheme))
            cells += [f"below {min(steps):g} ms", ""] if row is None else [
                f"{1e3 * row.step:g} ms", f"{rounded(row.speed, 2):,.0f}"
            ]  # fmt: skip
        lines.append(f"| {NAMES[scheme]} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def facts(found: Study) -> list[str]:
    """Sentences about agreement and distances that go below the table."""
    lines = [
        f"{material}: the converged solutions agree to {error:.0e} of the path."
        for material, error in found.agreement.items()
    ]
    change = found.pairs["silicone"] / found.pairs["undamped"] - 1.0
    pairs = ", ".join(f"{name} {100 * part:+.2g} %" for name, part in zip(PAIRS, change, strict=True))
    return [*lines, f"Damping changes the distances that the pairs of Fig. 13.8 swim by {pairs}."]


def draw(found: Study, file: Path) -> None:
    """Draw the ringing, the distances of the pairs, and errors over the time step."""
    from studies.style import COLOURS, DPI, FAINT, INK, as_numbers, as_percent, subplots

    figure, (rings, pairs, front) = subplots(1, 3, figsize=(13.5, 4.6))
    styles: dict[str, dict[str, Any]] = {"undamped": {"color": INK}, "silicone": {"color": "#3366aa"}}
    for material in MATERIALS:
        t, stretching = found.ringing[material]
        rings.semilogy(t, 1e3 * stretching, lw=1.3, label=material, **styles[material])
        offset = 0.38 * list(MATERIALS).index(material) - 0.19
        pairs.bar(np.arange(len(PAIRS)) + offset, 1e3 * found.pairs[material], 0.36, **styles[material])
    rings.set(xlabel="time in the stroke [s]", ylabel="lengthening speed of limbs, r.m.s. [mm/s]")
    rings.set_title("1. How limbs ring lengthwise, pair {1-,2+}", fontsize=10.5, loc="left")
    rings.legend(frameon=False, fontsize=8.5)
    pairs.set_xticks(np.arange(len(PAIRS)), list(PAIRS))
    pairs.set_ylabel("distance after ten strokes, converged [mm]")
    pairs.set_title("2. How far the pairs of Fig. 13.8 swim", fontsize=10.5, loc="left")
    for scheme in STEPS:
        for material, line in (("undamped", ":"), ("silicone", "-")):
            mine = rows_of(found.rows, material, scheme)
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


def main() -> None:
    """Command line: run the study, write its files and print its table."""
    parser = study_parser("studies.scenes.damping", __doc__)
    parser.add_argument("--quick", action="store_true", help="run fewer swims with longer steps")
    parser.add_argument(
        "--out", type=Path, default=Path("runs/damping"), help="folder for CSV and picture (default: %(default)s)"
    )
    options = parser.parse_args()
    found = study(QUICK if options.quick else Plan())
    options.out.mkdir(parents=True, exist_ok=True)
    with (options.out / "damping.csv").open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, list(Row.__dataclass_fields__))
        writer.writeheader()
        writer.writerows(map(asdict, found.rows))
    command = "python -m studies.scenes.damping" + " --quick" * options.quick
    keep(as_data(found, command), options.out / "damping.json")
    draw(found, options.out / "damping.png")
    console = Console()
    console.print(as_table(found))
    for fact in facts(found):
        console.print(fact)
    console.print(f"Written: {', '.join(str(options.out / f'damping.{kind}') for kind in ('json', 'csv', 'png'))}")


if __name__ == "__main__":
    run_command(main)
