"""Statements of the chapter beside computed numbers."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from seastar_gym import gaits
from studies.chapter import REAL_TIME_FROM
from studies.chapter.swims import Cost, Swim
from studies.frame import write_rows
from studies.pages import markdown
from studies.style import MM, MS

PAIRS = {name.replace(",", ", ").replace("-", "⁻").replace("+", "⁺"): command for name, command in gaits.PAIRS.items()}
SIDE = gaits.SWIMMING_STROKES + gaits.RESTING_STROKES
"""Strokes on a side of the pentagon, swimming and resting."""
BISECTORS = (36.0, 72.0, 108.0, 144.0)
"""Directions of the pairs' bisectors at rest, on the side that they swim to [degrees]."""


@dataclass(frozen=True)
class Statement:
    """A statement of the chapter and a quantity that it is about.

    values: Values in `unit`, of every setting of `swims.SETTINGS` and perhaps of `swims.LIMIT`, or of every
        discretisation.
    """

    sentence: str
    quantity: str
    unit: str
    values: tuple[float, ...]


def stroke_motion(straight: Swim, stroke: int = -1) -> tuple[float, float, float, float]:
    """Motion of the hub along x in a stroke: (advance while heated, advance after that, return, time of return).

    stroke: Number of the stroke from 0, or from the end. Distances in [m]; the time at which the hub turns back is in
    [s] from the stroke's start.
    """
    begins = straight.at_strokes()
    start, end = begins[:-1][stroke], begins[1:][stroke]
    x, since = straight.hub()[start : end + 1, 0], straight.time[start : end + 1] - straight.time[start]
    heated = int(np.searchsorted(since, straight.scene.actuator.corners[1] - 1e-9))
    farthest = int(np.argmax(x))
    return x[heated] - x[0], x[farthest] - x[heated], x[farthest] - x[-1], float(since[farthest])


def straight_statements(swims: Sequence[Swim]) -> list[Statement]:
    """Statements about Fig. 13.6, the straight swim."""
    moves = list(zip(*(stroke_motion(swim) for swim in swims), strict=True))
    forward = "the robot swims forward during the actuating phase ..."
    back = "... but moves slightly backward in the cooling state"
    no_y = "no displacement along the Y-axis"
    return [
        Statement("the net motion of the robot is forward", "x after 10 strokes", "mm",
                  tuple(MM * s.hub()[-1, 0] for s in swims)),
        Statement(forward, "forward while heated, first stroke", "mm",
                  tuple(MM * stroke_motion(swim, 0)[0] for swim in swims)),
        Statement(forward, "forward while heated, 10th stroke", "mm", tuple(MM * np.array(moves[0]))),
        Statement(forward, "forward after that", "mm", tuple(MM * np.array(moves[1]))),
        Statement(back, "backward", "mm", tuple(MM * np.array(moves[2]))),
        Statement(back, "turns back at", "s", moves[3]),
        Statement(no_y, "largest |y|", "mm", tuple(MM * np.abs(s.hub()[:, 1]).max() for s in swims)),
    ]  # fmt: skip


def pentagon_statements(swims: Sequence[Swim]) -> list[Statement]:
    """Statements about Figs. 13.2 and 13.7, the pentagon."""
    corners = [s.hub()[s.at_strokes()[::SIDE]] for s in swims]
    sides = [np.hypot(*np.diff(c, axis=0).T) for c in corners]
    stops = [s.at_strokes()[gaits.SWIMMING_STROKES :: SIDE] for s in swims]
    rests = [s.at_strokes()[SIDE::SIDE] for s in swims]
    coasts = [np.hypot(*(s.hub()[r] - s.hub()[b]).T) for s, r, b in zip(swims, rests, stops, strict=True)]
    rest = "left unactuated for 5 s to bring the robot to a complete stop"
    same = "the same initial conditions for each straight component"
    return [
        Statement("regular pentagon", "mean side", "mm", tuple(MM * d.mean() for d in sides)),
        Statement(same, "longest minus shortest side", "mm", tuple(MM * np.ptp(d) for d in sides)),
        Statement("a closed path", "end to start", "mm", tuple(MM * np.hypot(*c[-1]) for c in corners)),
        Statement(rest, "hub coasts back in the rest", "mm", tuple(MM * c.mean() for c in coasts)),
        Statement(rest, "hub's speed after the rest", "mm/s",
                  tuple(MM * np.hypot(*s.hub_velocity()[r].T).max() for s, r in zip(swims, rests, strict=True))),
        Statement(rest, "fastest node after the rest", "mm/s",
                  tuple(MM * np.hypot(*s.velocities[r, 0].T).max() for s, r in zip(swims, rests, strict=True))),
    ]  # fmt: skip


def pair_statements(swims: Sequence[Swim]) -> list[Statement]:
    """Statements about Fig. 13.8, the pairs of limbs."""
    ends = [s.positions[-1, :, 0] for s in swims]
    order = "the maximum with limbs #1 and #4, a lower efficiency with #1 and #2"
    farther = [np.hypot(*(end[1])) / np.hypot(*end[3]) for end in ends]
    rows = [
        Statement(order, f"distance of {name}", "mm", tuple(MM * np.hypot(*end[k]) for end in ends))
        for k, name in enumerate(PAIRS)
    ]
    off = [np.degrees(np.arctan2(end[:, 1], end[:, 0])) - BISECTORS for end in ends]
    return [
        *rows,
        Statement(order, "distance of {1⁻, 3⁺} over that of {1⁻, 5⁺}", "", tuple(farther)),
        Statement("always moves along the bisector", "largest angle off it", "degrees",
                  tuple(np.abs(o).max() for o in off)),
    ]  # fmt: skip


def cost_statements(costs: Sequence[Cost]) -> list[Statement]:
    """Statements about Fig. 13.9, the cost of implicit Euler as in the chapter, in either discretisation."""
    at_3 = int(np.argmin(np.abs(costs[0].steps - REAL_TIME_FROM)))
    slopes = (np.polyfit(np.log(cost.steps), np.log(cost.in_batch), 1)[0] for cost in costs)
    firsts = [MS * cost.steps[cost.regularised].min(initial=np.inf) for cost in costs]
    faster = "faster than real time when h is 3 ms or more"
    return [
        Statement(faster, "real-time factor at 3 ms, one robot alone", "", tuple(1.0 / c.alone[at_3] for c in costs)),
        Statement(faster, f"the same per robot of {costs[0].n_robots}", "",
                  tuple(1.0 / c.in_batch[at_3] for c in costs)),
        Statement("time linearly scales with step size", "exponent of h", "", tuple(slopes)),
        Statement("numerical issues at h of 20 ms or more", "smallest h at which Newton's matrix is indefinite", "ms",
                  tuple(firsts)),
    ]  # fmt: skip


COLUMNS = ("its setting", "its ten nodes, converged", "continuum", "73 nodes")
"""Columns of values. Of the cost, the second is empty; the last has the pairs only."""


def cells(row: Statement) -> tuple[float | None, ...]:
    """A row's values in COLUMNS."""
    values = row.values if len(row.values) > 2 else (row.values[0], None, *row.values[1:])
    return (*values, *[None] * (len(COLUMNS) - len(values)))


def as_table(statements: Sequence[Statement]) -> str:
    """Statements as a table in Markdown, each sentence once."""
    rows, last = [], ""
    for row in statements:
        values = ["" if value is None else f"{value:.4g} {row.unit}".rstrip() for value in cells(row)]
        rows.append(["" if row.sentence == last else row.sentence, row.quantity.replace("|", "\\|"), *values])
        last = row.sentence
    return markdown(["the chapter", "quantity", *COLUMNS], rows, (0, 1))


def write_csv(statements: Sequence[Statement], file: Path) -> None:
    """Write statements as CSV."""
    rows = ([row.sentence, row.quantity, row.unit, *cells(row)] for row in statements)
    write_rows(file, ["the chapter", "quantity", "unit", *COLUMNS], rows)
