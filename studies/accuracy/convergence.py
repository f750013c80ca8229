"""Swims that stand for the continuum and for infinitely short steps, and errors of resolutions against them."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from seastar_gym.accuracy.measure import Measured, Progress, Swims, errors, measure, path_lengths, swim_all
from seastar_gym.accuracy.setting import at
from seastar_gym.scene import Numerics, Scene
from seastar_gym.scene.numerics import Resolution, SchemeName
from seastar_gym.scene.robot import Discretisation
from studies.accuracy.cases import Cases
from studies.accuracy.rows import Figures, Row, figures, medians
from studies.accuracy.settings import Plan

TIGHT = 1e-9
"""Newton tolerance of the swims that others are compared with."""


def tight(nodes: int, step: float, scheme: SchemeName = "implicit-midpoint") -> Resolution:
    """Resolution of a swim that others are compared with."""
    return Resolution("continuum", nodes, Numerics(scheme, step, TIGHT))


def short(plan: Plan, discretisation: Discretisation, nodes: int) -> Numerics:
    """Numerics that stand for infinitely short steps with a discretisation and nodes per limb."""
    step = plan.limit[1] if nodes >= plan.limit[0] else plan.fine
    if discretisation == "chapter" and nodes > plan.finest:
        step = 4.0 * plan.fine
    return Numerics("implicit-midpoint", step, TIGHT)


def measured(cases: Cases, plan: Plan, resolutions: Sequence[Resolution], progress: Progress) -> Measured:
    """Swims of some cases and their errors at all resolutions."""
    return measure(Scene(), resolutions, tight(*plan.limit), partial(short, plan), cases.commands, progress)


def rows_of(batches: Sequence[Cases], found: Sequence[Measured], resolutions: Sequence[Resolution]) -> list[Row]:
    """Rows of all resolutions, yet without speeds. found: Errors of every batch."""
    rows = []
    for k, resolution in enumerate(resolutions):
        space, time = [each.space[k] for each in found], [each.time[k] for each in found]
        reports = [each.swims[k] for each in found]

        def mean(name: str, reports: list[Swims] = reports) -> float:
            return float(np.mean(np.concatenate([getattr(each, name).ravel() for each in reports])))

        rows.append(
            Row(
                resolution,
                figures(batches, space),
                figures(batches, time),
                iterations=mean("newton_iterations"),
                steps=mean("steps"),
                rejections=sum(int(each.rejections.sum()) for each in reports),
                halvings=sum(int(each.halvings.sum()) for each in reports),
                typical=medians(batches, space, time),
            )
        )
    return rows


def second_opinion(cases: Cases, plan: Plan, progress: Progress) -> dict[str, Figures]:
    """Errors of the limit itself on some cases, by what they are from.

    Space: Twice the edges bring a quarter of the error, so a third of the difference that they make is left. Time: The
    same for half the steps. Scheme: SDIRK3 against the midpoint rule, with the same nodes.
    """
    nodes, step = plan.opinion
    finer = 2 * nodes - 1
    wanted = tight(nodes, step), tight(finer, step), tight(nodes, 0.5 * step), tight(nodes, step, "sdirk3")
    plain, fine, shorter, other = swim_all([at(Scene(), each) for each in wanted], cases.commands, progress)
    lengths = path_lengths(Scene(), fine.hub)
    space, time, scheme = (
        figures([cases], [errors(each, against, lengths)])
        for each, against in ((plain, fine), (plain, shorter), (other, shorter))
    )
    return {
        f"space, from {nodes} and {finer} nodes": space._replace(
            path=space.path / 3.0, straight=space.straight / 3.0, pair=space.pair / 3.0
        ),
        f"time, midpoint {1e3 * step:g} ms": time,
        f"scheme, sdirk3 {1e3 * step:g} ms": scheme,
    }
