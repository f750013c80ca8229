"""Whether a setting gathers energy over long swims.

Errors are measured over ten strokes. The implicit midpoint rule damps nothing, and on some meshes it resonates with
some steps: the robot gathers energy for a hundred strokes, and only then swims differently. Kinetic energies at the
ends of strokes tell, without a swim of short steps to compare with. They are relative to the water, which may carry the
robot off.
"""

import warnings

import numpy as np
from numpy.typing import NDArray

from seastar_gym.accuracy.commands import CLASSES, STROKES
from seastar_gym.accuracy.water import with_the_water
from seastar_gym.scene import Scene
from seastar_gym.simulator.growth import ENOUGH, WINDOW

Floats = NDArray[np.float64]

LONG = 200
"""Strokes of a long swim."""
NOISE = 1e-6
"""Share of the largest early energy of all swims, below which an energy is noise. Equal limbs that all turn alike end
their strokes at rest, with 1e-20 to 1e-28 of it, which is rounding; other swims of 2 to 6 equal limbs have at least
0.1."""


def energy_growth(scene: Scene, samples: int = 8, seed: int = 0) -> float:
    """Largest kinetic energy of late strokes over that of early ones, the worst of some long swims; inf for a failure.

    Robots repeat one command, or two in turn, `samples` of each, and swim the alternation of mirrored pairs. A setting
    that gathers no energy has about 1, one that resonates ten and more; at `ENOUGH` the swims end.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "The kinetic energy", RuntimeWarning)  # it is told by the result
        return float(_energy_growths(scene, long_swims(scene.robot.n_limbs, samples, seed)).max())


def _energy_growths(scene: Scene, commands: Floats) -> Floats:
    """Growth of the energy of each long swim, shape (1 + 2 samples,)."""
    n = commands.shape[1]
    simulator, energies, failed = with_the_water(scene, n), np.empty((LONG, n)), np.zeros(n, bool)
    for stroke in range(LONG):
        failed |= simulator.stroke(commands[stroke % STROKES]).status > 0
        energies[stroke] = simulator.kinetic_energy(relative_to_water=True)
        growth = _growth(energies[:WINDOW], energies[stroke : stroke + 1]) if stroke >= WINDOW else np.zeros(n)
        growth[failed] = np.inf
        if growth.max() >= ENOUGH:
            return growth
    return np.where(failed, np.inf, _growth(energies[:WINDOW], energies[-WINDOW:]))


def _growth(early: Floats, late: Floats) -> Floats:
    """Largest late energy over the largest early one of the same swim; both of shape (strokes, n)."""
    first = early.max(axis=0)
    least = max(NOISE * first.max(), np.finfo(float).tiny)
    return np.asarray(late.max(axis=0) / np.maximum(first, least))


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
