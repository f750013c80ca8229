"""The chapter's Figs. 13.2 and 13.5b to 13.9, recomputed and written as PNG.

Each swim is computed three times: with the chapter's setting, with its ten nodes converged in time, and with ten nodes
in the continuum's discretisation. The pictures show the first and the last. The pairs of limbs swim with 73 nodes, too.
The chapter's statements are printed beside the numbers, and written to `statements.csv`. What the pictures and tables
of docs/ show is written to `chapter.json`.
"""

from pathlib import Path

import numpy as np
from rich.console import Console
from tqdm import tqdm

from seastar_gym.gaits import STRAIGHT
from seastar_gym.scene import SmaPulse
from studies.chapter import pictures
from studies.chapter.cost import measure_cost
from studies.chapter.kept import kept, pair_commands, pentagon_commands
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
from studies.chapter.swims import CONTINUUM, LIMIT, SETTINGS, THE_CHAPTERS, swim
from studies.kept import keep
from studies.parser import study_parser
from studies.provenance import provenance

STEPS = np.array([0.1, 0.2, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 30.0, 40.0]) * 1e-3
"""Time steps of Fig. 13.9 [s]."""
QUICK_STEPS = np.array([0.3, 1.0, 3.0, 10.0, 20.0, 40.0]) * 1e-3
"""Time steps of Fig. 13.9 in a quick run [s]."""


def make_figures(out: Path, quick: bool = False, progress: bool = True) -> list[Statement]:
    """Compute all swims, write all figures into a folder, and return the statements.

    quick: Take 1 ms as converged, and fewer time steps.
    """
    out.mkdir(parents=True, exist_ok=True)
    *settings, limit = [setting.coarser(1e-3 if quick else 0.0) for setting in (*SETTINGS, LIMIT)]
    steps, seconds = (QUICK_STEPS, 0.01) if quick else (STEPS, 0.5)
    bar = tqdm(total=4 + 2 * len(steps), unit="part", disable=not progress)
    actuator = SmaPulse()
    pictures.draw_pulse(actuator, out / "fig_13_5b.png")

    bar.set_description("straight swim")
    straight = [swim(setting, np.tile(STRAIGHT, (10, 1, 1)), 200) for setting in settings]
    pictures.draw_straight(straight[-1], straight[0], out / "fig_13_6.png")
    statements = straight_statements(straight)
    bar.update()

    bar.set_description("pentagon")
    pentagon = [swim(setting, pentagon_commands(), 20) for setting in settings]
    pictures.draw_pentagon_snapshots(pentagon[-1], pentagon[0], out / "fig_13_2.png")
    bar.update()
    pictures.draw_pentagon(pentagon[-1], pentagon[0], out / "fig_13_7a.png")
    pictures.draw_pentagon_signals(pentagon[-1], out / "fig_13_7b.png")
    statements += pentagon_statements(pentagon)
    bar.update()

    bar.set_description("pairs")
    pairs = [swim(setting, pair_commands(), 50) for setting in (*settings, limit)]
    pictures.draw_pairs(pairs[-2], pairs[0], list(PAIRS), out / "fig_13_8.png")
    statements += pair_statements(pairs)
    made = provenance("python -m studies.chapter" + " --quick" * quick)
    keep({**made, **kept(straight, pentagon, pairs)}, out / "chapter.json")
    bar.update()

    bar.set_description("time steps")
    costs = [measure_cost(robot, steps, seconds, bar.update) for robot in (THE_CHAPTERS, CONTINUUM.robot)]
    pictures.draw_cost(costs, out / "fig_13_9.png")
    bar.close()
    return statements + cost_statements(costs)


def main() -> None:
    """Command line: write the figures and statements and print the statements."""
    parser = study_parser("studies.chapter", __doc__)
    parser.add_argument(
        "--quick", action="store_true", help="take 1 ms as converged, and fewer time steps in Fig. 13.9"
    )
    parser.add_argument("--out", type=Path, default=Path("runs/chapter"), help="folder (default: %(default)s)")
    options = parser.parse_args()
    statements = make_figures(options.out, options.quick)
    write_csv(statements, options.out / "statements.csv")
    console = Console()
    console.print(as_table(statements))
    console.print(f"Written: {', '.join(str(file) for file in sorted(options.out.glob('*.png')))}")
