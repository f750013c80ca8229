"""`SlurmArrays`: cells as arrays of jobs of SLURM, through submitit."""

import itertools
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import submitit

from seastar_gym.scene.checks import require_count
from seastar_gym.sweep.cells import Cell
from seastar_gym.sweep.executors import Outcome, Work, sentence_of
from seastar_gym.sweep.executors.here import outcome_of

ARRAY = 1000
"""Jobs of an array: what SLURM takes at once by default."""


class SlurmArrays:
    """Runs cells as jobs of SLURM, one processor each. Nodes and this process share the folder.

    folder: Folder of the jobs' files.
    cluster: "slurm", or "local" for processes of this machine, as submitit starts them.
    workers: Jobs at a time at most.
    cells_per_job: Cells of a job. A job that is lost costs all of them.
    minutes: Time limit of a job.
    partition: Partition of SLURM.
    """

    def __init__(
        self, folder: str | Path, cluster: str = "slurm", workers: int | None = None, cells_per_job: int = 1,
        minutes: int = 60, partition: str | None = None,
    ):  # fmt: skip
        require_count("cells_per_job", cells_per_job, 1, 1_000_000)
        self.folder, self.cluster, self.workers = Path(folder), cluster, workers
        self.cells_per_job, self.minutes, self.partition = cells_per_job, minutes, partition

    def run(self, work: Work, cells: Iterator[Cell]) -> Iterator[Outcome]:
        """Run all cells, one array of jobs after the other."""
        try:
            executor = submitit.AutoExecutor(self.folder, cluster=self.cluster)
        except RuntimeError as refused:
            raise ValueError(f"There is no SLURM here: {sentence_of(refused)}") from None
        executor.update_parameters(timeout_min=self.minutes, **self._of_slurm())
        size = ARRAY if self.cluster == "slurm" else self.workers or 1
        while jobs := list(itertools.islice(iter(partial(self._next, cells), []), size)):
            under_way = executor.map_array(partial(_outcomes, work), jobs)
            try:
                for job in submitit.helpers.as_completed(under_way):
                    yield from _outcomes_of(jobs[under_way.index(job)], job)
            finally:
                for job in under_way:
                    if not job.done():
                        job.cancel(check=False)

    def _of_slurm(self) -> dict[str, Any]:
        named = {"slurm_partition": self.partition, "slurm_array_parallelism": self.workers}
        chosen = {name: value for name, value in named.items() if value is not None}
        return {**chosen, "cpus_per_task": 1} if self.cluster == "slurm" else {}

    def _next(self, cells: Iterator[Cell]) -> list[Cell]:
        """Cells of the next job."""
        return list(itertools.islice(cells, self.cells_per_job))


def _outcomes(work: Work, cells: list[Cell]) -> list[tuple[bytes | None, str]]:
    """What a job returns."""
    return [outcome_of(work, cell)[1:] for cell in cells]


def _outcomes_of(cells: list[Cell], job: Any) -> list[Outcome]:
    try:
        return [Outcome(cell, *answer) for cell, answer in zip(cells, job.result(), strict=True)]
    except (submitit.core.utils.FailedJobError, submitit.core.utils.UncompletedJobError) as lost:
        return [Outcome(cell, None, f"Its job was lost: {sentence_of(lost)[:200]}.") for cell in cells]
