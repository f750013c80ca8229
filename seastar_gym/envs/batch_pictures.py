"""Pictures of the robots of a batch, each with a trail and a view of its own."""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.camera import Camera
from seastar_gym.envs.frame import Frame, frames_of
from seastar_gym.envs.rendering import LARGEST, SMALLEST, Renderer
from seastar_gym.envs.swimming import Swimming

Picture = NDArray[np.uint8]

SHEET_WIDTH = 1920
"""Width [px] of a sheet of pictures side by side, as long as they are no smaller than SMALLEST."""


def picture_size(n_pictures: int) -> tuple[int, int]:
    """Width and height [px] of each of `n_pictures` pictures, for a sheet that can still be looked at."""
    width = min(LARGEST[0], max(SMALLEST[0], SHEET_WIDTH // math.ceil(math.sqrt(n_pictures))))
    width -= width % 4  # videos need even numbers
    return width, width * 3 // 4


class BatchPictures:
    """Trails and views of all robots of a task, drawn one after the other by one renderer when they are asked for."""

    def __init__(self, task: Swimming):
        self._task = task
        self._trails: list[list[NDArray[np.float64]]] = [[] for _ in range(task.n_robots)]
        self._cameras: dict[int, Camera] = {}
        self._renderer: Renderer | None = None

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_renderer": None}

    def begin(self, robots: NDArray[np.bool_]) -> None:
        """Forget the trails and views of the robots in a mask, shape (n_robots,): they begin an episode."""
        hub = self._task.simulator.hub_position()
        for robot in np.flatnonzero(robots).tolist():
            self._trails[robot] = [hub[robot]]
            self._cameras.pop(robot, None)

    def follow(self) -> None:
        """Extend all trails to the present positions of the hubs."""
        for trail, hub in zip(self._trails, self._task.simulator.hub_position(), strict=True):
            trail.append(hub)

    def draw(self, robots: Iterable[int], commands: NDArray[np.float64]) -> tuple[Picture, ...]:
        """Pictures of the robots of these numbers, shape (height, width, 3) each.

        commands: Commands of all robots in the last stroke, shape (n_robots, n_limbs).
        """
        wanted = list(robots)
        trails = {robot: np.array(self._trails[robot]).reshape(-1, 2) for robot in wanted}
        frames = dict(zip(trails, frames_of(self._task, commands, trails), strict=True))
        return tuple(self._draw(robot, frames[robot]) for robot in wanted)

    def _draw(self, robot: int, frame: Frame) -> Picture:
        renderer, body = self._get_renderer(), self._task.simulator.scene.of_robot(robot).robot
        radius = self._task.radius_of(robot)
        renderer.reset(self._task.waypoints_of(robot), body, self._task.headings_of(robot), radius)
        renderer.camera = self._cameras.get(robot, renderer.camera)
        picture = renderer.draw(frame)
        self._cameras[robot] = renderer.camera
        return picture

    def _get_renderer(self) -> Renderer:
        if self._renderer is None:
            body = self._task.simulator.scene.of_robot(0).robot
            size = picture_size(self._task.n_robots)
            self._renderer = Renderer(body, self._task.waypoints_of(0), self._task.radius_of(0), size)
        return self._renderer
