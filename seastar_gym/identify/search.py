"""How `identify` looks for the least residual, and what it refuses before.

Limbs that are stiff and little damped ring after every pulse. With a wrong modulus a simulated limb comes into phase
with the measured one again after a whole period, so that long tracks have several minima, each with narrow intervals;
one or two strokes have one. So the first strokes are fitted first, with a weak prior, and then more of them.

The noise of a track is told by its fourth differences. A residual that is well above it is a sign of points that were
mistaken, which a robust fit finds and leaves out, of another minimum, which is looked for from other moduli, or of
a scene that lacks something.
"""

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import OptimizeResult, least_squares

from seastar_gym.identify.measurement import ORIENTATION, Measurement, get_parameter, with_parameters
from seastar_gym.identify.trajectories import delayed_trajectories, trajectories
from seastar_gym.scene import Scene

Floats = NDArray[np.float64]

STAGES = (1.0, 2.0, 4.0)
"""Strokes that are fitted before the whole track."""
ROUGHLY = {"xtol": 1e-3, "ftol": 1e-4, "max_nfev": 25}
"""Options of these fits."""
SUSPICIOUS = 1.1
"""Residual over the track's noise from which on a fit is doubted."""
OUTLIER = 6.0
"""Distance from the robust fit, over the noise, from which on a point is left out."""
MOST_OUTLIERS = 0.2
"""Largest share of the points that is left out."""
OTHERS = np.geomspace(1.0 / 6.0, 6.0, 24)
"""Factors of the stiffness from which other minima are looked for."""
STIFFNESS = {"youngs_modulus": 1.0, "EI": 1.0, "radius": 0.5, "length": -0.25, "density": -1.0}
"""Ends of names of parameters that change a limb's frequency, and the power of the stiffness that does the same."""
ROUNDS = 3
"""Steps from each of them before the two best are fitted."""
APART = 0.12
"""Least distance between logarithms of parameters of minima that differ."""
LEAST_NOISE = 5e-4
"""Noise, over the length of a limb, below which errors of the simulation count more."""
MOST_PERIODS, MOST_PAUSES = 3.0, 100.0
"""Longest times, in strokes, between pictures with which the strokes' motion is seen, and between commands."""
DIFFERENCE = 1e-4
"""Relative change of a parameter for a column of the Jacobian. Trajectories are accurate to about its square."""
DELAYS_APART = 0.02
"""Distance between delays that are tried for a first guess [s]."""
LONGEST_PAUSE = 60.0
"""Longest time between the first picture and the first command [s]."""


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
        simulated = lru_cache(maxsize=1)  # for residuals and Jacobian at once
        self._simulate = simulated(lambda *x: trajectories(self.scenes(x), measurement, self._delays(x)))

    def scenes(self, fitted: ArrayLike) -> list[Scene]:
        """Scene with these parameters, and scenes in which one of what is fitted is changed a little."""
        p = len(self.names)
        values = self.guess * np.exp((np.asarray(fitted) - self._changes)[:, :p])
        return [with_parameters(self._scene, self.names, row) for row in values]

    def _delays(self, fitted: ArrayLike) -> Floats:
        """Delays of these scenes [s]."""
        return (np.asarray(fitted) - self._changes)[:, -1] if self.delayed else np.zeros(len(self._changes))

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


class Found(NamedTuple):
    """End of a search.

    fit: Of the points that were kept. residuals: Of these points.
    noise: Of the track [m], NaN for fewer than five pictures. least: Noise that is too little to matter [m].
    left_out: Number of points that were left out.
    """

    fit: OptimizeResult
    residuals: Residuals
    noise: float
    least: float
    left_out: int = 0

    @property
    def ratio(self) -> float:
        """Residual over the noise of the track, or of the residuals if that is less; NaN if neither is known."""
        table = np.full(self.residuals.seen.shape, np.nan)
        table[self.residuals.seen] = self.fit.fun
        own = noise_of(table, order=2)
        return float(np.sqrt(np.mean(self.fit.fun**2))) / max(np.fmin(self.noise, own), self.least)


def noise_of(positions: Floats, order: int = 4) -> float:
    """Noise of the coordinates of a track [m], from differences of this order; NaN for fewer pictures than these need.

    Differences of a coordinate are those of the pictures in which it was seen. The noise is the root mean square over
    coordinates, whose noises may differ: those of an orientation and a place do.
    """
    seen = [column[np.isfinite(column)] for column in positions.reshape(len(positions), -1).T]
    columns = [np.abs(np.diff(column, n=order)) for column in seen]
    counts = [len(column) for column in columns]
    if not any(counts):
        return math.nan
    squares = [np.median(column) ** 2 if column.size else 0.0 for column in columns]
    return float(1.4826 * math.sqrt(np.average(squares, weights=counts) / math.comb(2 * order, order)))


def search(
    residuals_of: Callable[[Measurement], Residuals],
    measurement: Measurement,
    period: float,
    start: Floats,
    bound: Floats,
    length: float,
    largest_delay: float = 0.0,
) -> Found:
    """Least residual of a track, from a start and within bounds of either sign.

    period: Of the strokes [s]. length: Of a limb [m]. largest_delay: Of the pictures against the commands [s].
    """
    tiny = LEAST_NOISE * length
    noise, x = noise_of(measurement.positions), start
    robust = {"loss": "soft_l1", "f_scale": 2.0 * np.fmax(noise, tiny)}  # points that were mistaken count little
    for strokes in STAGES:
        part = beginning(measurement, strokes * period, period, largest_delay)
        if part is not None and np.isfinite(part.positions).sum() > 4 * len(start):
            some = residuals_of(part)
            x = x if np.isfinite(some(x)).all() else start  # what fits less may be impossible for longer
            x = least(some, x, bound, prior=np.fmax(noise, tiny), **ROUGHLY, **robust).x
    whole = residuals_of(measurement)
    found = Found(least(whole, x if np.isfinite(whole(x)).all() else start, bound), whole, noise, tiny)
    if found.ratio > SUSPICIOUS:
        found = without_outliers(residuals_of, found, bound)
    if found.ratio > SUSPICIOUS:
        found = least_of_others(found, start, bound)
    return found


def least(residuals: Residuals, x: Floats, bound: Floats, *, prior: float = 0.0, **options: Any) -> OptimizeResult:
    """Least residual near x. prior: Residual of each parameter that is twice its first guess, 0 for none [m]."""
    weights = np.diag(np.where(np.arange(len(x)) < len(residuals.names), prior / math.log(2.0), 0.0))
    options = {"xtol": 1e-6, "ftol": 1e-8, **options}
    if not prior:
        return least_squares(residuals, x, residuals.jacobian, (-bound, bound), **options)
    return least_squares(
        lambda x: np.append(residuals(x), weights @ x), x,
        lambda x: np.vstack([residuals.jacobian(x), weights]), (-bound, bound), **options,
    )  # fmt: skip


def beginning(measurement: Measurement, duration: float, period: float, margin: float = 0.0) -> Measurement | None:
    """What was measured in this time since the first command [s]; None if that is all.

    margin: Time for which commands are kept beyond it, as the clocks may differ [s].
    """
    times = measurement.command_times
    begin = 0.0 if times is None else float(times[0])
    early = measurement.time < begin + duration - 1e-9
    if early.all() or not early.any() or not np.isfinite(measurement.positions[early]).any():
        return None
    given = begin + period * np.arange(len(measurement.commands)) if times is None else times
    n = max(1, int(np.sum(given < begin + duration + margin - 1e-9)))
    return replace(
        measurement, time=measurement.time[early], positions=measurement.positions[early],
        commands=measurement.commands[:n], command_times=None if times is None else times[:n],
    )  # fmt: skip


def without_outliers(residuals_of: Callable[[Measurement], Residuals], found: Found, bound: Floats) -> Found:
    """Fit of the points that a robust fit comes near to, if what is left fits as well as its noise; else as found."""
    robust = least(found.residuals, found.fit.x, bound, loss="soft_l1", f_scale=2.0 * np.fmax(found.noise, found.least))
    measured, table = found.residuals.measurement, np.zeros(found.residuals.seen.shape)
    table[found.residuals.seen] = found.residuals(robust.x)
    far = np.abs(table).max(axis=2) > OUTLIER * np.fmax(found.noise, found.least)
    if not 0 < far.sum() <= MOST_OUTLIERS * found.residuals.seen.any(axis=2).sum():
        return found
    kept = residuals_of(replace(measured, positions=np.where(far[..., None], np.nan, measured.positions)))
    other = Found(least(kept, robust.x, bound), kept, found.noise, found.least, int(far.sum()))
    return other if other.ratio <= SUSPICIOUS else found


def least_of_others(found: Found, start: Floats, bound: Floats) -> Found:
    """The least of what was found and of the minima from other stiffnesses."""
    names, shift = found.residuals.names, np.zeros((len(OTHERS), len(start)))
    chosen = [(end, [k for k, name in enumerate(names) if name.endswith(end)]) for end in STIFFNESS]
    end, places = next((each for each in chosen if each[1]), ("", []))  # all moduli, or else all of another kind
    if not places:
        return found
    shift[:, places] = STIFFNESS[end] * np.log(OTHERS)[:, None]
    rows = np.clip(start + shift, -0.99 * bound, 0.99 * bound)
    best = found.fit
    for x in distinct(*descended(found.residuals, rows, bound))[:2]:
        if np.isfinite(found.residuals(x)).all():
            fit = least(found.residuals, x, bound)
            best = min(best, fit, key=lambda each: each.cost)
    return found._replace(fit=best)


def descended(residuals: Residuals, rows: Floats, bound: Floats) -> tuple[Floats, Floats]:
    """Rows after some steps of Levenberg and Marquardt, all of them side by side, and their costs."""
    best, costs = rows.copy(), np.full(len(rows), np.inf)
    damping, steps = np.full(len(rows), 1e-2), np.zeros_like(rows)
    slopes: list[tuple[Floats, Floats] | None] = [None] * len(rows)
    for _ in range(ROUNDS + 1):
        tried = np.clip(best + steps, -bound, bound)
        values, jacobians = residuals.at(tried)
        for k, (r, J) in enumerate(zip(values, jacobians, strict=True)):
            cost = float(r @ r)
            if cost < costs[k]:
                best[k], costs[k], slopes[k], damping[k] = tried[k], cost, (J.T @ J, J.T @ r), damping[k] / 5.0
            else:
                damping[k] *= 10.0
            if (known := slopes[k]) is not None:
                H = known[0] + damping[k] * np.diag(np.diag(known[0])) + 1e-12 * np.trace(known[0]) * np.eye(len(J.T))
                steps[k] = -np.clip(np.linalg.solve(H, known[1]), -0.7, 0.7)
    return best, costs


def distinct(rows: Floats, costs: Floats) -> list[Floats]:
    """Rows that are apart from each better one, best first."""
    found = list[Floats]()
    for k in np.argsort(costs):
        if np.isfinite(costs[k]) and all(np.abs(rows[k] - other).max() > APART for other in found):
            found.append(rows[k])
    return found


# What is refused before anything is simulated


def require_clocks(measurement: Measurement, period: float, largest_delay: float = 0.0) -> None:
    """ValueError for times that cannot be seconds of one clock. period: Of the strokes [s]."""
    pictures, commands = measurement.time, measurement.command_times
    commands = np.zeros(1) if commands is None else commands
    between, pause = (float(np.median(np.diff(each))) if len(each) > 1 else 0.0 for each in (pictures, commands))
    far = abs(pictures[0] - commands[0]) > LONGEST_PAUSE + largest_delay
    if far or between > MOST_PERIODS * period or pause > MOST_PAUSES * period:
        raise ValueError(
            f"Pictures are {between:.4g} s apart and commands {pause:.4g} s, for strokes of {period:.4g} s, the first "
            f"picture is of {pictures[0]:.6g} s and the first command of {commands[0]:.6g} s: give both in seconds, "
            "not milliseconds, of one clock."
        )


def require_places(measurement: Measurement, length: float) -> None:
    """ValueError for points that are farther apart than a robot of this length [m] is long."""
    seen = measurement.positions[:, [node != ORIENTATION for node in measurement.nodes]]
    if seen.shape[1] < 2:
        return
    none = np.isnan(seen)
    spans = (np.where(none, -np.inf, seen).max(axis=1) - np.where(none, np.inf, seen).min(axis=1)).max(axis=1)
    known = spans[np.isfinite(spans)]
    far = float(np.median(known)) if known.size else 0.0
    if far > 1.1 * length:
        units = {"mm": 1e3, "cm": 1e2}
        unit = next(
            (f": they may be in {name}." for name, size in units.items() if 0.2 < far / length / size < 5.0), "."
        )
        raise ValueError(
            f"The points of a picture are up to {far:.3g} m apart, and the robot is {length:.3g} m long{unit}"
        )


def require_rest(
    measurement: Measurement, rest: Floats, length: float, first: Floats | None = None, largest_delay: float = 0.0
) -> float:
    """Distance of the robot from its shape at rest in the pictures from before the first command [m]; NaN if unknown.

    ValueError where it is not at rest. Where there are no such pictures, the first one may be as far from it as the
    simulated robot is then. rest, first: Positions of the nodes at rest, and simulated at the first picture [m], shape
    (n_nodes_seen, 2); None: as at rest. length: Of a limb [m].
    """
    begin = 0.0 if measurement.command_times is None else float(measurement.command_times[0])
    n_early = int(np.sum(measurement.time <= begin - largest_delay + 1e-9))
    if not n_early and largest_delay:
        return math.nan  # they may be of any time
    early = measurement.positions[: max(n_early, 1)]
    early = early[np.isfinite(early).any(axis=(1, 2))]
    if not len(early):
        return math.nan
    seen = np.full(rest.shape, np.nan)
    known = np.isfinite(early).any(axis=0)
    seen[known] = np.nanmean(early[:, known], axis=0)
    noise = noise_of(measurement.positions)
    moved = 0.0 if n_early or first is None else _distance(first, rest)
    allowed = max(3.0 * noise if math.isfinite(noise) else 0.0, 0.01 * length) + moved
    off = _distance(seen, rest)
    if off > allowed:
        others = {name: _distance(seen, other) for name, other in _alike(seen, rest).items()}
        name = min(others, key=lambda each: others[each])
        hint = f" {name} it would be within {1e3 * others[name]:.2g} mm." if others[name] < 0.3 * off else ""
        raise ValueError(
            f"The robot at rest is {1e3 * off:.3g} mm from the first picture, in the root mean square, and "
            f"{1e3 * allowed:.2g} mm are allowed: check units, which point is which node, and that the track begins at "
            f"rest, with the hub at the origin and limb 1 along +x.{hint}"
        )
    return off


def _distance(one: Floats, other: Floats) -> float:
    """Root mean square of the difference [m]."""
    return float(np.sqrt(np.nanmean((one - other) ** 2)))


def _alike(seen: Floats, rest: Floats) -> dict[str, Floats]:
    """The robot at rest mirrored, turned, scaled and moved so that it fits best, by what was done to it."""
    known = np.asarray(np.isfinite(seen).all(axis=1))
    there, here = np.where(known[:, None], seen, 0.0), np.where(known[:, None], rest, 0.0)
    angle = math.atan2(np.sum(here[:, 0] * there[:, 1] - here[:, 1] * there[:, 0]), np.sum(here * there))
    c, s = math.cos(angle), math.sin(angle)
    factor = np.sum(here * there) / max(np.sum(here * here), 1e-300)
    shift = np.nanmean(np.where(known[:, None], seen - rest, np.nan), axis=0)
    return {
        "Mirrored": rest * [1.0, -1.0],
        f"Turned by {math.degrees(angle):.0f} degrees": rest @ np.array([[c, s], [-s, c]]),
        f"Scaled by {factor:.3g}": max(factor, 1e-3) * rest,
        f"Moved by ({1e3 * shift[0]:.0f}, {1e3 * shift[1]:.0f}) mm": rest + shift,
    }


def ends_of_search(names: Sequence[str], x: Floats, bound: Floats) -> tuple[str, ...]:
    """Names of the parameters that are where the search ends."""
    return tuple(name for name, one, most in zip(names, x, bound, strict=False) if abs(one) > 0.999 * most)
