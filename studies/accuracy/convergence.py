"""Swims that stand for the continuum and for infinitely short steps, and errors of settings against them."""

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene import Numerics, Scene
from seastar_gym.scene.numerics import Setting
from studies.accuracy.cases import Cases, Errors, Swim, errors, hub_path_lengths, scene_of, swim
from studies.accuracy.rows import Figures, Row, figures, medians
from studies.accuracy.settings import Plan, Resolution

Floats = NDArray[np.float64]

TIGHT = 1e-9
"""Newton tolerance of the swims that others are compared with."""

Job = tuple[Cases, Scene]


def swim_all(jobs: Sequence[Job], bar: Any) -> list[Swim]:
    """Swims of all jobs, computed on all processors, the longest first."""

    def cost(job: Job) -> float:
        cases, scene = job
        return scene.robot.nodes_per_limb * cases.commands[..., 0].size / scene.numerics.step

    order = sorted(range(len(jobs)), key=lambda k: -cost(jobs[k]))

    def run(k: int) -> Swim:
        swum = swim(*jobs[k])
        bar.update()
        return swum

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        swum = dict(zip(order, pool.map(run, order), strict=True))
    return [swum[k] for k in range(len(jobs))]


def in_groups(cases: Cases, n: int = 16) -> list[Cases]:
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


class Exact(NamedTuple):
    """Swims that others are compared with, every one a list over batches.

    limit: Those that stand for the continuum. fine: Those that stand for infinitely short steps, by resolution.
    """

    limit: list[Swim]
    fine: dict[Resolution, list[Swim]]


def tight(discretisation: str, nodes: int, step: float, scheme: str = "implicit-midpoint") -> Setting:
    """Setting of a swim that others are compared with."""
    return Setting(discretisation, nodes, Numerics(scheme, step, TIGHT))  # type: ignore[arg-type]


def swim_batches(batches: Sequence[Cases], scenes: Sequence[Scene], bar: Any) -> list[list[Swim]]:
    """Swims of all batches with every scene, split into groups for the processors."""
    jobs = [(group, scene) for scene in scenes for batch in batches for group in in_groups(batch)]
    swum = iter(swim_all(jobs, bar))
    return [[together([next(swum) for _ in in_groups(batch)]) for batch in batches] for _ in scenes]


def n_groups(batches: Sequence[Cases]) -> int:
    """Number of groups that `swim_batches` makes."""
    return sum(len(in_groups(batch)) for batch in batches)


def fine_setting(plan: Plan, resolution: Resolution) -> Setting:
    """Setting that stands for infinitely short steps."""
    discretisation, nodes = resolution
    if discretisation == "chapter" and nodes > plan.finest:
        return tight(*resolution, 4.0 * plan.fine)
    return tight(*resolution, plan.limit[1] if nodes >= plan.limit[0] else plan.fine)


def converge(
    batches: Sequence[Cases], plan: Plan, resolutions: Sequence[Resolution], bar: Any, physics: Scene = Scene()
) -> Exact:
    """Swims that others are compared with."""
    wanted = [tight("continuum", *plan.limit), *(fine_setting(plan, each) for each in resolutions)]
    limit, *fine = swim_batches(batches, [scene_of(each, physics) for each in wanted], bar)
    return Exact(limit, dict(zip(resolutions, fine, strict=True)))


def against(swum: Sequence[Swim], exact: Sequence[Swim], limit: Sequence[Swim]) -> list[Errors]:
    """Errors of swims of all batches against others, as fractions of the lengths of the limit's paths.

    With the same lengths for space and time, no swim errs by more than the sum of the two.
    """
    all_three = zip(swum, exact, limit, strict=True)
    return [errors(each, other, hub_path_lengths(last.hub)) for each, other, last in all_three]


def compared(batches: Sequence[Cases], swum: Sequence[Swim], exact: Sequence[Swim], limit: Sequence[Swim]) -> Figures:
    """Largest errors of swims of all batches against others."""
    return figures(batches, against(swum, exact, limit))


def second_opinion(cases: Cases, plan: Plan, bar: Any) -> dict[str, Figures]:
    """Errors of the limit itself on some cases, by what they are from.

    Space: Twice the edges bring a quarter of the error, so a third of the difference that they make is left. Time: The
    same for half the steps. Scheme: SDIRK3 against the midpoint rule, with the same nodes.
    """
    nodes, step = plan.opinion
    finer = 2 * nodes - 1
    wanted = [
        tight("continuum", nodes, step), tight("continuum", finer, step), tight("continuum", nodes, 0.5 * step),
        tight("continuum", nodes, step, "sdirk3"),
    ]  # fmt: skip
    plain, fine, short, other = (found[0] for found in swim_batches([cases], [scene_of(each) for each in wanted], bar))

    def doubt(each: Swim, other: Swim) -> Figures:
        return compared([cases], [each], [other], [fine])

    def third(found: Figures) -> Figures:
        return found._replace(path=found.path / 3.0, straight=found.straight / 3.0, pair=found.pair / 3.0)

    return {
        f"space, from {nodes} and {finer} nodes": third(doubt(plain, fine)),
        f"time, midpoint {1e3 * step:g} ms": doubt(plain, short),
        f"scheme, sdirk3 {1e3 * step:g} ms": doubt(other, short),
    }


def measure(
    batches: Sequence[Cases], exact: Exact, settings: Sequence[Setting], bar: Any, physics: Scene = Scene()
) -> list[Row]:
    """Rows of all settings, yet without speeds."""
    space = {each: against(fine, exact.limit, exact.limit) for each, fine in exact.fine.items()}
    swum = swim_batches(batches, [scene_of(each, physics) for each in settings], bar)
    size = np.array([len(batch) * len(batch.commands) for batch in batches])
    rows = []
    for setting, mine in zip(settings, swum, strict=True):
        resolution = setting.discretisation, setting.nodes_per_limb
        time = against(mine, exact.fine[resolution], exact.limit)
        rows.append(
            Row(
                setting,
                figures(batches, space[resolution]),
                figures(batches, time),
                iterations=float(size @ [each.iterations for each in mine] / size.sum()),
                steps=float(size @ [each.steps for each in mine] / size.sum()),
                rejections=sum(each.rejections for each in mine),
                halvings=sum(each.halvings for each in mine),
                typical=medians(batches, space[resolution], time),
            )
        )
    return rows
