"""Calls of compiled code whose arguments are of known types."""

from collections.abc import Callable, Hashable
from typing import Any

from numba.core.registry import CPUDispatcher


class KnownCode:
    """Machine code of entry points by what the types of their arguments depend on.

    Called by itself, an entry point looks at every array of every bundle each time to find out their types.
    """

    def __init__(self) -> None:
        self._codes: dict[tuple[Any, Hashable], Callable[..., None]] = {}

    def call(self, kind: Hashable, entry: Callable[..., None], *args: Any) -> None:
        """Call an entry point. All calls of it with one `kind` have arguments of the same types."""
        key = entry, kind
        if key not in self._codes:
            self._codes[key] = code_for(entry, *args)
        self._codes[key](*args)


def code_for(entry: Callable[..., Any], *args: Any) -> Callable[..., Any]:
    """Machine code of an entry point for arguments of the types of these; what is no entry point, as it is."""
    if not isinstance(entry, CPUDispatcher):
        return entry
    code: Callable[..., Any] = entry.compile(tuple(map(entry.typeof_pyval, args)))
    return code
