"""Arrays that a batch writes the results of a step into."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene.checks import require_kind


class Buffers(NamedTuple):
    """Arrays of one step of a batch, such as rows of a learner's memory; none of them shares memory with another.

    observations: Shape (num_envs, size). rewards, terminated, truncated: Shape (num_envs,), numbers and flags.
    """

    observations: NDArray[Any]
    rewards: NDArray[Any]
    terminated: NDArray[Any]
    truncated: NDArray[Any]

    def take(self, results: Buffers) -> None:
        """Write the results of a step."""
        for buffer, result in zip(self, results, strict=True):
            buffer[...] = result


def require_buffers(out: Buffers, n_robots: int, size: int) -> None:
    """ValueError, with one sentence, for arrays that cannot take the results of so many robots."""
    require_kind("out", out, Buffers, "Buffers")
    shapes = {"observations": (n_robots, size)}
    for name, buffer in out._asdict().items():
        shape, kind = shapes.get(name, (n_robots,)), "f" if name in ("observations", "rewards") else "b"
        fits = isinstance(buffer, np.ndarray) and buffer.shape == shape and buffer.dtype.kind == kind
        if not fits or not buffer.flags.writeable:
            what = "numbers" if kind == "f" else "flags"
            raise ValueError(f"out.{name} must be a writeable array of {what} of shape {shape}.")
