"""`differentiate`: a swim of one robot, and its derivatives in numbers of the scene, commands and the start.

Memory of a tape: bundles of coefficients and of work whose rows of robots stand on it.
"""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.gradients.history import OF_STAGE, OF_STEP
from seastar_gym.gradients.tape import Replayed, advance_slopes, arrays_of
from seastar_gym.gradients.unknowns import Rotations, Start, slopes_of_start, strengths_of, unknowns_of
from seastar_gym.lanes.registers import N_LANES
from seastar_gym.lanes.rows import aligned_rows, side_by_side
from seastar_gym.lanes.tape import FACTOR, PLACE, ROW
from seastar_gym.model import make_limits, make_rods, scheme_for
from seastar_gym.rods.bundles import Work, make_work
from seastar_gym.rods.step import MOMENTS, REPORT_ROWS, SCHEMES, SMALLEST_HUB_T, WORK
from seastar_gym.rods.terms.hub import Actuation
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import as_finite, require_kind, require_texts
from seastar_gym.scene.numerics import require_duration
from seastar_gym.simulator.drive import checked_commands
from seastar_gym.simulator.report import SolverStatus
from seastar_gym.simulator.state import State

Floats = NDArray[np.float64]

WorkOfGradient = namedtuple("WorkOfGradient", (*Work._fields, "kept", "replayed"))  # type: ignore[misc]
"""`Work` with a history, see history.py, or with a step that is replayed, see replay.py."""


def as_rows_of_tape(bundle: Any) -> Any:
    """A bundle whose rows of robots are rows of a tape: values, and factors and place, which are 0."""
    return widened(bundle, ROW)


def widened(bundle: Any, width: int) -> Any:
    """A bundle whose rows of robots, shape (n, N_LANES), have zeros behind them, shape (n, width)."""
    if isinstance(bundle, np.ndarray) and bundle.ndim == 2:
        rows = aligned_rows(len(bundle), width)
        rows[:, :N_LANES] = bundle
        return rows
    if hasattr(bundle, "_fields"):
        return bundle._replace(**{name: widened(getattr(bundle, name), width) for name in bundle._fields})
    return bundle


def works(own: Work, residual: Floats, n_stages: int, n_points: int) -> tuple[Any, Work]:
    """Memory on a tape, and on the lanes of `Simulator`; its rows stand one behind the other in both, see Replayed."""
    n_lists, n_rows = (sum(len(part) for part in arrays_of(own) if part.ndim == n) for n in (1, 2))
    memory, lists = np.zeros((n_rows, ROW)), np.zeros(n_lists)
    slots = 1 if n_stages == 1 else n_stages + 1
    of_stages, of_lists = aligned_rows(slots, n_rows, N_LANES), np.zeros((slots, n_lists))
    replayed = Replayed(
        np.zeros((OF_STEP + 1, ROW)), np.zeros((n_stages * (OF_STAGE + 2 * n_points), ROW)), np.zeros(1),
        np.zeros(n_stages), residual, memory.ravel(), lists, of_stages.ravel(), of_lists.ravel(), n_rows, n_lists,
    )  # fmt: skip
    on_tape = WorkOfGradient(*_in_memory(own, memory, lists), None, replayed)  # type: ignore[call-arg]
    return on_tape, _in_memory(own, of_stages[-1], of_lists[-1])


def _in_memory(bundle: Any, rows: Floats, lists: Floats) -> Any:
    """A bundle whose arrays stand in these, one behind the other: rows of robots, and what robots share."""
    taken = [0, 0]

    def placed(part: Any) -> Any:
        if isinstance(part, np.ndarray):
            begin = taken[part.ndim - 1]
            taken[part.ndim - 1] += len(part)
            return (lists, rows)[part.ndim - 1][begin : begin + len(part)]
        if hasattr(part, "_fields"):
            return part._replace(**{name: placed(getattr(part, name)) for name in part._fields})
        return part

    return placed(bundle)


def with_places(bundle: Any, moved: Sequence[NDArray[np.bool_]]) -> int:
    """Give those rows of a tape that are moved their places, from 1 on, in the order of `arrays_of`; how many."""
    n = 0
    for rows, some in zip(arrays_of(bundle), moved, strict=True):
        if rows.ndim == 2:
            count = int(some.sum())
            rows.view(np.int64)[some, PLACE] = np.arange(n + 1, n + 1 + count)
            rows[some, FACTOR:PLACE] = 1.0
            n += count
    return n


COUNTS = ("halvings", "energy_cuts", "solver_iterations")
"""Rows of a report that tell whether a swim is one of several branches."""


class Motion(NamedTuple):
    """A swim, or its derivatives in an unknown, whose arrays have the unknown's axes behind those that are named here.

    positions, velocities: Of the nodes at the start and at ends of intervals [m], [m/s], shape (n + 1, n_nodes, 2).
    heading: As of `Simulator.heading` [rad], shape (n + 1,). work: Of the actuators in every interval [J], shape (n,).
    """

    positions: Floats
    velocities: Floats
    heading: Floats
    work: Floats

    @property
    def hub(self) -> Floats:
        """Positions of the hub [m], shape (n + 1, 2)."""
        return self.positions[:, 0]


class Derivatives(NamedTuple):
    """A swim and its derivatives.

    swim: The swim, to the bits of `Simulator`. by: Derivatives by the names of unknowns, per unit of each.
    status: SolverStatus of every interval, shape (n,). After a failure all is NaN.
    halvings, energy_cuts: Counts of every interval, as in StrokeReport, shape (n,).
    solver_iterations: Iterations of the linear solver where limbs touched, in every interval, shape (n,).
    """

    swim: Motion
    by: dict[str, Motion]
    status: NDArray[np.int64]
    halvings: NDArray[np.int64]
    energy_cuts: NDArray[np.int64]
    solver_iterations: NDArray[np.int64]

    @property
    def sentence(self) -> str:
        """What the derivatives are of, in one sentence."""
        return sentence_of(self.status, {name: getattr(self, name) for name in COUNTS})


def sentence_of(status: NDArray[np.int64], counts: dict[str, NDArray[np.int64]]) -> str:
    """What derivatives of a swim are of, in one sentence, from its status and COUNTS of every interval."""
    if status.any():
        first = int(np.flatnonzero(status)[0])
        return f"The solver failed in interval {first + 1}: {SolverStatus(int(status[first])).sentence}"
    total = {name: int(count.sum()) for name, count in counts.items()}
    if not any(total.values()):
        return "The derivatives are of the swim as it is: no step was halved, no energy cut, and no limb touched."
    touched = "some" if total["solver_iterations"] else "no"
    return (
        f"The derivatives are of the branch that was taken: {total['halvings']} steps were halved, "
        f"{total['energy_cuts']} lost energy, and {touched} limbs touched."
    )


def differentiate(
    scene: Scene, commands: ArrayLike, by: Sequence[str], state: State | None = None, duration: float | None = None
) -> Derivatives:
    """Swim with these commands, one interval after the other, and differentiate the swim.

    scene: Of one robot. commands: As for `Simulator.stroke`, shape (n, n_limbs).
    by: Names of unknowns: numbers of the scene such as "fluid.drag_coefficient" or "robot.limbs.0.radius.1",
        "commands", shape (n, n_limbs), and "positions" and "velocities" of the nodes at the start, shape (n_nodes, 2).
    state: Of the one robot at the start; None means at rest. Actuators at the start depend on no unknown.
    duration: Length of an interval [s]; None means a stroke.

    A direction takes a lane, so that N_LANES of them cost some three to four swims of a robot alone. Stages are
    differentiated as solved exactly: what Newton's tolerance leaves of them is in the swim, not in its derivatives. How
    steps were halved, limbs touched and energies were cut is taken as it came; where limbs begin or cease to touch,
    derivatives jump. At the ends of [-1, 1], derivatives in commands are those from within; where a wire's rotation has
    a corner, they are the mean of both sides.
    """
    told, length = checked_swim(scene, commands, duration)
    require_names(by)
    unknowns = unknowns_of(scene, told, by)
    start, slopes = slopes_of_start(scene, state, unknowns)
    rotations, groups = Rotations(scene, state, told, unknowns), _groups(scene, start, slopes)
    for k in range(len(told)):
        times, turned, rises = rotations.interval(k, length)
        for group in groups:
            group.advance(times, turned, rises)
    value, slope = _joined(groups, start, slopes)
    found, column = dict[str, Motion](), 0
    for unknown in unknowns:
        some = slice(column, column + unknown.size)
        found[unknown.name] = Motion(*(part[..., some].reshape(*part.shape[:-1], *unknown.shape) for part in slope))
        column += unknown.size
    report = {name: groups[0].counts(name) for name in COUNTS}
    return Derivatives(value, found, groups[0].counts("status"), **report)


def checked_swim(scene: Scene, commands: ArrayLike, duration: float | None) -> tuple[Floats, float]:
    """Commands as an array, and the length of an interval [s]. ValueError if the scene's one robot cannot follow."""
    require_kind("scene", scene, Scene, "a Scene")
    if scene.n_robots is not None:
        raise ValueError("Derivatives need the scene of one robot, such as scene.of_robot(0).")
    if scene.terms:
        raise ValueError("Derivatives know the package's terms alone: leave out Scene.terms, or take differences.")
    told = as_finite("commands", commands, (None, scene.robot.n_limbs))
    length = scene.actuator.period if duration is None else duration
    require_duration(length, scene.numerics.step)
    for command in told:
        checked_commands(command[None], scene, strengths_of(scene))
    return told, float(length)


def require_names(by: Sequence[str]) -> None:
    """ValueError if `by` does not name unknowns, each once."""
    require_texts("by", by)
    if not by or len(set(by)) < len(by):
        raise ValueError("by must name one unknown or more, each once.")


def n_rows_of_a(rods: Any, n_stages: int) -> int:
    """Rows of accelerations at the stages of a step."""
    return (2 * rods.n_free + 1) * n_stages + (n_stages if rods.body is not None else 0)


def advanced(
    entry: Callable[..., None],
    scene: Scene,
    rods: Any,
    work: Any,
    places: tuple[Floats, Floats],
    times: Floats,
    shape: Floats,
    failed: Floats,
) -> tuple[dict[str, float], Floats]:
    """Advance a robot's rows q and v, shape (1, n_rows, n), through an interval; the report's counts, and the effort.

    times: Ends of the time steps [s]. shape: Rotations then [rad], shape (1, n_times * n_limbs, n).
    failed: SolverStatus, shape (1, 1, n).
    """
    n_limbs, scheme, n = scene.robot.n_limbs, scheme_for(scene), shape.shape[-1]
    report, peaks = np.zeros((1, len(REPORT_ROWS), n)), np.zeros((1, n_limbs, n))
    report[:, SMALLEST_HUB_T, :N_LANES], peaks[..., :N_LANES] = np.inf, 1.0
    a, effort = aligned_rows(1, n_rows_of_a(rods, scheme.n_stages), n), np.zeros((1, MOMENTS + n_limbs, n))
    actuation = Actuation(*(np.zeros((n_limbs, n)) for _ in range(2)))
    entry(
        rods, work, scheme, SCHEMES["implicit-euler"], actuation, *places, a, peaks, times, shape, n_limbs, failed,
        report, make_limits(scene), effort,
    )  # fmt: skip
    status = float(failed[0, 0, 0])
    return {**dict(zip(REPORT_ROWS, report[0, :, 0].tolist(), strict=True)), "status": status}, effort


class _Group:
    """A robot in N_LANES lanes, with a direction in each. columns: Of the slopes that its lanes carry."""

    def __init__(self, scene: Scene, start: Start, slopes: Start, columns: slice):
        self._scene, self._columns, one = scene, columns, make_rods(scene)
        self._rods = widened(side_by_side([one] * N_LANES), 2 * N_LANES)
        for rows, rise in zip(arrays_of(self._rods), slopes.coefficients, strict=True):
            if rows.ndim == 2:
                rows[:, N_LANES : N_LANES + self._n] = rise[:, columns]
            elif rise[:, columns].any():
                raise ValueError("There are no derivatives in numbers on a grid.")
        self._work = widened(make_work(one, scheme_for(scene).n_stages), 2 * N_LANES)
        self._q, self._v = (self._rows(value, rise) for value, rise in zip(start[1:3], slopes[1:3], strict=True))
        self._failed = np.zeros((1, 1, 2 * N_LANES))
        self._held = np.array([2 * node + axis for node in scene.held_nodes for axis in (0, 1)], dtype=int)
        self._reports: list[dict[str, float]] = []
        self.states, self.work = [(self._q[0].copy(), self._v[0].copy())], list[Floats]()

    @property
    def _n(self) -> int:
        return self._columns.stop - self._columns.start

    def _rows(self, value: Floats, rise: Floats) -> Floats:
        rows = aligned_rows(1, len(value), 2 * N_LANES)
        rows[0, :, :N_LANES] = value[:, None]
        rows[0, :, N_LANES : N_LANES + self._n] = rise[:, self._columns]
        return rows

    def advance(self, times: Floats, turned: Floats, rises: Floats) -> None:
        """Advance through the intervals between `times` [s] with rotations, shape (n_times, n_limbs) [rad]."""
        held = self._q[0, self._held]
        self._v[0, self._held] = 0.0
        report, effort = advanced(
            advance_slopes(), self._scene, self._rods, self._work, (self._q, self._v), times,
            self._rows(turned.ravel(), rises.reshape(turned.size, -1)), self._failed,
        )  # fmt: skip
        self._q[0, self._held], self._v[0, self._held] = held, 0.0
        if report["status"] > 0.0:
            self._q[:] = self._v[:] = effort[:] = np.nan
        self._reports.append(report)
        self.states.append((self._q[0].copy(), self._v[0].copy()))
        self.work.append(effort[0, WORK].copy())

    def counts(self, name: str) -> NDArray[np.int64]:
        return np.array([report[name] for report in self._reports]).astype(np.int64)


def _groups(scene: Scene, start: Start, slopes: Start) -> list[_Group]:
    n = slopes.q.shape[-1]
    return [_Group(scene, start, slopes, slice(a, min(a + N_LANES, n))) for a in range(0, n, N_LANES)]


def _joined(groups: list[_Group], start: Start, slopes: Start) -> tuple[Motion, Motion]:
    """The swim, and its slopes in all unknowns behind all other axes."""
    n, n_rows = slopes.q.shape[-1], 2 * start.rest.shape[-2]

    def apart(all_rows: list[list[Floats]]) -> tuple[Floats, Floats]:
        rows = np.array(all_rows)  # (n_groups, n + 1, n_rows, 2 N_LANES)
        rise = np.moveaxis(rows[..., N_LANES:], 0, -2)
        return rows[0, ..., 0], rise.reshape(*rise.shape[:-2], -1)[..., :n]

    nodes = []
    for field in (0, 1):
        value, rise = apart([[state[field][:n_rows] for state in group.states] for group in groups])
        nodes.append((value.reshape(len(value), -1, 2), rise.reshape(len(value), -1, 2, n)))
    work, work_rise = apart([group.work for group in groups])
    (places, place_rises), (velocities, velocity_rises) = nodes
    heading, heading_rise = _heading(places, place_rises, start.rest, slopes.rest)
    return Motion(places, velocities, heading, work), Motion(place_rises, velocity_rises, heading_rise, work_rise)


def _heading(places: Floats, rises: Floats, rest: Floats, rest_rises: Floats) -> tuple[Floats, Floats]:
    """Heading of every state and its slopes, see state.py."""
    across, along = turned_from(places, rest)
    of_places, of_rest = slopes_of_heading(places, rest)
    rise = np.einsum("knx,knxu->ku", of_places, rises) + np.einsum("knx,nxu->ku", of_rest, rest_rises)
    return np.arctan2(across, along), rise


def turned_from(places: Floats, rest: Floats) -> tuple[Floats, Floats]:
    """Sums of cross and dot products of node positions, from the hub, with those at rest, of every state."""
    x, y = np.moveaxis(places - places[:, :1], -1, 0)
    a, b = rest.T
    return y @ a - x @ b, x @ a + y @ b


def slopes_of_heading(places: Floats, rest: Floats) -> tuple[Floats, Floats]:
    """Slopes of the heading of every state in its positions, and in those at rest, shape (n + 1, n_nodes, 2) each."""
    across, along = (part[:, None] for part in turned_from(places, rest))
    x, y = np.moveaxis(places - places[:, :1], -1, 0)
    a, b = rest.T
    squared = across**2 + along**2
    of_places = np.stack([-along * b - across * a, along * a - across * b], axis=-1) / squared[..., None]
    of_rest = np.stack([along * y - across * x, -along * x - across * y], axis=-1) / squared[..., None]
    of_places[:, 0] -= of_places.sum(axis=1)
    return of_places, of_rest
