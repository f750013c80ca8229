"""`SlurmArrays`: tasks as arrays of jobs of SLURM, through submitit."""

import itertools
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import submitit

from seastar_gym.executors import Outcome, Task, Work, sentence_of
from seastar_gym.executors.here import outcome_of
from seastar_gym.scene.checks import require_count

ARRAY = 1000
"""Jobs of an array: what SLURM takes at once by default."""


class SlurmArrays:
    """Runs tasks as jobs of SLURM, one processor each. Nodes and this process share the folder.

    folder: Folder of the jobs' files.
    cluster: "slurm", or "local" for processes of this machine, as submitit starts them.
    workers: Jobs at a time at most.
    tasks_per_job: Tasks of a job. A job that is lost costs all of them.
    minutes: Time limit of a job.
    partition: Partition of SLURM.
    """

    def __init__(
        self, folder: str | Path, cluster: str = "slurm", workers: int | None = None, tasks_per_job: int = 1,
        minutes: int = 60, partition: str | None = None,
    ):  # fmt: skip
        require_count("tasks_per_job", tasks_per_job, 1, 1_000_000)
        self.folder, self.cluster, self.workers = Path(folder), cluster, workers
        self.tasks_per_job, self.minutes, self.partition = tasks_per_job, minutes, partition

    def run(self, work: Work[Task], tasks: Iterator[Task]) -> Iterator[Outcome[Task]]:
        """Run all tasks, one array of jobs after the other."""
        try:
            executor = submitit.AutoExecutor(self.folder, cluster=self.cluster)
        except RuntimeError as refused:
            raise ValueError(f"There is no SLURM here: {sentence_of(refused)}") from None
        executor.update_parameters(timeout_min=self.minutes, **self._of_slurm())
        size = ARRAY if self.cluster == "slurm" else self.workers or 1
        while jobs := list(itertools.islice(iter(partial(self._next, tasks), []), size)):
            try:
                under_way = executor.map_array(partial(_outcomes, work), jobs)
            except submitit.core.utils.FailedJobError as refused:
                raise ValueError(f"SLURM does not take the jobs: {sentence_of(refused)}") from None
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

    def _next(self, tasks: Iterator[Task]) -> list[Task]:
        """Tasks of the next job."""
        return list(itertools.islice(tasks, self.tasks_per_job))


def _outcomes(work: Work[Task], tasks: list[Task]) -> list[tuple[bytes | None, str]]:
    """What a job returns."""
    return [outcome_of(work, task)[1:] for task in tasks]


def _outcomes_of(tasks: list[Task], job: Any) -> list[Outcome[Task]]:
    try:
        return [Outcome(task, *answer) for task, answer in zip(tasks, job.result(), strict=True)]
    except (submitit.core.utils.FailedJobError, submitit.core.utils.UncompletedJobError) as lost:
        return [Outcome(task, None, f"Its job was lost: {sentence_of(lost)[:200]}.") for task in tasks]
