"""`Workers`: threads that share the parts of a batch."""

import os
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor


class Workers:
    """Threads that share the parts of a batch. They start with the first run, and again after `close`.

    n: Number of threads. If it is 1, the caller's own thread does the work.
    """

    def __init__(self, n: int):
        self.n = n
        self._pool: ThreadPoolExecutor | None = None
        self._at_work: list[threading.Lock] = []
        self._process = os.getpid()

    def run(self, work: Callable[[int, slice], None], parts: Iterable[slice]) -> None:
        """Call work(thread, part) for all parts. A thread that has finished one takes the next.

        If a part fails or the caller is interrupted, all threads have stopped before the exception is raised.
        """
        if self.n == 1:
            for part in parts:
                work(0, part)
            return
        waiting = iter(list(parts))
        pool, at_work = self._get_pool(), self._at_work

        def take_parts(thread: int) -> None:
            with at_work[thread]:
                for part in waiting:
                    work(thread, part)

        try:
            list(pool.map(take_parts, range(self.n)))
        except BaseException:
            _stop(waiting, at_work)
            raise

    def _get_pool(self) -> ThreadPoolExecutor:
        """Pool of this process. A fork inherits its parent's pool, but not the threads in it."""
        if self._pool is None or self._process != os.getpid():
            self._process = os.getpid()
            self._at_work = [threading.Lock() for _ in range(self.n)]
            self._pool = ThreadPoolExecutor(self.n)
        return self._pool

    def close(self) -> None:
        """End the threads."""
        pool, self._pool = self._pool, None
        if pool is not None and self._process == os.getpid():
            pool.shutdown()


def _stop(waiting: Iterator[slice], at_work: Iterable[threading.Lock]) -> None:
    """Take all waiting parts away and wait for the threads. A thread that is late finds no part."""
    try:
        for _ in waiting:
            pass
        for busy in at_work:
            with busy:
                pass
    except BaseException:  # interrupted once more: the threads are waited for all the same
        _stop(waiting, at_work)
        raise
