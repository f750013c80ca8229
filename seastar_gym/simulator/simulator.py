"""`Simulator`: a batch of robots of one scene, advanced by whole strokes."""

import os
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.der.energy import energies
from seastar_gym.der.rods import Work, make_work
from seastar_gym.der.stepping.report import REPORT_ROWS, SMALLEST_HUB_T
from seastar_gym.der.stepping.schemes import SCHEMES
from seastar_gym.der.stepping.stroke import advance
from seastar_gym.der.terms.hub import Actuation
from seastar_gym.model.coefficients import Coefficients
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import require_count
from seastar_gym.scene.numerics import MAX_STEPS
from seastar_gym.scene.per_robot import column
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simd.rows import aligned_rows, from_rows, to_rows, write_rows
from seastar_gym.simulator.body_frame import best_fit_heading
from seastar_gym.simulator.drive import Drive
from seastar_gym.simulator.report import COUNTS
from seastar_gym.simulator.report import SolverStatus as SolverStatus
from seastar_gym.simulator.report import StrokeReport as StrokeReport
from seastar_gym.simulator.schedule import step_times
from seastar_gym.simulator.threads import Threads
from seastar_gym.simulator.turn import BROKEN_OFF, Turn

Floats = NDArray[np.float64]


class State(NamedTuple):
    """Everything that a simulator's future depends on, besides its commands.

    positions, velocities: [m], [m/s], shape (n_robots, n_nodes, 2). time: [s], shape (n_robots,).
    actuators: What actuators remember, shape (n_robots, n_limbs, n_state) with n_state = 0 for most; None: at rest.
    """

    positions: Floats
    velocities: Floats
    time: Floats
    actuators: Floats | None = None

    def of_robots(self, robots: NDArray[np.intp] | NDArray[np.bool_] | slice) -> "State":
        """The state of some of the robots, in their order."""
        return State(*(None if part is None else part[robots] for part in self))  # type: ignore[arg-type]


PARTS_PER_THREAD = 8
LARGEST_PART = 64  # lane groups: an interrupt waits for the part that is under way
MAX_ROBOTS, MAX_THREADS = 100_000_000, 4096
ROW_ARRAYS = ("q", "v", "_a", "_commands", "_rotations", "_failed", "_report")
CLOCK = ("_start_time", "_strokes", "_since_stroke")
"""What a simulator is made of besides its arguments: rows of numbers per robot, and its clock."""

MOVED = ("q", "v", "_commands", "_rotations", "_failed", "_last_hub", *CLOCK)
"""What a stroke changes, besides what the actuators remember and what the next stroke makes anew."""


class Simulator:
    """`n_robots` robots of one scene, at rest with the hub at the origin until told otherwise.

    scene: What is modelled.
    n_robots: Size of the batch.
    threads: Lane groups are shared out over this many threads; all processors if None. A robot's trajectory is the
        same to the last bit whatever the batch, the lane and the number of threads.

    A stroke that does not come to its end (Ctrl-C, an exception, a generator that was closed or dropped) has not begun.
    One stroke at a time: what comes in the middle of one is refused with a RuntimeError.

    coefficients: The scene's numbers for the kernels.
    memory: What every thread works in, (Work, Actuation) of der/rods.py.
    q, v: The node positions and velocities as the kernels keep them, shape (n_groups, 2 n_nodes, N_LANES), not copies.
    """

    def __init__(self, scene: Scene, n_robots: int = 1, threads: int | None = None):
        if not isinstance(scene, Scene):
            raise ValueError(f"Simulator needs a Scene, not {scene!r}.")
        require_count("n_robots", n_robots, 1, MAX_ROBOTS)
        if threads is not None:
            require_count("threads", threads, 1, MAX_THREADS)
        self.scene = scene
        self.n_robots = int(n_robots)
        n_groups = -(-self.n_robots // N_LANES)
        available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        self.threads = min(n_groups, available if threads is None else int(threads))
        self.coefficients = Coefficients(scene, self.n_robots)
        self._scheme = SCHEMES[scene.numerics.scheme]
        self._times = step_times(scene.actuator.corners, scene.numerics.step)
        n_limbs, n_rows = scene.robot.n_limbs, 2 * scene.robot.n_nodes
        self.q = aligned_rows(n_groups, n_rows, N_LANES)
        self.v = aligned_rows(n_groups, n_rows, N_LANES)
        self.q[:] = self.coefficients.rest
        self._a = aligned_rows(n_groups, (n_rows + 1) * self._scheme.n_stages + 2, N_LANES)
        self._drive = Drive(scene.actuator, self.n_robots, n_limbs, self._times)
        self._shape = self._curve = self._shape_rows(self._drive.curve)
        self._commands = np.zeros((n_groups, n_limbs, N_LANES))  # share of _shape that every limb follows
        self._rotations = np.zeros((n_groups, n_limbs, N_LANES))  # of the limbs by their actuators, now [rad]
        self._failed = np.zeros((n_groups, 1, N_LANES))  # SolverStatus
        self._report = np.zeros((n_groups, len(REPORT_ROWS), N_LANES))
        self._held_rows = np.array([2 * node + axis for node in scene.held_nodes for axis in (0, 1)], dtype=int)
        self._held = self.q[:, self._held_rows]  # coordinates of held nodes
        self._start_time = np.zeros(self.n_robots)
        self._strokes = np.zeros(self.n_robots, dtype=np.int64)
        self._since_stroke = np.zeros(self.n_robots)
        self._last_hub = self.hub_position()
        self._threads, self._turn = Threads(self.threads), Turn()
        self.memory = [self._make_memory() for _ in range(self.threads)]
        self.set_limb_strengths(scene.limb_strengths or 1.0)

    def _make_memory(self) -> tuple[Work, Actuation]:
        robot = self.scene.robot
        rotations = Actuation(np.zeros((robot.n_limbs, N_LANES)), np.zeros((robot.n_limbs, N_LANES)))
        return make_work(self.coefficients.rods(0), self._scheme.n_stages), rotations

    def set_scene(self, scene: Scene, mask: ArrayLike | None = None) -> None:
        """Go on with a scene that differs in numbers of `PER_ROBOT` alone.

        mask: The robots whose numbers have changed, shape (n_robots,), all if None.
        """
        chosen = self._checked_mask(mask)
        with self._turn.change():
            self.coefficients.set_scene(scene, chosen)
            if scene.actuator != self.scene.actuator:
                self._set_actuator(scene)
            self.scene = scene

    def _set_actuator(self, scene: Scene) -> None:
        self._drive.set_actuator(scene.actuator)
        self._curve = self._shape_rows(self._drive.curve)

    @contextmanager
    def _new_state(self, of_all: bool) -> Iterator[None]:
        """Around whatever puts robots into a state; that `of_all` mends what was broken off before."""
        with self._turn.change(cures=of_all):
            if self._turn.broken and of_all:
                self.coefficients = Coefficients(self.scene, self.n_robots)
                self._set_actuator(self.scene)
            elif self._turn.broken:
                raise RuntimeError(BROKEN_OFF)
            yield

    def _checked_mask(self, mask: ArrayLike | None) -> NDArray[np.bool_]:
        chosen = np.ones(self.n_robots, bool) if mask is None else np.asarray(mask)
        if chosen.dtype != bool or chosen.shape != (self.n_robots,):
            raise ValueError(f"mask must be boolean of shape ({self.n_robots},), not {chosen.dtype} {chosen.shape}.")
        return chosen

    def close(self) -> None:
        """End the threads; a stroke after that starts them again."""
        self._threads.close()

    def __getstate__(self) -> dict[str, Any]:
        self._turn.require_whole()
        # By robot, not by lane: whoever reads it may have another lane width.
        rows = {name: self._read(getattr(self, name)) for name in ROW_ARRAYS}
        numbers = {name: getattr(self, name) for name in CLOCK}
        drive = {"state": self._drive.state, "strengths": self._drive.strengths}
        arguments = (self.scene, self.n_robots, self.threads)
        return {"arguments": arguments, "rows": rows, "clock": numbers, "drive": drive}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__init__(*state["arguments"])  # type: ignore[misc]
        for name, values in state["rows"].items():
            write_rows(getattr(self, name), values)
        self.__dict__.update(state["clock"])
        self._drive.__dict__.update(state["drive"])
        self._last_hub = self.hub_position()

    # --- state -------------------------------------------------------------------------------------------------

    def reset(self, mask: ArrayLike | None = None, heading: ArrayLike = 0.0) -> None:
        """Put robots at rest with the hub at the origin and limb 1 in direction `heading`.

        mask: Which robots, shape (n_robots,), all if None. heading: [rad], a number or shape (n_robots,).
        """
        chosen = self._checked_mask(mask)
        angles = _as_floats("heading", heading)
        if angles.shape not in ((), (self.n_robots,)):
            raise ValueError(f"heading must be a number or of shape ({self.n_robots},), not {angles.shape}.")
        angles = np.broadcast_to(angles, (self.n_robots,))
        if not np.isfinite(angles[chosen]).all():
            raise ValueError("heading must be finite [rad].")
        with self._new_state(bool(chosen.all())):
            self._put_at_rest(chosen, angles)

    def _put_at_rest(self, chosen: NDArray[np.bool_], angles: Floats) -> None:
        for robot in np.flatnonzero(chosen):
            nodes = self.coefficients.nodes(robot)
            # At heading zero the nodes are exactly those of rest, so that symmetric scenes stay symmetric.
            c, s = np.cos(angles[robot]), np.sin(angles[robot])
            turned = np.stack([c * nodes[:, 0] - s * nodes[:, 1], s * nodes[:, 0] + c * nodes[:, 1]], axis=1)
            group, lane = divmod(robot, N_LANES)
            self.q[group, :, lane] = turned.reshape(-1)
            self.v[group, :, lane] = 0.0
            self._commands[group, :, lane] = 0.0
            self._rotations[group, :, lane] = 0.0
            self._failed[group, 0, lane] = 0.0
            self._last_hub[robot] = 0.0
        self._drive.put(chosen, self._drive.at_rest[chosen])
        self._set_time(chosen, 0.0)

    def _set_time(self, chosen: NDArray[np.bool_] | slice, time: Floats | float) -> None:
        self._start_time[chosen] = time
        self._strokes[chosen] = 0
        self._since_stroke[chosen] = 0.0

    def get_state(self) -> State:
        """A copy of the state; `set_state` continues from it to the last bit (at the ends of strokes)."""
        self._turn.require_whole()
        return State(self.positions, self.velocities, self.time, self._drive.state.copy())

    def set_state(self, state: State) -> None:
        """Put all robots into a state; robots that had failed are well again."""
        if not isinstance(state, tuple | list) or len(state) not in (3, 4):
            raise ValueError(f"A State of {', '.join(State._fields)} is needed, not {type(state).__name__}.")
        state = State(*state)
        at_rest = self._drive.at_rest
        state = state._replace(actuators=at_rest if state.actuators is None else state.actuators)
        shape = (self.n_robots, self.scene.robot.n_nodes, 2)
        arrays = []
        for name, value, wanted in zip(State._fields, state, (shape, shape, shape[:1], at_rest.shape), strict=True):
            array = _as_floats(f"State.{name}", value)
            if array.shape != wanted:
                raise ValueError(f"State.{name} must have shape {wanted}, not {array.shape}.")
            if not np.isfinite(array).all():
                raise ValueError(f"State.{name} must be finite.")
            arrays.append(array)
        with self._new_state(of_all=True):
            self._put_state(arrays)

    def _put_state(self, arrays: list[Floats]) -> None:
        write_rows(self.q, arrays[0])
        write_rows(self.v, arrays[1])
        self._commands[:] = 0.0
        self._failed[:] = 0.0
        self._last_hub = self.hub_position()
        self._set_time(slice(None), arrays[2])
        self._drive.put(slice(None), arrays[3])
        write_rows(self._rotations, self._drive.rotations())

    @property
    def actuators(self) -> Floats:
        """What the actuators remember, shape (n_robots, n_limbs, n_state); see State."""
        return self._drive.state.copy()

    def observe_actuators(self) -> Floats:
        """What the actuators remember as numbers of order one, shape (n_robots, k), limb after limb; k = 0 for most."""
        return self._drive.observe()

    @property
    def limb_strengths(self) -> Floats:
        """Share of its rotation that every limb still makes, shape (n_robots, n_limbs), a copy."""
        return self._drive.strengths.copy()

    def set_limb_strengths(self, strengths: ArrayLike) -> None:
        """Weaken limbs from the next stroke on: from 0 (failed) to 1, shape (n_limbs,) or (n_robots, n_limbs)."""
        array = _as_floats("limb_strengths", strengths)
        wanted = self._drive.strengths.shape
        if array.shape not in ((), wanted[1:], wanted) or not ((array >= 0.0) & (array <= 1.0)).all():
            raise ValueError(f"limb_strengths must be numbers from 0 to 1 of shape {wanted[1:]} or {wanted}.")
        with self._turn.change():
            self._drive.strengths = np.broadcast_to(array, wanted).copy()

    def _read(self, rows: Floats) -> Floats:
        return np.asarray(from_rows(rows, self.n_robots))

    @property
    def positions(self) -> Floats:
        """Node positions [m], shape (n_robots, n_nodes, 2), a copy."""
        return self._read(self.q).reshape(self.n_robots, -1, 2)

    @property
    def velocities(self) -> Floats:
        """Node velocities [m/s], shape (n_robots, n_nodes, 2), a copy."""
        return self._read(self.v).reshape(self.n_robots, -1, 2)

    @property
    def time(self) -> Floats:
        """Simulated time of every robot [s], shape (n_robots,), counted in strokes."""
        return self._start_time + self._strokes * self.scene.actuator.period + self._since_stroke

    @property
    def stroke_time(self) -> float:
        """What a stroke takes [s], as the last pause of stroke_in_parts says it."""
        return float(self._times[-1])

    @property
    def failed(self) -> NDArray[np.bool_]:
        """Robots whose solver has given up and that wait for a reset, shape (n_robots,)."""
        return self._read(self._failed)[:, 0] > 0.0

    def hub_position(self) -> Floats:
        """Position of the hub [m], world frame, shape (n_robots, 2)."""
        return self._read(self.q[:, :2])

    def hub_velocity(self) -> Floats:
        """Velocity of the hub [m/s], world frame, shape (n_robots, 2)."""
        return self._read(self.v[:, :2])

    def heading(self) -> Floats:
        """Turn of the rest shape that fits the nodes best [rad], shape (n_robots,); robots of one batch share it."""
        return best_fit_heading(self.positions, self.scene.robot.nodes())

    def elastic_energy(self) -> Floats:
        """Stretching and bending energy (13.14) at the present actuation [J], shape (n_robots,)."""
        return self._energies()[0]

    def kinetic_energy(self) -> Floats:
        """Kinetic energy [J], shape (n_robots,)."""
        return self._energies()[1]

    def _energies(self) -> tuple[Floats, Floats]:
        work, actuation = self.memory[0]
        both = np.zeros((2, len(self.q), 1, N_LANES))
        for group in range(len(self.q)):
            actuation.delta_psi_end[:] = self._rotations[group]
            rods = self.coefficients.rods(group)
            energies(rods, work, actuation, self.q[group], self.v[group], both[0, group], both[1, group])
        return self._read(both[0])[:, 0], self._read(both[1])[:, 0]

    # --- motion ------------------------------------------------------------------------------------------------

    def stroke(self, commands: ArrayLike) -> StrokeReport:
        """Advance all robots by one actuation period.

        commands: Share of the actuator's curve per limb, in [-1, 1], + is anti-clockwise, shape (n_robots, n_limbs).
        """
        with self._whole_stroke(commands):
            self._advance(0, len(self._times) - 1)
            return self._end_stroke()

    def stroke_in_parts(self, commands: ArrayLike, parts: int) -> Generator[float, None, StrokeReport]:
        """A stroke that pauses `parts` times, after about equal times, to be looked at; the same bits as `stroke`.

        Yields the time since the stroke began [s]. Its StrokeReport is the generator's return value. A generator that
        is closed or dropped before its end puts the robots back to where the stroke began.
        """
        require_count("parts", parts, 1, MAX_STEPS)
        with self._whole_stroke(commands) as stroke:
            wanted = self._times[-1] * np.arange(1, parts + 1) / parts
            ends = np.unique(np.clip(np.searchsorted(self._times, wanted - 1e-12), 1, len(self._times) - 1))
            begin = 0
            for end in ends:
                self._advance(begin, end)
                begin = end
                self._show(end)
                self._turn.pause()
                yield float(self._times[end])
                self._turn.resume(stroke)
            return self._end_stroke()

    @contextmanager
    def _whole_stroke(self, commands: ArrayLike) -> Iterator[object]:
        """Around a stroke: if it does not come to its end, it has not begun."""
        checked = self._checked_commands(commands)
        self._turn.require_whole()
        stroke = self._turn.take()
        before = {name: getattr(self, name).copy() for name in MOVED}, dict(vars(self._drive))
        try:
            self._begin_stroke(checked)
            yield stroke
            self._turn.give_back()
        except BaseException:
            self._put_back(stroke, *before)
            raise

    def _put_back(self, stroke: object, moved: dict[str, Any], drive: dict[str, Any]) -> None:
        """Undo a stroke, unless robots were put into another state since."""
        try:
            if self._turn.resume(stroke):
                for name, values in moved.items():
                    getattr(self, name)[:] = values
                vars(self._drive).update(drive)
                self._turn.give_back()
        except BaseException:  # interrupted once more: the robots are put back all the same
            self._put_back(stroke, moved, drive)
            raise

    def _show(self, end: int) -> None:
        """Let clock and actuators tell how far the stroke has come: to the time step `end`."""
        self._since_stroke[:] = self._read(self._report)[:, REPORT_ROWS.index("covered")]
        self._drive.advance(end)
        self._rotations[:] = self._commands * (self._shape[end] if self._shape.ndim == 1 else self._shape[:, end])

    def _begin_stroke(self, commands: Floats) -> None:
        peaks, shape = self._drive.begin_stroke(commands)
        write_rows(self._commands, peaks)
        self._shape = self._curve if shape is None else self._shape_rows(shape)
        self._start_time += self._since_stroke  # of a stroke that failed, or in which the simulator was copied
        self._since_stroke[:] = 0.0
        self._held = self.q[:, self._held_rows]
        self.v[:, self._held_rows] = 0.0
        self._a[:] = 0.0  # a stroke depends on the state at its beginning only
        self._report[:] = 0.0
        self._report[:, SMALLEST_HUB_T] = np.inf

    def _shape_rows(self, shape: Floats | None) -> Floats:
        """Rotations at times, per robot and limb, as rows for the kernels: (n_groups, n_times, n_limbs, N_LANES).

        One number per time, for all limbs of all robots, stays what it is.
        """
        if shape is None or shape.ndim == 1:
            return np.zeros_like(self._times) if shape is None else shape
        rows = to_rows(shape.transpose(1, 0, 2))
        return rows.reshape(len(self.q), *shape[:, 0].shape, N_LANES)

    def _checked_commands(self, commands: ArrayLike) -> Floats:
        array = _as_floats("commands", commands)
        wanted = (self.n_robots, self.scene.robot.n_limbs)
        if array.shape != wanted:
            raise ValueError(f"commands must have shape (n_robots, n_limbs) = {wanted}, not {array.shape}.")
        good = np.abs(array) <= 1.0
        if not good.all():
            robot, limb = np.argwhere(~good)[0]
            raise ValueError(
                f"commands must be numbers in [-1, 1]; robot {robot} has {array[robot, limb]!r} for limb {limb + 1}."
            )
        if self.scene.robot.hub_hinge == "turning":
            self._check_turning_hub(array)
        return array

    def _check_turning_hub(self, commands: Floats) -> None:
        commands = self.limb_strengths * commands
        turn = column(self.scene.actuator.peak_angle) * (np.roll(commands, -1, axis=1) - commands)
        angle = np.array([limb.gap for limb in self.scene.robot.limb_shapes()]) + turn
        closed = np.minimum(angle, 2.0 * np.pi - angle) < 1e-9
        if closed.any():
            robot, limb = np.argwhere(closed)[0]
            raise ValueError(
                f'With hub_hinge="turning" the command of robot {robot} closes the hub hinge between limbs {limb + 1} '
                f'and {(limb + 1) % commands.shape[1] + 1}, where its curvature is infinite: use hub_hinge="opening".'
            )

    def _advance(self, begin: int, end: int) -> None:
        times = self._times[begin : end + 1]

        # More parts than threads, and whoever is ready takes the next: another process may hold up one of the threads.
        n_parts = 1 if self.threads == 1 else min(len(self.q), PARTS_PER_THREAD * self.threads)
        n_parts = max(n_parts, -(-len(self.q) // LARGEST_PART))
        if not self.coefficients.are_shared:
            n_parts = len(self.q)
        bounds = len(self.q) * np.arange(n_parts + 1) // n_parts

        def swim(thread: int, part: slice) -> None:
            work, actuation = self.memory[thread]
            shape = self._shape[begin : end + 1]
            if self._shape.ndim > 1:
                shape = np.ascontiguousarray(self._shape[part, begin : end + 1])
            advance(
                self.coefficients.rods(part.start), work, self._scheme, SCHEMES["implicit-euler"], actuation,
                self.q[part], self.v[part], self._a[part], self._commands[part], times, shape, self._failed[part],
                self._report[part], self.coefficients.limits(part.start),
            )  # fmt: skip

        self._threads.run(swim, map(slice, bounds[:-1], bounds[1:]))

    def _end_stroke(self) -> StrokeReport:
        self.q[:, self._held_rows] = self._held
        self.v[:, self._held_rows] = 0.0
        rows = dict(zip(REPORT_ROWS, self._read(self._report).T, strict=True))
        failed = self.failed
        if failed.any():
            self._lay_out_lost(failed)
        self._last_hub = self.hub_position()
        self._strokes += ~failed
        self._since_stroke = np.where(failed, rows["covered"], 0.0)
        self._drive.advance(len(self._times) - 1)
        write_rows(self._rotations, self._drive.rotations())
        counts = {name: rows[name].astype(np.int64) for name in COUNTS}
        angle = 2.0 * np.arctan(rows["smallest_hub_t"])
        if self.scene.robot.hub_hinge == "turning":
            angle += np.pi
        return StrokeReport(
            status=self._read(self._failed)[:, 0].astype(np.int64),
            covered=rows["covered"],
            smallest_opening_angle=angle,
            **counts,
        )

    def _lay_out_lost(self, failed: NDArray[np.bool_]) -> None:
        """Put the failed robots whose state is not finite at rest where their hub was last."""
        lost = np.flatnonzero(failed & ~np.isfinite(self._read(self.q) + self._read(self.v)).all(axis=1))
        for robot in lost:
            group, lane = divmod(robot, N_LANES)
            self.q[group, :, lane] = (self._last_hub[robot] + self.coefficients.nodes(robot)).reshape(-1)
            self.v[group, :, lane] = 0.0
            self._failed[group, 0, lane] = SolverStatus.NOT_FINITE


def _as_floats(name: str, value: object) -> Floats:
    """The value as an array of numbers, or one sentence."""
    try:
        array = np.asarray(value)
    except ValueError as ragged:
        raise ValueError(f"{name} must be an array of numbers, not rows of different lengths.") from ragged
    if array.dtype.kind not in "biuf":
        raise ValueError(f"{name} must be numbers, not {array.dtype} values.")
    return array.astype(float)
