"""Real-time factors of settings."""

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.accuracy.measure import Progress
from seastar_gym.gaits import STRAIGHT
from seastar_gym.scene import Scene
from seastar_gym.simulator import Simulator
from studies.accuracy.cases import random_sequences

Floats = NDArray[np.float64]


def measure_speeds(scenes: Sequence[Scene], rounds: int, progress: Progress, n_robots: int = 32) -> Floats:
    """Real-time factors on one core for mixed commands and for the straight swim, shape (len(scenes), 2).

    Every round times all settings once, after the first stroke from rest. The best round counts, because other work of
    the machine can only add time.
    """
    mixed = random_sequences(n_robots, np.random.default_rng(1)).commands[:3]
    workloads = [mixed, np.broadcast_to(STRAIGHT, mixed.shape)]
    best = np.full((len(scenes), 2), np.inf)
    simulators: dict[tuple[int, int], tuple[Simulator, Any]] = {}
    for turn in range(rounds):
        for k, scene in enumerate(scenes):
            for w, commands in enumerate(workloads):
                if (k, w) not in simulators:
                    simulator = Simulator(scene, n_robots, threads=1)
                    simulator.stroke(commands[0])
                    simulators[k, w] = simulator, simulator.get_state()
                simulator, state = simulators[k, w]
                simulator.set_state(state)
                start = time.thread_time()
                for command in commands[1:]:
                    simulator.stroke(command)
                best[k, w] = min(best[k, w], time.thread_time() - start)
            progress((turn + (k + 1) / len(scenes)) / rounds)
    simulated = n_robots * (len(mixed) - 1) * Scene().actuator.period
    return simulated / best
