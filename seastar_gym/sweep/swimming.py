"""How the designs of a batch swim, one number per design and column."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.controllers.contract import actions_of, require_fit
from seastar_gym.envs.options import SwimOptions
from seastar_gym.envs.paths import WAYPOINT_RADIUS
from seastar_gym.envs.robots import Robots
from seastar_gym.envs.vector import ManyRobotsEnv
from seastar_gym.envs.waypoints import AlongPath
from seastar_gym.evaluation.rollout import rollout
from seastar_gym.scene import Scene
from seastar_gym.scene.number import with_numbers
from seastar_gym.simulator import Simulator
from seastar_gym.sweep.designs import Batch, Configuration, Controller

Floats = NDArray[np.float64]

REFUSED = -1
"""Status of a design that a scene refuses; others have that of the solver, see `SolverStatus`."""
UNITS = {
    "speed": "m/s", "strokes_per_metre": "1/m", "ahead": "m", "aside": "m", "turn": "rad", "energy": "J",
    "work": "J", "peak_moment": "N m", "smallest_opening_angle": "rad", "newton_iterations": "1", "status": "1",
}  # fmt: skip
"""Columns of results and their units.

speed: Distance between the places of the hub at the beginning and at the end of the measurement, over its time.
strokes_per_metre: Periods of the actuator that a metre takes at that speed.
ahead, aside: That distance along the robot's x axis at the beginning, and to the left of it. The axis is that of the
    rest shape that fits all nodes best; for controllers, that of observations, which fits hub and stations.
turn: Rotation of the robot during the measurement.
energy: Electric energy of the measured intervals.
work: Mechanical work of the actuators in these intervals, see `StrokeReport`.
peak_moment: Largest moment that a limb resisted its actuator with in them.
smallest_opening_angle: Between neighbouring limbs at the hub, at any time. Below zero, limbs have crossed.
    With a body it is pi.
newton_iterations: Of all intervals.
status: SolverStatus, the largest of all intervals, or REFUSED. All else is NaN unless it is zero.

Of a controller, the measurement is the whole swim, and the speed is the length of the path up to the last waypoint
reached over the time of the swim.
"""
OF_CONTROLLERS = {"time": "s", "waypoints": "1"}
"""Columns besides, of controllers, and their units.

time: Time until the last waypoint is reached; NaN if it is not. waypoints: Number of waypoints reached.
"""

OF_EPISODES = (
    "time", "waypoint_index", "hub_position", "energy", "work", "peak_moment", "smallest_opening_angle",
    "newton_iterations", "solver_status",
)  # fmt: skip
"""Entries of info that the columns of controllers are made of."""


def units_of(frame: Configuration) -> dict[str, str]:
    """Columns of results of a frame, and their units."""
    return UNITS if frame.controller is None else UNITS | OF_CONTROLLERS


def swim(batch: Batch, device: str = "cpu") -> dict[str, NDArray[Any]]:
    """Columns of results of a batch's designs, shape (n_robots,) each. device: Where robots swim, see `Simulator`."""
    sound = np.ones(batch.n_robots, bool)
    try:
        scene = scene_of(batch, sound)
    except ValueError:
        sound = np.array([_is_sound(batch, k) for k in range(batch.n_robots)])
        scene = scene_of(batch, sound) if sound.any() else batch.configuration.scene
    found = measure(scene, batch, int(sound.sum()), device) if sound.any() else {}
    columns: dict[str, NDArray[Any]] = {}
    for name in units_of(batch.configuration):
        columns[name] = np.full(batch.n_robots, np.nan)
        columns[name][sound] = found.get(name, np.nan)
    columns["status"] = np.where(sound, columns["status"], REFUSED).astype(np.int64)
    return columns


def scene_of(batch: Batch, chosen: NDArray[np.bool_] | int) -> Scene:
    """Scene of some robots of a batch side by side, or of one."""
    return with_numbers(batch.configuration.scene, {name: values[chosen] for name, values in batch.numbers.items()})


def _is_sound(batch: Batch, robot: int) -> bool:
    try:
        scene_of(batch, robot)
    except ValueError:
        return False
    return True


def measure(scene: Scene, batch: Batch, n_robots: int, device: str = "cpu") -> dict[str, NDArray[Any]]:
    """Columns of results of robots side by side, NaN where the solver failed."""
    frame, controller = batch.configuration, batch.configuration.controller
    if controller is None:
        columns = repeat(scene, frame, n_robots, device)
    else:
        columns = steer(scene, frame.scene, controller, n_robots, device)
    status = columns.pop("status")
    return {**{name: np.where(status == 0.0, column, np.nan) for name, column in columns.items()}, "status": status}


def repeat(scene: Scene, frame: Configuration, n_robots: int, device: str) -> dict[str, NDArray[Any]]:
    """Columns of results of robots side by side that repeat a gait."""
    simulator, gait, swum = Simulator(scene, n_robots, 1, effort=True, device=device), frame.gait, frame.swim
    interval = scene.actuator.period if gait.interval is None else gait.interval
    status, iterations, energy, work, moment = np.zeros((5, n_robots))
    angle = np.full(n_robots, np.inf)
    hub, heading = simulator.hub_position(), simulator.heading()
    for k in range(swum.settling + swum.measured):
        if k == swum.settling:
            hub, heading, energy[:] = simulator.hub_position(), simulator.heading(), 0.0
            work[:] = moment[:] = 0.0
        report = simulator.advance(interval, np.tile(gait.commands[k % len(gait.commands)], (n_robots, 1)))
        status, angle = np.maximum(status, report.status), np.fmin(angle, report.smallest_opening_angle)
        iterations, energy = iterations + report.newton_iterations, energy + report.energy
        work, moment = work + report.work, np.maximum(moment, report.peak_moment)
    way = (simulator.hub_position() - hub) @ [1.0, 1.0j] * np.exp(-1j * heading)
    speed = np.abs(way) / (swum.measured * interval)
    return {
        **ways(scene, speed, way, simulator.heading() - heading), "energy": energy, "work": work, "peak_moment": moment,
        "smallest_opening_angle": angle, "newton_iterations": iterations, "status": status,
    }  # fmt: skip


def steer(scene: Scene, frame: Scene, controller: Controller, n_robots: int, device: str) -> dict[str, NDArray[Any]]:
    """Columns of results of robots side by side that a controller steers, up to the last waypoint or the time limit.

    frame: Scene that the controller knows.
    """
    n_limbs, policy, waypoints = scene.robot.n_limbs, controller.policy(frame), np.array(controller.waypoints)
    actions = actions_of(policy, n_limbs)
    require_fit(policy, scene, actions, controller.decision_period)
    options = SwimOptions(actions, scene=scene, decision_period=controller.decision_period, device=device)
    robots = Robots(AlongPath(waypoints, waypoint_radius=WAYPOINT_RADIUS), options, n_robots, 1, effort=True)
    headings: list[Floats] = []
    swum = rollout(
        ManyRobotsEnv(robots), policy, seeds=0, until=controller.decisions, record=OF_EPISODES,
        on_step=lambda info: headings.append(robots.heading()),
    )  # fmt: skip
    begin, end = headings[0], np.array(headings)[swum.decisions, np.arange(n_robots)]
    reached, time = swum.last("waypoint_index"), swum.last("time")
    lengths = np.cumsum([0.0, *np.hypot(*np.diff(waypoints, axis=0, prepend=0.0).T)])
    way = swum.last("hub_position") @ [1.0, 1.0j] * np.exp(-1j * begin)
    return {
        **ways(scene, lengths[reached] / time, way, end - begin),
        "energy": swum.total("energy"), "work": swum.total("work"),
        "peak_moment": swum.of("peak_moment", 0.0).max(axis=0),
        "smallest_opening_angle": np.fmin.reduce(swum.of("smallest_opening_angle"), axis=0),
        "newton_iterations": swum.total("newton_iterations"),
        "time": np.where(reached == len(waypoints), time, np.nan), "waypoints": reached.astype(np.float64),
        "status": swum.last("solver_status").astype(np.float64),
    }  # fmt: skip


def ways(scene: Scene, speed: Floats, way: NDArray[np.complex128], turn: Floats) -> dict[str, Floats]:
    """Columns of where robots swam. way: Of the hub, in the body frame of the beginning [m]. turn: On it [rad]."""
    with np.errstate(divide="ignore"):
        strokes = 1.0 / (speed * scene.actuator.period)
    return {
        "speed": speed, "strokes_per_metre": strokes, "ahead": way.real, "aside": way.imag,
        "turn": turn - 2.0 * np.pi * np.rint(turn / (2.0 * np.pi)),
    }  # fmt: skip
