"""What speed costs: `python -m studies.accuracy`.

Finds the converged solution with two schemes of different kind, then the error of every setting against it and the
time it takes. Writes `accuracy.csv`, the summary `accuracy.md` and three pictures; with `--store` also the table of
`seastar_gym.scene.fidelity`, which `Numerics.for_error` and the presets' promises come from.

Errors are of the hub's path at the ends of strokes, over the length of the converged path; see `accuracy_cases`. Times
are those that one thread computed, the best of several rounds, for a batch with commands as mixed as a learner's.
"""

import argparse
import itertools
import os
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from tqdm import tqdm

from seastar_gym.gaits import STRAIGHT
from seastar_gym.scene import Numerics, fidelity
from seastar_gym.scene.numerics import SchemeName
from seastar_gym.simulator import Simulator
from studies.accuracy.cases import (
    Cases,
    Errors,
    Swim,
    errors,
    gaits,
    hub_path_lengths,
    joined,
    pentagon,
    random_sequences,
    scene_of,
    swim,
    swims,
)
from studies.accuracy.rows import Row, Space, Study, presets, promised
from studies.accuracy.tables import TABLE_WIDTH, as_markdown, as_table, facts, store, write_csv

Floats = NDArray[np.float64]

MS = 1e-3
TIGHT = 1e-12
"""Newton tolerance of converged solutions."""
STEPS: dict[SchemeName, tuple[float, ...]] = {
    "implicit-euler": (20, 10, 5, 3, 2, 1, 0.5, 0.25),
    "sdirk2": (50, 30, 20, 15, 10, 5, 2, 1, 0.5, 0.2),
    "sdirk3": (50, 30, 20, 10, 5, 2, 1, 0.5, 0.2),
    "implicit-midpoint": (10, 8, 5, 4, 3, 2, 1.5, 1, 0.8, 0.6, 0.5, 0.4, 0.3, 0.25, 0.2, 0.1),
}
"""h [ms], all of them tried with every Newton tolerance."""
ADAPTED = (0.02, 0.015, 0.01, 0.007, 0.005, 0.003, 0.002, 0.001)
"""path_tolerance of adapted steps."""
LARGEST_ADAPTED = 5 * MS
FINE_NODES = (10, 19, 37, 73)
"""N of the extrapolation N -> infinity: each halves the edges of the one before."""


@dataclass(frozen=True)
class Plan:
    """How much is computed.

    n_random: Random sequences. side: Strokes of swimming and of rest on a side of the pentagon. converged: The two
    schemes and steps [s] that have to agree. shortest: Shortest step of the settings [s]. tolerances: Newton
    tolerances. nodes: N whose settings are measured besides 10. fine: Step of converged solutions for other N [s].
    coarse_nodes, n_fine: Further N of the convergence picture, and how many of FINE_NODES. n_spatial: Robots of other
    N. rounds: Of timing.
    """

    n_random: int = 64
    side: tuple[int, int] = (9, 1)
    converged: tuple[tuple[SchemeName, float], ...] = (("sdirk3", 0.01 * MS), ("implicit-midpoint", 0.005 * MS))
    shortest: float = 0.1 * MS
    tolerances: tuple[float, ...] = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
    nodes: tuple[int, ...] = (5, 19, 37)
    fine: float = 0.02 * MS
    coarse_nodes: tuple[int, ...] = (4, 5, 7)
    n_fine: int = 4
    n_spatial: int = 16
    rounds: int = 5


QUICK = Plan(
    n_random=8, side=(4, 1), converged=(("sdirk3", 0.05 * MS), ("implicit-midpoint", 0.025 * MS)), shortest=0.25 * MS,
    tolerances=(1e-6, 1e-8), nodes=(), fine=0.1 * MS, coarse_nodes=(5,), n_fine=3, n_spatial=8, rounds=2,
)  # fmt: skip


# --- settings --------------------------------------------------------------------------------------------------------


def settings(plan: Plan) -> list[Numerics]:
    """All settings for N = 10."""
    fixed = [
        Numerics(scheme, step * MS, tolerance)
        for scheme, steps in STEPS.items()
        for step, tolerance in itertools.product(steps, plan.tolerances)
        if step * MS >= plan.shortest
    ]
    adapted = [
        Numerics("implicit-midpoint", LARGEST_ADAPTED, tolerance, path_tolerance=path_tolerance)
        for path_tolerance, tolerance in itertools.product(ADAPTED, plan.tolerances)
        if tolerance <= 1e-6
    ]
    return list(dict.fromkeys([*presets().values(), *fixed, *adapted]))


def settings_for_other_nodes() -> list[Numerics]:
    """Fewer, for other N."""
    steps: dict[SchemeName, tuple[float, ...]] = {
        "implicit-euler": (20, 3), "sdirk2": (20, 5, 1), "sdirk3": (20, 5), "implicit-midpoint": (5, 2, 1, 0.5),
    }  # fmt: skip
    fixed = [Numerics(scheme, step * MS) for scheme, each in steps.items() for step in each]
    return list(dict.fromkeys([*presets().values(), *fixed]))


# --- errors ----------------------------------------------------------------------------------------------------------

Job = tuple[Cases, Numerics, int]


def swim_all(jobs: Sequence[Job], bar: Any) -> list[Swim]:
    """Swims of all jobs (cases, numerics, nodes per limb), on all processors, longest first."""
    order = sorted(range(len(jobs)), key=lambda k: jobs[k][1].step / (jobs[k][2] * jobs[k][0].commands[..., 0].size))

    def run(k: int) -> Swim:
        swum = swim(*jobs[k])
        bar.update()
        return swum

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        swum = dict(zip(order, pool.map(run, order), strict=True))
    return [swum[k] for k in range(len(jobs))]


def in_groups(cases: Cases, n: int = 8) -> list[Cases]:
    """Cases cut into batches of n robots, for many processors."""
    parts = [slice(k, k + n) for k in range(0, len(cases), n)]
    return [Cases(cases.names[part], cases.kinds[part], cases.commands[:, part]) for part in parts]


def together(swum: Sequence[Swim]) -> Swim:
    """Swims of groups as one."""
    hub, heading = (np.concatenate([getattr(each, name) for each in swum], axis=1) for name in ("hub", "heading"))
    share = np.array([each.hub.shape[1] for each in swum]) / hub.shape[1]
    return Swim(
        hub,
        heading,
        iterations=float(share @ [each.iterations for each in swum]),
        steps=float(share @ [each.steps for each in swum]),
        rejections=sum(each.rejections for each in swum),
        halvings=sum(each.halvings for each in swum),
        failed=sum(each.failed for each in swum),
    )


def converge(batches: Sequence[Cases], plan: Plan, bar: Any) -> tuple[list[Swim], dict[str, float]]:
    """The converged swim of every batch, by the first of plan.converged, and how far the second is off, by kind."""
    found: list[list[Swim]] = []
    jobs: list[Job] = []
    for scheme, step in plan.converged:
        numerics = Numerics(scheme, step, TIGHT)
        jobs += [(group, numerics, 10) for batch in batches for group in in_groups(batch)]
    swum = iter(swim_all(jobs, bar))
    for _ in plan.converged:
        found.append([together([next(swum) for _ in in_groups(batch)]) for batch in batches])
    agreement: dict[str, float] = {}
    for batch, first, second in zip(batches, *found, strict=True):
        for kind, error in zip(batch.kinds, errors(second, first).path, strict=True):
            agreement[kind] = max(agreement.get(kind, 0.0), float(error))
    return found[0], agreement


def as_row(numerics: Numerics, nodes: int, batches: Sequence[Cases], swum: Sequence[Swim], found: list[Errors]) -> Row:
    """Errors of all batches as one row."""
    kinds = np.array([kind for batch in batches for kind in batch.kinds])
    names = np.array([name for batch in batches for name in batch.names])
    path, heading, end = (np.concatenate(column) for column in zip(*found, strict=True))
    some = kinds != "gait"

    def largest(kind: str) -> float:
        return float(path[kinds == kind].max(initial=0.0))

    size = np.array([len(batch) * len(batch.commands) for batch in batches])
    return Row(
        numerics,
        nodes,
        path=float(path[some].max()),
        worst=str(names[some][path[some].argmax()]),
        straight=largest("straight"),
        pair=largest("pair"),
        pentagon=largest("pentagon"),
        random=largest("random"),
        median=float(np.median(path[kinds == "random"])) if (kinds == "random").any() else 0.0,
        gait=largest("gait"),
        heading=float(np.degrees(heading[some].max())),
        end=float(end[some].max()),
        iterations=float(size @ [each.iterations for each in swum] / size.sum()),
        steps=float(size @ [each.steps for each in swum] / size.sum()),
        rejections=sum(each.rejections for each in swum),
        halvings=sum(each.halvings for each in swum),
    )


def measure_errors(
    batches: Sequence[Cases], converged: Sequence[Swim], all_numerics: Sequence[Numerics], nodes: int, bar: Any
) -> list[Row]:
    """A row for every setting, against the converged solution of the same N."""
    swum = iter(swim_all([(batch, numerics, nodes) for numerics in all_numerics for batch in batches], bar))
    rows = []
    for numerics in all_numerics:
        mine = [next(swum) for _ in batches]
        found = [errors(each, exact) for each, exact in zip(mine, converged, strict=True)]
        rows.append(as_row(numerics, nodes, batches, mine, found))
    return rows


# --- space -----------------------------------------------------------------------------------------------------------


def extrapolated(paths: Sequence[Floats]) -> Floats:
    """The limit of paths whose edges are halved from one to the next, with errors of first and second order."""
    once = [2.0 * finer - coarser for coarser, finer in itertools.pairwise(paths)]
    return (4.0 * once[-1] - once[-2]) / 3.0


def measure_space(cases: Cases, plan: Plan, bar: Any) -> tuple[dict[int, Swim], list[Space], float]:
    """Converged swims of every N, their spatial errors, and how far the straight swim goes for N -> infinity [m]."""
    nodes = sorted({*plan.coarse_nodes, *plan.nodes, *FINE_NODES[: plan.n_fine]})

    def numerics(n: int) -> Numerics:
        return Numerics("implicit-midpoint", plan.fine * (2.5 if n > 40 else 1.0), 1e-10)

    swum = dict(zip(nodes, swim_all([(cases, numerics(n), n) for n in nodes], bar), strict=True))
    limit = extrapolated([swum[n].hub for n in FINE_NODES[: plan.n_fine]])
    lengths = hub_path_lengths(limit)
    space = []
    for n in nodes:
        error = np.linalg.norm(swum[n].hub - limit, axis=-1).max(axis=0) / lengths
        space.append(Space(n, float(error.max()), float(error[0])))
    return swum, space, float(limit[-1, 0, 0])


# --- time ------------------------------------------------------------------------------------------------------------


def measure_speeds(keys: Sequence[tuple[Numerics, int]], rounds: int, bar: Any, n_robots: int = 32) -> Floats:
    """Simulated over computing seconds on one core, shape (len(keys), 2): mixed commands, straight swim.

    Every round times all settings once, after the first stroke from rest; the best round counts, because whatever else
    the machine does can only take time.
    """
    mixed = random_sequences(n_robots, np.random.default_rng(1)).commands[:3]
    workloads = [mixed, np.broadcast_to(STRAIGHT, mixed.shape)]
    best = np.full((len(keys), 2), np.inf)
    simulators: dict[tuple[int, int], tuple[Simulator, Any]] = {}
    for _ in range(rounds):
        for k, (numerics, nodes) in enumerate(keys):
            for w, commands in enumerate(workloads):
                if (k, w) not in simulators:
                    simulator = Simulator(scene_of(numerics, nodes), n_robots, threads=1)
                    simulator.stroke(commands[0])
                    simulators[k, w] = simulator, simulator.get_state()
                simulator, state = simulators[k, w]
                simulator.set_state(state)
                start = time.thread_time()
                for command in commands[1:]:
                    simulator.stroke(command)
                best[k, w] = min(best[k, w], time.thread_time() - start)
            bar.update()
    simulated = n_robots * (len(mixed) - 1) * scene_of(Numerics()).actuator.period
    return simulated / best


# --- the study -------------------------------------------------------------------------------------------------------


def study(plan: Plan, progress: bool = True) -> Study:
    """Everything but pictures."""
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
    """Compute, print, write."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="fewer settings and swims, in under a minute")
    parser.add_argument("--out", type=Path, default=Path("runs/accuracy"), help="folder for tables and pictures")
    parser.add_argument("--store", action="store_true", help="also write the table that comes with the package")
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
