"""Memory of a tape: bundles of coefficients and of work whose rows of robots stand on it."""

from collections import namedtuple
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.der.rods import Work
from seastar_gym.gradients.history import OF_STAGE, OF_STEP
from seastar_gym.gradients.on_tape import Replayed
from seastar_gym.gradients.stencils import arrays_of
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simd.rows import aligned_rows
from seastar_gym.simd.tape_lanes import FACTOR, PLACE, ROW

Floats = NDArray[np.float64]

WorkOfGradient = namedtuple("WorkOfGradient", (*Work._fields, "kept", "replayed"))  # type: ignore[misc]
"""`Work` with a history, see history.py, or with a step that is replayed, see replay.py."""


def as_rows_of_tape(bundle: Any) -> Any:
    """A bundle whose rows of robots are rows of a tape: values, and factors and place, which are 0."""
    return widened(bundle, ROW)


def widened(bundle: Any, width: int) -> Any:
    """A bundle whose rows of robots, shape (n, N_LANES), have zeros behind them, shape (n, width)."""
    if isinstance(bundle, np.ndarray) and bundle.ndim == 2:
        rows = aligned_rows(len(bundle), width)
        rows[:, :N_LANES] = bundle
        return rows
    if hasattr(bundle, "_fields"):
        return bundle._replace(**{name: widened(getattr(bundle, name), width) for name in bundle._fields})
    return bundle


def works(own: Work, residual: Floats, n_stages: int, n_points: int) -> tuple[Any, Work]:
    """Memory on a tape, and on the lanes of `Simulator`; its rows stand one behind the other in both, see Replayed."""
    n_lists, n_rows = (sum(len(part) for part in arrays_of(own) if part.ndim == n) for n in (1, 2))
    memory, lists = np.zeros((n_rows, ROW)), np.zeros(n_lists)
    slots = 1 if n_stages == 1 else n_stages + 1
    of_stages, of_lists = aligned_rows(slots, n_rows, N_LANES), np.zeros((slots, n_lists))
    replayed = Replayed(
        np.zeros((OF_STEP + 1, ROW)), np.zeros((n_stages * (OF_STAGE + 2 * n_points), ROW)), np.zeros(1),
        np.zeros(n_stages), residual, memory.ravel(), lists, of_stages.ravel(), of_lists.ravel(), n_rows, n_lists,
    )  # fmt: skip
    on_tape = WorkOfGradient(*_in_memory(own, memory, lists), None, replayed)  # type: ignore[call-arg]
    return on_tape, _in_memory(own, of_stages[-1], of_lists[-1])


def _in_memory(bundle: Any, rows: Floats, lists: Floats) -> Any:
    """A bundle whose arrays stand in these, one behind the other: rows of robots, and what robots share."""
    taken = [0, 0]

    def placed(part: Any) -> Any:
        if isinstance(part, np.ndarray):
            begin = taken[part.ndim - 1]
            taken[part.ndim - 1] += len(part)
            return (lists, rows)[part.ndim - 1][begin : begin + len(part)]
        if hasattr(part, "_fields"):
            return part._replace(**{name: placed(getattr(part, name)) for name in part._fields})
        return part

    return placed(bundle)


def with_places(bundle: Any, moved: Sequence[NDArray[np.bool_]]) -> int:
    """Give those rows of a tape that are moved their places, from 1 on, in the order of `arrays_of`; how many."""
    n = 0
    for rows, some in zip(arrays_of(bundle), moved, strict=True):
        if rows.ndim == 2:
            count = int(some.sum())
            rows.view(np.int64)[some, PLACE] = np.arange(n + 1, n + 1 + count)
            rows[some, FACTOR:PLACE] = 1.0
            n += count
    return n
