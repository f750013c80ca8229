"""Error and speed of every scheme, time step and tolerance.

Computes the converged solution with two schemes of different kind, then the error of every setting against it and its
computing time. Writes `accuracy.csv`, the summary `accuracy.md` and three pictures. `--store` also writes the table of
`seastar_gym.scene.fidelity`, from which `Numerics.for_error` and the presets take their errors and speeds.

The error is the hub's distance from its converged path at the ends of strokes, as a fraction of that path's length.
Times are processor times of one thread, the best of several rounds, for a batch of random commands.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from tqdm import tqdm

from seastar_gym.scene import fidelity
from studies.accuracy.cases import gaits, joined, pentagon, random_sequences, swims
from studies.accuracy.convergence import converge, in_groups, measure_errors, measure_space
from studies.accuracy.rows import Study, promised
from studies.accuracy.settings import FINE_NODES, QUICK, Plan, settings, settings_for_other_nodes
from studies.accuracy.speeds import measure_speeds
from studies.accuracy.tables import TABLE_WIDTH, as_markdown, as_table, facts, store, write_csv
from studies.parser import study_parser


def study(plan: Plan, progress: bool = True) -> Study:
    """Run the whole study; drawing is left to the caller."""
    cases = joined(swims(), random_sequences(plan.n_random, np.random.default_rng(0)), gaits())
    batches = [cases, pentagon(*plan.side)]
    mine, others = settings(plan), settings_for_other_nodes() if plan.nodes else []

    def bar(what: str, total: int) -> Any:
        return tqdm(total=total, desc=what, disable=not progress, unit="swim")

    with bar("converging", len(plan.converged) * sum(len(in_groups(batch)) for batch in batches)) as each:
        converged, agreement = converge(batches, plan, each)
    with bar("nodes", len({*plan.coarse_nodes, *plan.nodes, *FINE_NODES[: plan.n_fine]})) as each:
        few = cases.first(plan.n_spatial)
        fine, space, limit = measure_space(few, plan, each)
    with bar("errors", len(batches) * len(mine) + len(plan.nodes) * len(others)) as each:
        rows = promised(measure_errors(batches, converged, mine, 10, each))
        for nodes in plan.nodes:
            rows += measure_errors([few], [fine[nodes]], others, nodes, each)
    with bar("speeds", plan.rounds * len(rows)) as each:
        speeds = measure_speeds([(row.numerics, row.nodes_per_limb) for row in rows], plan.rounds, each)
    errors_of = {each.nodes_per_limb: each for each in space}
    rows = [
        replace(
            row,
            speed=float(speed),
            straight_speed=float(straight_speed),
            spatial=errors_of[row.nodes_per_limb].path,
            spatial_straight=errors_of[row.nodes_per_limb].straight,
        )
        for row, (speed, straight_speed) in zip(rows, speeds, strict=True)
    ]
    return Study(rows, agreement, space, converged[0].hub[:, 0, 0], limit)


def main() -> None:
    """Command line: run the study, write its files and print its table."""
    parser = study_parser("studies.accuracy", __doc__)
    parser.add_argument("--quick", action="store_true", help="run fewer settings and swims, in under a minute")
    parser.add_argument(
        "--out", type=Path, default=Path("runs/accuracy"), help="folder for tables and pictures (default: %(default)s)"
    )
    parser.add_argument(
        "--store", action="store_true", help="also write the table of errors and speeds that comes with the package"
    )
    options = parser.parse_args()
    if options.quick and options.store:
        parser.error("--store needs the whole study, not --quick.")
    from studies.accuracy import pictures as accuracy_pictures

    found = study(QUICK if options.quick else Plan())
    options.out.mkdir(parents=True, exist_ok=True)
    write_csv(found.rows, options.out / "accuracy.csv")
    (options.out / "accuracy.md").write_text(as_markdown(found), encoding="utf-8")
    pictures = accuracy_pictures.draw_all(found, options.out)
    console = Console()
    console.width = max(console.width, TABLE_WIDTH)
    console.print(as_table(found))
    for fact in facts(found):
        console.print(fact)
    if options.store:
        store(found)
        console.print(f"Stored: {fidelity.PRESETS}")
    console.print(f"Written: {', '.join(str(path) for path in (options.out / 'accuracy.csv', *pictures))}")
