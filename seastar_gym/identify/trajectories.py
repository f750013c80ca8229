"""Simulated trajectories of nodes, at the times of a measurement."""

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from seastar_gym.identify.measurement import Measurement
from seastar_gym.identify.parameters import get_parameter, with_parameters
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import as_finite, require_count, require_kind, require_number, require_seed
from seastar_gym.scene.per_robot import frame_of, side_by_side
from seastar_gym.simulator import Simulator

Floats = NDArray[np.float64]

MOST_STROKES, MOST_TIMES = 100_000, 10_000_000
"""Most strokes and times of a simulated measurement."""


def trajectory(time: Floats, nodes: Sequence[int], commands: Floats, scene: Scene) -> Floats:
    """Positions of nodes of a scene's robot at these times [m], shape (n, n_nodes_seen, 2).

    Positions between time steps are interpolated by cubic Hermite polynomials, which are as accurate as the schemes.
    NaN if the solver gave up.
    """
    require_kind("scene", scene, Scene, "a Scene")
    times, given = as_finite("time", time, (None,)), as_finite("commands", commands, (None, scene.robot.n_limbs))
    if times.ndim != 1 or not len(times) or times[0] < 0.0 or (np.diff(times) < 0.0).any():
        raise ValueError("time must be a row of times that are not negative, and in order [s].")
    if given.ndim != 2 or not len(given):
        raise ValueError(f"commands must have shape (n_strokes, {scene.robot.n_limbs}), not {given.shape}.")
    require_kind("nodes", nodes, (tuple, list), "a tuple of whole numbers")
    for node in nodes:
        require_count("A node", node, 0, scene.robot.n_nodes - 1)
    return batch_of_trajectories(times, nodes, given, [scene])[0]


def batch_of_trajectories(time: Floats, nodes: Sequence[int], commands: Floats, scenes: Sequence[Scene]) -> Floats:
    """Trajectories of scenes of one frame, simulated as one batch; shape (n_scenes, n, n_nodes_seen, 2)."""
    n_robots, of_nodes = len(scenes), list(nodes)
    simulator = Simulator(side_by_side(scenes), n_robots, threads=1)
    period, step = scenes[0].actuator.period, scenes[0].numerics.step
    times, seen = [0.0], [(simulator.positions[:, of_nodes], simulator.velocities[:, of_nodes])]
    for stroke, command in enumerate(commands):
        for since in simulator.stroke_in_parts(np.tile(command, (n_robots, 1)), math.ceil(period / step)):
            times.append(stroke * period + since)
            seen.append((simulator.positions[:, of_nodes], simulator.velocities[:, of_nodes]))
        if simulator.failed.all():
            return np.full((n_robots, len(time), len(nodes), 2), np.nan)
    if time[-1] > times[-1] + 1e-9:
        raise ValueError(
            f"The last time of {time[-1]:.4g} s is beyond the last stroke, which ends at {times[-1]:.4g} s."
        )
    x, v = (np.array(values) for values in zip(*seen, strict=True))
    found = np.moveaxis(CubicHermiteSpline(times, x, v)(time), 1, 0)
    found[simulator.failed] = np.nan
    return found


def trajectories(scenes: Sequence[Scene], measurement: Measurement) -> Floats:
    """Trajectories of every scene's robot [m], shape (n_scenes, n, n_nodes_seen, 2).

    Scenes that differ only in numbers that may differ from robot to robot are simulated in the lanes of one batch.
    Others, with other durations or other points of a measured curve, are simulated in batches of their own, on threads.
    """
    frames = [frame_of(scene) for scene in scenes]
    batches = {frame: [k for k, other in enumerate(frames) if other == frame] for frame in frames}
    found = np.empty((len(scenes), *measurement.positions.shape))

    def simulate(batch: list[int]) -> None:
        its_scenes = [scenes[k] for k in batch]
        found[batch] = batch_of_trajectories(measurement.time, measurement.nodes, measurement.commands, its_scenes)

    with ThreadPoolExecutor() as pool:
        list(pool.map(simulate, batches.values()))
    return found


def synthetic(
    scene: Scene, truth: dict[str, float], n_strokes: int = 8, rate: float = 25.0, noise: float = 1e-3, seed: int = 0
) -> Measurement:
    """Simulated measurement of hub and tips in strokes of random commands, at `rate` [Hz], with noise [m] on top.

    truth: Values of parameters by name, which replace those of the scene.
    """
    require_kind("scene", scene, Scene, "a Scene")
    require_kind("truth", truth, dict, "a dict of values by name")
    require_count("n_strokes", n_strokes, 1, MOST_STROKES)
    require_number("rate", rate, "Hz")
    require_number("noise", noise, "m", zero_allowed=True)
    require_seed(seed)
    if n_strokes * scene.actuator.period * rate > MOST_TIMES:
        raise ValueError(f"{n_strokes} strokes at {rate:g} Hz are more than {MOST_TIMES:,} times.")
    rng, robot = np.random.default_rng(seed), scene.robot
    for name in truth:
        get_parameter(scene, name)  # refuses what the scene has not
    commands = rng.integers(-1, 2, (n_strokes, robot.n_limbs)).astype(float)
    times = np.arange(math.floor(n_strokes * scene.actuator.period * rate)) / rate
    nodes = (0, *((robot.nodes_per_limb - 1) * (np.arange(robot.n_limbs) + 1)).tolist())
    exact = trajectory(times, nodes, commands, with_parameters(scene, list(truth), list(truth.values())))
    return Measurement(times, exact + noise * rng.standard_normal(exact.shape), nodes, commands)
