"""Many swims of every agent, on named and random paths, nominal and disturbed: means with confidence intervals.

    python -m agents.trials --agents learned greedy pentagon --swims 1000 --out runs/trials.csv

Random paths have random headings. The disturbed pentagon is there for the scripted gait, which knows no other path.
"""

import csv
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import tyro
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

from agents.names import AgentNames
from seastar_gym.command import run_command
from seastar_gym.controllers.contract import Policy
from seastar_gym.controllers.roster import load_agents
from seastar_gym.envs.options import make_scene
from seastar_gym.evaluation.disturbances import CURRENT_DIRECTIONS, DISTURBANCES
from seastar_gym.evaluation.many import statistics, swim_many
from seastar_gym.evaluation.swim import TIME_LIMIT, decisions_in
from seastar_gym.files import beside
from seastar_gym.scene.checks import require_count, require_number
from seastar_gym.scene.numerics import Fidelity

NOMINAL: tuple[str, ...] = ("pentagon", "square", "triangle", "figure-eight")

PRINTED = (
    "strokes_to_finish", "simulated_time_s", "mean_cross_track_error_mm", "limbs_heated_per_metre",
    "energy_per_metre_J",
)  # fmt: skip
"""Measures that are printed, besides the success rate."""


def trials(agents: Mapping[str, Policy], fidelity: Fidelity, options: "Options") -> list[dict[str, str | int | float]]:
    """Rows of the results, one for every set of swims and agent."""
    rows = []
    scene = make_scene(None, fidelity, options.decision_period)
    for path, label, n_swims in _sets(options):
        for agent, policy in agents.items():
            swims = swim_many(
                agent, policy, path, n_swims, scene, DISTURBANCES[label], seed=options.seed,
                threads=options.num_threads, decision_period=options.decision_period,
                max_strokes=decisions_in(TIME_LIMIT, options.decision_period),
            )  # fmt: skip
            row: dict[str, str | int | float] = {
                "path": path, "disturbance": label, "agent": agent, "fidelity": fidelity, "swims": n_swims
            }  # fmt: skip
            for name, numbers in statistics(swims).items():
                row |= dict(zip((name, f"{name}_low", f"{name}_high"), numbers, strict=True))
            rows.append(row)
    return rows


def _sets(options: "Options") -> list[tuple[str, str, int]]:
    """Path, disturbance and number of swims of every set that was asked for.

    The disturbed pentagon is swum for every combination of a current's direction and a weak limb.
    """
    nominal: list[tuple[str, str, int]] = [(path, "none", 1) for path in NOMINAL]
    random: list[tuple[str, str, int]] = [("random", name, options.swims) for name in DISTURBANCES]
    pentagon: list[tuple[str, str, int]] = [
        ("pentagon", name, 5 * CURRENT_DIRECTIONS) for name in DISTURBANCES if name != "none"
    ]
    known = {"nominal": nominal, "random": random, "pentagon": pentagon}
    return [one for name in options.sets for one in known[name]]


@dataclass(frozen=True)
class Options:
    """Many swims of every agent, nominal and disturbed: print a table of means, and write it as CSV."""

    agents: AgentNames = ("learned", "greedy", "pentagon")
    sets: tuple[Literal["nominal", "random", "pentagon"], ...] = ("nominal", "random", "pentagon")
    """Sets of swims: nominal, the named paths undisturbed; random, random paths under every disturbance; pentagon, the
    pentagon under every disturbance."""
    swims: int = 1000
    """Number of random paths of every set."""
    fidelity: tuple[Fidelity, ...] = ("balanced",)
    """Accuracies of the simulation, each in turn."""
    seed: int = 0
    """Seed of paths, headings and disturbances, which are the same for every agent."""
    decision_period: float | None = None
    """Time between decisions [s]; by default a stroke of 1 s. With another, robots have wires."""
    num_threads: int | None = None
    """Number of threads of the simulator; by default one for every processor."""
    out: Path = Path("runs/trials.csv")
    """CSV file of the results."""

    def __post_init__(self) -> None:
        require_count("swims", self.swims, 1, 1_000_000)
        if not (self.agents and self.sets and self.fidelity):
            raise ValueError("There is nothing to swim: name at least one agent, one set and one fidelity.")
        if self.decision_period is not None:
            require_number("decision_period", self.decision_period, "s")


def _print(rows: Sequence[dict[str, str | int | float]], decision_period: float | None) -> None:
    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    for name in (
        "path",
        "disturbance",
        "agent",
        "fidelity",
        "swims",
        "success",
        "strokes" if decision_period is None else f"decisions\nof {decision_period:g} s",
        "time [s]",
        "cross-track\nerror [mm]",
        "heated\n[1/m]",
        "energy\n[J/m]",
    ):
        table.add_column(Text(name))
    for row in rows:
        success = f"{row['success_rate']:.1%} [{row['success_rate_low']:.1%}, {row['success_rate_high']:.1%}]"
        others = (
            f"{row[name]:.1f} [{row[name + '_low']:.1f}, {row[name + '_high']:.1f}]"
            for name in PRINTED
        )
        table.add_row(
            *(str(row[name]) for name in ("path", "disturbance", "agent", "fidelity", "swims")), success, *others
        )
    Console(width=220).print(table)


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; returns the exit code."""
    options = tyro.cli(Options, prog="python -m agents.trials", args=arguments)
    rows = []
    try:
        for fidelity in options.fidelity:
            agents = load_agents(options.agents, options.seed, fidelity, options.decision_period)
            rows += trials(agents, fidelity, options)
    except (ValueError, OSError) as bad_input:
        print(bad_input, file=sys.stderr)
        return 2
    _print(rows, options.decision_period)
    with beside(options.out) as part, part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    return 0


if __name__ == "__main__":
    run_command(main)
