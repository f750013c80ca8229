"""Whether a setting gathers energy over long swims.

Errors are measured over ten strokes. The implicit midpoint rule damps nothing, and on some meshes it resonates with
some steps: the robot gathers energy for a hundred strokes, and only then swims differently. Kinetic energies at the
ends of strokes tell, without a dear swim to compare with.
"""

import numpy as np
from numpy.typing import NDArray

from seastar_gym.certification.commands import CLASSES, STROKES
from seastar_gym.scene import Scene
from seastar_gym.simulator import Simulator

Floats = NDArray[np.float64]

LONG = 200
"""Strokes of a long swim."""
WINDOW = 20
"""First and last strokes whose largest energies are compared."""
ENOUGH = 20.0
"""Growth at which nothing more is to be learned."""


def energy_growth(scene: Scene, samples: int = 8, seed: int = 0) -> float:
    """Largest kinetic energy of late strokes over that of early ones, the worst of some long swims; inf for a failure.

    Robots repeat one command, or two in turn, `samples` of each, and swim the alternation of mirrored pairs. A setting
    that gathers no energy has about 1, one that resonates ten and more; at `ENOUGH` the swims end.
    """
    commands = long_swims(scene.robot.n_limbs, samples, seed)
    simulator, energies = Simulator(scene, commands.shape[1]), np.empty((LONG, commands.shape[1]))
    early = np.full(commands.shape[1], np.inf)
    for stroke in range(LONG):
        if simulator.stroke(commands[stroke % STROKES]).status.any():
            return float(np.inf)
        energies[stroke] = simulator.kinetic_energy()
        if stroke == WINDOW - 1:
            first = energies[:WINDOW].max(axis=0)
            early = np.where(first > 0.0, first, np.inf)
        if (growth := float(np.max(energies[stroke] / early))) >= ENOUGH:
            return growth
    return float(np.max(energies[-WINDOW:].max(axis=0) / early))


def long_swims(n_limbs: int, samples: int, seed: int) -> Floats:
    """Commands that are repeated in long swims, shape (STROKES, 1 + 2 samples, n_limbs)."""
    rng = np.random.default_rng(seed)
    drawn = [CLASSES[name](rng, samples, n_limbs) for name in ("repeated ternary", "alternating ternary")]
    return np.concatenate([mirrored_pairs(n_limbs)[:, None], *drawn], axis=1)


def mirrored_pairs(n_limbs: int) -> Floats:
    """Limbs 2 and n opposed, then 3 and n - 1, in turn: a fast straight gait, shape (STROKES, n_limbs)."""
    commands = np.zeros((STROKES, n_limbs))
    for stroke in range(STROKES):
        limb = 1 + stroke % max(1, (n_limbs - 1) // 2)
        commands[stroke, limb % n_limbs], commands[stroke, -limb] = 1.0, -1.0
    return commands
