"""`Frame`: what one picture of a swim shows, apart from the path."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.robots import Robots
from seastar_gym.envs.scenery import NOTHING, Scenery
from seastar_gym.scene.number import chosen
from seastar_gym.scene.water import AnyCurrent
from seastar_gym.simulator import Simulator

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Frame:
    """State of a swim that one picture shows."""

    positions: FloatArray
    """Node positions [m], shape (n_nodes, 2)."""
    command: FloatArray
    """Command of the current decision in [-1, 1], shape (n_limbs,); + is anti-clockwise."""
    trail: FloatArray
    """Former positions of the hub [m], shape (k, 2), oldest first; k may be 0."""
    waypoint_index: int
    """The waypoint that the robot swims to; the number of waypoints once all are reached."""
    time: float
    """Simulated time [s]."""
    wire_state: FloatArray | None = None
    """How warm wires + and - of every limb are, from 0 to 1, shape (n_limbs, 2); None without wires."""
    scenery: Scenery = NOTHING
    """What the task shows besides."""
    roots: FloatArray | None = None
    """Places where limbs begin on a body [m], shape (n_limbs, 2); None where they begin at the hub."""
    outline: FloatArray | None = None
    """Outline of the body [m], shape (n, 2); None without one."""
    current: AnyCurrent | None = None
    """Current of the water; None for water at rest."""


def body_of(simulator: Simulator) -> tuple[FloatArray | None, FloatArray | None]:
    """Roots of limbs, shape (n_robots, n_limbs, 2), and outlines, shape (n_robots, n, 2) [m]; None without a body."""
    body = simulator.scene.robot.body
    if body is None or body.is_point:
        return None, None
    x, y = body.shape.drawn().T if body.shape.area else np.zeros((2, 0))
    angles = simulator.orientation()[:, None]
    c, s = np.cos(angles), np.sin(angles)
    outline = np.stack([c * x - s * y, s * x + c * y], axis=-1)
    return simulator.root_positions(), simulator.hub_position()[:, None] + outline


def frames_of(robots: Robots, trails: Mapping[int, FloatArray]) -> Iterator[Frame]:
    """Frames of robots at present. trails: As in `Frame`, by the numbers of the robots that are shown."""
    simulator = robots.simulator
    positions, time, wire_state = simulator.positions, simulator.time, robots.wire_state()
    roots, outlines = body_of(simulator)
    fluid = simulator.scene.fluid
    for robot, trail in trails.items():
        yield Frame(
            positions=positions[robot],
            command=robots.last_commands[robot],
            trail=trail,
            waypoint_index=int(robots.waypoint_index[robot]),
            time=float(time[robot]),
            wire_state=None if wire_state is None else wire_state[robot],
            scenery=robots.task.scenery(robots, robot),
            roots=None if roots is None else roots[robot],
            outline=None if outlines is None else outlines[robot],
            current=None if fluid is None else chosen(fluid.current, itemgetter(robot)),
        )
