"""Where batches of a sweep, or trainings, are run: any executor of `concurrent.futures`, and those that commands make.

Results are the same bits on each. A worker that is lost costs the batch that it was at.
"""

import argparse
import os
import re
import signal
import socket
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from multiprocessing import get_context, parent_process
from pathlib import Path
from queue import SimpleQueue
from typing import Any, Generic, Literal, NamedTuple, TypeVar, get_args

from seastar_gym.command import DEFAULT, refused_by_disk
from seastar_gym.files import require_extra, within
from seastar_gym.process import processors
from seastar_gym.scene.checks import require_count, shown
from seastar_gym.sweep.designs import Batch

Task = TypeVar("Task")
Part = TypeVar("Part")
Work = Callable[[Batch], bytes]
"""What is done with a batch: a function that can be sent to another process, and that returns a file."""
KNOWN_FAILURES = (ValueError, OSError, MemoryError, ArithmeticError)
"""Failures of a batch that leave its worker sound."""
COLOUR = re.compile(r"\x1b\[[0-9;]*m")
PATIENCE = 10.0
"""Time that the head of a cluster has to answer [s]."""
LOOK = 1.0
"""Time between looks for the end of a job [s]."""


class Outcome(NamedTuple, Generic[Task, Part]):
    """What came of a task, such as a batch. part: Its results, None if there are none. problem: Why, in a sentence."""

    task: Task
    part: Part | None
    problem: str = ""


Done = Outcome[Batch, bytes]
"""What came of a batch: a file."""


def outcomes(
    executor: Executor | None, work: Callable[[Task], Part], tasks: Iterable[Task], at_once: int
) -> Iterator[Outcome[Task, Part]]:
    """Outcomes of all tasks, as they are done. The next task is taken when there is room for it.

    ValueError if the executor cancels a task: those that follow might never end.

    executor: None runs them here, one after the other. at_once: Tasks under way at most.
    """
    if executor is None:
        yield from (attempt(work, task) for task in tasks)
        return
    done, pending = SimpleQueue[Future[Outcome[Task, Part]]](), dict[Future[Outcome[Task, Part]], Task]()

    def next_done() -> Outcome[Task, Part]:
        future = done.get()
        task = pending.pop(future)
        try:
            return future.result()
        except CancelledError:  # futures of what comes next might never end
            raise ValueError(
                "The executor has cancelled its tasks, as one does whose cluster has lost its head."
            ) from None
        except Exception as lost:  # of whatever kind a worker's end is
            return Outcome(task, None, f"Its worker was lost: {sentence_of(lost)}")

    try:
        for task in tasks:
            future = executor.submit(attempt, work, task)
            pending[future] = task
            future.add_done_callback(done.put)
            while len(pending) >= at_once or not done.empty():
                yield next_done()
        while pending:
            yield next_done()
    finally:
        for future in pending:
            future.cancel()


def attempt(work: Callable[[Task], Part], task: Task) -> Outcome[Task, Part]:
    """Outcome of a task that is run now, where it is."""
    try:
        return Outcome(task, work(task))
    except KNOWN_FAILURES as failure:
        return Outcome(task, None, sentence_of(failure))


def sentence_of(failure: BaseException) -> str:
    """A failure on one line."""
    if isinstance(failure, OSError):
        return refused_by_disk(failure)
    text = COLOUR.sub("", str(failure))
    if "Traceback" in text:  # of a worker: what counts is its end
        text = text.strip().splitlines()[-1]
    return " ".join(text.split())[:200] or type(failure).__name__


class Processes(ThreadPoolExecutor):
    """Processes of this machine. One that dies costs what it was at alone, and another takes its place.

    workers: How many; one per processor if None.
    """

    def __init__(self, workers: int | None = None):
        if workers is not None:
            require_count("workers", workers, 1, 4096)
        super().__init__(workers or processors())
        self._own, self._running, self._pools = threading.local(), set[int](), set[ProcessPoolExecutor]()

    def submit(self, work: Any, /, *arguments: Any, **named: Any) -> Future[Any]:
        """Run a function in one of the processes."""
        return super().submit(self._in_process, work, *arguments, **named)

    def _in_process(self, work: Any, *arguments: Any, **named: Any) -> Any:
        """What a thread does: its process, a pool of one, works for it."""
        own = self._own
        try:
            if not hasattr(own, "pool"):
                own.pool = ProcessPoolExecutor(1, get_context("spawn"), end_with_parent)
                self._pools.add(own.pool)
                own.process = own.pool.submit(os.getpid).result()
                self._running.add(own.process)
            return own.pool.submit(work, *arguments, **named).result()
        except BrokenExecutor:
            self._running.discard(vars(own).pop("process", 0))
            del own.pool
            raise

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes, and what they are at if futures are to be cancelled."""
        super().shutdown(False, cancel_futures=cancel_futures)
        for process in [*self._running] if cancel_futures else ():
            with suppress(ProcessLookupError):
                os.kill(process, signal.SIGTERM)
        super().shutdown(wait)
        for pool in self._pools:  # or their own threads may end while Python does, which then tells of a closed pipe
            pool.shutdown(wait)


def end_with_parent() -> None:
    """Have this process leave Ctrl-C to its parent, and end when that does, however it ends."""
    parent = parent_process()

    def follow() -> None:
        assert parent is not None
        parent.join()
        os._exit(1)

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=follow, daemon=True).start()


class RayTasks(Executor):
    """Tasks of a Ray cluster, one processor each. Nodes need this package and its extras.

    address: Of its head, "HOST:6379". None starts a cluster of this machine. workers: Its processors then.
    """

    def __init__(self, address: str | None = None, workers: int | None = None):
        import ray

        own: dict[str, Any] = {} if address else {"num_cpus": workers, "include_dashboard": False}
        if address:
            require_reachable(address)
        try:
            ray.init(address or "local", log_to_driver=False, logging_level="error", **own)
        except (ConnectionError, RuntimeError) as refused:
            raise ValueError(
                f"Ray does not start, or is not at {address}: {sentence_of(refused)} (a head with tokens needs "
                "RAY_AUTH_MODE=token)"
            ) from None
        self._ray = ray
        self._call = ray.remote(num_cpus=1, max_retries=0)(lambda work, *arguments: work(*arguments))

    def submit(self, work: Any, /, *arguments: Any, **named: Any) -> Future[Any]:
        """Run a function on the cluster. Ray does not repeat what is lost with its worker or node."""
        future: Future[Any] = self._call.remote(work, *arguments, **named).future()
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Leave the cluster, which ends what is under way."""
        self._ray.shutdown()


class SlurmJobs(ThreadPoolExecutor):
    """Jobs of SLURM, through submitit. Nodes and this process share the folder of their files.

    jobs: At a time at most. cluster: "slurm", or "local" for processes of this machine, as submitit starts them.
    parameters: Of submitit's executor, such as timeout_min and slurm_partition.
    """

    def __init__(self, folder: str | Path, jobs: int = 64, cluster: str = "slurm", **parameters: Any):
        import submitit

        try:
            self._jobs = submitit.AutoExecutor(folder, cluster=cluster)
        except RuntimeError as refused:
            raise ValueError(f"There is no SLURM here: {sentence_of(refused)}") from None
        self._jobs.update_parameters(**parameters)
        self._ended = threading.Event()
        super().__init__(jobs)

    def submit(self, work: Any, /, *arguments: Any, **named: Any) -> Future[Any]:
        """Run a function as a job, for which a thread waits."""
        return super().submit(self._as_job, work, *arguments, **named)

    def _as_job(self, work: Any, *arguments: Any, **named: Any) -> Any:
        """What a thread does: its job works for it, and is cancelled at the end."""
        job = self._jobs.submit(work, *arguments, **named)
        while not job.done():
            if self._ended.wait(LOOK):
                job.cancel()
                raise CancelledError("The job was cancelled.")
        return job.result()

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Wait for the jobs, or cancel them if futures are to be cancelled."""
        if cancel_futures:
            self._ended.set()
        super().shutdown(wait, cancel_futures=cancel_futures)


def dask_client(address: str | None = None, workers: int | None = None) -> Any:
    """Client of a Dask cluster, whose `get_executor()` is an executor; a context that closes it.

    address: Of the scheduler, "HOST:8786". None starts a cluster of this machine, with so many workers.
    """
    from distributed import Client

    if address:
        require_reachable(address.removeprefix("tcp://"), speaks_first=True)
        return Client(address, timeout=PATIENCE)
    return Client(n_workers=workers or processors(), threads_per_worker=1)


def require_reachable(address: str, speaks_first: bool = False) -> None:
    """ValueError unless something listens at "HOST:PORT": clusters themselves would try for minutes.

    speaks_first: Whether it must send something at once, as schedulers of Dask do, and web pages do not.
    """
    host, _, port = address.rpartition(":")
    if not host or not port.isdecimal():
        raise ValueError(f"The address of a cluster is HOST:PORT, such as head:6379, not {shown(address)}.")
    try:
        with socket.create_connection((host, int(port)), timeout=PATIENCE) as there:
            if speaks_first and not there.recv(1):
                raise ConnectionError("it says nothing")
    except (OSError, OverflowError) as refused:
        raise ValueError(f"There is no cluster at {address}: {sentence_of(refused)}") from None


Where = Literal["processes", "here", "ray", "slurm", "dask"]
"""Processes of this machine, this process, or a cluster."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add --executor, --workers, --address and --partition to a parser."""
    parser.add_argument(
        "--executor", choices=get_args(Where), default="processes",
        help=f"where batches run: processes of this machine, this process, or a cluster {DEFAULT}",
    )  # fmt: skip
    parser.add_argument("--workers", type=int, help="batches at a time (default: one per processor; of SLURM, 64)")
    parser.add_argument("--address", help="Ray, Dask: HOST:PORT of the head (default: a cluster of this machine)")
    parser.add_argument("--partition", help="SLURM: partition")
    parser.add_argument("--minutes", type=int, help="SLURM: time limit of a job [min] (default: 60)")


@contextmanager
def executor_of(options: Any) -> Iterator[Executor | None]:
    """Context with the executor that options name. It says at once what is missing, and ends with the context.

    options: What `add_options` adds, and the folder of results, `out`.
    """
    for name, largest in {"workers": 1_000_000, "minutes": 100_000}.items():
        if getattr(options, name) is not None:
            require_count(f"--{name}", getattr(options, name), 1, largest)
    for name, heeded in {"address": ("ray", "dask"), "partition": ("slurm",), "minutes": ("slurm",)}.items():
        if getattr(options, name) is not None and options.executor not in heeded:
            raise ValueError(f"--{name} is for --executor {' or '.join(heeded)}, not {options.executor}.")
    executor: Executor
    match options.executor:
        case "here":
            yield None
            return
        case "dask":
            require_extra("Runs on Dask", "dask", "distributed")
            with dask_client(options.address, options.workers) as client:
                yield client.get_executor()
            return
        case "ray":
            require_extra("Runs on Ray", "ray", "ray")
            executor = RayTasks(options.address, options.workers)
        case "slurm":
            require_extra("Runs on SLURM", "slurm", "submitit")
            own: dict[str, Any] = {"timeout_min": 60 if options.minutes is None else options.minutes}
            own |= {} if options.partition is None else {"slurm_partition": options.partition}
            executor = SlurmJobs(within(options.out, "slurm"), options.workers or 64, cpus_per_task=1, **own)
        case _:
            executor = Processes(options.workers)
    try:
        yield executor
    finally:
        executor.shutdown(cancel_futures=True)
