"""`StrokeReport`: the solver's status and counts for every robot after an interval of time, such as a stroke."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.rods.step import COVERED
from seastar_gym.scene.scene import LARGEST_OVERLAP

Floats = NDArray[np.float64]


class SolverStatus(IntEnum):
    """Outcome of a robot's interval. Every value but CONVERGED is a failure."""

    CONVERGED = 0
    NOT_CONVERGED = 1
    NOT_FINITE = 2
    ITERATION_LIMIT = 3

    @property
    def sentence(self) -> str:
        """Explanation for the user, in one sentence."""
        return {
            SolverStatus.CONVERGED: "The stroke converged.",
            SolverStatus.NOT_CONVERGED: (
                "A time step did not converge even after it was halved to its floor; the robot stays at its last good "
                "state until it is reset: use a smaller Numerics.step, a softer robot or slower initial velocities."
            ),
            SolverStatus.NOT_FINITE: (
                "The robot's positions or velocities were not finite when the stroke began; it lies at rest where its "
                "hub was before, until it is reset: write finite numbers into Simulator.q and Simulator.v only."
            ),
            SolverStatus.ITERATION_LIMIT: (
                "The stroke took all Newton iterations that a robot has for one (see Numerics); the robot stays at its "
                "last good state until it is reset: use a smaller Numerics.step or peak angle, or slower initial "
                "velocities."
            ),
        }[self]


MEASURED_IF_ASKED = ("error_estimate", "work", "peak_moment", "energy_growth")
"""Fields of a report that are NaN unless the simulator has `error_bars`, `effort` or numerics of your own."""


class StrokeReport(NamedTuple):
    """Outcome and cost of a stroke, or of any other interval; every array has shape (n_robots,).

    status: SolverStatus.
    newton_iterations: Newton iterations.
    regularised: Newton iterations that used the regularised matrix.
    backtracks: Halvings of a Newton update by the line search.
    steps: Time steps accepted.
    halvings: Time steps that did not converge or created energy. They are halved or, at the shortest, tried again.
    energy_cuts: Times that velocities were reduced: because the energy had grown a little, or because no step led on,
        see rods/guard.py.
    covered: Time covered [s].
    smallest_opening_angle: Smallest angle between neighbouring limbs at the hub [rad]. Below zero, limbs crossed. With
        a body it is pi.
    largest_overlap: Largest depth to which limbs pressed each other or a body at the ends of time steps, over the
        distance at which they touch: 1 where centre lines meet. 0 where surfaces are apart at the ends of all steps,
        also if contact pushed them apart within a step. See scene/scene.py.
    error_estimate: Estimate of the hub's error, of space and time [m]: a bound that holds in about 95 % of strokes, see
        watches.py. NaN without `error_bars`.
    heating_time: Time for which wires were heated, summed over limbs [s]; NaN if the actuator does not say it.
    energy: Electric energy of that heat, with the actuator's heating power [J]; NaN if the actuator does not say it.
    work: Mechanical work of the actuators, from their moments at the ends of the steps of `Numerics.step` [J]. What
        limbs give back counts as negative. NaN without `effort`.
    peak_moment: Largest moment that a limb resisted its actuator with at these times [N m], likewise. A moment is the
        slope of the elastic energy in the limb's rotation.
    energy_growth: Kinetic energy relative to the water, each over the squared largest command so far, over the largest
        in the first 20 strokes. Well above 1, the numerics gather energy. 1 in the first 20 strokes; NaN
        for the chapter's scene at a fidelity, which gathers none, and on other devices than "cpu".
    """

    status: NDArray[np.int64]
    newton_iterations: NDArray[np.int64]
    regularised: NDArray[np.int64]
    backtracks: NDArray[np.int64]
    steps: NDArray[np.int64]
    halvings: NDArray[np.int64]
    energy_cuts: NDArray[np.int64]
    covered: Floats
    smallest_opening_angle: Floats
    largest_overlap: Floats
    error_estimate: Floats
    heating_time: Floats
    energy: Floats
    work: Floats
    peak_moment: Floats
    energy_growth: Floats


LARGEST, LAST = ("status", "largest_overlap", "peak_moment"), ("error_estimate", "energy_growth")
"""Fields of which a whole has the largest, or the last, of its pieces; most others it has the sum of."""


def report_of_pieces(pieces: Sequence[StrokeReport]) -> StrokeReport:
    """Report of an interval that was advanced in pieces, one after the other."""

    def whole(name: str) -> NDArray[Any]:
        values = np.stack([getattr(piece, name) for piece in pieces])
        if name in LAST:
            return np.asarray(values[-1])
        if name == "smallest_opening_angle":
            return np.asarray(values.min(axis=0))
        return np.asarray(values.max(axis=0) if name in LARGEST else values.sum(axis=0))

    return StrokeReport(*map(whole, StrokeReport._fields))


def make_report(
    status: NDArray[np.int64],
    rows: Floats,
    told: Mapping[str, Floats],
    hub_hinge: str,
    heating_time: Floats,
    power: float,
) -> StrokeReport:
    """Report of an interval from the kernels' numbers.

    status, rows: As `Batch.end` returns them. told: What is measured if asked, by name, shape (n_robots,) each.
    power: Electric power of a heated wire [W].
    """
    newton, _, regularised, backtracks, steps, halvings, cuts = rows[:COVERED].astype(np.int64)
    covered, smallest_hub_t, overlap = rows[COVERED:]
    angle = np.arctan(smallest_hub_t)
    angle += angle
    if hub_hinge == "turning":
        angle += np.pi
    unknown = np.empty((len(MEASURED_IF_ASKED), len(status)))
    unknown.fill(np.nan)  # `np.full` takes thrice as long
    error, work, moment, growth = map(told.get, MEASURED_IF_ASKED, unknown)
    return StrokeReport(
        status, newton, regularised, backtracks, steps, halvings, cuts, covered, angle, overlap, error, heating_time,
        power * heating_time, work, moment, growth,
    )  # fmt: skip


def warn_of_overlap(overlaps: Floats) -> None:
    """Warn of the robot whose limbs pressed deepest. overlaps: Largest ones, shape (n_robots,)."""
    robot = int(overlaps.argmax())
    warnings.warn(
        f"Limbs of robot {robot} overlap by {overlaps[robot]:.2f} of the distance at which they touch: beyond "
        f"{LARGEST_OVERLAP:g} contact is too soft to rely on, and limbs soon pass through each other, which stops "
        "their robot. Use a larger Contact.modulus, a shorter Contact.layer, a smaller peak angle or slower initial "
        "velocities.",
        RuntimeWarning,
        stacklevel=2,
    )
