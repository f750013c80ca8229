"""`identify`: a least-squares fit of parameters to a measurement, with confidence intervals.

Parameters are fitted by their logarithms, so their errors are relative. Each column of the Jacobian comes from a scene
in which one parameter has changed a little. These scenes and the scene itself are simulated side by side, as robots of
one batch. `search.py` says where a fit begins, and what is refused. Intervals are those of `measurement.py`, whose
residuals may depend on those before them. Combinations of parameters, singular vectors of the Jacobian, whose relative
error is above UNTOLD are not determined by the data, and the estimate says so.

A delay between the logs, of a camera whose clock is not that of the commands, is one more parameter, fitted as it is
[s]: simulated trajectories are interpolated at the times of the pictures less the delay.

The frame of a track is only as good as the picture that it was taken from: an error of a few milliradians at the
beginning is one of all places. So trajectories may be moved and turned by the noise of one picture, which is linear
and is eliminated from residuals and Jacobian.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.identify.measurement import ORIENTATION, Measurement, get_parameter, uncertainty_of, with_parameters
from seastar_gym.identify.search import (
    SUSPICIOUS,
    Found,
    ends_of_search,
    noise_of,
    require_clocks,
    require_places,
    require_rest,
    search,
)
from seastar_gym.identify.trajectories import LONGEST_DELAY, at_rest, delayed_trajectories, trajectories
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import is_finite_number, require_kind, require_within, shown

Floats = NDArray[np.float64]

DIFFERENCE = 1e-4
"""Relative change of a parameter for a column of the Jacobian. Trajectories are accurate to about its square."""
UNTOLD = 0.5
"""Relative standard error above which a combination of parameters is undetermined."""
SHARE = 0.3
"""Component of such a combination, a unit vector, above which a parameter belongs to it."""
LARGEST_FACTOR = 20.0
"""Largest factor between a parameter and its first guess."""
DELAYS_APART = 0.02
"""Distance between delays that are tried for a first guess [s]."""
SHORTEST_DELAY = 1e-3
"""Least bound of a delay that is fitted [s]."""
TOLERANCE = 1e-7
"""Largest Newton tolerance of a fit: that of an ordinary run errs by more than a parameter's small change does."""
NEAR_END = 0.99
"""Share of the largest delay above which the best one may lie beyond."""
DOUBT = "residual over noise"
"""Entry in a file of intervals whose fit is doubted."""
DELAY = "the delay"
"""Name of the delay in sentences."""


class Delay(NamedTuple):
    """Time by which the clock of the pictures is ahead of that of the commands, and its confidence interval [s]."""

    value: float
    lower: float
    upper: float


class Estimate(NamedTuple):
    """Fitted parameters and their confidence intervals.

    names: Names of the p parameters.
    values: Estimates in the scene's units, shape (p,).
    lower, upper: Ends of the confidence intervals, shape (p,).
    correlation: Correlation of the estimates, shape (p, p); with a delay (p + 1, p + 1), and it is the last.
    untold: Groups of parameters that the data do not determine, or only in combination; their intervals mean nothing.
    residuals: Measured minus fitted positions [m], less what an error of the track's frame explains, shape (n,
        n_nodes_seen, 2); NaN where a point was not seen, or was left out.
    scene: Scene with the fitted values.
    delay: Delay between the logs. None where it was not fitted.
    noise: Of each coordinate of the track [m], from its fourth differences; NaN for fewer than five pictures.
    ratio: Residual over noise, about 1 for a fit that is right; NaN where the noise is not known. Above `SUSPICIOUS`
        a minimum is wrong, or the scene lacks something: then intervals mean little.
    left_out: Number of points that were left out, as another one was taken for them.
    at_end: Names of parameters that are at the end of the search.
    farthest: Picture [s] and node of the largest residual, and its size [m].
    """

    names: tuple[str, ...]
    values: Floats
    lower: Floats
    upper: Floats
    correlation: Floats
    untold: tuple[tuple[str, ...], ...]
    residuals: Floats
    scene: Scene
    delay: Delay | None = None
    noise: float = math.nan
    ratio: float = math.nan
    left_out: int = 0
    at_end: tuple[str, ...] = ()
    farthest: tuple[float, int, float] | None = None

    @property
    def root_mean_square(self) -> float:
        """Root mean square of the residuals [m]."""
        return float(np.sqrt(np.nanmean(self.residuals**2)))

    def report(self) -> str:
        """Text with the estimates, one line each, and the parameters that the data do not determine."""
        lines = [f"residuals: {1e3 * self.root_mean_square:.3g} mm root mean square{self._of_noise()}"]
        if self.left_out:
            lines.append(f"{self.left_out} points were left out: they are far from where the robot can have been.")
        rows = zip(self.names, self.values, self.lower, self.upper, strict=True)
        lines += [f"{name} = {value:.5g}   [{lower:.5g}, {upper:.5g}]" for name, value, lower, upper in rows]
        if self.delay is not None:
            lines.append("delay = {:.4f} s   [{:.4f}, {:.4f}]".format(*self.delay))
        if self.is_doubted and self.farthest is not None:
            picture, node, off = self.farthest
            lines.append(f"The largest residual is {1e3 * off:.3g} mm, of node {node} at {picture:.3f} s.")
        lines += [f"{name} is at the end of the search: begin with another first guess." for name in self.at_end]
        for group in self.untold:
            what = f"{group[0]} from the data" if len(group) == 1 else f"{' and '.join(group)} apart by these data"
            lines.append(f"Cannot tell {what}: measure something else, or fix {'it' if len(group) == 1 else 'one'}.")
        return "\n".join(lines)

    @property
    def is_doubted(self) -> bool:
        """Whether the residual is well above the noise of the track."""
        return self.ratio > SUSPICIOUS

    def _of_noise(self) -> str:
        """What the residuals are beside the noise of the track."""
        if not math.isfinite(self.ratio):
            return ""
        told = f", {self.ratio:.2f} times the noise of the track"
        return told if not self.is_doubted else f"{told}: a wrong minimum, or the scene lacks something"


def identify(
    scene: Scene,
    parameters: Sequence[str],
    measurement: Measurement,
    confidence: float = 0.95,
    largest_delay: float | None = None,
) -> Estimate:
    """Fit parameters of a scene to a measurement.

    parameters: Names of positive numbers of the scene, such as "fluid.density". The scene's values are the first guess.
    confidence: Probability that the truth lies within a confidence interval.
    largest_delay: Fit the delay between pictures and commands, too, from minus to plus this [s]. None means that they
        share a clock.
    """
    require_kind("scene", scene, Scene, "a Scene")
    require_kind("measurement", measurement, Measurement, "a Measurement")
    if isinstance(parameters, str) or not isinstance(parameters, Sequence) or not parameters:
        raise ValueError(f"parameters must be names of numbers, such as fluid.density, not {shown(parameters)}.")
    if not is_finite_number(confidence) or not 0.0 < confidence < 1.0:
        raise ValueError(f"confidence must be between 0 and 1, not {shown(confidence)}.")
    if largest_delay is not None:
        require_within("largest_delay", largest_delay, SHORTEST_DELAY, LONGEST_DELAY)
    precise = replace(scene.numerics, newton_tolerance=min(scene.numerics.newton_tolerance, TOLERANCE))
    residuals_of = partial(
        Residuals, replace(scene, numerics=precise), tuple(parameters), delayed=largest_delay is not None
    )
    residuals = residuals_of(measurement)
    start = np.zeros(len(parameters) + residuals.delayed)
    bound = np.full(len(start), math.log(LARGEST_FACTOR))
    try:
        residuals.scenes(start)
    except ValueError as impossible:
        raise ValueError(f"A first guess needs room for small changes: {impossible}") from impossible
    late, robot, period = largest_delay or 0.0, scene.robot, scene.actuator.period
    require_clocks(measurement, period, late)
    rests = [at_rest(each, measurement.nodes) for each in residuals.scenes(start)]
    are_known = all(np.array_equal(rest, rests[0]) for rest in rests)  # no length is fitted
    if are_known:
        require_places(measurement, float(2.0 * np.hypot(*robot.nodes().T).max()))
    first = residuals.trajectory(start)  # refuses times and commands that do not fit, which steps below may not
    if are_known:
        require_rest(measurement, rests[0], robot.limb_length, first[0], late)
    if largest_delay is not None:
        start[-1], bound[-1] = residuals.likely_delay(largest_delay), largest_delay
    found = search(residuals_of, measurement, period, start, bound, robot.limb_length, late)
    if largest_delay is not None and abs(best := float(found.fit.x[-1])) > NEAR_END * largest_delay:
        raise ValueError(f"The best delay is {best:.4g} s, at the end of what was tried: allow a larger one.")
    estimate = estimate_of(found, confidence)
    if (off := estimate.root_mean_square) > 0.5 * robot.limb_length:
        raise ValueError(
            f"The best fit is {1e3 * off:.3g} mm off in the root mean square, more than half a limb: are these the "
            "track, the commands and the scene of one swim, in metres and seconds?"
        )
    at_end, sizes = ends_of_search(residuals.names, found.fit.x, bound), np.linalg.norm(estimate.residuals, axis=2)
    picture, place = np.unravel_index(np.nanargmax(sizes), sizes.shape)
    farthest = float(measurement.time[picture]), measurement.nodes[place], float(sizes[picture, place])
    return estimate._replace(
        scene=with_parameters(scene, residuals.names, estimate.values.tolist()), noise=found.noise, ratio=found.ratio,
        left_out=found.left_out, at_end=at_end, farthest=farthest,
    )  # fmt: skip


class Residuals:
    """Simulated minus measured coordinates [m], as a function of the logarithms of parameters over their first guess.

    names: Names of the p parameters.
    guess: First guess of the parameters, shape (p,).
    delayed: Whether a delay [s] follows the logarithms.
    seen: Whether each coordinate was measured, shape (n, n_nodes_seen, 2).
    """

    def __init__(self, scene: Scene, names: tuple[str, ...], measurement: Measurement, delayed: bool = False):
        self.names, self.measurement, self.delayed, self._scene = names, measurement, delayed, scene
        self.guess = np.array([get_parameter(scene, name) for name in names])
        robot, n_fitted = scene.robot, len(names) + delayed
        if measurement.commands.shape[1] != robot.n_limbs or max(measurement.nodes) >= robot.n_nodes:
            raise ValueError(
                f"Commands and nodes must be those of a robot of {robot.n_limbs} limbs and {robot.n_nodes} nodes."
            )
        if ORIENTATION in measurement.nodes and robot.body is None:
            raise ValueError("An orientation is that of a body: give the scene a robot.body, or leave theta out.")
        self.seen = np.isfinite(measurement.positions)
        if self.seen.sum() <= n_fitted:
            raise ValueError(f"{self.seen.sum()} coordinates are too few for {n_fitted} parameters.")
        self._changes = DIFFERENCE * np.vstack([np.zeros(n_fitted), np.eye(n_fitted)])
        per_node = np.nan_to_num(noise_of(measurement.positions)) / math.sqrt(len(measurement.nodes))
        self._frame = np.array([per_node, per_node, per_node / robot.limb_length])  # its errors [m, m, rad]
        self._simulate = lru_cache(maxsize=1)(self._trajectories)  # for residuals and Jacobian at once

    def scenes(self, fitted: ArrayLike) -> list[Scene]:
        """Scene with these parameters, and scenes in which one of what is fitted is changed a little."""
        p = len(self.names)
        values = self.guess * np.exp((np.asarray(fitted) - self._changes)[:, :p])
        return [with_parameters(self._scene, self.names, row) for row in values]

    def _delays(self, fitted: ArrayLike) -> Floats:
        """Delays of these scenes [s]."""
        return (np.asarray(fitted) - self._changes)[:, -1] if self.delayed else np.zeros(len(self._changes))

    def _trajectories(self, *fitted: float) -> Floats:
        return trajectories(self.scenes(fitted), self.measurement, self._delays(fitted))

    def trajectory(self, fitted: Floats) -> Floats:
        """Simulated positions [m], shape (n, n_nodes_seen, 2)."""
        return np.asarray(self._simulate(*fitted)[0])

    def likely_delay(self, largest: float) -> float:
        """Delay up to `largest` by which the scene as it is fits best, of some that are DELAYS_APART [s]."""
        delays = np.linspace(-largest, largest, 2 * math.ceil(largest / DELAYS_APART) + 1)[1:-1]
        found = delayed_trajectories(self._scene, self.measurement, delays)
        errors = np.nansum((found - self.measurement.positions) ** 2, axis=(1, 2, 3))
        return float(delays[np.argmin(errors)])

    def __call__(self, fitted: Floats) -> Floats:
        """Residuals of the coordinates that were measured [m]; infinite where the simulation is impossible."""
        try:
            here = self.trajectory(fitted)
        except ValueError:  # beyond what can be modelled: least_squares takes a shorter step
            return np.full(self.seen.sum(), np.inf)
        return self._less_frame(here, (here - self.measurement.positions)[self.seen])

    def jacobian(self, fitted: Floats) -> Floats:
        """Derivative of the residuals by what is fitted, shape (n_seen, p), or (n_seen, p + 1) with a delay."""
        here, *changed = self._simulate(*fitted)
        return self._less_frame(here, np.stack([(here - other)[self.seen] / DIFFERENCE for other in changed], axis=1))

    def _less_frame(self, here: Floats, found: Floats) -> Floats:
        """Residuals, shape (n_seen,), or their derivatives, (n_seen, p), without what an error of the frame explains.

        It is the square root of their precision where the frame has errors of its own. here: Simulated positions.
        """
        finite = np.where(np.isfinite(found), found, np.inf)
        if not self._frame.any() or not np.isfinite(finite).all():
            return finite
        axes = np.zeros((3, *here.shape))
        placed = [node != ORIENTATION for node in self.measurement.nodes]
        axes[0, :, placed, 0] = axes[1, :, placed, 1] = self._frame[0]
        axes[2] = self._frame[2] * np.stack([-here[..., 1], here[..., 0]], axis=-1)
        noise = self._frame[0] * math.sqrt(len(self.measurement.nodes))
        U, s, _ = np.linalg.svd(axes[:, self.seen].T / noise, full_matrices=False)
        share = (1.0 - 1.0 / np.sqrt(1.0 + s**2)).reshape(-1, *[1] * (found.ndim - 1))
        return found - U @ (share * (U.T @ found))

    def at(self, rows: Floats) -> tuple[Floats, Floats]:
        """Residuals of several rows, shape (n, n_seen), and their derivatives, (n, n_seen, p); infinite and zero where
        a simulation is impossible. All are simulated side by side."""
        scenes, delays, possible = list[Scene](), list[Floats](), np.zeros(len(rows), bool)
        for k, row in enumerate(rows):
            with suppress(ValueError):
                scenes += self.scenes(row)
                delays.append(self._delays(row))
                possible[k] = True
        values = np.full((len(rows), self.seen.sum()), np.inf)
        slopes = np.zeros((*values.shape, rows.shape[1]))
        if possible.any():
            found = trajectories(scenes, self.measurement, np.concatenate(delays))
            found = found.reshape(-1, len(self._changes), *self.seen.shape)
            here = found[:, 0, self.seen]
            apart = np.moveaxis(here[:, None] - found[:, 1:, self.seen], 1, 2) / DIFFERENCE
            for k, row in enumerate(np.flatnonzero(possible)):
                values[row] = self._less_frame(found[k, 0], here[k] - self.measurement.positions[self.seen])
                slopes[row] = self._less_frame(found[k, 0], apart[k])
        return values, slopes


def estimate_of(found: Found, confidence: float) -> Estimate:
    """Estimates with confidence intervals, from the end of a search."""
    from scipy.stats import t as student  # takes half a second

    fit, residuals = found.fit, found.residuals
    assert isinstance(residuals, Residuals)
    names, guess, p = residuals.names, residuals.guess, len(residuals.names)
    freedom = residuals.seen.sum() - len(fit.x)
    times = residuals.measurement.time[np.nonzero(residuals.seen)[0]]
    known = uncertainty_of(fit.jac, fit.fun, times)
    off = np.full(residuals.seen.shape, np.nan)
    off[residuals.seen] = -fit.fun
    half = student.ppf(0.5 + 0.5 * confidence, freedom) * np.sqrt(np.diag(known.covariance))
    fitted = [*names, DELAY][: len(fit.x)]
    with np.errstate(over="ignore"):
        return Estimate(
            names=names,
            values=guess * np.exp(fit.x[:p]),
            lower=guess * np.exp((fit.x - half)[:p]),
            upper=guess * np.exp((fit.x + half)[:p]),
            correlation=known.correlation,
            untold=tuple(
                tuple(name for name, part in zip(fitted, direction, strict=True) if abs(part) > SHARE)
                for direction, error in zip(known.combinations, known.errors, strict=True)
                if error > UNTOLD
            ),
            residuals=off,
            scene=residuals.scenes(fit.x)[0],
            delay=Delay(*(fit.x[p] + half[p] * np.array([0.0, -1.0, 1.0])).tolist()) if len(fit.x) > p else None,
        )
