"""Many robots from many states through one interval: the step of a tree search in time."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene import Scene
from seastar_gym.scene.actuators.actuator import complete
from seastar_gym.simulator import Simulator, State

Floats = NDArray[np.float64]

CHUNK = 512
"""Robots that are simulated in one batch. Their memory stays in a processor's cache."""


class Interval(NamedTuple):
    """States after an interval, and the time for which wires were heated in it [s], shape (n_robots,)."""

    states: State
    heated: Floats


class Branches:
    """Simulation of intervals of a scene [s] from any number of states."""

    def __init__(self, scene: Scene, seconds: float):
        self.scene, self.seconds = scene, seconds
        self._simulators: dict[int, Simulator] = {}

    def _simulator(self, n_robots: int) -> Simulator:
        if n_robots not in self._simulators:
            self._simulators[n_robots] = Simulator(self.scene, n_robots)
        return self._simulators[n_robots]

    def at_rest(self) -> State:
        """State of one robot at rest."""
        return Simulator(self.scene).get_state()

    def deaf_wires(self, states: State) -> NDArray[np.bool_]:
        """Wires that cannot be heated now, shape (n_robots, n_limbs, 2)."""
        assert states.actuators is not None
        known = complete(self.scene.actuator).deaf_wires(states.actuators)
        assert known is not None
        return known

    def swim(self, states: State, commands: Floats) -> Interval:
        """One interval with commands, shape (n_robots, n_limbs)."""
        parts = [self._swim(states, commands, begin) for begin in range(0, len(commands), CHUNK)]
        swum, heated = zip(*parts, strict=True)
        return Interval(State.joined(swum), np.concatenate(heated))

    def _swim(self, states: State, commands: Floats, begin: int) -> Interval:
        n = len(commands) - begin
        size = min(CHUNK, 1 << (n - 1).bit_length())
        chosen = np.minimum(begin + np.arange(size), len(commands) - 1)  # the last robot fills the batch
        simulator = self._simulator(size)
        simulator.set_state(states.of_robots(chosen))
        report = simulator.advance(self.seconds, commands[chosen])
        return Interval(simulator.get_state().of_robots(slice(n)), report.heating_time[:n])
