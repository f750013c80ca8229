"""`Batch`: the numbers of all robots in memory, one robot per SIMD lane, and the kernels that advance them.

`Workers`: threads that share the parts of a batch.
"""

import os
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.lanes.dispatch import KnownCode
from seastar_gym.lanes.registers import N_LANES, NARROW, PLAIN, Form
from seastar_gym.lanes.rows import aligned_rows, from_rows, to_rows, write_rows
from seastar_gym.model import Coefficients, scheme_for
from seastar_gym.rods.bundles import Work, make_work
from seastar_gym.rods.interval import advance
from seastar_gym.rods.potential import energies, energies_in_water
from seastar_gym.rods.step import COVERED, MOMENTS, PEAK_MOMENT, REPORT_ROWS, SCHEMES, SMALLEST_HUB_T, WORK
from seastar_gym.rods.terms.hub import Actuation
from seastar_gym.scene import Scene
from seastar_gym.simulator.report import SolverStatus


class Workers:
    """Threads that share the parts of a batch. They start with the first run, and again after `close`.

    n: Number of threads. If it is 1, the caller's own thread does the work.
    """

    def __init__(self, n: int):
        self.n = n
        self._pool: ThreadPoolExecutor | None = None
        self._at_work: list[threading.Lock] = []
        self._process = os.getpid()

    def run(self, work: Callable[[int, slice], None], parts: Iterable[slice]) -> None:
        """Call work(thread, part) for all parts. A thread that has finished one takes the next.

        If a part fails or the caller is interrupted, all threads have stopped before the exception is raised.
        """
        if self.n == 1:
            for part in parts:
                work(0, part)
            return
        waiting = iter(list(parts))
        pool, at_work = self._get_pool(), self._at_work

        def take_parts(thread: int) -> None:
            with at_work[thread]:
                for part in waiting:
                    work(thread, part)

        try:
            list(pool.map(take_parts, range(self.n)))
        except BaseException:  # an interrupt, too: no thread works on once it is told
            _stop(waiting, at_work)
            raise

    def _get_pool(self) -> ThreadPoolExecutor:
        """Pool of this process. A fork inherits its parent's pool, but not the threads in it."""
        if self._pool is None or self._process != os.getpid():
            self._process = os.getpid()
            self._at_work = [threading.Lock() for _ in range(self.n)]
            self._pool = ThreadPoolExecutor(self.n)
        return self._pool

    def close(self) -> None:
        """End the threads."""
        pool, self._pool = self._pool, None
        if pool is not None and self._process == os.getpid():
            pool.shutdown()


def _stop(waiting: Iterator[slice], at_work: Iterable[threading.Lock]) -> None:
    """Take all waiting parts away and wait for the threads. A thread that is late finds no part."""
    try:
        for _ in waiting:
            pass
        for busy in at_work:
            with busy:
                pass
    except BaseException:  # interrupted once more: the threads are waited for all the same
        _stop(waiting, at_work)
        raise


Floats = NDArray[np.float64]

PARTS_PER_THREAD = 8
"""Parts of a batch for every thread. With more parts than threads, a thread that is held up by another process leaves
its share to the others."""
LARGEST_PART = 64
"""Lane groups in a part at most. An interrupt waits for the parts under way."""
FEW = N_LANES // 2 if N_LANES > 4 else 0
"""Robots at most that are advanced on NARROW lanes, to the same bits: a whole batch, or the rest of a small one. With
eight lanes few robots are 1.6 times as fast so, with four no faster. Code for few is not that for many: who swims both
waits for the compiler twice.
"""
SMALL = 4
"""Lane groups at most of a batch whose rest is advanced apart: in a larger one the rest hardly counts."""
ROWS = ("q", "v", "status")
"""Arrays of shape (n_groups, k, N_LANES) that an interval changes and the next one does not make anew."""
MOVED = (*ROWS, "last_hub")
"""All such arrays of a batch."""


class Batch:
    """Numbers of all robots in memory, and the kernels that advance them.

    Most arrays have the shape (n_groups, k, N_LANES): a group of robots after the other, one robot per lane.

    coefficients: The scene's coefficients for the kernels.
    memory: Working memory of every thread, (Work, Actuation) of `rods`.
    q, v: Node positions [m] and velocities [m/s], k = 2 n_nodes = n_node_rows. With a body, its angle and the roots of
        its limbs follow, see rods/star.py.
    a: Accelerations at the stages of a step.
    peaks: Factors by which limbs follow `shape`, k = n_limbs.
    times: Ends of the time steps of the present interval [s], shape (n_times,).
    shape: Rotation of limbs at `times`, per unit of `peaks`: shape (n_times,), or
        (n_groups, n_times, n_limbs, N_LANES) if it differs between limbs.
    status: SolverStatus, k = 1.
    report: Counts of the present interval, k = len(REPORT_ROWS).
    effort: Work and moments of the actuators in the present interval, k = MOMENTS + n_limbs; 0 if nobody asks.
    last_hub: Hub position at the end of the last interval [m], shape (n_robots, 2).
    """

    def __init__(self, scene: Scene, n_robots: int, threads: int, effort: bool):
        self._scene, self.n_robots = scene, n_robots
        self._known_parts: dict[bool, list[slice]] = {}  # by whether coefficients are shared
        self._code = KnownCode()
        n_groups, n_limbs, n_rows = -(-n_robots // N_LANES), scene.robot.n_limbs, 2 * scene.robot.n_nodes
        self._scheme = scheme_for(scene)
        self.coefficients = Coefficients(scene, n_robots)
        self.n_node_rows = n_rows
        body = self.coefficients.rods(0).body
        n_free_rows, n_place_rows = (n_rows, n_rows) if body is None else (n_rows + 2, n_rows + 2 + 2 * body.n_arms)
        self.q = aligned_rows(n_groups, n_place_rows, N_LANES)
        self.v = aligned_rows(n_groups, n_place_rows, N_LANES)
        self.q[:, : self.coefficients.rest.shape[1]] = self.coefficients.rest
        n_shares = 0 if body is None else self._scheme.n_stages
        self.a = aligned_rows(n_groups, (n_free_rows + 1) * self._scheme.n_stages + n_shares, N_LANES)
        self.peaks = np.zeros((n_groups, n_limbs, N_LANES))
        self.times = self.shape = np.zeros(1)
        self.status = np.zeros((n_groups, 1, N_LANES))
        self.report = np.zeros((n_groups, len(REPORT_ROWS), N_LANES))
        self.effort = np.zeros((n_groups, MOMENTS + n_limbs if effort else 0, N_LANES))
        self._held_rows = np.array([2 * node + axis for node in scene.held_nodes for axis in (0, 1)], dtype=int)
        self._held = self.q[:, self._held_rows]
        self.last_hub = self.hub_position()
        self.workers = Workers(threads)
        self.memory = [self._make_memory() for _ in range(threads)]

    def _make_memory(self) -> tuple[Work, Actuation]:
        n_limbs = self._scene.robot.n_limbs
        rotations = Actuation(np.zeros((n_limbs, N_LANES)), np.zeros((n_limbs, N_LANES)))
        return make_work(self.coefficients.rods(0), self._scheme.n_stages), rotations

    @property
    def arrays(self) -> ModuleType:
        """Module of the device's arrays."""
        return np

    def read(self, rows: Floats) -> Floats:
        """Copy of rows (n_groups, k, N_LANES) robot by robot, shape (n_robots, k)."""
        return from_rows(rows, self.n_robots)

    def _shape_rows(self, shape: Floats) -> Floats:
        """Rotations of shape (n_times, n_robots, n_limbs) as rows for the kernels; shape (n_times,) stays as it is."""
        if shape.ndim == 1:
            return shape
        rows = to_rows(shape.transpose(1, 0, 2))
        return rows.reshape(len(self.q), *shape[:, 0].shape, N_LANES)

    def hub_position(self) -> Floats:
        """Hub positions [m], shape (n_robots, 2)."""
        return self.read(self.q[:, :2])

    @property
    def failed(self) -> NDArray[np.bool_]:
        """Robots whose solver has given up, shape (n_robots,)."""
        return self.read(self.status)[:, 0] > 0.0

    def rows(self) -> dict[str, Floats]:
        """Copies of the arrays by name, robot by robot: their reader may have another lane width."""
        return {name: self.read(getattr(self, name)) for name in ROWS}

    def put_rows(self, rows: dict[str, Floats]) -> None:
        """Write the arrays that `rows` returned."""
        for name, values in rows.items():
            write_rows(getattr(self, name), values)
        self.last_hub = self.hub_position()

    def put_nodes(self, robot: int | np.intp, nodes: Floats, angle: float = 0.0) -> None:
        """Put a robot's nodes at positions [m], shape (n_nodes, 2), and its body at an angle [rad], at rest."""
        group, lane = divmod(robot, N_LANES)
        self.q[group, : self.n_node_rows, lane] = nodes.reshape(-1)
        self.v[group, :, lane] = 0.0
        if self.has_body:
            self.q[group, self.n_node_rows, lane] = angle * self._scales[group, lane]
            self._place_roots()

    @property
    def has_body(self) -> bool:
        """Whether robots have a body, with an orientation of its own."""
        return self.coefficients.rods(0).body is not None

    @property
    def _scales(self) -> Floats:
        """Arc over angle of every robot's body [m], shape (n_groups, N_LANES)."""
        bodies = [self.coefficients.rods(group).body for group in range(len(self.q))]
        return np.array([np.broadcast_to(body.scale.reshape(-1), N_LANES) for body in bodies if body is not None])

    def angles(self, rows: Floats) -> Floats:
        """Orientation of every body [rad] from q, or its rate [rad/s] from v, shape (n_robots,)."""
        return self.read(rows[:, self.n_node_rows, None] / self._scales[:, None])[:, 0]

    def nodes_of(self, rows: Floats) -> Floats:
        """Node positions [m] from q, or velocities [m/s] from v, shape (n_robots, n_nodes, 2)."""
        return self.read(rows[:, : self.n_node_rows]).reshape(self.n_robots, -1, 2)

    def put_at_rest(self, robot: np.intp, angle: float) -> None:
        """Put a robot at rest with the hub at the origin and limb 1 in the direction `angle` [rad]."""
        nodes = self.coefficients.nodes(robot)
        # At heading zero the nodes are exactly those of rest, so that symmetric scenes stay symmetric.
        c, s = np.cos(angle), np.sin(angle)
        x, y = c * nodes[:, 0] - s * nodes[:, 1], s * nodes[:, 0] + c * nodes[:, 1]
        self.put_nodes(robot, np.stack([x, y], axis=1), angle)
        group, lane = divmod(robot, N_LANES)
        self.status[group, :, lane] = 0.0
        self.last_hub[robot] = 0.0

    def _place_roots(self) -> None:
        """Put the roots of limbs where hub and angle say, with the velocities of there: kernels do so as they begin."""
        n, scales = self.n_node_rows, self._scales
        arms = np.array([limb.root for limb in self._scene.robot.limb_shapes()])[:, :, None]
        angle, spin = (rows[:, None, n] / scales[:, None] for rows in (self.q, self.v))
        c, s = np.cos(angle), np.sin(angle)
        x, y = c * arms[:, 0] - s * arms[:, 1], s * arms[:, 0] + c * arms[:, 1]
        for rows, away in ((self.q, (x, y)), (self.v, (-spin * y, spin * x))):
            for axis in (0, 1):
                rows[:, n + 2 + axis : n + 2 + 2 * len(arms) : 2] = rows[:, axis, None] + away[axis]

    def put_state(self, positions: Floats, velocities: Floats, orientation: Floats, spin: Floats) -> None:
        """Put all robots at node positions [m] with velocities [m/s], each of shape (n_robots, n_nodes, 2).

        orientation, spin: Of bodies [rad], [rad/s], shape (n_robots,); ignored without.
        """
        write_rows(self.q[:, : self.n_node_rows], positions)
        write_rows(self.v[:, : self.n_node_rows], velocities)
        if self.has_body:
            for rows, angle in ((self.q, orientation), (self.v, spin)):
                write_rows(rows[:, self.n_node_rows, None], angle)
                rows[:, self.n_node_rows] *= self._scales
            self._place_roots()
        self.status[:] = 0.0
        self.last_hub = self.hub_position()

    def save(self) -> dict[str, Any]:
        """Copies of what an interval changes, for `restore`."""
        return {name: getattr(self, name).copy() for name in MOVED}

    def restore(self, moved: dict[str, Any]) -> None:
        """Undo an interval, from the copies that `save` made before it."""
        for name, values in moved.items():
            getattr(self, name)[:] = values

    def energies(self, rotations: Floats) -> tuple[Floats, Floats]:
        """Elastic energy (13.14) and kinetic energy [J], shape (n_robots,) each.

        rotations: Rotations of the limbs by their actuators [rad], shape (n_robots, n_limbs).
        """
        (work, actuation), turned = self.memory[0], to_rows(rotations)
        both = np.zeros((2, len(self.q), 1, N_LANES))
        for group in range(len(self.q)):
            actuation.delta_psi_start[:] = actuation.delta_psi_end[:] = turned[group]
            rods = self.coefficients.rods(group)
            self._call(energies, rods, work, actuation, self.q[group], self.v[group], both[0, group], both[1, group])
        return self.read(both[0])[:, 0], self.read(both[1])[:, 0]

    def energy_in_water(self) -> Floats:
        """Kinetic energy with the velocity of every node less that of the water there [J], shape (n_robots,)."""
        q, v = self.q, self.v
        relative, found = aligned_rows(*v.shape[1:]), np.zeros((len(q), 1, N_LANES))
        bounds = [0, len(q)] if self.coefficients.are_shared else range(len(q) + 1)
        for part in map(slice, bounds[:-1], bounds[1:]):
            rods = self.coefficients.rods(part.start)
            self._call(energies_in_water, rods, q[part], v[part], relative, found[part])
        return self.read(found)[:, 0]

    def begin(self, times: Floats, peaks: Floats, shape: Floats) -> None:
        """Begin an interval in which limbs turn by `peaks`, shape (n_robots, n_limbs), times `shape`.

        times: Ends of the time steps [s]. shape: Rotations at those times, as `Drive.begin` returns them.
        """
        write_rows(self.peaks, peaks)
        self.times, self.shape = times, self._shape_rows(shape)
        if self._held_rows.size:
            self._held = self.q[:, self._held_rows]
            self.v[:, self._held_rows] = 0.0
        self.report.fill(0.0)
        self.report[:, SMALLEST_HUB_T] = np.inf
        self.effort.fill(0.0)

    def advance(self, begin: int, end: int) -> None:
        """Advance all robots from the time step `begin` of the interval to `end`."""
        times = self.times[begin : end + 1]
        if begin == 0:
            self.a.fill(0.0)  # an interval depends on the state at its beginning only

        def swim(thread: int, part: slice) -> None:
            work, actuation = self.memory[thread]
            shape, n_turning = self._shape_of(part, begin, end)
            self._call(
                advance.at(self._form(part)), self.coefficients.rods(part.start), work, self._scheme,
                SCHEMES["implicit-euler"], actuation, self.q[part], self.v[part], self.a[part], self.peaks[part], times,
                shape, n_turning, self.status[part], self.report[part], self.coefficients.limits(part.start),
                self.effort[part], kind=shape.ndim,
            )  # fmt: skip

        self.workers.run(swim, self._parts())

    def _parts(self) -> list[slice]:
        """Lane groups of each part of the batch. Coefficients hold for a whole part."""
        are_shared, n_groups, threads = self.coefficients.are_shared, len(self.status), self.workers.n
        if are_shared not in self._known_parts:
            n_parts = 1 if threads == 1 else min(n_groups, PARTS_PER_THREAD * threads)
            n_parts = max(n_parts, -(-n_groups // LARGEST_PART)) if are_shared else n_groups
            bounds = {n_groups * k // n_parts for k in range(n_parts + 1)}
            ends = sorted(bounds | {n_groups - 1} if self._form(slice(n_groups - 1, n_groups)) is NARROW else bounds)
            self._known_parts[are_shared] = list(map(slice, ends[:-1], ends[1:]))
        return self._known_parts[are_shared]

    def _form(self, part: slice) -> Form:
        """Width of the lanes on which a part is advanced."""
        n_groups, n_robots = len(self.status), self.n_robots - part.start * N_LANES
        return NARROW if n_robots <= FEW and n_groups <= SMALL else PLAIN

    def _call(self, entry: Callable[..., None], *args: Any, kind: int = 0) -> None:
        """Call compiled code with arguments whose types differ only by `kind`, and by what robots share."""
        self._code.call((kind, self.coefficients.are_shared), entry, *args)

    def _shape_of(self, part: slice, begin: int, end: int) -> tuple[Floats, int]:
        """Rows of the shape from time `begin` to `end` for kernels, and number of the limbs that have rows."""
        if self.shape.ndim == 1:
            return self.shape[begin : end + 1], 0
        rows = np.ascontiguousarray(self.shape[part, begin : end + 1])
        return rows.reshape(len(rows), -1, N_LANES), rows.shape[2]

    def covered(self) -> Floats:
        """Time covered since the interval began [s], shape (n_robots,)."""
        return self.read(self.report)[:, COVERED]

    def end(self) -> tuple[NDArray[np.int64], Floats, dict[str, Floats]]:
        """End an interval: release held nodes, put lost robots at rest.

        Returns the status, shape (n_robots,), the report's rows, (len(REPORT_ROWS), n_robots), and work and peak_moment
        of the actuators by name if somebody asks for them.
        """
        if self._held_rows.size:
            self.q[:, self._held_rows] = self._held
            self.v[:, self._held_rows] = 0.0
        if np.maximum.reduce(self.status, axis=None) > 0.0:
            self._put_lost_robots_at_rest()
        self.last_hub = self.hub_position()
        effort = self.read(self.effort).T if self.effort.size else None
        told = {} if effort is None else {"work": effort[WORK], "peak_moment": effort[PEAK_MOMENT]}
        return self.read(self.status)[:, 0].astype(np.int64), self.read(self.report).T, told

    def _put_lost_robots_at_rest(self) -> None:
        """Put failed robots whose state is not finite at rest where their hub was last."""
        lost = self.failed & ~np.isfinite(self.read(self.q) + self.read(self.v)).all(axis=1)
        for robot in np.flatnonzero(lost):
            self.put_nodes(robot, self.last_hub[robot] + self.coefficients.nodes(robot))
            group, lane = divmod(robot, N_LANES)
            self.status[group, 0, lane] = SolverStatus.NOT_FINITE
