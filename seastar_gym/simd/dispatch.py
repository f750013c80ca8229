"""Calls of compiled code whose arguments are of known types."""

from collections.abc import Callable
from typing import Any

from numba.core.registry import CPUDispatcher


def code_for(entry: Callable[..., Any], *args: Any) -> Callable[..., Any]:
    """Machine code of an entry point for arguments of the types of these, to be called with no others.

    Each call of the entry point itself looks at every array of every bundle to find out the types. What is no compiled
    entry point is returned as it is.
    """
    if not isinstance(entry, CPUDispatcher):
        return entry
    code: Callable[..., Any] = entry.compile(tuple(map(entry.typeof_pyval, args)))
    return code
