"""Unknowns by which swims are differentiated, and the slopes in them of all that a swim begins with."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.gradients.stencils import CENTRAL, OF_COMMANDS, arrays_of, of_command, step_of
from seastar_gym.model.rods import make_rods
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import is_finite_number, shown
from seastar_gym.scene.per_robot import at, with_numbers
from seastar_gym.simulator.drive import Drive
from seastar_gym.simulator.simulator import Simulator
from seastar_gym.simulator.state import State

Floats = NDArray[np.float64]

OF_START = ("positions", "velocities")
"""Unknowns of the state at the start, shape (n_nodes, 2) each."""
PARTS = ("robot", "fluid", "actuator", "contact", "gravity", "loads", "limb_strengths")
"""Parts of a scene whose numbers may be unknowns."""


class Start(NamedTuple):
    """What a swim begins with: arrays of coefficients, rows of q [m] and v [m/s], shape (n_rows,); places at rest [m],
    shape (n_nodes, 2).
    """

    coefficients: list[Floats]
    q: Floats
    v: Floats
    rest: Floats


def start_of(scene: Scene, state: State | None) -> Start:
    simulator = Simulator(scene, 1, threads=1)
    if state is not None:
        simulator.set_state(state)
    rest = np.asarray(simulator.coefficients.rest_shapes())
    return Start(arrays_of(make_rods(scene)), simulator.q[0, :, 0].copy(), simulator.v[0, :, 0].copy(), rest)


class Unknown(NamedTuple):
    """Numbers by one name: how many, and their shape.

    beside: Of a number of the scene, scenes at the places of CENTRAL, step apart.
    """

    name: str
    shape: tuple[int, ...]
    beside: tuple[Scene, ...] = ()
    step: float = 0.0

    @property
    def size(self) -> int:
        return int(np.prod(self.shape, dtype=int))


def unknowns_of(scene: Scene, commands: Floats, names: Sequence[str]) -> list[Unknown]:
    """Unknowns by their names. ValueError for those in which swims have no derivative."""
    return [_unknown(scene, commands, name) for name in names]


def _unknown(scene: Scene, commands: Floats, name: str) -> Unknown:
    if name == "commands":
        return Unknown(name, commands.shape)
    if name in OF_START:
        if scene.robot.has_body:
            raise ValueError(f"There are no derivatives in {name} of robots with a body.")
        return Unknown(name, (scene.robot.n_nodes, 2))
    value = at(scene, name) if name.split(".")[0] in PARTS else None
    if value is None or not is_finite_number(value):
        raise ValueError(
            f"by has {shown(name)}, which is no number of this scene, such as fluid.drag_coefficient, and none of "
            f"{', '.join(('commands', *OF_START))}."
        )
    value = float(value)
    step = step_of(value)
    try:
        beside = tuple(with_numbers(scene, {name: value + step * place}) for place in CENTRAL.places)
    except ValueError as refused:
        raise ValueError(f"There is no derivative in {name}, which cannot be changed both ways: {refused}") from None
    return Unknown(name, (), beside, step)


def slopes_of_start(scene: Scene, state: State | None, unknowns: Sequence[Unknown]) -> tuple[Start, Start]:
    """What a swim begins with, and its slopes: arrays with a further axis, of all unknowns."""
    start = start_of(scene, state)
    columns: list[Start] = []
    for unknown in unknowns:
        if unknown.beside:
            columns.append(_slope_in_number(start, state, unknown))
            continue
        n = start.q.size
        nothing = Start([np.zeros(a.shape) for a in start.coefficients], np.zeros(n), np.zeros(n), 0.0 * start.rest)
        if unknown.name in OF_START:
            field = "q" if unknown.name == "positions" else "v"
            columns += [nothing._replace(**{field: row}) for row in np.eye(n)[: unknown.size]]
        else:
            columns += [nothing] * unknown.size
    fields = zip(*(column[1:] for column in columns), strict=True)
    coefficients = zip(*(column.coefficients for column in columns), strict=True)
    return start, Start([np.stack(each, axis=-1) for each in coefficients], *(np.stack(f, axis=-1) for f in fields))


def _slope_in_number(start: Start, state: State | None, unknown: Unknown) -> Start:
    beside = [start_of(scene, state) for scene in unknown.beside]
    if any([a.shape for a in one.coefficients] != [a.shape for a in start.coefficients] for one in beside):
        raise ValueError(f"There is no derivative in {unknown.name}, whose smallest change adds or removes a term.")

    def slope(value: Floats, values: Sequence[Floats]) -> Floats:
        known = np.isfinite(value)  # an infinite threshold has no slope
        some = np.array([np.where(known, each, 0.0) for each in values])
        return CENTRAL.slope(np.where(known, value, 0.0), some, unknown.step)

    arrays = zip(start.coefficients, *(one.coefficients for one in beside), strict=True)
    return Start(
        [slope(value, values) for value, *values in arrays],
        *(slope(value, values) for value, *values in zip(start[1:], *(one[1:] for one in beside), strict=True)),
    )


class Rotations:
    """Rotations of the limbs in intervals one after the other, and their slopes in all unknowns."""

    def __init__(self, scene: Scene, state: State | None, commands: Floats, unknowns: Sequence[Unknown]):
        self._unknowns = unknowns
        self._own: list[tuple[int, Unknown, list[Drive]]] = []
        self._in_commands, self._stencils = -1, [of_command(command) for command in commands.flat]
        column = 0
        for unknown in unknowns:
            if unknown.name == "commands":
                self._in_commands = column
            elif unknown.beside and unknown.name.split(".")[0] in ("actuator", "limb_strengths"):
                drives = [_drive(one, state, 1) for one in unknown.beside]
                self._own.append((column, unknown, drives))
            column += unknown.size
        self._n, self._commands = column, commands
        n_changed = 4 * commands.size if self._in_commands >= 0 else 0
        self._drive = _drive(scene, state, 1 + n_changed)
        self._changed = self._changes() if n_changed else np.zeros((0, *commands.shape))

    def _changes(self) -> Floats:
        """Commands of all swims of which one differs, shape (4 commands.size, n_intervals, n_limbs)."""
        changes = np.zeros((self._commands.size, 4, self._commands.size))
        for k, stencil in enumerate(self._stencils):
            changes[k, :, k] = OF_COMMANDS * np.array(stencil.places)
        return self._commands + changes.reshape(-1, *self._commands.shape)

    def interval(self, k: int, duration: float) -> tuple[Floats, Floats, Floats]:
        """Ends of the time steps of interval k [s], rotations, shape (n_times, n_limbs) [rad], and slopes (.., n)."""
        told = np.concatenate([self._commands[None, k], self._changed[:, k]])
        times, turned = _turned(self._drive, told, duration)
        slopes = np.zeros((*turned.shape[:1], *turned.shape[2:], self._n))
        value = turned[:, 0]
        if self._in_commands >= 0:
            beside = turned[:, 1:].reshape(len(times), -1, 4, turned.shape[2])
            for n, stencil in enumerate(self._stencils):
                of_command_n = stencil.slope(value, np.moveaxis(beside[:, n], 1, 0), OF_COMMANDS)
                slopes[..., self._in_commands + n] = of_command_n
        for column, unknown, drives in self._own:
            grids, beside_it = zip(*(_turned(drive, told[:1], duration) for drive in drives), strict=True)
            if any(len(grid) != len(times) or not np.array_equal(grid, times) for grid in grids):
                raise ValueError(f"There is no derivative in {unknown.name}, which moves the ends of time steps.")
            slopes[..., column] = CENTRAL.slope(value, np.array([each[:, 0] for each in beside_it]), unknown.step)
        return times, value, slopes


def _drive(scene: Scene, state: State | None, n_robots: int) -> Drive:
    """Drive of as many robots as `Simulator` would have it."""
    simulator = Simulator(scene, 1, threads=1)
    if state is not None:
        simulator.set_state(state)
    drive, one = Drive(scene.actuator, n_robots, scene.robot.n_limbs, scene.numerics.step), simulator.get_state()
    drive.strengths = np.repeat(simulator.limb_strengths, n_robots, axis=0)
    actuators, commands, phase = (np.repeat(part, n_robots, axis=0) for part in one[3:6])  # type: ignore[arg-type]
    drive.put(actuators, commands, phase)
    return drive


def _turned(drive: Drive, commands: Floats, duration: float) -> tuple[Floats, Floats]:
    """Ends of the time steps of an interval [s], and rotations, shape (n_times, n_robots, n_limbs) [rad]."""
    times, peaks, shape = drive.begin(duration, commands)
    drive.advance(len(times) - 1)
    return times, peaks * (shape[:, None, None] if shape.ndim == 1 else shape)
