"""Runs the cells of a sweep that have no part yet, and writes their parts."""

import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from seastar_gym.command import refused_by_disk
from seastar_gym.executors import Executor, Outcome, Work
from seastar_gym.scene.checks import require_callable, require_file, require_kind, shown
from seastar_gym.sweep.cells import Cell
from seastar_gym.sweep.parts import Parts, part_of

ATTEMPTS = 3
"""How often a cell is tried whose worker is lost."""
MOST_LOST = 1000
"""Cells that wait for another attempt at most. With more, something is wrong with all of them."""
UNWRITTEN = 10
"""Parts in a row that the disk refuses at most. With more it is full for good, and what is simulated would be lost."""


@dataclass
class Tally:
    """Counts of a run.

    kept: Cells that had parts before. damaged: Parts that were damaged before, whose cells are run again.
    done: Cells and, in them, designs and intervals (such as strokes) that were run.
    losses: Attempts that failed. problems: Why cells have no part after all attempts, by the name of the cell.
    """

    kept: int = 0
    damaged: list[Path] = field(default_factory=list)
    done: int = 0
    designs: int = 0
    intervals: int = 0
    losses: int = 0
    problems: dict[str, str] = field(default_factory=dict)

    def count(self, cell: Cell) -> None:
        """Count a finished cell."""
        self.done += 1
        self.designs += cell.n_robots
        self.intervals += cell.n_robots * cell.frame.intervals


Progress = Callable[[Tally], None]
"""Called after every cell."""


def run(
    cells: Iterable[Cell], folder: str | os.PathLike[str], executor: Executor, progress: Progress | None = None,
    work: Work[Cell] = part_of,
) -> Tally:  # fmt: skip
    """Run the cells that have no part in the folder; those that were lost again at the end.

    An interrupt, such as Ctrl-C, leaves the parts of all finished cells. A part that the disk refuses costs its cell,
    which is lost; OSError if the disk refuses UNWRITTEN in a row.

    work: What makes a part of a cell.
    """
    require_file("folder", folder)
    require_kind("executor", executor, Executor, "an executor, such as Processes()")
    if progress is not None:
        require_callable("progress", progress)
    parts, tally = Parts(folder), Tally()
    waiting, lost = unfinished(cells, parts, tally), list[Outcome[Cell]]()
    for _ in range(ATTEMPTS):
        lost = _attempt(executor.run(work, waiting), parts, tally, progress)
        if not lost:
            return tally
        waiting = iter([outcome.task for outcome in lost])
    tally.problems = {outcome.task.name: outcome.problem for outcome in lost}
    return tally


def unfinished(cells: Iterable[Cell], parts: Parts, tally: Tally) -> Iterator[Cell]:
    """Cells without a sound part; others are counted."""
    try:
        each = iter(cells)
    except TypeError:
        raise ValueError(f"cells must be cells, as Sweep.cells gives them, not {shown(cells)}.") from None
    for cell in each:
        require_kind("A cell", cell, Cell, "a Cell, as Sweep.cells gives it")
        if parts.has(cell.name):
            tally.kept += 1
            continue
        if parts.file(cell.name).exists():
            tally.damaged.append(parts.file(cell.name))
        yield cell


def _attempt(
    outcomes: Iterator[Outcome[Cell]], parts: Parts, tally: Tally, progress: Progress | None
) -> list[Outcome[Cell]]:
    """Write the parts of outcomes; returns those without."""
    lost = list[Outcome[Cell]]()
    refused = 0
    for outcome in outcomes:
        try:
            if outcome.part is not None:
                parts.write(outcome.task.name, outcome.part)
                refused = 0
        except OSError as failure:
            refused += 1
            if refused == UNWRITTEN:
                raise
            outcome = Outcome(outcome.task, None, refused_by_disk(failure))
        _count(outcome, lost, tally)
        if progress is not None:
            progress(tally)
    return lost


def _count(outcome: Outcome[Cell], lost: list[Outcome[Cell]], tally: Tally) -> None:
    """Count an outcome. ValueError if too many are lost."""
    if outcome.part is not None:
        tally.count(outcome.task)
        return
    lost.append(outcome)
    tally.losses += 1
    if len(lost) > MOST_LOST:
        raise ValueError(f"More than {MOST_LOST} cells failed, the last one so: {outcome.problem}")
