"""Pictures of the robots of a batch, each with a trail and a view of its own."""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.rendering import Camera, Frame, Renderer, limb_nodes
from seastar_gym.envs.task import SwimTask

Picture = NDArray[np.uint8]

LARGEST, SMALLEST = (960, 720), (320, 240)
"""Width and height of a picture [px]: that of one robot alone, and that of one among many."""
SHEET_WIDTH = 1920
"""Width [px] of a sheet of pictures side by side, as long as they are no smaller than SMALLEST."""


def picture_size(n_pictures: int) -> tuple[int, int]:
    """Width and height [px] of each of so many pictures, for a sheet that can still be looked at."""
    width = min(LARGEST[0], max(SMALLEST[0], SHEET_WIDTH // math.ceil(math.sqrt(n_pictures))))
    width -= width % 4  # videos need even numbers
    return width, width * 3 // 4


class BatchPictures:
    """Trails and views of all robots of a task, drawn when they are asked for.

    One renderer draws them all, one after the other.
    """

    def __init__(self, task: SwimTask):
        self._task = task
        self._trails: list[list[NDArray[np.float64]]] = [[] for _ in range(task.n_robots)]
        self._cameras: dict[int, Camera] = {}
        self._renderer: Renderer | None = None

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_renderer": None}

    def begin(self, robots: NDArray[np.bool_]) -> None:
        """Forget what the robots in the mask did before: they begin an episode where they are."""
        hub = self._task.simulator.hub_position()
        for robot in np.flatnonzero(robots).tolist():
            self._trails[robot] = [hub[robot]]
            self._cameras.pop(robot, None)

    def follow(self) -> None:
        """Extend the trails to where the robots are now."""
        for trail, hub in zip(self._trails, self._task.simulator.hub_position(), strict=True):
            trail.append(hub)

    def draw(self, robots: Iterable[int], commands: NDArray[np.float64]) -> tuple[Picture, ...]:
        """Pictures of some robots after a stroke with the commands of all, shape (height, width, 3) each."""
        task, simulator = self._task, self._task.simulator
        positions, time = simulator.positions, simulator.time
        return tuple(
            self._draw(
                robot,
                Frame(
                    positions=positions[robot],
                    command=commands[robot],
                    trail=np.array(self._trails[robot]).reshape(-1, 2),
                    waypoint_index=int(task.waypoint_index[robot]),
                    time=float(time[robot]),
                ),
            )
            for robot in robots
        )

    def _draw(self, robot: int, frame: Frame) -> Picture:
        renderer, body = self._get_renderer(), self._task.simulator.scene.of_robot(robot).robot
        renderer.reset(self._task.waypoints_of(robot), body.limb_length, body.rod_radius)
        renderer.camera = self._cameras.get(robot, renderer.camera)
        picture = renderer.draw(frame)
        self._cameras[robot] = renderer.camera
        return picture

    def _get_renderer(self) -> Renderer:
        if self._renderer is None:
            body = self._task.simulator.scene.of_robot(0).robot
            self._renderer = Renderer(
                limb_nodes(body.n_limbs, body.nodes_per_limb),
                self._task.waypoints_of(0),
                limb_length=body.limb_length,
                rod_radius=body.rod_radius,
                waypoint_radius=self._task.waypoint_radius,
                size=picture_size(self._task.n_robots),
            )
        return self._renderer
