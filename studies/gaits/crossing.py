"""Do limbs swim through each other? Snapshots of a gait in which two limbs cross."""

import itertools

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene import Scene
from seastar_gym.scene.shape import cross_at_rest
from seastar_gym.simulator import Simulator

Floats = NDArray[np.float64]

SNAPSHOTS = 100
"""Snapshots of a gait, about evenly spread over its first periods."""
PERIODS = 4


def crossings(scene: Scene, gait: Floats, slot: float) -> int:
    """Percent of snapshots in which limbs cross. gait: Pulses, shape (n_slots, n_limbs). slot: Length of a slot [s]."""
    simulator, parts = Simulator(scene, 1), max(1, round(SNAPSHOTS / (PERIODS * len(gait))))
    crossed = [
        limbs_cross(simulator.positions[0], scene.robot.n_limbs)
        for commands in np.tile(gait, (PERIODS, 1))
        for _ in simulator.advance_in_parts(slot, commands[None], parts)
    ]
    return round(100.0 * float(np.mean(crossed)))


def limbs_cross(positions: Floats, n_limbs: int) -> bool:
    """Whether two limbs of a robot cross; positions: Those of its nodes [m], shape (n_nodes, 2)."""
    return cross_at_rest(positions, n_limbs, list(itertools.combinations(range(n_limbs), 2)))
