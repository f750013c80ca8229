"""The process: how many processors it may use, and Ctrl-C that waits.

Ctrl-C waits while numba is imported, compiles or loads code, and while scipy or pygame are imported: what is broken off
leaves libraries half there, and the process without a simulator.
"""

import contextlib
import os
import signal
import threading
from collections.abc import Callable, Iterator
from types import FrameType
from typing import Any

_waiting: list[tuple[int, FrameType | None]] = []
_handlers: list[Callable[[int, FrameType | None], Any]] = []


def _hold(number: int, frame: FrameType | None) -> None:
    """Handler of SIGINT meanwhile."""
    _waiting.append((number, frame))


def _restore(handler: Callable[[int, FrameType | None], Any]) -> None:
    """Let a handler have what comes from now on, and what has waited."""
    if signal.getsignal(signal.SIGINT) is _hold:
        signal.signal(signal.SIGINT, handler)
    waited = _waiting[:1]
    _waiting.clear()
    for given in waited:
        handler(*given)


def _handler_here() -> Any:
    """Handler that an interrupt would call in this thread: signals interrupt the main one only."""
    return signal.getsignal(signal.SIGINT) if threading.current_thread() is threading.main_thread() else None


@contextlib.contextmanager
def held_back() -> Iterator[None]:
    """Context at the end of which SIGINT is handled that comes within, by the handler that was there.

    Where no handler in Python would run, as in other threads or where SIGINT is ignored, and within another such
    context, it changes nothing.
    """
    handler = _handler_here()
    if not callable(handler) or handler is _hold:
        yield
        return
    signal.signal(signal.SIGINT, _hold)
    _handlers[:] = [handler]
    try:
        yield
    finally:
        _restore(handler)


@contextlib.contextmanager
def let_through() -> Iterator[None]:
    """Context in which SIGINT does not wait, although it does around it: to wait for another process."""
    if _handler_here() is not _hold:
        yield
        return
    try:
        _restore(_handlers[0])
        yield
    finally:
        signal.signal(signal.SIGINT, _hold)


def processors() -> int:
    """Number of the processors that this process may use, which may be fewer than the machine has."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
