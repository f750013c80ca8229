"""`Simulator`: a batch of robots of one scene, advanced by intervals of time, such as strokes.

Intervals that pause: what is looked at meanwhile, and what they return in the end.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from copy import copy
from itertools import pairwise
from types import ModuleType
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.lanes.registers import N_LANES
from seastar_gym.model import Coefficients, scheme_for
from seastar_gym.process import held_back, processors
from seastar_gym.rods.bundles import Work
from seastar_gym.rods.step import COVERED
from seastar_gym.rods.terms.hub import Actuation
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import as_array, as_finite, as_floats, require_choice, require_count, require_flag, shown
from seastar_gym.scene.numerics import MAX_STEPS, require_duration
from seastar_gym.scene.scene import LARGEST_OVERLAP
from seastar_gym.simulator.batch import Batch
from seastar_gym.simulator.device import DEVICES, DeviceBatch
from seastar_gym.simulator.drive import Drive, checked_commands, ends_at, ends_of_parts
from seastar_gym.simulator.lock import BROKEN_OFF, StrokeLock
from seastar_gym.simulator.report import StrokeReport, make_report, warn_of_overlap
from seastar_gym.simulator.state import Clock, State, best_fit_heading, checked_state, root_places
from seastar_gym.simulator.watches import EnergyGrowth, ErrorBars, Watch, is_watched, twin_scene

Result = TypeVar("Result")


def pausing(
    steps: Generator[float, None, Result], look: Callable[[float], float | None]
) -> Generator[float, None, Result]:
    """Yields what `look` makes of the time [s] at every pause of an interval, but for None; returns what it returns.

    Closing or dropping it closes the interval, as an exception in `look` does.
    """
    with contextlib.closing(steps):
        while True:
            try:
                time = next(steps)
            except StopIteration as over:
                return over.value
            if (pause := look(time)) is not None:
                yield pause


def completed(steps: Generator[float, None, Result], look: Callable[[float], object] = lambda _: None) -> Result:
    """What an interval returns in the end. look: Called with the time [s] at every pause."""
    with contextlib.closing(steps):
        while True:
            try:
                time = next(steps)
            except StopIteration as over:
                return over.value
            look(time)


Floats = NDArray[np.float64]

MAX_ROBOTS, MAX_THREADS = 100_000_000, 4096


class Simulator:
    """A batch of robots of one scene. They begin at rest, with the hub at the origin.

    scene: Robot, fluid, actuator and numerics.
    n_robots: Number of robots.
    threads: Number of threads that share the lane groups; all processors if None. A robot's trajectory is the same to
        the last bit whatever the batch, the lane and the number of threads.
    error_bars: Whether to estimate the hub's error by a twin of shorter edges and steps, see watches.py. It changes
        no bit of a trajectory, and a stroke takes three to five times as long.
    effort: Whether to measure the work and the largest moment of the actuators. It changes no bit of a trajectory.
    device: "cpu", "cuda" for an NVIDIA GPU with one robot per thread, or "scalar" for its twin on the processor, which
        is slow and for tests. The device changes no bit of a trajectory either, see device.py.

    A stroke, or any interval, that is not completed (Ctrl-C, an exception, a generator that is closed or dropped) is
    undone. While one is under way, other calls that would change the simulator are refused with a RuntimeError.
    """

    def __init__(
        self, scene: Scene, n_robots: int = 1, threads: int | None = None, error_bars: bool = False,
        effort: bool = False, device: str = "cpu",
    ):  # fmt: skip
        if not isinstance(scene, Scene):
            raise ValueError(f"Simulator needs a Scene, not {shown(scene)}.")
        require_count("n_robots", n_robots, 1, MAX_ROBOTS)
        if threads is not None:
            require_count("threads", threads, 1, MAX_THREADS)
        require_flag("error_bars", error_bars)
        require_flag("effort", effort)
        require_choice("device", device, ("cpu", *DEVICES))
        self.scene = scene
        self.n_robots = int(n_robots)
        self.threads = min(-(-self.n_robots // N_LANES), processors() if threads is None else int(threads))
        self.device = device
        self._batch = (
            Batch(scene, self.n_robots, self.threads, effort) if device == "cpu"
            else DeviceBatch(scene, self.n_robots, device, effort)
        )  # fmt: skip
        self._drive = Drive(scene.actuator, self.n_robots, scene.robot.n_limbs, scene.numerics.step)
        self._clock = Clock.at_zero(self.n_robots)
        self._lock = StrokeLock()
        self._known_duration: float | None = None  # of the last interval [s]
        self._may_warn_of_overlap = scene.contact is not None
        self._watches: dict[str, Watch] = {}  # by the field of a report that each tells
        if is_watched(scene) and device == "cpu":
            self._watches["energy_growth"] = EnergyGrowth(self.n_robots, scene.actuator.period, scheme_for(scene))
        if error_bars:
            twin = Simulator(twin_scene(scene), self.n_robots, self.threads, device=device)
            twin._watches, twin._may_warn_of_overlap = {}, False
            self._watches["error_estimate"] = ErrorBars(twin, self.n_robots)
        self.set_limb_strengths(scene.limb_strengths or 1.0)

    @property
    def coefficients(self) -> Coefficients:
        """Coefficients of the scene for the kernels."""
        return self._batch.coefficients

    @property
    def memory(self) -> list[tuple[Work, Actuation]]:
        """Working memory of every thread, (Work, Actuation) of `rods`."""
        return self._batch.memory

    @property
    def q(self) -> Floats:
        """Node positions in the kernels' memory [m], shape (n_groups, 2 n_nodes, N_LANES), not a copy.

        Of another device than "cpu" it is a copy that travels back with the next interval: take it anew after each.
        With a body, rows of its orientation and of its limbs' roots follow, see rods/star.py.
        """
        return self._batch.q

    @property
    def v(self) -> Floats:
        """Node velocities in the kernels' memory [m/s], likewise."""
        return self._batch.v

    def set_scene(self, scene: Scene, mask: ArrayLike | None = None) -> None:
        """Continue with a scene that differs only in numbers that may differ from robot to robot (`Numbers`).

        mask: Robots whose numbers have changed, shape (n_robots,), all if None.
        """
        chosen = self._checked_mask(mask)
        with self._lock.change():
            watches = [(watch, watch.checked(scene)) for watch in self._watches.values()]  # before anything changes
            self.coefficients.set_scene(scene, chosen)
            for watch, own in watches:
                watch.set_scene(own, chosen)
            if scene.actuator != self.scene.actuator:
                self._drive.set_actuator(scene.actuator)
            self.scene = scene

    @contextmanager
    def _new_state(self, of_all: bool) -> Iterator[None]:
        """Context of a change of state; a new state of all robots repairs a simulator whose change was interrupted."""
        with self._lock.change(repairs=of_all):
            if self._lock.broken and of_all:
                self._batch.coefficients = Coefficients(self.scene, self.n_robots)
                self._drive.set_actuator(self.scene.actuator)
                for watch in self._watches.values():
                    watch.set_scene(watch.checked(self.scene), np.ones(self.n_robots, bool))
            elif self._lock.broken:
                raise RuntimeError(BROKEN_OFF)
            yield

    def _checked_mask(self, mask: ArrayLike | None) -> NDArray[np.bool_]:
        chosen = np.ones(self.n_robots, bool) if mask is None else as_array("mask", mask)
        if chosen.dtype != bool or chosen.shape != (self.n_robots,):
            raise ValueError(f"mask must be boolean of shape ({self.n_robots},), not {chosen.dtype} {chosen.shape}.")
        return chosen

    def close(self) -> None:
        """End the threads. A later stroke starts them again."""
        self._batch.workers.close()
        for watch in self._watches.values():
            watch.close()

    def __getstate__(self) -> dict[str, Any]:
        self._lock.require_intact()
        drive = self._drive
        arguments = (self.scene, self.n_robots, self.threads, False, self._batch.effort.size > 0, self.device)
        actuators = drive.state, drive.commands, np.full(self.n_robots, drive.phase)
        moved = {"rows": self._batch.rows(), "clock": self._clock, "actuators": actuators}
        kept = {"strengths": drive.strengths, "watches": self._watches, "may_warn": self._may_warn_of_overlap}
        return {"arguments": arguments, **moved, **kept}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__init__(*state["arguments"])  # type: ignore[misc]
        self._batch.put_rows(state["rows"])
        self._drive.put(*state["actuators"])
        self._drive.strengths, self._clock = state["strengths"], state["clock"]
        self._watches, self._may_warn_of_overlap = state["watches"], state["may_warn"]

    def reset(self, mask: ArrayLike | None = None, heading: ArrayLike = 0.0) -> None:
        """Put robots at rest, with the hub at the origin and limb 1 in the direction `heading`.

        mask: Robots to reset, shape (n_robots,), all if None. heading: [rad], a number or shape (n_robots,).
        """
        chosen = self._checked_mask(mask)
        angles = as_floats("heading", heading)
        if angles.shape not in ((), (self.n_robots,)):
            raise ValueError(f"heading must be a number or of shape ({self.n_robots},), not {angles.shape}.")
        angles = np.broadcast_to(angles, (self.n_robots,))
        if not np.isfinite(angles[chosen]).all():
            raise ValueError("heading must be finite [rad].")
        with self._new_state(bool(chosen.all())):
            for robot in np.flatnonzero(chosen):
                self._batch.put_at_rest(robot, angles[robot])
            self._drive.put_at_rest(chosen)
            self._clock = self._clock.put(chosen, 0.0)
            for watch in self._watches.values():
                watch.reset(chosen, angles)

    def get_state(self) -> State:
        """Copy of the state. After `set_state` with it, intervals give the same bits, if none was under way."""
        self._lock.require_intact()
        drive = self._drive
        phase = np.full(self.n_robots, drive.phase)
        turning = (self._batch.angles(self.q), self._batch.angles(self.v)) if self._batch.has_body else (None, None)
        actuators, commands = drive.state.copy(), drive.commands.copy()
        return State(self.positions, self.velocities, self.time, actuators, commands, phase, *turning)

    def set_state(self, state: State) -> None:
        """Put all robots into a state. Robots that had failed swim again.

        Their errors are not estimated until they are reset: the state has no like on the mesh of the twin.
        """
        arrays = checked_state(state, self.coefficients.rest_shapes(), self._drive.at_rest, self._drive.longest)
        positions, velocities, time, actuators, commands, phase, orientation, spin = arrays
        checked_commands(commands, self.scene, self._drive.strengths, "State.commands")
        with self._new_state(of_all=True):
            self._batch.put_state(positions, velocities, orientation, spin)
            self._clock = self._clock.put(slice(None), time)
            self._drive.put(actuators, commands, phase)
            for watch in self._watches.values():
                watch.lose()

    @property
    def actuators(self) -> Floats:
        """Copy of the actuators' state, shape (n_robots, n_limbs, n_state), as in `State`."""
        return self._drive.state.copy()

    def observe_actuators(self) -> Floats:
        """Actuators' state as numbers of order one, shape (n_robots, k), limb after limb; k = 0 without memory."""
        return self._drive.observe()

    def refractory_wires(self) -> NDArray[np.bool_]:
        """Wires that cannot be heated now, for + and - of every limb, shape (n_robots, n_limbs, 2).

        Commands to them are ignored. In the middle of a stroke of an actuator without memory it is all of them, and
        commands are refused. An actuator of your own that has no `refractory_wires` has none.
        """
        return self._drive.refractory_wires()

    @property
    def limb_strengths(self) -> Floats:
        """Factor by which every limb's rotation is reduced, shape (n_robots, n_limbs), a copy."""
        return self._drive.strengths.copy()

    def set_limb_strengths(self, strengths: ArrayLike) -> None:
        """Reduce the rotation of limbs from the next interval on, by factors from 0 (no rotation) to 1 (full).

        strengths: Shape (n_limbs,) or (n_robots, n_limbs), or one number for all limbs.
        """
        checked = self._drive.checked_strengths(strengths)
        with self._lock.change():
            self._drive.strengths = checked
            for watch in self._watches.values():
                watch.set_limb_strengths(checked)

    @property
    def positions(self) -> Floats:
        """Node positions [m], shape (n_robots, n_nodes, 2), a copy."""
        return self._batch.nodes_of(self.q)

    @property
    def velocities(self) -> Floats:
        """Node velocities [m/s], shape (n_robots, n_nodes, 2), a copy."""
        return self._batch.nodes_of(self.v)

    def on_device(self, name: str) -> Any:
        """Node "positions" [m] or "velocities" [m/s] as an array of the device, shape (n_robots, n_nodes, 2), a copy.

        On "cuda" a CuPy array, which `torch.from_dlpack` takes without another copy.
        """
        require_choice("name", name, ("positions", "velocities"))
        if isinstance(self._batch, DeviceBatch):
            return self._batch.nodes_on_device("q" if name == "positions" else "v")
        return getattr(self, name)

    @property
    def arrays(self) -> ModuleType:
        """Module of the device's arrays: CuPy on "cuda", else numpy."""
        return self._batch.arrays

    def filled_on_device(self, kernel: Any, numbers: dict[str, Any], n_rows: int) -> Any:
        """Rows that a kernel fills from the state of every robot, on another device than "cpu".

        See `DeviceBatch.filled`.
        """
        assert isinstance(self._batch, DeviceBatch)
        return self._batch.filled(kernel, numbers, n_rows)

    @property
    def time(self) -> Floats:
        """Simulated time of every robot [s], shape (n_robots,)."""
        return self._clock.time

    @property
    def stroke_time(self) -> float:
        """Duration of a stroke [s], equal to the last time that `stroke_in_parts` yields."""
        return float(self.scene.actuator.period)

    @property
    def failed(self) -> NDArray[np.bool_]:
        """Robots whose solver has given up, shape (n_robots,). They stay where they are until they are reset."""
        return self._batch.failed

    @property
    def error_estimate(self) -> Floats:
        """Estimate of the error of every robot's hub [m], shape (n_robots,), as in the last StrokeReport.

        0 at rest after a reset. NaN without `error_bars`, and until the next reset after `set_state` or a failure.
        """
        return self._told("error_estimate")

    @property
    def energy_growth(self) -> Floats:
        """Kinetic energy relative to the water over the largest in the first strokes, shape (n_robots,), as in the last
        StrokeReport. NaN where it is not watched, 1 in the first strokes.
        """
        return self._told("energy_growth")

    def _told(self, field: str) -> Floats:
        """What a watch tells now, shape (n_robots,); NaN without one."""
        return self._watches[field].told if field in self._watches else np.full(self.n_robots, np.nan)

    def hub_position(self) -> Floats:
        """Position of the hub [m], world frame, shape (n_robots, 2)."""
        return self._batch.hub_position()

    def hub_velocity(self) -> Floats:
        """Velocity of the hub [m/s], world frame, shape (n_robots, 2)."""
        return self._batch.read(self.v[:, :2])

    def heading(self) -> Floats:
        """Rotation of every robot's own rest shape that fits its nodes best [rad], shape (n_robots,)."""
        return best_fit_heading(self.positions, self.coefficients.rest_shapes())

    def orientation(self) -> Floats:
        """Angle by which every robot's body has turned from rest [rad], shape (n_robots,); without one, its heading."""
        return self._batch.angles(self.q) if self._batch.has_body else self.heading()

    def spin(self) -> Floats:
        """Angular velocity of every robot's body [rad/s], shape (n_robots,); NaN without a body."""
        return self._batch.angles(self.v) if self._batch.has_body else np.full(self.n_robots, np.nan)

    def root_positions(self) -> Floats:
        """Places where limbs begin [m], world frame, shape (n_robots, n_limbs, 2): on the body, or at the hub."""
        return self.hub_position()[:, None] + root_places(self.scene.robot, self.orientation())

    def elastic_energy(self) -> Floats:
        """Stretching and bending energy (13.14) at the present actuation [J], shape (n_robots,)."""
        return self._batch.energies(self._drive.rotations())[0]

    def kinetic_energy(self, relative_to_water: bool = False) -> Floats:
        """Kinetic energy [J], shape (n_robots,).

        relative_to_water: With the velocity of every node less that of the water there.
        """
        return self._batch.energy_in_water() if relative_to_water else self._batch.energies(self._drive.rotations())[1]

    def stroke(self, commands: ArrayLike) -> StrokeReport:
        """Advance all robots by one actuation period.

        commands: Fraction of the actuator's curve for every limb, in [-1, 1], + is anti-clockwise, shape
            (n_robots, n_limbs).
        """
        return self.advance(self.scene.actuator.period, commands)

    def stroke_in_parts(self, commands: ArrayLike, parts: int) -> Generator[float, None, StrokeReport]:
        """Advance as `stroke` does, to the same bits, and pause `parts` times after about equal times.

        Yields the time since the stroke began [s] and returns the StrokeReport. During a pause, the simulator may be
        read. Closing or dropping the generator before its end undoes the stroke.
        """
        return (yield from self.advance_in_parts(self.scene.actuator.period, commands, parts))

    def advance(self, duration: float, commands: ArrayLike | None = None) -> StrokeReport:
        """Advance all robots by an interval of time.

        duration: Length of the interval [s].
        commands: Commands given now, as for `stroke`. None gives none, and what is under way continues.

        An actuator without memory is at rest after its period, and refuses commands before: limbs would jump. Every
        interval depends on the `State` at its beginning only, so Newton's first guess is made anew. Pieces that end
        where time steps do equal the whole to newton_tolerance, or to about 1e-5 limb lengths where something is
        linearised at the first guess: flow along limbs, added mass, a body. A step in which a piece ends is cut in two,
        which is another discretisation: limbs that ring faster than steps resolve then ring otherwise, by 4 % of the
        largest speed at fidelity "fast" and 11 % at "balanced", and the hub is 4e-6 and 4e-5 limb lengths away.
        """
        with self._interval(duration, commands):
            self._batch.advance(0, len(self._batch.times) - 1)
            return self._end_interval()

    def advance_in_parts(
        self, duration: float, commands: ArrayLike | None, parts: int
    ) -> Generator[float, None, StrokeReport]:
        """Advance as `advance` does, to the same bits, and pause as `stroke_in_parts` does."""
        require_count("parts", parts, 1, MAX_STEPS)
        return (yield from self._advance_in_pieces(duration, commands, lambda times: ends_of_parts(times, parts)))

    def advance_pausing(
        self, duration: float, commands: ArrayLike | None, pauses: ArrayLike
    ) -> Generator[float, None, StrokeReport]:
        """Advance as `advance` does, to the same bits, and pause as `stroke_in_parts` does, at certain times.

        pauses: Times since the interval began [s], shape (n,). A pause comes at the end of the time step in which its
            time lies; the last one is at the end of the interval.
        """
        wanted = as_finite("pauses", pauses, (None,))

        def ends_of(times: Floats) -> NDArray[np.intp]:
            return ends_at(times, np.append(wanted, times[-1]))

        return (yield from self._advance_in_pieces(duration, commands, ends_of))

    def _advance_in_pieces(
        self, duration: float, commands: ArrayLike | None, ends_of: Callable[[Floats], NDArray[np.intp]]
    ) -> Generator[float, None, StrokeReport]:
        """Advance, with a pause after each piece. ends_of: Steps with which pieces end, from the ends of all steps [s]
        since the interval began."""
        with self._interval(duration, commands) as interval:
            times = self._batch.times - self._batch.times[0]
            for begin, end in pairwise([0, *ends_of(times)]):
                self._batch.advance(begin, end)
                self._clock = self._clock._replace(within=self._batch.covered())
                self._drive.advance(end)
                self._lock.pause()
                yield float(times[end])
                self._lock.resume(interval)
            return self._end_interval()

    @contextmanager
    def _interval(self, duration: float, commands: ArrayLike | None) -> Iterator[object]:
        """Context of an interval, which is undone if it is not completed. Gives its holder of the lock."""
        if type(duration) is not float or duration != self._known_duration:
            require_duration(duration, self.scene.numerics.step)
            self._known_duration = float(duration)
        checked = None if commands is None else checked_commands(commands, self.scene, self._drive.strengths)
        interval = self._lock.acquire(intact=True)
        rows, clock, drive = self._batch.save(), self._clock, self._drive  # kernels write into rows, nobody into others
        watches = [(watch, watch.save()) for watch in self._watches.values()]
        try:
            self._drive = copy(drive)
            self._batch.begin(*self._drive.begin(float(duration), checked))
            self._clock = clock.begun(float(duration))
            for watch, _ in watches:
                watch.begin(float(duration), checked)
            yield interval
            self._lock.release()
        except BaseException:  # whatever ends an interval, also that its generator is dropped, undoes it
            with held_back():  # another Ctrl-C waits for the end
                if self._lock.resume(interval):  # unless robots were put into another state since
                    self._batch.restore(rows)
                    self._clock, self._drive = clock, drive
                    for watch, saved in watches:
                        watch.restore(saved)
                    self._lock.release()
            raise

    def _end_interval(self) -> StrokeReport:
        status, rows, told = self._batch.end()
        failed = status > 0
        self._clock = self._clock.ended(failed, rows[COVERED])
        self._drive.advance(len(self._batch.times) - 1)
        for field, watch in self._watches.items():
            watch.end(self, failed)
            told[field] = watch.told
        drive = self._drive
        report = make_report(status, rows, told, self.scene.robot.hub_hinge, drive.heating_time, drive.heating_power)
        if self._may_warn_of_overlap and report.largest_overlap.max() > LARGEST_OVERLAP:
            self._may_warn_of_overlap = False
            warn_of_overlap(report.largest_overlap)
        return report
