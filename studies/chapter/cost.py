"""Computing time against the time step, as in Fig. 13.9."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seastar_gym.gaits import STRAIGHT
from seastar_gym.scene import Numerics, Scene, Seastar
from seastar_gym.simulator import Simulator
from studies.frame import Floats
from studies.speed.strokes import repeat

BATCH = 64
"""Robots in the measured batch."""


@dataclass(frozen=True)
class Cost:
    """Computing time over simulated time, for several time steps.

    steps: Time steps [s], shape (n,).
    alone: Computing time over simulated time of a single robot, shape (n,).
    in_batch: The same ratio per robot of a batch of n_robots, shape (n,).
    regularised: Whether Newton's matrix was indefinite in some steps and therefore regularised, shape (n,).
    """

    steps: Floats
    alone: Floats
    in_batch: Floats
    n_robots: int
    regularised: NDArray[np.bool_]


def computing_seconds(simulator: Simulator, seconds: float) -> float:
    """Computing time of a stroke of the straight swim [s], the shortest of repeats that take about `seconds`.

    The shortest one counts, because other work of the machine can only add time.
    """
    commands = np.tile(STRAIGHT, (simulator.n_robots, 1))
    return min(repeat(lambda: simulator.stroke(commands), seconds, at_least=3))


def needs_regularisation(scene: Scene) -> bool:
    """Whether Newton's matrix is indefinite in some step of ten strokes of the straight swim."""
    simulator = Simulator(scene)
    return any(simulator.stroke(STRAIGHT[None]).regularised[0] > 0 for _ in range(10))


def measure_cost(robot: Seastar, steps: Floats, seconds: float, progress: Callable[[], object] = lambda: None) -> Cost:
    """Measure Fig. 13.9 on one thread; steps: Time steps [s], seconds: Duration of the measurement per point [s]."""
    alone, in_batch, regularised = [], [], []
    for step in steps:
        scene = Scene(robot, numerics=Numerics("implicit-euler", float(step)))
        period = scene.actuator.period
        alone.append(computing_seconds(Simulator(scene, 1, threads=1), seconds) / period)
        in_batch.append(computing_seconds(Simulator(scene, BATCH, threads=1), seconds) / period / BATCH)
        regularised.append(needs_regularisation(scene))
        progress()
    return Cost(steps, np.array(alone), np.array(in_batch), BATCH, np.array(regularised))
