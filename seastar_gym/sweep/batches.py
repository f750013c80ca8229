"""Batches: designs that are simulated side by side, named by the digest of all that their results depend on."""

import hashlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from seastar_gym.sweep.configurations import Configuration

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Batch:
    """One lane batch. numbers: Numbers of each robot by name, shape (n_robots,) each; () where all are alike."""

    configuration: Configuration
    numbers: dict[str, Floats]
    n_robots: int

    @cached_property
    def name(self) -> str:
        """Digest of the scene with its numerics, the commands, the numbers and the package's version."""
        digest = hashlib.sha256(self.configuration.digest)
        digest.update(str(self.n_robots).encode())
        for name, values in self.numbers.items():
            digest.update(name.encode() + b"\0" + np.ascontiguousarray(values, np.float64).tobytes())
        return digest.hexdigest()[:40]
