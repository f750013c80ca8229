"""Pictures of the robots of a batch, each with a trail and a view of its own."""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.camera import Camera
from seastar_gym.envs.frame import Frame, frames_of
from seastar_gym.envs.rendering import LARGEST, SMALLEST, Renderer
from seastar_gym.envs.robots import Robots

Picture = NDArray[np.uint8]

SHEET_WIDTH = 1920
"""Width [px] of a sheet of pictures side by side, as long as they are no smaller than SMALLEST."""


def picture_size(n_pictures: int) -> tuple[int, int]:
    """Width and height [px] of each of `n_pictures` pictures, for a sheet that can still be looked at."""
    width = min(LARGEST[0], max(SMALLEST[0], SHEET_WIDTH // math.ceil(math.sqrt(n_pictures))))
    width -= width % 4  # videos need even numbers
    return width, width * 3 // 4


class BatchPictures:
    """Trails and views of all robots, drawn one after the other by one renderer when they are asked for."""

    def __init__(self, robots: Robots):
        self._robots = robots
        self._trails: list[list[NDArray[np.float64]]] = [[] for _ in range(robots.n_robots)]
        self._cameras: dict[int, Camera] = {}
        self._renderer: Renderer | None = None
        self._shown: int | None = None
        """Robot whose path and view the renderer has."""

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_renderer": None, "_shown": None}

    def begin(self, begun: NDArray[np.bool_]) -> None:
        """Forget the trails and views of the robots in a mask, shape (n_robots,): they begin an episode."""
        hub = self._robots.simulator.hub_position()
        for robot in np.flatnonzero(begun).tolist():
            self._trails[robot] = [hub[robot]]
            self._cameras.pop(robot, None)
        self._shown = None

    def follow(self) -> None:
        """Extend all trails to the present positions of the hubs."""
        for trail, hub in zip(self._trails, self._robots.simulator.hub_position(), strict=True):
            trail.append(hub)

    def frames(self, wanted: Iterable[int]) -> list[Frame]:
        """What pictures of the robots of these numbers show now."""
        trails = {robot: np.array(self._trails[robot]).reshape(-1, 2) for robot in wanted}
        return list(frames_of(self._robots, trails))

    def draw(self, wanted: Iterable[int]) -> tuple[Picture, ...]:
        """Pictures of the robots of these numbers, shape (height, width, 3) each."""
        numbers = list(wanted)
        frames = dict(zip(dict.fromkeys(numbers), self.frames(numbers), strict=True))
        return tuple(self._draw(robot, frames[robot]) for robot in numbers)

    def _draw(self, robot: int, frame: Frame) -> Picture:
        picture = self.renderer_of(robot).draw(frame)
        self._cameras[robot] = self.renderer_of(robot).camera
        return picture

    def show(self, fps: float) -> None:
        """Show the picture of robot 0 in a window, no faster than `fps` pictures per second."""
        self.renderer_of(0).show(self.frames([0])[0], fps=fps)
        self._cameras[0] = self.renderer_of(0).camera

    def renderer_of(self, robot: int) -> Renderer:
        """The renderer, with the path and the view of a robot."""
        if self._renderer is not None and self._shown == robot:
            return self._renderer
        robots, task = self._robots, self._robots.task
        body, waypoints = robots.simulator.scene.of_robot(robot).robot, task.waypoints_of(robots, robot)
        headings, radius = task.headings_of(robots, robot), task.radius_of(robots, robot)
        if self._renderer is None:
            self._renderer = Renderer(body, waypoints, radius, picture_size(robots.n_robots))
        self._renderer.reset(waypoints, body, headings, radius)
        self._renderer.camera = self._cameras.get(robot, self._renderer.camera)
        self._shown = robot
        return self._renderer

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = self._shown = None
