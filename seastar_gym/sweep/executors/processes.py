"""`Processes`: cells in processes of this machine."""

import os
import signal
from collections.abc import Iterator
from contextlib import suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from typing import Any, NamedTuple

from seastar_gym.scene.checks import require_count
from seastar_gym.sweep.cells import Cell
from seastar_gym.sweep.executors import Outcome, Work
from seastar_gym.sweep.executors.here import outcome_of


class Worker(NamedTuple):
    """A process and the cell that it is at."""

    process: Any
    cell: Cell


class Processes:
    """Runs cells in processes of this machine, each at one cell. workers: How many; one per processor if None."""

    def __init__(self, workers: int | None = None):
        if workers is not None:
            require_count("workers", workers, 1, 4096)
        self.workers = workers or os.cpu_count() or 1

    def run(self, work: Work, cells: Iterator[Cell]) -> Iterator[Outcome]:
        """Run all cells. A process that dies is replaced by another."""
        busy: dict[Connection, Worker] = {}
        try:
            for cell in cells:
                _begin(busy, work, cell)
                while len(busy) >= self.workers:
                    yield from self._swept(busy, work, cells)
            while busy:
                yield from self._swept(busy, work, cells)
        finally:
            for connection, worker in busy.items():
                worker.process.terminate()
                worker.process.join()
                connection.close()

    def _swept(self, busy: dict[Connection, Worker], work: Work, cells: Iterator[Cell]) -> Iterator[Outcome]:
        """Outcomes of the cells that are done next. Their processes get the next cells, or end."""
        for connection in wait(list(busy)):
            assert isinstance(connection, Connection)
            process, cell = busy.pop(connection)
            try:
                outcome = Outcome(cell, *connection.recv())
            except (EOFError, OSError):
                connection.close()
                process.join()
                yield Outcome(cell, None, f"Its process was lost, with exit code {process.exitcode}.")
                continue
            following = next(cells, None)
            if following is None:
                connection.close()
                process.join()
            else:
                _give(busy, connection, Worker(process, following))
            yield outcome


def _begin(busy: dict[Connection, Worker], work: Work, cell: Cell) -> None:
    """Start a process with a cell."""
    context = get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=serve, args=(theirs, work), daemon=True)
    process.start()
    theirs.close()
    _give(busy, ours, Worker(process, cell))


def _give(busy: dict[Connection, Worker], connection: Connection, worker: Worker) -> None:
    """Give a process its cell. If the process is dead, the next look at it says so."""
    busy[connection] = worker
    with suppress(OSError):
        connection.send(worker.cell)


def serve(connection: Connection, work: Work) -> None:
    """A process's life: cells are read, run and answered until there are no more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that gives the cells
    while True:
        try:
            outcome = outcome_of(work, connection.recv())
            connection.send((outcome.part, outcome.problem))
        except (EOFError, BrokenPipeError, ConnectionResetError):
            return
