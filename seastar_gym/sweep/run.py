"""Runs the cells of a sweep that have no part yet, and writes their parts."""

import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field

from seastar_gym.sweep.cells import Cell
from seastar_gym.sweep.executors import Executor, Outcome, Work
from seastar_gym.sweep.parts import Parts, part_of

ATTEMPTS = 3
"""How often a cell is tried whose worker is lost."""
MOST_LOST = 1000
"""Cells that wait for another attempt at most. With more, something is wrong with all of them."""


@dataclass
class Tally:
    """Counts of a run.

    kept: Cells that had parts before. done: Cells and, in them, designs and intervals (such as strokes) that were run.
    losses: Attempts that failed. problems: Why cells have no part after all attempts, by the name of the cell.
    """

    kept: int = 0
    done: int = 0
    designs: int = 0
    intervals: int = 0
    losses: int = 0
    problems: dict[str, str] = field(default_factory=dict)

    def count(self, cell: Cell) -> None:
        """Count a finished cell."""
        swum = cell.frame.swim
        self.done += 1
        self.designs += cell.n_robots
        self.intervals += cell.n_robots * (swum.settling + swum.measured)


Progress = Callable[[Tally], None]
"""Called after every cell."""


def run(
    cells: Iterable[Cell], folder: str | os.PathLike[str], executor: Executor, progress: Progress | None = None,
    work: Work = part_of,
) -> Tally:  # fmt: skip
    """Run the cells that have no part in the folder; those that were lost again at the end.

    An interrupt, such as Ctrl-C, leaves the parts of all finished cells. OSError if the disk refuses a part.

    work: What makes a part of a cell.
    """
    parts, tally = Parts(folder), Tally()
    waiting, lost = unfinished(cells, parts, tally), list[Outcome]()
    for _ in range(ATTEMPTS):
        lost = _attempt(executor.run(work, waiting), parts, tally, progress)
        if not lost:
            return tally
        waiting = iter([outcome.cell for outcome in lost])
    tally.problems = {outcome.cell.name: outcome.problem for outcome in lost}
    return tally


def unfinished(cells: Iterable[Cell], parts: Parts, tally: Tally) -> Iterator[Cell]:
    """Cells without a part; others are counted."""
    for cell in cells:
        if parts.has(cell.name):
            tally.kept += 1
        else:
            yield cell


def _attempt(outcomes: Iterator[Outcome], parts: Parts, tally: Tally, progress: Progress | None) -> list[Outcome]:
    """Write the parts of outcomes; returns those without."""
    lost = []
    for outcome in outcomes:
        if outcome.part is None:
            lost.append(outcome)
            tally.losses += 1
            if len(lost) > MOST_LOST:
                raise ValueError(f"More than {MOST_LOST} cells failed, the last one so: {outcome.problem}")
        else:
            parts.write(outcome.cell.name, outcome.part)
            tally.count(outcome.cell)
        if progress is not None:
            progress(tally)
    return lost
