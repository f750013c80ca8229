"""`Coefficients`: coefficients and limits of a batch of robots, one set for all lane groups or one for each."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from seastar_gym.der.rods import Rods
from seastar_gym.der.stepping.scales import Limits
from seastar_gym.model.rods import make_limits, make_rods
from seastar_gym.scene import Scene
from seastar_gym.scene.per_robot import frame_of, of_robot
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simd.rows import put_robot, side_by_side

Floats = NDArray[np.float64]


class Coefficients:
    """Coefficients of a batch of robots of one scene.

    If no number differs from robot to robot, all lane groups share one set. Otherwise each has its own, with one robot
    per lane.

    are_shared: Whether all lane groups share one set.
    n_changes: How often `set_scene` has changed them.
    rest: Node positions at rest [m], shape (n_sets, 2 n_nodes, N_LANES). With a body, its angle and the roots of its
        limbs follow, see der/star.py: 2 + 2 n_limbs rows more.
    limb_length: Limb length L of the robot [m], shape (n_sets, 1, N_LANES).
    """

    def __init__(self, scene: Scene, n_robots: int):
        self.n_robots = n_robots
        self.n_changes = 0
        self._make(scene)

    def _make(self, scene: Scene) -> None:
        if scene.n_robots not in (None, self.n_robots):
            raise ValueError(f"The scene has numbers for {scene.n_robots} robots, the batch {self.n_robots}.")
        self._scene, self.are_shared = scene, scene.n_robots is None
        n_sets = 1 if self.are_shared else -(-self.n_robots // N_LANES)
        if self.are_shared:
            self._rods, self._limits = [make_rods(scene)], [make_limits(scene)]
        else:
            # Lanes left over repeat the last robot.
            robots = np.minimum(np.arange(n_sets * N_LANES), self.n_robots - 1).reshape(n_sets, N_LANES).tolist()
            self._rods = [side_by_side([make_rods(scene, robot) for robot in group]) for group in robots]
            self._limits = [side_by_side([make_limits(scene, robot) for robot in group]) for group in robots]
        robot, n_rows = scene.robot, 2 * scene.robot.n_nodes
        self.rest = np.zeros((n_sets, n_rows + (2 + 2 * robot.n_limbs if robot.has_body else 0), N_LANES))
        if robot.has_body:
            self.rest[:, n_rows + 2 :] = np.reshape([limb.root for limb in robot.limb_shapes()], (-1, 1))
        self.limb_length = np.zeros((n_sets, 1, N_LANES))
        self._put_lengths(range(n_sets * N_LANES))

    def _put_lengths(self, places: Iterable[int]) -> None:
        """Write rest positions and limb lengths of robots, by place (lane group times N_LANES plus lane)."""
        shapes: dict[tuple[float, ...], Floats] = {}  # robots of equal lengths have equal shapes
        for place in places:
            (group, lane), robot = divmod(place, N_LANES), min(place, self.n_robots - 1)
            lengths = tuple(of_robot(numbers, robot) for numbers in self._scene.robot.lengths)
            if lengths not in shapes:
                shapes[lengths] = self._scene.robot.nodes(robot).reshape(-1)
            self.rest[group, : len(shapes[lengths]), lane] = shapes[lengths]
            self.limb_length[group, 0, lane] = lengths[0]

    def set_scene(self, scene: Scene, chosen: NDArray[np.bool_]) -> None:
        """Continue with a scene that differs only in numbers that may differ from robot to robot.

        chosen: Robots whose numbers have changed, shape (n_robots,).
        """
        if not isinstance(scene, Scene) or frame_of(scene) != frame_of(self._scene):
            raise ValueError("set_scene needs a scene of the same terms that differs in numbers of each robot alone.")
        self.n_changes += 1
        if self.are_shared or scene.n_robots != self.n_robots:
            self._make(scene)
            return
        self._scene = scene
        robots = np.flatnonzero(chosen).tolist()
        for robot in robots:
            group, lane = divmod(robot, N_LANES)
            put_robot(self._rods[group], lane, make_rods(scene, robot))
            put_robot(self._limits[group], lane, make_limits(scene, robot))
        self._put_lengths(robots)

    def rods(self, group: int) -> Rods:
        """Coefficients of a lane group."""
        return self._rods[group % len(self._rods)]

    def limits(self, group: int) -> Limits:
        """Tolerances and limits of the solver for a lane group."""
        return self._limits[group % len(self._limits)]

    def nodes(self, robot: int | np.intp) -> Floats:
        """Node positions of a robot at rest [m], shape (n_nodes, 2)."""
        group, lane = divmod(int(robot), N_LANES)
        return self.rest[group % len(self.rest), : 2 * self._scene.robot.n_nodes, lane].reshape(-1, 2)

    def rest_shapes(self) -> Floats:
        """Node positions at rest [m], shape (n_nodes, 2) if no number differs, else (n_robots, n_nodes, 2)."""
        return self.nodes(0) if self.are_shared else np.array([self.nodes(robot) for robot in range(self.n_robots)])
