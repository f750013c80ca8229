"""`StrokeLock`: one stroke or other interval at a time changes a simulator, and an interrupted change is noticed."""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager

PAUSED = (
    "A stroke_in_parts or advance_in_parts of this simulator is under way: run it to its end, or close() it, which "
    "undoes it, before anything else."
)
ELSEWHERE = "Another thread is in the middle of a stroke of this simulator: take turns, or give each thread its own."
BROKEN_OFF = (
    "This simulator was interrupted in the middle of a change, so its robots and its clock may not belong together: "
    "call reset() or set_state() first."
)


def _this_thread() -> tuple[int, int]:
    return os.getpid(), threading.get_ident()


class StrokeLock:
    """Lock that a stroke or another change of a simulator holds.

    A stroke is held by its thread, and during a pause by the stroke alone. A thread that asks for a lock which it
    holds already was interrupted before it could release it: the simulator is then `broken` until it is repaired.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._holder: object | None = None
        self._thread: tuple[int, int] | None = None
        self.broken = False

    def acquire(self, intact: bool = False) -> object:
        """Begin a change. Returns its holder for `resume`; RuntimeError while another change is under way.

        intact: Whether to refuse it after a change that was interrupted, too.
        """
        with self._lock:
            if self._holder is not None:
                self._refuse_others()
            if intact and self.broken:
                raise RuntimeError(BROKEN_OFF)
            self._holder, self._thread = object(), _this_thread()
            return self._holder

    def _refuse_others(self) -> None:
        """RuntimeError if another thread holds the lock. Threads of a parent process do not run in a fork."""
        if self._thread is None:
            raise RuntimeError(PAUSED)
        if self._thread[0] == os.getpid() and self._thread != _this_thread():
            raise RuntimeError(ELSEWHERE)
        self.broken = True

    def require_intact(self) -> None:
        """RuntimeError if a change was interrupted or another thread is making one. A paused stroke is allowed."""
        with self._lock:
            if self._thread is not None:
                self._refuse_others()
            if self.broken:
                raise RuntimeError(BROKEN_OFF)

    def pause(self) -> None:
        """Keep the lock for the stroke, whichever thread continues it."""
        self._thread = None

    def resume(self, holder: object) -> bool:
        """Continue a stroke in this thread. Returns whether it still holds the lock."""
        with self._lock:
            if self._holder is holder:
                self._thread = _this_thread()
            return self._holder is holder

    def release(self) -> None:
        """End a completed change."""
        with self._lock:
            self._holder = self._thread = None

    @contextmanager
    def change(self, repairs: bool = False) -> Iterator[None]:
        """Context of a change. repairs: Whether it repairs what an interrupted change left."""
        self.acquire()
        try:
            yield
        except ValueError:  # refused before anything changed
            self.release()
            raise
        if repairs:
            self.broken = False
        self.release()
