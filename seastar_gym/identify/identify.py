"""Fits numbers of a scene to measured trajectories: `python -m seastar_gym.identify --help`.

A trajectory is a CSV file with a line of names, `time,x0,y0,x9,y9,..`: seconds, and the coordinates [m] of any nodes
(0 is the hub, j (N - 1) the tip of limb j). The robot begins at rest with its hub at the origin and limb 1 along +x;
empty fields were not seen. A second file has one command per line and stroke, one number per limb.

Parameters are positive numbers of the scene, by name: fluid.drag_coefficient, robot.youngs_modulus, robot.limb_length,
robot.limbs.0.length, actuator.peak_angle, or actuator.angles.2, a point of a measured curve. They are fitted by their
logarithms, so errors are relative to their values. The scene and those in which one parameter has changed a little, for
the columns of the Jacobian, are simulated side by side, as the robots of one batch. With J the derivative of the
residuals r and s^2 = |r|^2/(n - p), the covariance is s^2 (J^T J)^-1: independent errors of one size for all
coordinates. Where a direction of parameters, a singular vector of J, has a relative error above UNTOLD, the data cannot
tell them, and the estimate says so.

`--synthetic` makes data of its own, with 1 mm of noise, and shows that the fit finds what made them.
"""

import argparse
import math
import re
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields, is_dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import least_squares
from scipy.stats import t as student

from seastar_gym.extras import require_extra
from seastar_gym.scene import Numerics, Scene, Seastar, SmaPulse, Water
from seastar_gym.scene.checks import is_finite_number, is_whole_number, shown
from seastar_gym.scene.csv_rows import Row, read_numbers, read_rows
from seastar_gym.scene.per_robot import frame_of, side_by_side, with_numbers
from seastar_gym.simulator import Simulator

Floats = NDArray[np.float64]

NODE = re.compile("[0-9]{1,5}")
"""The number of a node, as a column's name says it."""
DIFFERENCE = 1e-4
"""Relative change of a parameter for a column of the Jacobian; trajectories are good to about its square."""
UNTOLD = 0.5
"""Relative standard error of a combination of parameters that is as good as unknown."""
SHARE = 0.3
"""Part in such a combination, a unit vector, from which on a parameter belongs to it."""
LARGEST_FACTOR = 20.0
"""Between a parameter and its first guess."""


@dataclass(frozen=True)
class Measurement:
    """Where nodes of a robot were.

    time: Since the first stroke began [s], shape (n,). positions: [m], shape (n, n_nodes_seen, 2), NaN: not seen.
    nodes: Which nodes, shape (n_nodes_seen,). commands: Of every stroke, shape (n_strokes, n_limbs).
    """

    time: Floats
    positions: Floats
    nodes: tuple[int, ...]
    commands: Floats

    def __post_init__(self) -> None:
        for name in ("time", "positions", "commands"):
            array = getattr(self, name)
            if not isinstance(array, np.ndarray) or array.dtype.kind not in "iuf":
                raise ValueError(f"{name} must be an array of numbers, not {shown(array)}.")
        if not isinstance(self.nodes, tuple) or not all(map(is_whole_number, self.nodes)) or self.time.ndim != 1:
            raise ValueError(f"nodes must be a tuple of whole numbers, not {shown(self.nodes)}, and times in a row.")
        if self.positions.shape != (len(self.time), len(self.nodes), 2) or not np.isfinite(self.positions).any():
            raise ValueError(f"{len(self.time)} times and {len(self.nodes)} nodes do not fit the positions measured.")
        if self.commands.ndim != 2 or not len(self.commands):
            raise ValueError("Commands must be one line per stroke with one number per limb.")
        if not np.isfinite(self.time).all() or self.time.min() < 0.0 or (np.diff(self.time) < 0.0).any():
            raise ValueError("Times must be finite, not negative, and in order [s].")

    @classmethod
    def from_csv(cls, trajectory: str | Path, commands: str | Path) -> "Measurement":
        """From two files, see above."""
        names, *rows = read_rows(trajectory) or [Row(str(trajectory), ())]
        nodes = tuple(int(name[1:]) for name in names.fields[1::2] if NODE.fullmatch(name[1:]))
        expected = ("time", *(f"{axis}{node}" for node in nodes for axis in "xy"))
        if not (nodes and rows) or names.fields != expected:
            raise ValueError(f"{trajectory}: the first line must be time,x0,y0,.. and there must be others below it.")
        for row in rows:
            if len(row.fields) != len(expected):
                raise row.refused(f"the line must have {len(expected)} fields, as the first one, not {len(row.fields)}")
            if not row.fields[0]:
                raise row.refused("there is no time")
        numbers = np.array([row.numbers(empty_allowed=True) for row in rows])
        commanded = np.array(read_numbers(commands, "one number per limb, every line as many"))
        try:
            return cls(numbers[:, 0], numbers[:, 1:].reshape(len(numbers), len(nodes), 2), nodes, commanded)
        except ValueError as unfit:
            raise ValueError(f"{trajectory}: {unfit}") from None

    def to_csv(self, trajectory: str | Path, commands: str | Path) -> None:
        """What from_csv reads."""
        names = ["time", *(f"{axis}{node}" for node in self.nodes for axis in "xy")]
        numbers = np.column_stack([self.time, self.positions.reshape(len(self.time), -1)])
        lines = [names, *(["" if math.isnan(x) else f"{x:.7g}" for x in row] for row in numbers.tolist())]
        Path(trajectory).write_text("".join(",".join(line) + "\n" for line in lines), encoding="utf-8")
        np.savetxt(commands, self.commands, "%g", ",")


class Estimate(NamedTuple):
    """Fitted parameters; arrays over parameters.

    values, lower, upper: Estimates and the ends of their confidence intervals, in the scene's units.
    correlation: Of the estimates, shape (p, p).
    untold: Groups of parameters that the data cannot tell, or not apart; their intervals mean nothing.
    residuals: Measured less fitted [m], shape (n, n_nodes_seen, 2). scene: With the fitted values.
    """

    names: tuple[str, ...]
    values: Floats
    lower: Floats
    upper: Floats
    correlation: Floats
    untold: tuple[tuple[str, ...], ...]
    residuals: Floats
    scene: Scene

    @property
    def root_mean_square(self) -> float:
        """Of the residuals [m]."""
        return float(np.sqrt(np.nanmean(self.residuals**2)))

    def report(self) -> str:
        """For people."""
        lines = [f"residuals: {1e3 * self.root_mean_square:.3g} mm root mean square"]
        rows = zip(self.names, self.values, self.lower, self.upper, strict=True)
        lines += [f"{name} = {value:.5g}   [{lower:.5g}, {upper:.5g}]" for name, value, lower, upper in rows]
        for group in self.untold:
            what = f"{group[0]} from the data" if len(group) == 1 else f"{' and '.join(group)} apart by these data"
            lines.append(f"Cannot tell {what}: measure something else, or fix {'it' if len(group) == 1 else 'one'}.")
        return "\n".join(lines)


def get_parameter(scene: Scene, name: str) -> float:
    """A number of the scene. ValueError: it has none of that name that could be fitted; counts could not."""
    if not isinstance(scene, Scene) or not isinstance(name, str):
        raise ValueError(f"A Scene and a parameter's name are needed, not {shown(scene)} and {shown(name)}.")
    first, *rest = name.split(".")
    value: Any = getattr(scene, first) if first in ("robot", "fluid", "actuator", "contact") else None
    for step in rest:
        if isinstance(value, tuple) and step.isdigit() and int(step) < len(value):
            value = value[int(step)]
        else:
            own = fields(value) if is_dataclass(value) else ()
            known = step in {field.name for field in own if field.type not in (int, "int")}
            value = getattr(value, step) if known else None
    if not is_finite_number(value) or value <= 0.0:
        raise ValueError(f"{name!r} is no positive number of this scene, such as fluid.drag_coefficient.")
    return float(value)


def with_parameters(scene: Scene, names: Sequence[str], values: Sequence[float] | Floats) -> Scene:
    """The scene with other numbers."""
    return with_numbers(scene, {name: float(value) for name, value in zip(names, values, strict=True)})


# --- trajectories ----------------------------------------------------------------------------------------------------


def trajectory(time: Floats, nodes: Sequence[int], commands: Floats, scene: Scene) -> Floats:
    """Where nodes of a scene's robot are at these times [m], shape (n, n_nodes_seen, 2).

    Between time steps by cubic Hermite interpolation, of the order of the schemes. NaN where the solver gave up.
    """
    return batch_of_trajectories(time, nodes, commands, [scene])[0]


def batch_of_trajectories(time: Floats, nodes: Sequence[int], commands: Floats, scenes: Sequence[Scene]) -> Floats:
    """Those of scenes of one frame, whose robots are the lanes of one batch; shape (n_scenes, n, n_nodes_seen, 2)."""
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
    """That of every scene's robot, shape (n_scenes, n, n_nodes_seen, 2).

    Scenes that differ in numbers of each robot alone are simulated side by side, in the lanes of one batch; others (of
    other durations, or other points of a measured curve) beside them, on threads.
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


# --- the fit ---------------------------------------------------------------------------------------------------------


def identify(scene: Scene, parameters: Sequence[str], measurement: Measurement, confidence: float = 0.95) -> Estimate:
    """Fit parameters of a scene, from the scene's own values on, to a measurement."""
    if isinstance(parameters, str) or not isinstance(parameters, Sequence) or not parameters:
        raise ValueError(f"parameters must be names of numbers, such as fluid.density, not {shown(parameters)}.")
    if not is_finite_number(confidence) or not 0.0 < confidence < 1.0:
        raise ValueError(f"confidence must be between 0 and 1, not {shown(confidence)}.")
    names = tuple(parameters)
    guess = np.array([get_parameter(scene, name) for name in names])
    n_limbs = scene.robot.n_limbs
    if measurement.commands.shape[1] != n_limbs or max(measurement.nodes) >= scene.robot.n_nodes:
        raise ValueError(
            f"Commands and nodes must be those of a robot of {n_limbs} limbs and {scene.robot.n_nodes} nodes."
        )
    seen = np.isfinite(measurement.positions)
    if seen.sum() <= len(names):
        raise ValueError(f"{seen.sum()} coordinates are too few for {len(names)} parameters.")

    changes = DIFFERENCE * np.vstack([np.zeros(len(names)), np.eye(len(names))])

    def scenes_at(logarithms: ArrayLike) -> list[Scene]:
        """The scene with these parameters, and with each of them changed a little."""
        return [with_parameters(scene, names, guess * np.exp(logarithms - change)) for change in changes]

    @lru_cache(maxsize=1)
    def simulate(*logarithms: float) -> Floats:
        """Their trajectories, for residuals and Jacobian in one go."""
        return trajectories(scenes_at(logarithms), measurement)

    def residuals(logarithms: Floats) -> Floats:
        try:
            scenes_at(logarithms)
        except ValueError:  # beyond what can be modelled: least_squares takes a shorter step
            return np.full(seen.sum(), np.inf)
        found = (simulate(*logarithms)[0] - measurement.positions)[seen]
        return np.where(np.isfinite(found), found, np.inf)

    def jacobian(logarithms: Floats) -> Floats:
        here, *changed = simulate(*logarithms)
        return np.stack([(here - other)[seen] / DIFFERENCE for other in changed], axis=1)

    bound = math.log(LARGEST_FACTOR)
    fit = least_squares(residuals, np.zeros(len(names)), jacobian, (-bound, bound), xtol=1e-6, ftol=1e-8)
    spread = math.sqrt(2.0 * fit.cost / (seen.sum() - len(names)))
    _, singular, directions = np.linalg.svd(fit.jac, full_matrices=False)
    errors = spread / np.maximum(singular, 1e-300)
    covariance = (directions.T * errors**2) @ directions
    half = student.ppf(0.5 + 0.5 * confidence, seen.sum() - len(names)) * np.sqrt(np.diag(covariance))
    found = simulate(*fit.x)[0]
    with np.errstate(over="ignore"):
        return Estimate(
            names=names,
            values=guess * np.exp(fit.x),
            lower=guess * np.exp(fit.x - half),
            upper=guess * np.exp(fit.x + half),
            correlation=covariance / np.sqrt(np.outer(np.diag(covariance), np.diag(covariance))),
            untold=tuple(
                tuple(name for name, part in zip(names, direction, strict=True) if abs(part) > SHARE)
                for direction, error in zip(directions, errors, strict=True)
                if error > UNTOLD
            ),
            residuals=measurement.positions - found,
            scene=scenes_at(fit.x)[0],
        )


def draw(estimate: Estimate, measurement: Measurement, file: Path) -> None:
    """Measured and fitted paths, and the residuals over time."""
    import matplotlib.pyplot as plt

    figure, (paths, over_time) = plt.subplots(1, 2, figsize=(10, 4.2), layout="constrained")
    fitted = measurement.positions - estimate.residuals
    for k, node in enumerate(measurement.nodes):
        (line,) = paths.plot(*1e3 * fitted[:, k].T, label="hub" if node == 0 else f"node {node}")
        paths.plot(*1e3 * measurement.positions[:, k].T, ".", color=line.get_color(), markersize=3, alpha=0.4)
        over_time.plot(measurement.time, 1e3 * estimate.residuals[:, k], ".", color=line.get_color(), markersize=3)
    paths.set(xlabel="x [mm]", ylabel="y [mm]", title="dots: measured, lines: fitted", aspect="equal")
    figure.legend(loc="outside lower center", ncols=len(measurement.nodes))
    over_time.axhline(0.0, color="black", linewidth=0.8)
    over_time.set(xlabel="time [s]", ylabel="measured less fitted, x and y [mm]")
    over_time.set_title(f"{1e3 * estimate.root_mean_square:.2f} mm root mean square")
    figure.savefig(file, dpi=120)
    plt.close(figure)


# --- data of our own -------------------------------------------------------------------------------------------------

TRUTH = {"fluid.drag_coefficient": 1.3, "robot.youngs_modulus": 1.4e6, "actuator.peak_angle": 0.55}


def synthetic(
    scene: Scene, truth: dict[str, float], n_strokes: int = 8, rate: float = 25.0, noise: float = 1e-3, seed: int = 0
) -> Measurement:
    """Hub and tips of a robot in strokes of random commands, `rate` times per second, with noise [m]."""
    rng, robot = np.random.default_rng(seed), scene.robot
    commands = rng.integers(-1, 2, (n_strokes, robot.n_limbs)).astype(float)
    times = np.arange(math.floor(n_strokes * scene.actuator.period * rate)) / rate
    nodes = (0, *((robot.nodes_per_limb - 1) * (np.arange(robot.n_limbs) + 1)).tolist())
    exact = trajectory(times, nodes, commands, with_parameters(scene, list(truth), list(truth.values())))
    return Measurement(times, exact + noise * rng.standard_normal(exact.shape), nodes, commands)


def main() -> int:
    """The command line; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("trajectory", nargs="?", type=Path, help="CSV: time,x0,y0,..")
    parser.add_argument("commands", nargs="?", type=Path, help="CSV: one command per stroke")
    parser.add_argument("--fit", nargs="+", default=list(TRUTH), metavar="PARAMETER", help="default: %(default)s")
    parser.add_argument("--step", type=float, default=5e-3, help="time step of the implicit midpoint rule [s]")
    parser.add_argument("--picture", type=Path, help="where to draw the fit")
    parser.add_argument("--synthetic", action="store_true", help="fit data of our own")
    options = parser.parse_args()
    if not options.synthetic and options.commands is None:
        parser.error("give a trajectory and its commands, or --synthetic")
    try:
        if options.picture is not None:
            require_extra("Pictures", "studies", "matplotlib")
        scene = Scene(Seastar(), Water(), SmaPulse(), Numerics("implicit-midpoint", options.step))
        if options.synthetic:
            measurement = synthetic(scene, TRUTH)
            print("truth:", ", ".join(f"{name} = {value:g}" for name, value in TRUTH.items()))
        else:
            measurement = Measurement.from_csv(options.trajectory, options.commands)
        begin = time.perf_counter()
        estimate = identify(scene, options.fit, measurement)
        print(estimate.report(), f"{time.perf_counter() - begin:.1f} s", sep="\n")
        if options.picture is not None:
            draw(estimate, measurement, options.picture)
    except (ValueError, OSError, ModuleNotFoundError) as bad_input:
        print(bad_input, file=sys.stderr)
        return 2
    return 0
