"""Simulated trajectories of nodes, at the times of a measurement."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from seastar_gym.identify.measurement import (
    ORIENTATION,
    Measurement,
    get_parameter,
    pointer,
    require_command_times,
    with_parameters,
)
from seastar_gym.process import processors
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import (
    as_finite,
    require_count,
    require_kind,
    require_number,
    require_seed,
    require_within,
)
from seastar_gym.scene.number import frame_of, side_by_side
from seastar_gym.scene.numerics import SHORTEST
from seastar_gym.simulator import Simulator

Floats = NDArray[np.float64]

MOST_STROKES, MOST_TIMES = 100_000, 10_000_000
"""Most strokes and times of a simulated measurement."""
LONGEST_DELAY = 60.0
"""Longest delay between the logs of a measurement [s]."""


def trajectory(
    time: Floats, nodes: Sequence[int], commands: Floats, scene: Scene, command_times: Floats | None = None
) -> Floats:
    """Positions of nodes of a scene's robot at these times [m], shape (n, n_nodes_seen, 2).

    Positions between time steps are interpolated by cubic Hermite polynomials, which are as accurate as the schemes.
    NaN if the solver gave up. For nodes and command_times see `Measurement`.
    """
    require_kind("scene", scene, Scene, "a Scene")
    times, given = as_finite("time", time, (None,)), as_finite("commands", commands, (None, scene.robot.n_limbs))
    if times.ndim != 1 or not len(times) or times[0] < 0.0 or (np.diff(times) < 0.0).any():
        raise ValueError("time must be a row of times that are not negative, and in order [s].")
    if given.ndim != 2 or not len(given):
        raise ValueError(f"commands must have shape (n_strokes, {scene.robot.n_limbs}), not {given.shape}.")
    if command_times is not None:
        command_times = as_finite("command_times", command_times, (None,))
        require_command_times(command_times, len(given))
    require_kind("nodes", nodes, (tuple, list), "a tuple of whole numbers")
    for node in nodes:
        require_count("A node", node, 0 if scene.robot.body is None else ORIENTATION, scene.robot.n_nodes - 1)
    return batch_of_trajectories(times, nodes, given, [scene], command_times)[0]


def batch_of_trajectories(
    time: Floats,
    nodes: Sequence[int],
    commands: Floats,
    scenes: Sequence[Scene],
    command_times: Floats | None = None,
    delays: Sequence[float] | Floats | None = None,
) -> Floats:
    """Trajectories of scenes of one frame, simulated as one batch; shape (n_scenes, n, n_nodes_seen, 2).

    delays: By how much the clock of `time` is ahead of that of the commands, for every scene [s]. None means 0.
    """
    late = np.zeros(len(scenes)) if delays is None else np.asarray(delays)
    motions = _motions(scenes, nodes, commands, command_times, time[-1], late.min())
    return np.stack([motion(time - delay) for motion, delay in zip(motions, late, strict=True)])


def delayed_trajectories(scene: Scene, measurement: Measurement, delays: Floats) -> Floats:
    """Trajectories of one scene's robot for several delays [s]; shape (n_delays, n, n_nodes_seen, 2)."""
    asked = measurement.nodes, measurement.commands, measurement.command_times
    (motion,) = _motions([scene], *asked, measurement.time[-1], delays.min())
    return np.stack([motion(measurement.time - delay) for delay in delays])


Motion = Callable[[Floats], Floats]
"""Function from times of the commands' clock [s], shape (n,), to positions of tracked nodes [m], (n, n_nodes, 2)."""


def _motion(begin: float, times: Floats, x: Floats, v: Floats, failed: bool) -> Motion:
    """Motion by known positions x [m] and velocities v [m/s], since the first command [s]; x[k] is (n_nodes, 2)."""
    spline = CubicHermiteSpline(times, x, v)

    def positions(time: Floats) -> Floats:
        found = spline(np.maximum(time - begin, 0.0))  # before the first command they are those at rest
        return np.full_like(found, np.nan) if failed else np.asarray(found)

    return positions


def _intervals(
    scene: Scene, last: float, commands: Floats, command_times: Floats | None, delay: float
) -> list[tuple[float, Floats | None]]:
    """Lengths [s] of intervals between commands, until the last time [s] that was measured, and their commands.

    A command has shape (n_limbs,), and is None to coast.

    delay: Of the clock that measured, see `batch_of_trajectories` [s].
    """
    period = scene.actuator.period
    if command_times is None:
        end = len(commands) * period
        if last > end + 1e-9:
            raise ValueError(f"The last time of {last:.4g} s is beyond the last stroke, which ends at {end:.4g} s.")
        lengths, coasting = [period] * len(commands), last - delay - end
    else:
        end = max(command_times[-1] + period, last - delay)
        lengths, coasting = np.diff(command_times, append=end).tolist(), 0.0
    intervals = list[tuple[float, Floats | None]](zip(lengths, commands, strict=True))
    return [*intervals, (coasting, None)] if coasting > SHORTEST * scene.numerics.step else intervals


def _motions(
    scenes: Sequence[Scene],
    nodes: Sequence[int],
    commands: Floats,
    command_times: Floats | None,
    last: float,
    delay: float,
) -> list[Motion]:
    """Motion of every scene's robot, simulated as one batch. last, delay: See `_intervals`."""
    intervals = _intervals(scenes[0], last, commands, command_times, delay)
    simulator = Simulator(side_by_side(scenes), len(scenes), threads=1)
    end, times, seen = 0.0, [0.0], [_tracked(simulator, nodes)]
    for duration, command in intervals:
        given = None if command is None else np.tile(command, (len(scenes), 1))
        for since in simulator.advance_in_parts(duration, given, math.ceil(duration / scenes[0].numerics.step)):
            times.append(end + since)
            seen.append(_tracked(simulator, nodes))
        end = end + duration
    x, v = (np.array(values) for values in zip(*seen, strict=True))
    begin = 0.0 if command_times is None else float(command_times[0])
    failed = enumerate(simulator.failed)
    return [_motion(begin, np.array(times), x[:, k], v[:, k], bool(gave_up)) for k, gave_up in failed]


def at_rest(scene: Scene, nodes: Sequence[int]) -> Floats:
    """Positions of nodes of a scene's robot before the first command [m], shape (n_nodes_seen, 2)."""
    return np.asarray(_tracked(Simulator(scene, 1, threads=1), nodes)[0][0])


def _tracked(simulator: Simulator, nodes: Sequence[int]) -> tuple[Floats, Floats]:
    """Present positions [m] and velocities [m/s] of nodes, shape (n_robots, n_nodes_seen, 2)."""
    chosen = list(nodes)
    x, v = simulator.positions[:, chosen], simulator.velocities[:, chosen]
    if ORIENTATION in chosen:
        place, theta = chosen.index(ORIENTATION), simulator.orientation()
        x[:, place] = pointer(theta)
        v[:, place] = simulator.spin()[:, None] * pointer(theta + 0.5 * math.pi)
    return x, v


def trajectories(
    scenes: Sequence[Scene], measurement: Measurement, delays: Sequence[float] | Floats | None = None
) -> Floats:
    """Trajectories of every scene's robot [m], shape (n_scenes, n, n_nodes_seen, 2).

    Scenes that differ only in numbers that may differ from robot to robot are simulated in the lanes of one batch.
    Others, with other durations or other points of a measured curve, are simulated in batches of their own, on threads.

    delays: See `batch_of_trajectories`.
    """
    late = np.zeros(len(scenes)) if delays is None else np.asarray(delays)
    frames = [frame_of(scene) for scene in scenes]
    batches = {frame: [k for k, other in enumerate(frames) if other == frame] for frame in frames}
    found = np.empty((len(scenes), *measurement.positions.shape))

    def simulate(batch: list[int]) -> None:
        asked = measurement.time, measurement.nodes, measurement.commands
        found[batch] = batch_of_trajectories(*asked, [scenes[k] for k in batch], measurement.command_times, late[batch])

    with ThreadPoolExecutor(processors()) as pool:
        list(pool.map(simulate, batches.values()))
    return found


def synthetic(
    scene: Scene,
    truth: dict[str, float],
    n_strokes: int = 8,
    rate: float = 25.0,
    noise: float = 1e-3,
    seed: int = 0,
    delay: float = 0.0,
) -> Measurement:
    """Simulated measurement of hub and tips in strokes of random commands, at `rate` [Hz], with noise [m] on top.

    truth: Values of parameters by name, which replace those of the scene.
    delay: By how much the pictures' clock is ahead of that of the commands [s].
    """
    require_kind("scene", scene, Scene, "a Scene")
    require_kind("truth", truth, dict, "a dict of values by name")
    require_count("n_strokes", n_strokes, 1, MOST_STROKES)
    require_number("rate", rate, "Hz")
    require_number("noise", noise, "m", zero_allowed=True)
    require_within("delay", delay, -LONGEST_DELAY, LONGEST_DELAY)
    require_seed(seed)
    if n_strokes * scene.actuator.period * rate > MOST_TIMES:
        raise ValueError(f"{n_strokes} strokes at {rate:g} Hz are more than {MOST_TIMES:,} times.")
    rng, robot = np.random.default_rng(seed), scene.robot
    for name in truth:
        get_parameter(scene, name)  # refuses what the scene has not
    commands = rng.integers(-1, 2, (n_strokes, robot.n_limbs)).astype(float)
    times = np.arange(math.floor(n_strokes * scene.actuator.period * rate)) / rate
    if not len(times):
        raise ValueError(f"{n_strokes} strokes at {rate:g} Hz are less than one time.")
    nodes = (0, *((robot.nodes_per_limb - 1) * (np.arange(robot.n_limbs) + 1)).tolist())
    robot_as_built = with_parameters(scene, list(truth), list(truth.values()))
    (exact,) = batch_of_trajectories(times, nodes, commands, [robot_as_built], delays=[delay])
    return Measurement(times, exact + noise * rng.standard_normal(exact.shape), nodes, commands)
