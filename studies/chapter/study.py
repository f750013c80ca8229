"""The chapter's Figs. 13.2 and 13.5b to 13.9, recomputed and written as PNG.

Each swim is computed three times: with the chapter's setting, with its ten nodes converged in time, and with ten nodes
in the continuum's discretisation. The pictures show the first and the last. The pairs of limbs swim with 73 nodes, too.
The chapter's statements are printed beside the numbers, and written to `statements.csv`. What the pictures and tables
of docs/ show is written to `chapter.json`.
"""

from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from tqdm import tqdm

from seastar_gym.gaits import STRAIGHT
from seastar_gym.scene import SmaPulse
from studies.chapter import pictures
from studies.chapter.cost import measure_cost
from studies.chapter.results import as_results, pair_commands, pairs_table, pentagon_commands, strokes_table, swims_of
from studies.chapter.statements import (
    PAIRS,
    Statement,
    as_table,
    cost_statements,
    pair_statements,
    pentagon_statements,
    straight_statements,
    write_csv,
)
from studies.chapter.swims import CONTINUUM, LIMIT, QUICK, SETTINGS, THE_CHAPTERS, swim
from studies.frame import Results, Study

STEPS = np.array([0.1, 0.2, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 30.0, 40.0]) * 1e-3
"""Time steps of Fig. 13.9 [s]."""
QUICK_STEPS = np.array([0.3, 1.0, 3.0, 10.0, 20.0, 40.0]) * 1e-3
"""Time steps of Fig. 13.9 in a quick run [s]."""


def make_figures(out: Path, quick: bool = False, progress: bool = True) -> tuple[list[Statement], dict[str, Any]]:
    """Compute all swims, write the figures that docs/ lacks into a folder; returns the statements and what is kept.

    quick: Take 1 ms as converged, and fewer time steps.
    """
    out.mkdir(parents=True, exist_ok=True)
    *settings, limit = [setting.coarser(QUICK if quick else 0.0) for setting in (*SETTINGS, LIMIT)]
    steps, seconds = (QUICK_STEPS, 0.01) if quick else (STEPS, 0.5)
    bar = tqdm(total=3 + 2 * len(steps), unit="part", disable=not progress)
    actuator = SmaPulse()
    pictures.draw_pulse(actuator, out / "fig_13_5b.png")

    bar.set_description("straight swim")
    straight = [swim(setting, np.tile(STRAIGHT, (10, 1, 1)), 200) for setting in settings]
    pictures.draw_straight(straight[-1], straight[0], out / "fig_13_6.png")
    statements = straight_statements(straight)
    bar.update()

    bar.set_description("pentagon")
    pentagon = [swim(setting, pentagon_commands(), 20) for setting in settings]
    pictures.draw_pentagon_signals(pentagon[-1], out / "fig_13_7b.png")
    statements += pentagon_statements(pentagon)
    bar.update()

    bar.set_description("pairs")
    pairs = [swim(setting, pair_commands(), 50) for setting in (*settings, limit)]
    statements += pair_statements(pairs)
    bar.update()

    bar.set_description("time steps")
    costs = [measure_cost(robot, steps, seconds, bar.update) for robot in (THE_CHAPTERS, CONTINUUM.robot)]
    pictures.draw_cost(costs, out / "fig_13_9.png")
    bar.close()
    return statements + cost_statements(costs), as_results(straight, pentagon, pairs)


def run(results: Results) -> None:
    """Swim, write the figures and the statements, and print the statements."""
    statements, found = make_figures(results.out)
    write_csv(statements, results.out / "statements.csv")
    Console().print(as_table(statements))
    results.update(found)


STUDY = Study(
    "chapter",
    run,
    file="chapter/chapter.json",
    out=Path("runs/chapter"),
    pictures={
        "fig_13_2.png": lambda found, file: pictures.draw_pentagon_snapshots(*swims_of(found, "pentagon"), file),
        "fig_13_7a.png": lambda found, file: pictures.draw_pentagon(*swims_of(found, "pentagon"), file),
        "fig_13_8.png": lambda found, file: pictures.draw_pairs(*swims_of(found, "pairs"), list(PAIRS), file),
    },
    tables={"chapter pairs": pairs_table, "chapter strokes": strokes_table},
)
