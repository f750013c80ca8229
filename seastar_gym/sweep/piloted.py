"""How designs swim a path that a controller steers them along."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.controllers.contract import actions_of, require_fit
from seastar_gym.envs.commands import to_commands
from seastar_gym.envs.options import SwimOptions
from seastar_gym.envs.task import SwimTask
from seastar_gym.scene import Scene
from seastar_gym.sweep.pilots import Pilot

RADIUS = 0.01
"""Radius of waypoints [m]."""


def steer(scene: Scene, frame: Scene, pilot: Pilot, n_robots: int) -> dict[str, NDArray[Any]]:
    """Columns of results of robots side by side, each up to its last waypoint or the time limit.

    frame: Scene that the controller knows.
    """
    n_limbs, policy = scene.robot.n_limbs, pilot.policy(frame)
    actions = actions_of(policy, n_limbs)
    require_fit(policy, scene, actions, pilot.decision_period)
    options = SwimOptions(
        np.array(pilot.waypoints), actions, scene=scene, waypoint_radius=RADIUS, decision_period=pilot.decision_period
    )
    task = SwimTask(options, n_robots, 1, effort=True)
    task.reset(np.ones(n_robots, bool), [np.random.default_rng(robot) for robot in range(n_robots)])
    begin = task.heading()
    swimming, begins, state = np.ones(n_robots, bool), np.ones(n_robots, bool), None
    status, iterations, energy, work, moment, time, turn = np.zeros((7, n_robots))
    hub, angle = np.zeros((n_robots, 2)), np.full(n_robots, np.inf)
    for _ in range(pilot.decisions):
        chosen, state = policy.predict(task.observe(), state=state, episode_start=begins, deterministic=True)
        commands = to_commands(actions, n_limbs, chosen, n_robots)
        commands[~swimming] = 0.0
        done, now = task.step(commands), swimming
        iterations[now] += done.info["newton_iterations"][now]
        energy[now] += done.info["energy"][now]
        work[now] += done.info["work"][now]
        moment[now] = np.maximum(moment, done.info["peak_moment"])[now]
        angle[now] = np.fmin(angle, done.info["smallest_opening_angle"])[now]
        status[now], time[now] = done.info["solver_status"][now], done.info["time"][now]
        hub[now], turn[now] = done.info["hub_position"][now], (task.heading() - begin)[now]
        swimming, begins = swimming & ~done.terminated, np.zeros(n_robots, bool)
        if not swimming.any():
            break
    reached = task.waypoint_index
    corners = np.concatenate([np.zeros((1, 2)), np.array(pilot.waypoints)])
    lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
    speed = lengths[reached] / time
    with np.errstate(divide="ignore"):
        strokes = 1.0 / (speed * scene.actuator.period)
    way = hub @ [1.0, 1.0j] * np.exp(-1j * begin)
    return {
        "speed": speed, "strokes_per_metre": strokes, "ahead": way.real, "aside": way.imag,
        "turn": turn - 2.0 * np.pi * np.rint(turn / (2.0 * np.pi)), "energy": energy,
        "work": work, "peak_moment": moment, "smallest_opening_angle": angle, "newton_iterations": iterations,
        "time": np.where(reached == len(pilot.waypoints), time, np.nan), "waypoints": reached.astype(np.float64),
        "status": status,
    }  # fmt: skip
