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
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.identify.measurement import Measurement, uncertainty_of, with_parameters
from seastar_gym.identify.search import (
    SUSPICIOUS,
    Found,
    Residuals,
    ends_of_search,
    require_clocks,
    require_places,
    require_rest,
    search,
)
from seastar_gym.identify.trajectories import LONGEST_DELAY, at_rest
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import is_finite_number, require_kind, require_within, shown

Floats = NDArray[np.float64]

UNTOLD = 0.5
"""Relative standard error above which a combination of parameters is undetermined."""
SHARE = 0.3
"""Component of such a combination, a unit vector, above which a parameter belongs to it."""
LARGEST_FACTOR = 20.0
"""Largest factor between a parameter and its first guess."""
SHORTEST_DELAY = 1e-3
"""Least bound of a delay that is fitted [s]."""
TOLERANCE = 1e-7
"""Largest Newton tolerance of a fit: that of an ordinary run errs by more than a parameter's small change does."""
NEAR_END = 0.99
"""Share of the largest delay above which the best one may lie beyond."""
DOUBT, UNSURE = "residual over noise", "cannot tell"
"""Entries in a file of intervals: of a fit that is doubted, and names of parameters whose intervals mean nothing."""
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
    def unsure(self) -> tuple[str, ...]:
        """Names of the parameters that are untold or at the end of the search."""
        told = {*self.at_end, *(name for group in self.untold for name in group)}
        return tuple(name for name in self.names if name in told)

    def intervals(self) -> dict[str, Any]:
        """Ends of the confidence intervals by name, where they are numbers, and what puts them in doubt."""
        ends = zip(self.names, self.lower.tolist(), self.upper.tolist(), strict=True)
        found: dict[str, Any] = {name: [low, high] for name, low, high in ends if math.isfinite(high)}
        found |= {DOUBT: round(self.ratio, 2)} if self.is_doubted else {}
        return found | ({UNSURE: list(self.unsure)} if self.unsure else {})

    @property
    def is_doubted(self) -> bool:
        """Whether the residual is well above the noise of the track."""
        return self.ratio > SUSPICIOUS

    def _of_noise(self) -> str:
        """What the residuals are beside the noise of the track."""
        if not math.isfinite(self.ratio):
            return "; too few pictures tell the noise of the track, so nothing tells whether the fit is right"
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
    if twice := [name for name in parameters if list(parameters).count(name) > 1]:
        raise ValueError(f"A parameter is fitted once, and {shown(twice[0])} is named twice.")
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


def estimate_of(found: Found, confidence: float) -> Estimate:
    """Estimates with confidence intervals, from the end of a search."""
    from scipy.stats import t as student  # takes half a second

    fit, residuals = found.fit, found.residuals
    names, guess, p = residuals.names, residuals.guess, len(residuals.names)
    freedom = residuals.seen.sum() - len(fit.x)
    times = residuals.measurement.time[np.nonzero(residuals.seen)[0]]
    known = uncertainty_of(fit.jac, fit.fun, times, found.least)
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
