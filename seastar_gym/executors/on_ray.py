"""`RayTasks`: tasks as those of Ray Core, on a running cluster or one of this machine."""

import socket
from collections.abc import Iterator
from typing import Any

import ray
from ray.exceptions import RayError, RayTaskError

from seastar_gym.executors import Outcome, Task, Work, sentence_of
from seastar_gym.executors.here import outcome_of
from seastar_gym.scene.checks import shown

AHEAD = 2
"""Tasks under way for every processor of the cluster, so that none waits for the next."""
PATIENCE = 10.0
"""Time after which the size of the cluster is asked for again while no task is done, or for its head to answer [s]."""


class RayTasks:
    """Runs tasks as those of Ray, one processor each.

    Nodes need this package and its extras; results come back to this process, which alone writes files.

    address: Address of a cluster's head, "HOST:6379". None starts a cluster of this machine and stops it in the end.
    workers: Tasks at a time at most; as many as the cluster has processors if None.
    """

    def __init__(self, address: str | None = None, workers: int | None = None):
        self.address, self.workers = address, workers

    def run(self, work: Work[Task], tasks: Iterator[Task]) -> Iterator[Outcome[Task]]:
        """Run all tasks. Those that are lost with their worker or node are not repeated by Ray."""
        began = connect(self.address, self.workers)
        remote = ray.remote(num_cpus=1, max_retries=0)(_outcome)
        pending: dict[Any, Task] = {}
        try:
            while self._fill(pending, remote, work, tasks):
                done, _ = ray.wait(list(pending), timeout=PATIENCE)
                for reference in done:
                    yield _outcome_of(pending.pop(reference), reference)
        finally:
            for reference in pending:
                ray.cancel(reference, force=True)
            if began:
                ray.shutdown()

    def _fill(self, pending: dict[Any, Task], remote: Any, work: Work[Task], tasks: Iterator[Task]) -> bool:
        """Give tasks while there is room for them; whether any are under way."""
        room = self.workers or AHEAD * max(1, int(ray.cluster_resources().get("CPU", 1)))
        while len(pending) < room:
            task = next(tasks, None)
            if task is None:
                break
            pending[remote.remote(work, task)] = task
        return bool(pending)


def connect(address: str | None, workers: int | None) -> bool:
    """Connect to the cluster of a head, or start one of this machine for None; whether that was done now.

    workers: Processors of a cluster that is started; those of this machine if None.
    """
    if ray.is_initialized():
        return False
    if address:
        require_reachable(address)
    own: dict[str, Any] = {} if address else {"num_cpus": workers, "include_dashboard": False}
    try:
        ray.init(address or "local", log_to_driver=False, logging_level="error", **own)
    except (ConnectionError, RuntimeError) as refused:
        where = f"There is no Ray cluster at {address}" if address else "Ray does not start here"
        raise ValueError(f"{where}: {sentence_of(refused)}") from None
    return True


def require_reachable(address: str) -> None:
    """ValueError unless something listens at "HOST:PORT": Ray itself would try for minutes."""
    host, _, port = address.rpartition(":")
    if not host or not port.isdecimal():
        raise ValueError(f"The address of a Ray cluster is HOST:PORT, such as head:6379, not {shown(address)}.")
    try:
        socket.create_connection((host, int(port)), timeout=PATIENCE).close()
    except (OSError, OverflowError) as refused:
        raise ValueError(f"There is no Ray cluster at {address}: {sentence_of(refused)}.") from None


def _outcome(work: Work[Task], task: Task) -> tuple[bytes | None, str]:
    """What a task of Ray returns."""
    outcome = outcome_of(work, task)
    return outcome.part, outcome.problem


def _outcome_of(task: Task, reference: Any) -> Outcome[Task]:
    try:
        return Outcome(task, *ray.get(reference))
    except RayTaskError as failure:
        return Outcome(task, None, sentence_of(failure.cause or failure))
    except RayError as failure:
        return Outcome(task, None, f"Its worker was lost: {type(failure).__name__}.")
