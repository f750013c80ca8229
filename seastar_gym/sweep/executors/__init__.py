"""Executors: where cells are run. All have one method, `run`, and results are the same bits on each.

An executor takes cells as it has room for them, and yields their outcomes in whatever order they are done. A worker
that is lost costs the cell that it was at.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple, Protocol

from seastar_gym.command import refused_by_disk
from seastar_gym.sweep.cells import Cell

Work = Callable[[Cell], bytes]
"""What is done with a cell: a function of a module, that returns a file."""

KNOWN_FAILURES = (ValueError, OSError, MemoryError, ArithmeticError)
"""Failures of a cell that leave its worker sound."""


class Outcome(NamedTuple):
    """What came of a cell. part: Its results, None if there are none. problem: Why, in a sentence."""

    cell: Cell
    part: bytes | None
    problem: str = ""


class Executor(Protocol):
    """A place where cells are run."""

    def run(self, work: Work, cells: Iterator[Cell]) -> Iterator[Outcome]:
        """Run all cells. Closing the iterator ends what is under way."""
        ...


def sentence_of(failure: BaseException) -> str:
    """A failure on one line."""
    if isinstance(failure, OSError):
        return refused_by_disk(failure)
    return " ".join(str(failure).split()) or type(failure).__name__
