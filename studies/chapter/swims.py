"""What the figures show: swims with the chapter's setting, with its ten nodes converged in time, and in the continuum;
and computing time against the time step, as in Fig. 13.9."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.gaits import STRAIGHT
from seastar_gym.scene import Numerics, Scene, Seastar
from seastar_gym.simulator import Simulator, SolverStatus
from studies.benchmark import repeat
from studies.frame import Floats
from studies.style import MS


@dataclass(frozen=True)
class Setting:
    """Robot and numerics of a swim, and their name in legends and tables."""

    name: str
    robot: Seastar
    numerics: Numerics

    @property
    def label(self) -> str:
        """Name in legends, with the numerics."""
        scheme = self.numerics.scheme.replace("-", " ").replace("euler", "Euler")
        return f"{self.name} ({scheme}, {MS * self.numerics.step:g} ms)"


THE_CHAPTERS = Seastar(discretisation="chapter")
CONVERGED = Numerics("implicit-midpoint", 0.25e-3)
CHAPTER = Setting("the chapter's setting", THE_CHAPTERS, Numerics("implicit-euler", 3e-3))
IN_TIME = Setting("its ten nodes, converged in time", THE_CHAPTERS, CONVERGED)
CONTINUUM = Setting("continuum, ten nodes", Seastar(nodes_per_limb=10), CONVERGED)
"""As far as infinitely many nodes to 0.01 % on the straight swim, and to 0.8 % for the pairs."""
LIMIT = Setting("continuum, 73 nodes", Seastar(nodes_per_limb=73), CONVERGED)
"""As far as infinitely many nodes to 0.02 %: pairs swim as far with 37 nodes to 0.04 %."""
SETTINGS = CHAPTER, IN_TIME, CONTINUUM


@dataclass(frozen=True)
class Swim:
    """Recorded motion of the robots of one scene.

    label: Name of the setting in legends.
    scene: Simulated scene.
    commands: Commands of every stroke, shape (n_strokes, n_robots, n_limbs).
    time: Times of the samples [s], shape (n,). The first sample is at rest, before the first stroke.
    positions, velocities: Node positions [m] and velocities [m/s], shape (n, n_robots, n_nodes, 2).
    """

    label: str
    scene: Scene
    commands: Floats
    time: Floats
    positions: Floats
    velocities: Floats

    def hub(self, robot: int = 0) -> Floats:
        """Hub positions of a robot [m], shape (n, 2)."""
        return self.positions[:, robot, 0]

    def hub_velocity(self) -> Floats:
        """Hub velocities of the first robot [m/s], shape (n, 2)."""
        return self.velocities[:, 0, 0]

    def at(self, time: float) -> int:
        """Index of the first sample that is not before a time [s]."""
        return int(np.searchsorted(self.time, time - 1e-9))

    def at_strokes(self) -> NDArray[np.intp]:
        """Indices of the samples at rest and at the end of every stroke, shape (n_strokes + 1,)."""
        ends = np.arange(len(self.commands) + 1) * self.scene.actuator.period
        return np.searchsorted(self.time, ends - 1e-9)

    def actuated(self, time: float) -> NDArray[np.bool_]:
        """Mask of the first robot's limbs that are rotated at a time [s], shape (n_limbs,)."""
        stroke, since = divmod(time + 1e-9, self.scene.actuator.period)
        turned = stroke < len(self.commands) and self.scene.actuator.delta_psi(since) > 1e-6
        active: NDArray[np.bool_] = turned & (self.commands[int(stroke) if turned else 0, 0] != 0.0)
        return active


def swim(setting: Setting, commands: ArrayLike, samples_per_stroke: int) -> Swim:
    """Simulate and record robots from rest; commands: shape (n_strokes, n_robots, n_limbs)."""
    commands = np.asarray(commands, float)
    scene = Scene(setting.robot, numerics=setting.numerics)
    simulator = Simulator(scene, commands.shape[1])
    samples = [(0.0, simulator.positions, simulator.velocities)]
    for stroke, command in enumerate(commands):
        for since in simulator.stroke_in_parts(command, samples_per_stroke):
            now = stroke * scene.actuator.period + since
            samples.append((now, simulator.positions, simulator.velocities))
        if simulator.failed.any():
            raise RuntimeError(SolverStatus.NOT_CONVERGED.sentence)
    times, positions, velocities = (np.array(values) for values in zip(*samples, strict=True))
    return Swim(setting.label, scene, commands, times, positions, velocities)


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
    return min(repeat(lambda: simulator.stroke(commands), seconds))


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
