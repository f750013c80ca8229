"""Many swims of every agent, on named and random paths, nominal and disturbed: means with confidence intervals.

    python -m agents.trials --agents learned greedy pentagon --swims 1000 --out runs/trials.csv

Random paths have random headings. The disturbed pentagon is there for the scripted gait, which knows no other path.
"""

import csv
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
import tyro
from numpy.typing import NDArray
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text
from scipy.stats import bootstrap

from agents.disturbances import CURRENT_DIRECTIONS, DISTURBANCES, Disturbance, DisturbedTask
from agents.roster import AgentNames, load_agents
from agents.swim import TIME_LIMIT, Policy, Swim, actions_of, decisions_in, require_fit
from seastar_gym.command import run_command
from seastar_gym.envs.commands import to_commands
from seastar_gym.envs.reward import RewardWeights
from seastar_gym.envs.task import Outcome, SwimTask, make_scene
from seastar_gym.envs.task import Path as SwimPath
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import require_count, require_number
from seastar_gym.scene.numerics import Fidelity

HELD_OUT_SEED = 1_000
"""Seed of the paths that policies are measured on; trainings draw theirs from small seeds."""
MM = 1000.0
RESAMPLES, CONFIDENCE = 2000, 0.95
NOMINAL: tuple[str, ...] = ("pentagon", "square", "triangle", "figure-eight")

HEAT = ("limbs_heated", "heating_time", "energy")
"""Entries of info, and fields of a `Swim`, of every decision."""

PRINTED = (
    "strokes_to_finish", "simulated_time_s", "mean_cross_track_error_mm", "limbs_heated_per_metre",
    "energy_per_metre_J",
)  # fmt: skip
"""Measures that are printed, besides the success rate."""

Interval = tuple[float, float, float]
"""Mean, and the ends of its confidence interval."""


def swim_many(
    agent: str,
    policy: Policy,
    path: SwimPath,
    n_swims: int,
    scene: Scene,
    disturbance: Disturbance = Disturbance(),
    *,
    max_strokes: int = 400,
    waypoint_radius: float = 0.01,
    seed: int = 0,
    threads: int | None = None,
    decision_period: float | None = None,
) -> list[Swim]:
    """Swims of `n_swims` robots side by side, each to its last waypoint or for `max_strokes` strokes, or decisions.

    The path "random" has random headings. waypoint_radius: Radius of the waypoints [m]. decision_period: Time between
    decisions [s]. None means a stroke.
    """
    actions = actions_of(policy, scene.robot.n_limbs)
    require_fit(policy, scene, actions, decision_period)
    with_heading = isinstance(path, str) and path == "random"
    inner = SwimTask(
        scene, n_swims, path, RewardWeights(), waypoint_radius, with_heading, threads, actions=actions,
        decision_period=decision_period,
    )  # fmt: skip
    task = DisturbedTask(inner, disturbance, np.random.default_rng([seed, n_swims]))
    task.reset([np.random.default_rng([seed, swim]) for swim in range(n_swims)])
    waypoints, counts = inner.waypoints.copy(), inner.n_waypoints
    hubs, reached = [task.hub_position()], [inner.waypoint_index.copy()]
    outcomes: list[Outcome] = []
    state, begins, n_limbs = None, np.ones(n_swims, bool), scene.robot.n_limbs
    while len(outcomes) < max_strokes and (inner.waypoint_index < counts).any():
        chosen, state = policy.predict(task.observe(), state=state, episode_start=begins, deterministic=True)
        commands = to_commands(actions, n_limbs, chosen, n_swims)
        commands[inner.waypoint_index == counts] = 0.0
        outcomes.append(task.step(commands))
        hubs.append(task.hub_position())
        reached.append(inner.waypoint_index.copy())
        begins[:] = False
    return [
        _up_to_the_last_waypoint(
            Swim(
                agent=agent,
                waypoints=waypoints[k, : counts[k]],
                hub=np.array([hub[k] for hub in hubs]),
                waypoint_index=np.array([index[k] for index in reached]),
                time=inner.decision_period * np.arange(len(hubs), dtype=np.float64),
                **{name: np.array([one.info[name][k] for one in outcomes]) for name in HEAT},
                solver_message=None,
            )
        )
        for k in range(n_swims)
    ]


def _up_to_the_last_waypoint(done: Swim) -> Swim:
    strokes = int(np.argmax(done.waypoint_index == len(done.waypoints))) if done.finished else done.strokes
    parts = {name: getattr(done, name)[: strokes + 1] for name in ("hub", "waypoint_index", "time")}
    return replace(done, **parts, **{name: getattr(done, name)[:strokes] for name in HEAT})


def mean_with_interval(values: NDArray[np.float64]) -> Interval:
    """Mean of values and the ends of its bootstrap confidence interval; NaN where there are no values."""
    if len(values) == 0:
        return np.nan, np.nan, np.nan
    if np.ptp(values) == 0.0:
        return values[0], values[0], values[0]
    found = bootstrap(
        (values,), np.mean, confidence_level=CONFIDENCE, n_resamples=RESAMPLES, method="percentile", batch=100,
        rng=np.random.default_rng(0),
    ).confidence_interval  # fmt: skip
    return float(values.mean()), float(found.low), float(found.high)


def statistics(swims: Sequence[Swim]) -> dict[str, Interval]:
    """Mean measures of a set of swims, by name, with intervals; strokes and seconds are those of finished swims."""
    finished = np.array([done.finished for done in swims], dtype=np.float64)
    strokes = np.array([done.strokes for done in swims if done.finished], dtype=np.float64)
    errors = MM * np.array([done.cross_track_errors.mean() for done in swims])
    seconds = np.array([done.time[-1] for done in swims if done.finished], dtype=np.float64)
    effort = np.array([done.heated_per_metre for done in swims if done.heated_per_metre is not None], dtype=np.float64)
    joules = np.array([done.joules_per_metre for done in swims if done.joules_per_metre is not None], dtype=np.float64)
    measures = {
        "success_rate": finished,
        "strokes_to_finish": strokes,
        "mean_cross_track_error_mm": errors,
        "limbs_heated_per_metre": effort,
        "simulated_time_s": seconds,
        "energy_per_metre_J": joules,
    }
    return {name: mean_with_interval(values) for name, values in measures.items()}


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
    options.out.parent.mkdir(parents=True, exist_ok=True)
    with options.out.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    return 0


if __name__ == "__main__":
    run_command(main)
