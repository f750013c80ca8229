"""`Here`: cells in this process, one after the other."""

from collections.abc import Iterator

from seastar_gym.sweep.cells import Cell
from seastar_gym.sweep.executors import KNOWN_FAILURES, Outcome, Work, sentence_of


class Here:
    """Runs cells in this process."""

    def run(self, work: Work, cells: Iterator[Cell]) -> Iterator[Outcome]:
        """Run all cells."""
        for cell in cells:
            yield outcome_of(work, cell)


def outcome_of(work: Work, cell: Cell) -> Outcome:
    """Outcome of a cell that is run now."""
    try:
        return Outcome(cell, work(cell))
    except KNOWN_FAILURES as failure:
        return Outcome(cell, None, sentence_of(failure))
