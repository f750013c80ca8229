"""`identify`: a least-squares fit of parameters to a measurement, with confidence intervals.

Parameters are fitted by their logarithms, so their errors are relative. Each column of the Jacobian comes from a scene
in which one parameter has changed a little. These scenes and the scene itself are simulated side by side, as robots of
one batch. Intervals are those of `covariance.py`, whose residuals may depend on those before them.
Combinations of parameters, singular vectors of the Jacobian, whose relative error is above UNTOLD are not determined by
the data, and the estimate says so.
"""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import OptimizeResult, least_squares
from scipy.stats import t as student

from seastar_gym.identify.covariance import uncertainty_of
from seastar_gym.identify.measurement import Measurement
from seastar_gym.identify.parameters import get_parameter, with_parameters
from seastar_gym.identify.trajectories import trajectories
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import is_finite_number, require_kind, shown

Floats = NDArray[np.float64]

DIFFERENCE = 1e-4
"""Relative change of a parameter for a column of the Jacobian. Trajectories are accurate to about its square."""
UNTOLD = 0.5
"""Relative standard error above which a combination of parameters is undetermined."""
SHARE = 0.3
"""Component of such a combination, a unit vector, above which a parameter belongs to it."""
LARGEST_FACTOR = 20.0
"""Largest factor between a parameter and its first guess."""


class Estimate(NamedTuple):
    """Fitted parameters and their confidence intervals.

    names: Names of the p parameters.
    values: Estimates in the scene's units, shape (p,).
    lower, upper: Ends of the confidence intervals, shape (p,).
    correlation: Correlation of the estimates, shape (p, p).
    untold: Groups of parameters that the data do not determine, or only in combination; their intervals mean nothing.
    residuals: Measured minus fitted positions [m], shape (n, n_nodes_seen, 2).
    scene: Scene with the fitted values.
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
        """Root mean square of the residuals [m]."""
        return float(np.sqrt(np.nanmean(self.residuals**2)))

    def report(self) -> str:
        """Text with the estimates, one line each, and the parameters that the data do not determine."""
        lines = [f"residuals: {1e3 * self.root_mean_square:.3g} mm root mean square"]
        rows = zip(self.names, self.values, self.lower, self.upper, strict=True)
        lines += [f"{name} = {value:.5g}   [{lower:.5g}, {upper:.5g}]" for name, value, lower, upper in rows]
        for group in self.untold:
            what = f"{group[0]} from the data" if len(group) == 1 else f"{' and '.join(group)} apart by these data"
            lines.append(f"Cannot tell {what}: measure something else, or fix {'it' if len(group) == 1 else 'one'}.")
        return "\n".join(lines)


def identify(scene: Scene, parameters: Sequence[str], measurement: Measurement, confidence: float = 0.95) -> Estimate:
    """Fit parameters of a scene to a measurement.

    parameters: Names of positive numbers of the scene, such as "fluid.density". The scene's values are the first guess.
    confidence: Probability that the truth lies within a confidence interval.
    """
    require_kind("scene", scene, Scene, "a Scene")
    require_kind("measurement", measurement, Measurement, "a Measurement")
    if isinstance(parameters, str) or not isinstance(parameters, Sequence) or not parameters:
        raise ValueError(f"parameters must be names of numbers, such as fluid.density, not {shown(parameters)}.")
    if not is_finite_number(confidence) or not 0.0 < confidence < 1.0:
        raise ValueError(f"confidence must be between 0 and 1, not {shown(confidence)}.")
    residuals = Residuals(scene, tuple(parameters), measurement)
    bound = math.log(LARGEST_FACTOR)
    start = np.zeros(len(parameters))
    try:
        residuals.scenes(start)
    except ValueError as impossible:
        raise ValueError(f"A first guess needs room for small changes: {impossible}") from impossible
    fit = least_squares(residuals, start, residuals.jacobian, (-bound, bound), xtol=1e-6, ftol=1e-8)
    return estimate_of(fit, residuals, confidence)


class Residuals:
    """Simulated minus measured coordinates [m], as a function of the logarithms of parameters over their first guess.

    names: Names of the p parameters.
    guess: First guess of the parameters, shape (p,).
    seen: Whether each coordinate was measured, shape (n, n_nodes_seen, 2).
    """

    def __init__(self, scene: Scene, names: tuple[str, ...], measurement: Measurement):
        self.names, self.measurement, self._scene = names, measurement, scene
        self.guess = np.array([get_parameter(scene, name) for name in names])
        robot = scene.robot
        if measurement.commands.shape[1] != robot.n_limbs or max(measurement.nodes) >= robot.n_nodes:
            raise ValueError(
                f"Commands and nodes must be those of a robot of {robot.n_limbs} limbs and {robot.n_nodes} nodes."
            )
        self.seen = np.isfinite(measurement.positions)
        if self.seen.sum() <= len(names):
            raise ValueError(f"{self.seen.sum()} coordinates are too few for {len(names)} parameters.")
        self._changes = DIFFERENCE * np.vstack([np.zeros(len(names)), np.eye(len(names))])
        self._simulate = lru_cache(maxsize=1)(self._trajectories)  # for residuals and Jacobian at once

    def scenes(self, logarithms: ArrayLike) -> list[Scene]:
        """Scene with these parameters, and scenes in which one of them is changed a little; p + 1 scenes."""
        values = (self.guess * np.exp(logarithms - change) for change in self._changes)
        return [with_parameters(self._scene, self.names, row) for row in values]

    def _trajectories(self, *logarithms: float) -> Floats:
        return trajectories(self.scenes(logarithms), self.measurement)

    def trajectory(self, logarithms: Floats) -> Floats:
        """Simulated positions [m], shape (n, n_nodes_seen, 2)."""
        return np.asarray(self._simulate(*logarithms)[0])

    def __call__(self, logarithms: Floats) -> Floats:
        """Residuals of the coordinates that were measured [m]; infinite where the simulation is impossible."""
        try:
            self.scenes(logarithms)
        except ValueError:  # beyond what can be modelled: least_squares takes a shorter step
            return np.full(self.seen.sum(), np.inf)
        found = (self.trajectory(logarithms) - self.measurement.positions)[self.seen]
        return np.where(np.isfinite(found), found, np.inf)

    def jacobian(self, logarithms: Floats) -> Floats:
        """Derivative of the residuals by the logarithms [m], shape (n_seen, p)."""
        here, *changed = self._simulate(*logarithms)
        return np.stack([(here - other)[self.seen] / DIFFERENCE for other in changed], axis=1)


def estimate_of(fit: OptimizeResult, residuals: Residuals, confidence: float) -> Estimate:
    """Estimates with confidence intervals, from a least-squares fit of the residuals."""
    names, guess = residuals.names, residuals.guess
    freedom = residuals.seen.sum() - len(names)
    times = residuals.measurement.time[np.nonzero(residuals.seen)[0]]
    known = uncertainty_of(fit.jac, fit.fun, times)
    half = student.ppf(0.5 + 0.5 * confidence, freedom) * np.sqrt(np.diag(known.covariance))
    with np.errstate(over="ignore"):
        return Estimate(
            names=names,
            values=guess * np.exp(fit.x),
            lower=guess * np.exp(fit.x - half),
            upper=guess * np.exp(fit.x + half),
            correlation=known.correlation,
            untold=tuple(
                tuple(name for name, part in zip(names, direction, strict=True) if abs(part) > SHARE)
                for direction, error in zip(known.combinations, known.errors, strict=True)
                if error > UNTOLD
            ),
            residuals=residuals.measurement.positions - residuals.trajectory(fit.x),
            scene=residuals.scenes(fit.x)[0],
        )
