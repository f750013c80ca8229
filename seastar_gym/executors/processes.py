"""`Processes`: tasks in processes of this machine."""

import signal
from collections.abc import Iterator
from contextlib import suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from typing import Any, NamedTuple

from seastar_gym.executors import Outcome, Task, Work
from seastar_gym.executors.here import outcome_of
from seastar_gym.processors import processors
from seastar_gym.scene.checks import require_count


class Worker(NamedTuple):
    """A process and the task that it is at."""

    process: Any
    task: Any


class Processes:
    """Runs tasks in processes of this machine, each at one task. workers: How many; one per processor if None."""

    def __init__(self, workers: int | None = None):
        if workers is not None:
            require_count("workers", workers, 1, 4096)
        self.workers = workers or processors()

    def run(self, work: Work[Task], tasks: Iterator[Task]) -> Iterator[Outcome[Task]]:
        """Run all tasks. A process that dies is replaced by another."""
        busy: dict[Connection, Worker] = {}
        try:
            for task in tasks:
                _begin(busy, work, task)
                while len(busy) >= self.workers:
                    yield from self._swept(busy, tasks)
            while busy:
                yield from self._swept(busy, tasks)
        finally:
            for connection, worker in busy.items():
                worker.process.terminate()
                worker.process.join()
                connection.close()

    def _swept(self, busy: dict[Connection, Worker], tasks: Iterator[Task]) -> Iterator[Outcome[Task]]:
        """Outcomes of the tasks that are done next. Their processes get the next tasks, or end."""
        for connection in wait(list(busy)):
            assert isinstance(connection, Connection)
            process, task = busy.pop(connection)
            try:
                outcome = Outcome(task, *connection.recv())
            except (EOFError, OSError):
                connection.close()
                process.join()
                yield Outcome(task, None, f"Its process was lost, with exit code {process.exitcode}.")
                continue
            following = None
            try:
                yield outcome  # first, since the next task may depend on it, or fail to be made
                following = next(tasks, None)
            finally:
                if following is None:
                    connection.close()
                    process.join()
            if following is not None:
                _give(busy, connection, Worker(process, following))


def _begin(busy: dict[Connection, Worker], work: Work[Task], task: Task) -> None:
    """Start a process with a task."""
    context = get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=serve, args=(theirs, work), daemon=True)
    process.start()
    theirs.close()
    _give(busy, ours, Worker(process, task))


def _give(busy: dict[Connection, Worker], connection: Connection, worker: Worker) -> None:
    """Give a process its task. If the process is dead, the next look at it says so."""
    busy[connection] = worker
    with suppress(OSError):
        connection.send(worker.task)


def serve(connection: Connection, work: Work[Any]) -> None:
    """A process's life: tasks are read, run and answered until there are no more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that gives the tasks
    while True:
        try:
            outcome = outcome_of(work, connection.recv())
            connection.send((outcome.part, outcome.problem))
        except (EOFError, BrokenPipeError, ConnectionResetError):
            return
