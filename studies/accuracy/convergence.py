"""Converged swims, and errors of settings against them in time and in space."""

import itertools
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene import Numerics
from studies.accuracy.cases import Cases, Errors, Swim, errors, hub_path_lengths, swim
from studies.accuracy.rows import Row, Space
from studies.accuracy.settings import FINE_NODES, Plan

Floats = NDArray[np.float64]

TIGHT = 1e-12
"""Newton tolerance of converged solutions."""

Job = tuple[Cases, Numerics, int]


def swim_all(jobs: Sequence[Job], bar: Any) -> list[Swim]:
    """Swims of all jobs (cases, numerics, nodes per limb), computed on all processors, the longest first."""
    order = sorted(range(len(jobs)), key=lambda k: jobs[k][1].step / (jobs[k][2] * jobs[k][0].commands[..., 0].size))

    def run(k: int) -> Swim:
        swum = swim(*jobs[k])
        bar.update()
        return swum

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        swum = dict(zip(order, pool.map(run, order), strict=True))
    return [swum[k] for k in range(len(jobs))]


def in_groups(cases: Cases, n: int = 8) -> list[Cases]:
    """Cases split into batches of n robots, to be shared among processors."""
    parts = [slice(k, k + n) for k in range(0, len(cases), n)]
    return [Cases(cases.names[part], cases.kinds[part], cases.commands[:, part]) for part in parts]


def together(swum: Sequence[Swim]) -> Swim:
    """Swims of several groups of robots joined to one."""
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
    """Converged swim of every batch by the first of plan.converged, and the second's largest path error by kind."""
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
    """Row of a setting from the swims and errors of all batches."""
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
    """Rows of all settings, with errors against the converged solution of the same N."""
    swum = iter(swim_all([(batch, numerics, nodes) for numerics in all_numerics for batch in batches], bar))
    rows = []
    for numerics in all_numerics:
        mine = [next(swum) for _ in batches]
        found = [errors(each, exact) for each, exact in zip(mine, converged, strict=True)]
        rows.append(as_row(numerics, nodes, batches, mine, found))
    return rows


def extrapolated(paths: Sequence[Floats]) -> Floats:
    """Limit of paths whose edge length halves from each to the next; removes errors of first and second order."""
    once = [2.0 * finer - coarser for coarser, finer in itertools.pairwise(paths)]
    return (4.0 * once[-1] - once[-2]) / 3.0


def measure_space(cases: Cases, plan: Plan, bar: Any) -> tuple[dict[int, Swim], list[Space], float]:
    """Converged swims by N, their spatial errors, and the straight swim's final hub x for N -> infinity [m]."""
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
