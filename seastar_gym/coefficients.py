"""What a scene's numbers are to the kernels: one set for all lane groups, or one for each with a lane per robot."""

import numpy as np
from numpy.typing import NDArray

from seastar_gym.der.lanes import N_LANES
from seastar_gym.der.rods import Rods, put_robot, side_by_side
from seastar_gym.per_robot import frame_of
from seastar_gym.scene import Scene


class Coefficients:
    """Of a batch of robots of one scene, shared by all lane groups where no number differs from robot to robot."""

    def __init__(self, scene: Scene, n_robots: int):
        if scene.n_robots not in (None, n_robots):
            raise ValueError(f"The scene has numbers for {scene.n_robots} robots, the batch {n_robots}.")
        self.n_robots, self._scene = n_robots, scene
        self._rods = [scene.rods()] if scene.n_robots is None else self._rods_of_groups()

    def _rods_of_groups(self) -> list[Rods]:
        robots = [self._scene.rods(robot) for robot in range(self.n_robots)]
        robots += robots[-1:] * (-len(robots) % N_LANES)
        return [side_by_side(robots[first : first + N_LANES]) for first in range(0, len(robots), N_LANES)]

    @property
    def are_shared(self) -> bool:
        """Whether all lane groups have the same."""
        return self._scene.n_robots is None

    def rods(self, group: int) -> Rods:
        """Those of a lane group."""
        return self._rods[group % len(self._rods)]

    def changed(self, scene: Scene, chosen: NDArray[np.bool_]) -> "Coefficients":
        """Those of a scene that differs in numbers of `PER_ROBOT` alone, for the chosen robots only where it can be.

        Robots that were not chosen keep their numbers, unless one of the scenes has the same for all.
        """
        if not isinstance(scene, Scene) or frame_of(scene) != frame_of(self._scene):
            raise ValueError("set_scene needs a scene of the same terms that differs in numbers of each robot alone.")
        if self.are_shared or scene.n_robots != self.n_robots:
            return Coefficients(scene, self.n_robots)
        self._scene = scene
        for robot in np.flatnonzero(chosen):
            group, lane = divmod(int(robot), N_LANES)
            put_robot(self._rods[group], lane, scene.rods(int(robot)))
        return self
