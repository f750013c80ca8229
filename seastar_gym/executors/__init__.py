"""Executors: where the cells of a sweep, or the jobs of a benchmark, are run. All have one method, `run`.

An executor takes tasks as it has room for them, and yields their outcomes in whatever order they are done. Results are
the same bits on each. A worker that is lost costs the task that it was at.
"""

from collections.abc import Callable, Iterator
from typing import Generic, NamedTuple, Protocol, TypeVar, runtime_checkable

from seastar_gym.command import refused_by_disk

Task = TypeVar("Task")
"""What is run: plain data that can be sent to another process, such as a `Batch`."""

Work = Callable[[Task], bytes]
"""What is done with a task: a function of a module, that returns a file."""

KNOWN_FAILURES = (ValueError, OSError, MemoryError, ArithmeticError)
"""Failures of a task that leave its worker sound."""


class Outcome(NamedTuple, Generic[Task]):
    """What came of a task. part: Its results, None if there are none. problem: Why, in a sentence."""

    task: Task
    part: bytes | None
    problem: str = ""


@runtime_checkable
class Executor(Protocol):
    """A place where tasks are run."""

    def run(self, work: Work[Task], tasks: Iterator[Task]) -> Iterator[Outcome[Task]]:
        """Run all tasks. Closing the iterator ends what is under way."""
        ...


def sentence_of(failure: BaseException) -> str:
    """A failure on one line."""
    if isinstance(failure, OSError):
        return refused_by_disk(failure)
    return " ".join(str(failure).split()) or type(failure).__name__
