"""`record` and `gradient`: the gradient of a number of a swim in all unknowns, by one sweep back through the swim."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from threading import RLock
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.gradients.history import CAPACITY, COUNTERS, INTERVAL, KEPT, N_STEPS, OF_STEP, Kept, n_numbers
from seastar_gym.gradients.replay import Rows, Slopes, Tape, pull_back
from seastar_gym.gradients.replay import Scene as SceneOnTape
from seastar_gym.gradients.swim import (
    COUNTS,
    Motion,
    WorkOfGradient,
    advanced,
    as_rows_of_tape,
    checked_swim,
    n_rows_of_a,
    require_names,
    sentence_of,
    slopes_of_heading,
    turned_from,
    with_places,
    works,
)
from seastar_gym.gradients.tape import arrays_of
from seastar_gym.gradients.unknowns import OF_START, Rotations, Start, Unknown, slope_in_number, start_of, unknowns_of
from seastar_gym.lanes.registers import N_LANES
from seastar_gym.lanes.rows import aligned_rows, side_by_side
from seastar_gym.lanes.tape import ENTRY, ROW
from seastar_gym.model import make_limits, make_rods, scheme_for
from seastar_gym.rods.bundles import make_work
from seastar_gym.rods.interval import advance
from seastar_gym.rods.step import REPORT_ROWS, SCHEMES, WORK
from seastar_gym.rods.terms.hub import Actuation
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import as_floats, require_callable, shown
from seastar_gym.simulator.state import State

Floats = NDArray[np.float64]

QUANTITIES = ("hub", *Motion._fields)
"""Quantities of a swim that a number may depend on."""
SPARE_STEPS = 16
"""Steps more than there are ends of steps in an interval, for which there is room at first."""
ENTRIES = 1 << 14
"""Entries of a new tape; it grows where steps need more. Each takes 80 bytes with four lanes, its slope included."""

MOST_KEPT = 64e6
"""Memory of the time steps that a record keeps [B]; others are swum once more."""

Feedback = Callable[[int, Floats], tuple[Floats, Floats]]
"""How commands depended on states: from the number of an interval and the slope in its command, shape (n_limbs,), the
slopes that it has by that command in positions and velocities at the beginning, shape (n_nodes, 2) each."""

_the_tape = RLock()


class Gradient(NamedTuple):
    """A number of a swim, and its gradient.

    value: The number. swim: The swim, to the bits of `Simulator`.
    by: Gradients by the names of unknowns, per unit and in the shape of each.
    status: SolverStatus of every interval, shape (n,). After a failure all is NaN.
    sentence: What the gradient is of.
    """

    value: float
    swim: Motion
    by: dict[str, Floats]
    status: NDArray[np.int64]
    sentence: str


def gradient(
    scene: Scene,
    commands: ArrayLike,
    objective: Callable[[Motion], tuple[float, Mapping[str, ArrayLike]]],
    by: Sequence[str],
    state: State | None = None,
    duration: float | None = None,
) -> Gradient:
    """Swim with these commands, and find the gradient of a number of the swim.

    objective: From a swim, its number, and the number's slopes in quantities of the swim by their names: "hub",
        "positions", "velocities", "heading" and "work", each of the shape in `Motion`.

    Other arguments are those of `differentiate`, and so is what derivatives are. The cost does not depend on how many
    unknowns there are, see docs/gradients.md.
    """
    require_names(by)
    record_of_swim = record(scene, commands, state, duration)
    told: Any = objective(record_of_swim.swim)
    if not (isinstance(told, tuple) and len(told) == 2 and np.ndim(told[0]) == 0 and isinstance(told[1], Mapping)):
        raise ValueError(f"objective must return a number and its slopes by name, not {shown(told)}.")
    value, slopes = told
    found = record_of_swim.gradient(slopes, by)
    return Gradient(float(value), record_of_swim.swim, found, record_of_swim.status, record_of_swim.sentence)


def record(scene: Scene, commands: ArrayLike, state: State | None = None, duration: float | None = None) -> Record:
    """Swim with these commands, and keep the time steps, for gradients of the swim.

    Arguments are those of `differentiate`.
    """
    told, length = checked_swim(scene, commands, duration)
    return Record(scene, told, state, length)


class Record:
    """A swim that can be gone back through.

    swim: The swim, to the bits of `Simulator`. status: SolverStatus of every interval, shape (n,).

    It keeps its time steps, 3.7 kB each for a robot of 56 nodes, as far as they fit MOST_KEPT, and the states between
    intervals: `gradient` swims others once more, one interval after the other.
    """

    def __init__(self, scene: Scene, commands: Floats, state: State | None, duration: float):
        self._scene, self._commands, self._state, self._duration = scene, commands, state, duration
        self._rods, self._limits = make_rods(scene), make_limits(scene)
        self._scheme = scheme_for(scene)
        self._n_limbs, self._n_a = scene.robot.n_limbs, n_rows_of_a(self._rods, self._scheme.n_stages)
        self._held = np.array([2 * node + axis for node in scene.held_nodes for axis in (0, 1)], dtype=int)
        self._start = start_of(scene, state)
        drives = Rotations(scene, state, commands, ())
        self._work = make_work(self._rods, self._scheme.n_stages)
        self._turns = [drives.interval(k, duration)[:2] for k in range(len(commands))]
        self._states, self._reports, work = [(self._start.q, self._start.v)], [], []
        self._kept, room = list[Floats | None](), MOST_KEPT
        for k in range(len(commands)):
            done, report, at_end, kept = self._swim(k)
            work.append(done)
            self._reports.append(report)
            self._states.append(at_end)
            room -= kept.nbytes
            self._kept.append(kept if room >= 0.0 else None)
        places, velocities = (
            np.array([state[field][: 2 * self._rods.n_nodes] for state in self._states]).reshape(
                len(self._states), -1, 2
            )
            for field in (0, 1)
        )
        heading = np.arctan2(*turned_from(places, self._start.rest))
        self.swim = Motion(places, velocities, heading, np.array(work))
        self.status = self._counts("status")

    @property
    def sentence(self) -> str:
        """What gradients of this swim are of, in one sentence."""
        return sentence_of(self.status, {name: self._counts(name) for name in COUNTS})

    def gradient(
        self, slopes: Mapping[str, ArrayLike], by: Sequence[str], feedback: Feedback | None = None
    ) -> dict[str, Floats]:
        """Gradient, by the names of unknowns, of a number with these slopes in quantities of the swim.

        slopes: By names of quantities, as in `gradient`; of those that are not there the number does not depend. by: As
        in `differentiate`. feedback: Of a policy that gave the commands, asked from the last interval to the first. A
        change of the start or of a command then changes the later commands, too.
        """
        require_names(by)
        if feedback is not None:
            require_callable("feedback", feedback)
        unknowns = unknowns_of(self._scene, self._commands, by)
        given = self._checked(slopes)
        if self.status.any():
            return {unknown.name: np.full(unknown.shape, np.nan) for unknown in unknowns}
        beside = {u.name: slope_in_number(self._start, self._state, u) for u in unknowns if u.beside}
        with _the_tape:
            sweep = _Sweep(self, given, list(beside.values()), feedback, "commands" in by)
        of_rotations = self._through_rotations(unknowns, sweep.of_turns)
        found = {}
        for unknown in unknowns:
            if unknown.beside:
                found[unknown.name] = np.asarray(
                    sweep.slope_along(beside[unknown.name]) + of_rotations.get(unknown.name, 0.0)
                )
            elif unknown.name in OF_START:
                rows = sweep.of_q if unknown.name == "positions" else sweep.of_v
                found[unknown.name] = rows[: unknown.size].reshape(unknown.shape)
            else:
                found[unknown.name] = np.reshape(sweep.of_commands, unknown.shape)
        return found

    def _checked(self, slopes: Mapping[str, ArrayLike]) -> dict[str, Floats]:
        unknown = sorted(set(slopes) - set(QUANTITIES))
        if unknown:
            raise ValueError(f"slopes has {shown(unknown[0])}, which is none of {', '.join(QUANTITIES)}.")
        given = {name: as_floats(f"slopes in {name}", value) for name, value in slopes.items()}
        for name, value in given.items():
            if value.shape != getattr(self.swim, name).shape:
                raise ValueError(
                    f"slopes in {name} must have shape {getattr(self.swim, name).shape}, not {value.shape}."
                )
            if not np.isfinite(value).all():
                raise ValueError(f"slopes in {name} must be finite numbers.")
        return {name: given.get(name, np.zeros(getattr(self.swim, name).shape)) for name in QUANTITIES}

    def _through_rotations(self, unknowns: Sequence[Unknown], of_turns: list[Floats]) -> dict[str, Floats]:
        """What the gradients in numbers of the actuators owe to the limbs' rotations."""
        some = [u for u in unknowns if u.name.split(".")[0] in ("actuator", "limb_strengths")]
        if not some:
            return {}
        drives = Rotations(self._scene, self._state, self._commands, some)
        total = np.zeros(sum(u.size for u in some))
        for k, of_turn in enumerate(of_turns):
            total = total + np.tensordot(of_turn, drives.interval(k, self._duration)[2], axes=2)
        parts = np.split(total, np.cumsum([u.size for u in some])[:-1])
        return {u.name: part.reshape(u.shape) for u, part in zip(some, parts, strict=True)}

    def rises_by_commands(self) -> list[dict[int, Floats]]:
        """Slopes of the rotations of every interval, by the numbers of the commands that limbs still feel in it.

        Shape (n_times, n_limbs, n_limbs) each, the command's limb last.
        """
        commands, found = self._commands, list[dict[int, Floats]]()
        drives = Rotations(self._scene, self._state, commands, [Unknown("commands", commands.shape)])
        for k in range(len(commands)):
            rises = drives.felt(k, self._duration)[2]
            found.append({command: rise.copy() for command, rise in rises.items() if rise.any()})
        return found

    def _counts(self, name: str) -> NDArray[np.int64]:
        return np.array([report[name] for report in self._reports], dtype=np.int64)

    def history(self, k: int) -> Floats:
        """Every step of interval k and where the last one ended, shape (n_steps + 1, n_numbers), see history.py."""
        kept = self._kept[k]
        return self._swim(k)[3] if kept is None else kept

    def _swim(self, k: int) -> tuple[float, dict[str, float], tuple[Floats, Floats], Floats]:
        """Swim through interval k: the actuators' work [J], the report, (q, v) at its end, and its history."""
        times, turned = self._turns[k]
        n_q, n_a, stages = self._start.q.size, self._n_a, self._scheme.n_stages
        n_rows = n_numbers(n_q, n_a, stages, self._rods.n_points)
        rows, n_lanes = aligned_rows(n_rows, N_LANES), (1, n_q, N_LANES)
        shape = np.repeat(turned.ravel()[:, None], N_LANES, axis=1)
        capacity = len(times) + SPARE_STEPS
        while True:
            q, v = (aligned_rows(*n_lanes) for _ in range(2))
            q[:], v[:] = (of_state[:, None] for of_state in self._states[k])
            v[0, self._held], failed = 0.0, np.zeros((1, 1, N_LANES))
            counters, found = np.zeros(COUNTERS), np.empty((capacity + 1, n_rows))
            counters[CAPACITY] = capacity
            kept = Kept(counters, rows, rows.ravel(), found.ravel(), n_rows, n_q, n_a)
            work = WorkOfGradient(*self._work, kept, None)  # type: ignore[call-arg]
            counts, effort = advanced(
                advance.at(KEPT), self._scene, self._rods, work, (q, v), times, shape[None], failed
            )
            n = int(counters[N_STEPS])
            if n < capacity:
                break
            capacity *= 2
        found[n] = 0.0
        found[n, INTERVAL] = len(times) - 1
        found[n, OF_STEP : OF_STEP + n_q], found[n, OF_STEP + n_q : OF_STEP + 2 * n_q] = q[0, :, 0], v[0, :, 0]
        if counts["status"] > 0.0:
            q[:] = v[:] = effort[:] = np.nan
        q[0, self._held, 0], v[0, self._held] = self._states[k][0][self._held], 0.0
        return float(effort[0, WORK, 0]), counts, (q[0, :, 0].copy(), v[0, :, 0].copy()), found[: n + 1].copy()


class _Sweep:
    """Slopes of a number, taken from the end of a swim to its beginning.

    given: Slopes in the quantities of the swim, all of QUANTITIES.
    changes: Changes of what the swim begins with, in whose direction `slope_along` will be asked for.
    feedback: As of `Record.gradient`. by_commands: Whether `of_commands` is asked for, too.
    of_q, of_v: Slopes in rows of the state at the start. of_turns: Slopes in the rotations of every interval.
    of_commands: Those in its command, shape (n_limbs,). of_rest: Those in positions at rest.
    """

    def __init__(
        self,
        record: Record,
        given: Mapping[str, Floats],
        changes: Sequence[Start],
        feedback: Feedback | None,
        by_commands: bool,
    ):
        self._record, one, stages = record, record._rods, record._scheme.n_stages
        # Shared coefficients, where nobody asks for slopes in them, are known as constants when kernels are compiled.
        self._rods = as_rows_of_tape(side_by_side([one] * N_LANES)) if changes else one
        self._moved = [
            np.any([change.coefficients[k] != 0.0 for change in changes], axis=0) & np.full(len(rows), bool(changes))
            for k, rows in enumerate(arrays_of(self._rods))
        ]
        self._n_coefficients = with_places(self._rods, self._moved)
        n_q = record._start.q.size
        sizes = (n_q, n_q, record._n_a, *3 * (record._n_limbs,), 2 * one.n_free * stages)
        self._rows, self._beside = (Rows(*(np.zeros((n, ROW)) for n in sizes)) for _ in range(2))
        memory = make_work(one, stages, again=True)
        self._work, self._own_work = works(memory, self._rows.residual, stages, one.n_points)
        self._grow(ENTRIES)
        of_places, of_rest = slopes_of_heading(record.swim.positions, record._start.rest)
        in_places = given["positions"] + given["heading"][:, None, None] * of_places
        in_places[:, 0] += given["hub"]
        self.of_rest: Floats = np.tensordot(given["heading"], of_rest, axes=1)
        n, held = 2 * one.n_nodes, record._held
        self.of_q, self.of_v = (np.zeros(n_q) for _ in range(2))
        self.of_turns: list[Floats] = []
        self.of_commands: list[Floats] = []
        rises = record.rises_by_commands() if by_commands or feedback is not None else []
        by_command: list[list[Floats]] = [[np.zeros(record._n_limbs)] for _ in rises]  # from interval to interval
        for k in range(len(record._turns), -1, -1):
            if k < len(record._turns):
                kept_still = self.of_q[held].copy()
                self.of_q[held] = self.of_v[held] = 0.0
                self.of_turns.insert(0, self._pull_back(k, float(given["work"][k])))
                self.of_q[held] += kept_still
                self.of_v[held] = 0.0
                for command, rise in rises[k].items() if rises else ():
                    by_command[command].insert(1, np.tensordot(self.of_turns[0], rise, 2))
                if rises:
                    self.of_commands.insert(0, np.sum(by_command[k], axis=0))
                if feedback is not None:
                    by_policy = _shaped(feedback(k, self.of_commands[0]), (one.n_nodes, 2))
                    self.of_q[:n] += by_policy[0].ravel()
                    self.of_v[:n] += by_policy[1].ravel()
            self.of_q[:n] += in_places[k].ravel()
            self.of_v[:n] += given["velocities"][k].ravel()
        self.of_coefficients: Floats = self._slopes[1 : 1 + self._n_coefficients]

    def slope_along(self, start: Start) -> float:
        """Slope of the number if what the swim begins with changes like this."""
        total = self.of_q @ start.q + self.of_v @ start.v + (self.of_rest * start.rest).sum()
        place = 0
        for rows, moved, change in zip(arrays_of(self._rods), self._moved, start.coefficients, strict=True):
            if moved.any() and rows.ndim == 1:
                raise ValueError("There are no derivatives in numbers on a grid.")
            n = int(moved.sum())
            total += self.of_coefficients[place : place + n] @ change[moved]
            place += n
        return float(total)

    def _grow(self, capacity: int) -> None:
        self._entries = np.zeros(capacity * ENTRY)
        self._slopes = np.zeros(capacity)

    def _pull_back(self, k: int, of_work: float) -> Floats:
        """Take slopes through interval k; returns those in its rotations, shape (n_times, n_limbs)."""
        record = self._record
        times, turned = record._turns[k]
        kept = record.history(k)
        first = 1 + self._n_coefficients
        before = self._slopes[:first].copy()
        scene = SceneOnTape(
            self._rods, self._work, record._scheme, SCHEMES["implicit-euler"],
            Actuation(self._rows.start, self._rows.end), Actuation(self._beside.start, self._beside.end),
            record._limits, np.zeros((len(REPORT_ROWS), ROW)), record._rods, self._own_work, np.zeros((1, N_LANES)),
        )  # fmt: skip
        places, places_beside = (Rows(*(part.view(np.uint64) for part in rows)) for rows in (self._rows, self._beside))
        while True:
            of = Slopes(self.of_q.copy(), self.of_v.copy(), np.zeros(record._n_a), 0.0 * turned, of_work)
            tape = Tape(self._entries, self._entries.view(np.uint32), self._slopes, first)
            outcome = pull_back(scene, tape, self._rows, places, self._beside, places_beside, kept, times, turned, of)
            if outcome == 0:
                break
            if outcome == 2:
                raise RuntimeError("A time step could not be repeated as it was.")
            self._grow(2 * len(self._slopes))
            self._slopes[:first] = before
        self.of_q, self.of_v = of.q, of.v
        return of.shape


def _shaped(answer: object, shape: tuple[int, int]) -> list[Floats]:
    """What a feedback has answered, as arrays. ValueError for other shapes."""
    parts = [as_floats("slopes by feedback", part) for part in answer] if isinstance(answer, tuple | list) else []
    if [part.shape for part in parts] != [shape, shape]:
        raise ValueError(f"feedback must return slopes in positions and velocities, of shape {shape} each.")
    return parts
