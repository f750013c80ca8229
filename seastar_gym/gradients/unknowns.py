"""Unknowns by which swims are differentiated, and the slopes in them of all that a swim begins with."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.gradients.tape import CENTRAL, OF_COMMANDS, arrays_of, of_command, step_of
from seastar_gym.model import make_rods
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import is_finite_number, shown
from seastar_gym.scene.number import at, with_numbers
from seastar_gym.simulator.drive import Drive
from seastar_gym.simulator.simulator import Simulator
from seastar_gym.simulator.state import State, checked_state

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
    rods, nodes = make_rods(scene), np.asarray(scene.robot.nodes(0))
    if state is None:
        q, v = np.zeros(2 * rods.n_points), np.zeros(2 * rods.n_points)
        q[: nodes.size] = nodes.ravel()  # roots of limbs on a body are placed when the swim begins
    else:
        simulator = Simulator(scene, 1, threads=1)
        simulator.set_state(state)
        q, v = simulator.q[0, :, 0].copy(), simulator.v[0, :, 0].copy()
    return Start(arrays_of(rods), q, v, nodes)


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
            columns.append(slope_in_number(start, state, unknown))
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


def slope_in_number(start: Start, state: State | None, unknown: Unknown) -> Start:
    beside = [start_of(scene, state) for scene in unknown.beside]
    if any([a.shape for a in one.coefficients] != [a.shape for a in start.coefficients] for one in beside):
        raise ValueError(f"There is no derivative in {unknown.name}, whose smallest change adds or removes a term.")

    value, *values = (np.concatenate([array.ravel() for array in _arrays_of(one)]) for one in (start, *beside))
    known = np.isfinite(value)  # an infinite threshold has no slope
    slopes = CENTRAL.slope(np.where(known, value, 0.0), np.where(known, values, 0.0), unknown.step)
    shapes = [array.shape for array in _arrays_of(start)]
    parts = np.split(slopes, np.cumsum([math.prod(shape) for shape in shapes])[:-1])
    *coefficients, q, v, rest = (part.reshape(shape) for part, shape in zip(parts, shapes, strict=True))
    return Start(coefficients, q, v, rest)


def _arrays_of(start: Start) -> list[Floats]:
    return [*start.coefficients, *start[1:]]


FORGOTTEN = 4e-16
"""Relative difference of actuators' states from which on an earlier command has no effect any more."""


class Felt(NamedTuple):
    """Commands of an interval that limbs still feel.

    interval: Its number. weights: Of the stencils, shape (n_limbs, 4).
    states, commands: Of drives beside that of the swim, four for the command of every limb.
    """

    interval: int
    weights: Floats
    states: Floats
    commands: Floats


class Rotations:
    """Rotations of the limbs in intervals one after the other, and their slopes in all unknowns."""

    def __init__(self, scene: Scene, state: State | None, commands: Floats, unknowns: Sequence[Unknown]):
        self._own: list[tuple[int, Unknown, list[Drive]]] = []
        self._in_commands, column = -1, 0
        for unknown in unknowns:
            if unknown.name == "commands":
                self._in_commands = column
            elif unknown.beside and unknown.name.split(".")[0] in ("actuator", "limb_strengths"):
                self._own.append((column, unknown, [_drive(one, state) for one in unknown.beside]))
            column += unknown.size
        self._n, self._commands, self._scene = column, commands, scene
        self._drive = _drive(scene, state)
        self._felt: list[Felt] = []

    def interval(self, k: int, duration: float) -> tuple[Floats, Floats, Floats]:
        """Ends of the time steps of interval k [s], rotations, shape (n_times, n_limbs) [rad], and slopes (.., n)."""
        told = self._commands[k]
        times, value, felt = self.felt(k, duration)
        slopes = np.zeros((*value.shape, self._n))
        for interval, rises in felt.items():
            column = self._in_commands + told.size * interval
            slopes[..., column : column + told.size] = rises
        for column, unknown, drives in self._own:
            grids, beside_it = zip(*(_turned(drive, told[None], duration) for drive in drives), strict=True)
            if any(len(grid) != len(times) or not np.array_equal(grid, times) for grid in grids):
                raise ValueError(f"There is no derivative in {unknown.name}, which moves the ends of time steps.")
            slopes[..., column] = CENTRAL.slope(value, np.array([each[:, 0] for each in beside_it]), unknown.step)
        return times, value, slopes

    def felt(self, k: int, duration: float) -> tuple[Floats, Floats, dict[int, Floats]]:
        """Ends and rotations as of `interval`, and slopes in the commands that limbs still feel, by their numbers.

        Shape (n_times, n_limbs, n_limbs) each, the command's limb last.
        """
        before = self._drive.state, self._drive.commands, self._drive.phase
        times, turned = _turned(self._drive, self._commands[k][None], duration)
        value = turned[:, 0]
        return times, value, self._slopes_in_commands(k, duration, before, value) if self._in_commands >= 0 else {}

    def _slopes_in_commands(
        self, k: int, duration: float, before: tuple[Floats, Floats, float], value: Floats
    ) -> dict[int, Floats]:
        """Let drives beside this one follow the interval, four for every command that is still felt and every limb."""
        told, n_limbs = self._commands[k], self._commands.shape[1]
        size = 4 * n_limbs  # four drives for the command of every limb
        stencils = [of_command(command) for command in told]
        changed = np.repeat(told[None, None], n_limbs, axis=0).repeat(4, axis=1)  # (limb, place, limb)
        for limb, stencil in enumerate(stencils):
            changed[limb, :, limb] += OF_COMMANDS * np.array(stencil.places)
        state, under_way, phase = before
        weights = np.array([stencil.weights for stencil in stencils])
        self._felt.append(Felt(k, weights, np.repeat(state, size, axis=0), np.repeat(under_way, size, axis=0)))
        n_felt = len(self._felt)
        drive = Drive(self._scene.actuator, size * n_felt, n_limbs, self._scene.numerics.step)
        drive.strengths = np.repeat(self._drive.strengths, size * n_felt, axis=0)
        states, commands = (np.concatenate(each) for each in list(zip(*self._felt, strict=True))[2:])
        drive.put(states, commands, np.full(size * n_felt, phase))
        given = np.repeat(told[None], size * n_felt, axis=0)
        given[-size:] = changed.reshape(size, n_limbs)
        _, turned = _turned(drive, given, duration)
        beside = (turned - value[:, None]).reshape(len(value), n_felt, n_limbs, 4, n_limbs)
        found = np.einsum("tflpx,flp->txfl", beside, np.array([felt.weights for felt in self._felt])) / OF_COMMANDS
        slopes = {felt.interval: found[..., i, :] for i, felt in enumerate(self._felt)}
        base = self._drive.state
        differs = np.abs(drive.state - base) > FORGOTTEN * np.abs(base)
        self._felt = [
            felt._replace(states=drive.state[own], commands=drive.commands[own])
            for felt, own in ((felt, slice(size * i, size * (i + 1))) for i, felt in enumerate(self._felt))
            if differs[own].any()
        ]
        return slopes


def _drive(scene: Scene, state: State | None) -> Drive:
    """Drive of one robot as `Simulator` would have it."""
    drive = Drive(scene.actuator, 1, scene.robot.n_limbs, scene.numerics.step)
    drive.strengths = strengths_of(scene)
    if state is not None:
        checked = checked_state(state, np.asarray(scene.robot.nodes(0)), drive.at_rest, drive.longest)
        drive.put(*checked[3:6])
    return drive


def strengths_of(scene: Scene) -> Floats:
    """Strengths of the limbs of one robot, shape (1, n_limbs)."""
    return np.full((1, scene.robot.n_limbs), scene.limb_strengths or 1.0)


def _turned(drive: Drive, commands: Floats, duration: float) -> tuple[Floats, Floats]:
    """Ends of the time steps of an interval [s], and rotations, shape (n_times, n_robots, n_limbs) [rad]."""
    times, peaks, shape = drive.begin(duration, commands)
    drive.advance(len(times) - 1)
    return times, peaks * (shape[:, None, None] if shape.ndim == 1 else shape)
