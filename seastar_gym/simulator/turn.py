"""`Turn`: one stroke at a time changes a simulator, and one that was broken off in the middle of a change is known."""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager

PAUSED = (
    "A stroke_in_parts of this simulator is under way: run it to its end, or close() it, which undoes it, before "
    "anything else."
)
ELSEWHERE = "Another thread is in the middle of a stroke of this simulator: take turns, or give each thread its own."
BROKEN_OFF = (
    "This simulator was interrupted in the middle of a change, so its robots and its clock may not belong together: "
    "call reset() or set_state() first."
)


def _this_thread() -> tuple[int, int]:
    return os.getpid(), threading.get_ident()


class Turn:
    """Whose turn it is to change a simulator.

    Idle, nobody has it. In a stroke, the stroke's thread has it, or the stroke alone while it pauses. Whoever asks and
    has it already was interrupted: nothing gave the turn back, so that the simulator is `broken` until it is cured.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._holder: object | None = None
        self._thread: tuple[int, int] | None = None
        self.broken = False

    def take(self) -> object:
        """Begin a change: returns what the turn is given back with. RuntimeError while it is somebody else's."""
        with self._lock:
            self._refuse_others()
            self._holder, self._thread = object(), _this_thread()
            return self._holder

    def _refuse_others(self) -> None:
        """Where the holder is this thread, or one of a process that this one was forked from, nobody is at it."""
        if self._holder is None:
            return
        if self._thread is None:
            raise RuntimeError(PAUSED)
        if self._thread[0] == os.getpid() and self._thread != _this_thread():
            raise RuntimeError(ELSEWHERE)
        self.broken = True

    def require_whole(self) -> None:
        """Refuse to go on from a broken state, or from one that another thread is changing; a pause is fine."""
        with self._lock:
            if self._thread is not None:
                self._refuse_others()
            if self.broken:
                raise RuntimeError(BROKEN_OFF)

    def pause(self) -> None:
        """Keep the turn for the stroke, whichever thread goes on with it."""
        self._thread = None

    def resume(self, holder: object) -> bool:
        """Whether it is still this holder's turn; its thread is this one from now on."""
        with self._lock:
            if self._holder is holder:
                self._thread = _this_thread()
            return self._holder is holder

    def give_back(self) -> None:
        """End a change that is whole."""
        with self._lock:
            self._holder = self._thread = None

    @contextmanager
    def change(self, cures: bool = False) -> Iterator[None]:
        """Around a change of its own; if it `cures`, nothing is left of what was broken."""
        self.take()
        try:
            yield
        except ValueError:  # refused before anything changed
            self.give_back()
            raise
        if cures:
            self.broken = False
        self.give_back()
