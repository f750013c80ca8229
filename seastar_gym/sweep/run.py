"""Runs the batches of a sweep that have no part yet, and writes their parts."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass, field
from pathlib import Path

from seastar_gym.command import refused_by_disk
from seastar_gym.scene.checks import require_callable, require_count, require_file, require_kind, shown
from seastar_gym.sweep.batches import Batch
from seastar_gym.sweep.executors import Outcome, Work, outcomes
from seastar_gym.sweep.result_files import ResultFiles, result_file_of

AT_ONCE = 1000
"""Batches that an executor has at a time, unless somebody says it."""
ATTEMPTS = 3
"""How often a batch is tried whose worker is lost."""
MOST_LOST = 1000
"""Batches that wait for another attempt at most. With more, something is wrong with all of them."""
UNWRITTEN = 10
"""Parts in a row that the disk refuses at most. With more it is full for good, and what is simulated would be lost."""


@dataclass
class Progress:
    """Counts of a run.

    kept: Batches that had parts before. damaged: Parts that were damaged before, whose batches are run again.
    done: Batches and, in them, designs and intervals (such as strokes) that were run.
    losses: Attempts that failed. problems: Why batches have no part after all attempts, by the name of the batch.
    """

    kept: int = 0
    damaged: list[Path] = field(default_factory=list)
    done: int = 0
    designs: int = 0
    intervals: int = 0
    losses: int = 0
    problems: dict[str, str] = field(default_factory=dict)

    def count(self, batch: Batch) -> None:
        """Count a finished batch."""
        self.done += 1
        self.designs += batch.n_robots
        self.intervals += batch.n_robots * batch.configuration.intervals


OnProgress = Callable[[Progress], None]
"""Called after every batch."""


def run(
    batches: Iterable[Batch], folder: str | os.PathLike[str], executor: Executor | None = None,
    progress: OnProgress | None = None, work: Work = result_file_of, at_once: int = AT_ONCE,
) -> Progress:  # fmt: skip
    """Run the batches that have no part in the folder; those that were lost again at the end.

    An interrupt, such as Ctrl-C, leaves the parts of all finished batches. A part that the disk refuses costs its
    batch, which is lost; OSError if the disk refuses UNWRITTEN in a row.

    executor: Any of `concurrent.futures`; None runs batches in this process, one after the other. A lost worker costs
        its batch alone, but where its executor is broken then, as ProcessPoolExecutor is: the same run goes on with
        another. work: What makes a part of a batch. at_once: Batches that the executor has at a time at most.
    """
    require_file("folder", folder)
    require_count("at_once", at_once, 1, 1_000_000)
    if executor is not None:
        require_kind("executor", executor, Executor, "an executor of concurrent.futures, such as Processes()")
    if progress is not None:
        require_callable("progress", progress)
    parts, tally = ResultFiles(folder), Progress()
    waiting, lost = unfinished(batches, parts, tally), list[Outcome]()
    for _ in range(ATTEMPTS):
        lost = _attempt(outcomes(executor, work, waiting, at_once), parts, tally, progress)
        if not lost:
            return tally
        waiting = iter([outcome.task for outcome in lost])
    tally.problems = {outcome.task.name: outcome.problem for outcome in lost}
    return tally


def unfinished(batches: Iterable[Batch], parts: ResultFiles, tally: Progress) -> Iterator[Batch]:
    """Batches without a sound part; others are counted."""
    try:
        each = iter(batches)
    except TypeError:
        raise ValueError(f"batches must be batches, as Sweep.batches gives them, not {shown(batches)}.") from None
    for batch in each:
        require_kind("A batch", batch, Batch, "a Batch, as Sweep.batches gives it")
        if parts.has(batch.name):
            tally.kept += 1
            continue
        if parts.file(batch.name).exists():
            tally.damaged.append(parts.file(batch.name))
        yield batch


def _attempt(
    found: Iterator[Outcome], parts: ResultFiles, tally: Progress, progress: OnProgress | None
) -> list[Outcome]:
    """Write the parts of outcomes; returns those without."""
    lost = list[Outcome]()
    refused = 0
    for outcome in found:
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


def _count(outcome: Outcome, lost: list[Outcome], tally: Progress) -> None:
    """Count an outcome. ValueError if too many are lost."""
    if outcome.part is not None:
        tally.count(outcome.task)
        return
    lost.append(outcome)
    tally.losses += 1
    if len(lost) > MOST_LOST:
        raise ValueError(f"More than {MOST_LOST} batches failed, the last one so: {outcome.problem}")
