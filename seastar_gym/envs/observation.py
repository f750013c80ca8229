"""Observations of robots, filled by kernels: what they see.

Layout of an observation: what a robot sees, in which order and units.

A limb has nine stations, evenly spaced from hub to tip, whatever its nodes: observations, and policies
made for them, do not depend on the mesh. Stations of the chapter's robot are its nodes.

The body frame has its origin at the hub. Its x axis is the direction of limb 1 of the rest shape, after the rotation
that fits the rest shape best to the robot (least squares over all stations). Every number is of order one; lengths are
in units of the robot's own limb length:

index                 meaning                                           unit
0 .. 2m-1             station positions relative to the hub, x and y    limb lengths
2m .. 4m-1            station velocities relative to the hub, x and y   VELOCITY_SCALE
4m, 4m+1              hub velocity, x and y                             VELOCITY_SCALE
4m+2, 4m+3            current waypoint relative to the hub, x and y     limb lengths
4m+4, 4m+5            next waypoint relative to the hub, x and y        limb lengths

with m = 9 n_limbs stations in the order {1,1}..{1,9}, {2,1}.. (m = 45 for five limbs: 186 numbers). On the last leg the
next waypoint is the current one. Distances of waypoints are not clipped.

If actuators have a memory (`has_memory`), the numbers of its `observe` for limb 1, limb 2, .. stand before the
waypoints, which are always the last four numbers; an environment may leave the memory out. A task may add numbers to
those of every limb, such as its last command.

Further entries of a task stand after those of the limbs, before the waypoints. If headings are asked for
(`options.py`), they are cosine and sine of the turn to the heading at the current waypoint, and of that to the heading
at the next. A task may show nothing of the limbs' shape: its observation then begins with the numbers of the limbs.

With a `Sight`, fewer stations may be seen, or none, and further entries after those of the task say what follows from
the last two pictures, and the age of the last one, see `entries_of` in sight.py.

Stations: the places along the limbs where a robot is observed, the same ones whatever its nodes.

Station k of a limb lies at k/9 of its length, k = 1..9. Between nodes, the limb is the cubic spline through its nodes
and the hub, or its root on a body, in arc length and with not-a-knot ends; with fewer than four nodes it is the
polynomial through them. So the stations of a robot of ten nodes per limb are its nodes, and its observation converges
with the fourth power of the edge length.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from seastar_gym.interrupts import held_back
from seastar_gym.lanes.compile import entry_point, kernel
from seastar_gym.lanes.dispatch import KnownCode
from seastar_gym.lanes.registers import add_product, borrow, load, load_number, select, splat, sqrt, store
from seastar_gym.lanes.rows import to_rows
from seastar_gym.model import Coefficients
from seastar_gym.scene import Scene, Seastar
from seastar_gym.scene.actuators.base import Actuator, complete
from seastar_gym.scene.checks import require_count, require_flag, require_limbs, shown
from seastar_gym.simulator import Simulator
from seastar_gym.simulator.state import best_fit_heading, root_places

OBSERVATION_LAYOUT = 2
"""Version of this table, which saved policies name. A change of order, unit or frame gives it another number."""
VELOCITY_SCALE = 0.025
"""Unit of velocities [m/s]: nodes and hub move at 12 to 24 mm/s root mean square after strokes of random commands."""
N_STATIONS = 9
"""Stations of a limb: the nodes {i,1}..{i,9} of the chapter's robot."""
MOST_REMEMBERED = 1_000_000
"""Most numbers that the actuators of a robot may remember."""

Entry = Literal["scalar", "pseudoscalar", "vector"]
"""The same in every frame; reversed by a mirror; two numbers, x and y in the body frame."""
SIZES: Mapping[Entry, int] = {"scalar": 1, "pseudoscalar": 1, "vector": 2}
"""Numbers of every entry."""
HEADINGS: tuple[Entry, ...] = ("scalar", "pseudoscalar", "scalar", "pseudoscalar")
"""Entries of asked headings, which come first."""


@dataclass(frozen=True)
class Layout:
    """What an observation consists of, and the places of all that, as slices of its last axis.

    n_limbs: Number of limbs. of_limb: Numbers of every limb besides its stations: the memory of its actuator, and what
    a task adds. entries: Further entries, asked headings first. shows_limbs: Whether the stations of the limbs and the
    hub's velocity are seen. stations: Number of stations that are seen of a limb, evenly spaced, the last at the tip.
    """

    n_limbs: int = 5
    of_limb: int = 0
    entries: tuple[Entry, ...] = ()
    shows_limbs: bool = True
    stations: int = N_STATIONS

    def __post_init__(self) -> None:
        require_limbs(self.n_limbs)
        require_count("of_limb", self.of_limb, 0, MOST_REMEMBERED)
        require_flag("shows_limbs", self.shows_limbs)
        require_count("stations", self.stations, 1, N_STATIONS)
        known = isinstance(self.entries, tuple) and all(isinstance(entry, str) for entry in self.entries)
        if not known or not set(self.entries) <= set(get_args(Entry)):
            raise ValueError(f"entries must be a tuple of {', '.join(get_args(Entry))}, not {shown(self.entries)}.")

    @classmethod
    def of(cls, scene: Scene, observe_actuators: bool = True, entries: tuple[Entry, ...] = ()) -> Layout:
        """Layout for the robot of a scene, with the memory of its actuators or without."""
        return cls(scene.robot.n_limbs, memory_size(scene.actuator) if observe_actuators else 0, entries)

    @cached_property
    def _places(self) -> tuple[slice, ...]:
        along_limbs, hub = (2 * self.stations * self.n_limbs, 2) if self.shows_limbs else (0, 0)
        further = sum(SIZES[entry] for entry in self.entries)
        ends = np.cumsum([along_limbs, along_limbs, hub, self.n_limbs * self.of_limb, further, 2, 2]).tolist()
        return tuple(map(slice, [0, *ends[:-1]], ends))

    @property
    def positions(self) -> slice:
        """Positions of the stations relative to the hub [limb lengths]."""
        return self._places[0]

    @property
    def velocities(self) -> slice:
        """Velocities of the stations relative to the hub [VELOCITY_SCALE]."""
        return self._places[1]

    @property
    def hub_velocity(self) -> slice:
        """Velocity of the hub [VELOCITY_SCALE]."""
        return self._places[2]

    @cached_property
    def stations_and_hub(self) -> slice:
        """The positions, the velocities and the hub's velocity."""
        return slice(0, self.hub_velocity.stop)

    @cached_property
    def actuators(self) -> slice:
        """Numbers of the limbs, limb after limb: the memory of its actuator, and what a task adds to it."""
        return self._places[3]

    @cached_property
    def further(self) -> slice:
        """Further entries."""
        return self._places[4]

    @property
    def headings(self) -> slice:
        """Asked headings; empty where none are asked for."""
        start = self.further.start
        return slice(start, start + (len(HEADINGS) if self.asks_headings else 0))

    @property
    def current_waypoint(self) -> slice:
        """Current waypoint relative to the hub [limb lengths]."""
        return self._places[5]

    @property
    def next_waypoint(self) -> slice:
        """Next waypoint relative to the hub [limb lengths]."""
        return self._places[6]

    @cached_property
    def waypoints(self) -> slice:
        """The current waypoint and the next."""
        return slice(self.current_waypoint.start, self.next_waypoint.stop)

    @cached_property
    def size(self) -> int:
        """Length of the observation."""
        return int(self.next_waypoint.stop)

    @property
    def asks_headings(self) -> bool:
        """Whether headings are asked for."""
        return self.entries[: len(HEADINGS)] == HEADINGS

    @property
    def tips(self) -> list[int]:
        """Places of the positions of the limbs' tips: x and y, limb after limb."""
        return [2 * self.stations * limb + k for limb in range(1, self.n_limbs + 1) for k in (-2, -1)]

    def begins(self, kind: Entry) -> NDArray[np.intp]:
        """Where the entries of a kind begin, among the numbers of the further entries."""
        ends = np.cumsum([0, *(SIZES[entry] for entry in self.entries)])[: len(self.entries)]
        return np.asarray(ends[[entry == kind for entry in self.entries]], np.intp)


def memory_size(actuator: Actuator) -> int:
    """Numbers that are observed of an actuator, 0 without memory."""
    known = complete(actuator)
    return known.observe(known.rest).shape[-1]


Floats = NDArray[np.float64]


class Stations(NamedTuple):
    """What kernels need to know of `weights`.

    n_stations, n_nodes: Numbers of stations and nodes of a limb, without the hub. weights: Row after row, shape
    (n_stations n_nodes,). first, last: Nodes of every station whose weights are not zero, the last excluded, shape
    (n_stations,) each; whole numbers. root_weights: Weights of the root of a limb on a body, shape (n_stations,), or
    None where limbs begin at the hub. first_root: Row of the first root's x, among those of places (rods/star.py).
    """

    n_stations: int
    n_nodes: int
    weights: Floats
    first: Floats
    last: Floats
    root_weights: Floats | None
    first_root: int


def stations_of(robot: Seastar) -> Stations:
    """Stations of a robot's limbs."""
    return stations(robot.nodes_per_limb, robot.n_limbs if robot.has_body else 0)


@cache
def stations(nodes_per_limb: int, limbs_on_body: int = 0) -> Stations:
    """Stations of limbs of nodes_per_limb nodes with the hub, or with the root of so many limbs on a body."""
    rows = weights(nodes_per_limb, N_STATIONS + 1)
    used = rows != 0.0
    first, last = np.argmax(used, axis=1), rows.shape[1] - np.argmax(used[:, ::-1], axis=1)
    first, last = first.astype(np.float64), last.astype(np.float64)
    of_root = of_beginning(rows) if limbs_on_body else None
    first_root = 2 * (2 + limbs_on_body * (nodes_per_limb - 1)) if limbs_on_body else 0
    return Stations(N_STATIONS, nodes_per_limb - 1, rows.ravel(), first, last, of_root, first_root)


def of_beginning(rows: Floats) -> Floats:
    """What rows of weights leave for the point where a limb begins, if vectors are measured from elsewhere."""
    return 1.0 - rows.sum(axis=1)


@cache
def weights(n: int, m: int) -> Floats:
    """Weights, shape (m - 1, n - 1), of n evenly spaced points of a curve for its values at m evenly spaced ones.

    The first points of both stand at the same end, from which all vectors are measured; they have no weights.
    """
    value, point = np.arange(m)[:, None], np.arange(n)
    on_point = value * (n - 1) == point * (m - 1)
    known = on_point.any(axis=1, keepdims=True)
    found = on_point.astype(np.float64) if known.all() else np.where(known, on_point, _spline_weights(n, m))
    found = found[1:, 1:].copy()
    found.setflags(write=False)
    return found


def _spline_weights(n: int, m: int) -> Floats:
    """Weights, shape (m, n), of all points for all values: values = at_values at_points^-1 points."""
    # These take half a second to import, and robots whose nodes stand at all stations do without.
    with held_back():
        from scipy.interpolate import BSpline
        from scipy.sparse.linalg import splu

    degree, knots = min(3, n - 1), np.linspace(0.0, 1.0, n)[2:-2]
    knots = np.concatenate([np.zeros(degree + 1), knots, np.ones(degree + 1)])
    at_points, at_values = (BSpline.design_matrix(np.linspace(0.0, 1.0, k), knots, degree) for k in (n, m))
    return np.asarray(splu(at_points.T.tocsc()).solve(at_values.T.toarray()).T)


def node_weights(nodes_per_limb: int) -> Floats:
    """Weights, shape (nodes_per_limb - 1, 9), of stations for nodes, both without the hub.

    Up to ten nodes follow exactly from their stations; more lie on the spline through them.
    """
    if nodes_per_limb > N_STATIONS:
        return weights(N_STATIONS + 1, nodes_per_limb)
    return np.asarray(np.linalg.pinv(weights(nodes_per_limb, N_STATIONS + 1)), np.float64)


def roots_from_hub(positions: Floats, robot: Seastar, orientation: Floats | None = None) -> Floats:
    """Places where limbs begin, from the hub [m], shape (..., n_limbs, 2).

    positions: Node positions [m], shape (..., n_nodes, 2). orientation: Of the body [rad], shape (...); None means that
    of the rest shape that fits the nodes best.
    """
    if orientation is None:
        each = positions.reshape(-1, *positions.shape[-2:])
        orientation = best_fit_heading(each, robot.nodes()).reshape(positions.shape[:-2])
    return root_places(robot, orientation)


def at_stations(positions: Floats, robot: Seastar, orientation: Floats | None = None) -> Floats:
    """Hub and stations relative to the hub [m], shape (..., 9 n_limbs + 1, 2).

    positions, orientation: As in `roots_from_hub`.
    """
    from_hub = positions - positions[..., :1, :]
    limbs = from_hub[..., 1:, :].reshape(*positions.shape[:-2], robot.n_limbs, -1, 2)
    rows = weights(robot.nodes_per_limb, N_STATIONS + 1)
    along = rows @ limbs
    if robot.has_body:
        roots = roots_from_hub(positions, robot, orientation)
        along += of_beginning(rows)[:, None] * roots[..., None, :]
    return np.concatenate([from_hub[..., :1, :], along.reshape(*positions.shape[:-2], -1, 2)], axis=-2)


def body_heading(
    positions: Floats, robot: Seastar, orientation: Floats | None = None, rest: Floats | None = None
) -> Floats:
    """Direction of the body frame's x axis [rad], shape (n_robots,), see `observation.py`.

    positions: Node positions [m], shape (n_robots, n_nodes, 2). orientation: As in `roots_from_hub`.
    rest: Node positions at rest [m], shape (n_nodes, 2) or (n_robots, n_nodes, 2). None means those of `robot`.
    """
    shapes = robot.nodes() if rest is None else rest
    at_rest = at_stations(shapes, robot, np.zeros(shapes.shape[:-2]))
    return best_fit_heading(at_stations(positions, robot, orientation), at_rest)


def heading_of(simulator: Simulator) -> Floats:
    """`body_heading` of the robots of a simulator [rad], shape (n_robots,), each by its own shape at rest."""
    robot, orientation = simulator.scene.robot, simulator.orientation() if simulator.scene.robot.has_body else None
    return body_heading(simulator.positions, robot, orientation, simulator.coefficients.rest_shapes())


@kernel
def at_station(rows, stations, limb, station):
    """(x, y) at a station of a limb relative to the hub, of rows that have x and y of every node, or place (star.py).

    At a station that is a node, no bit differs from the node's.
    """
    first, last = int(load_number(stations.first, station)), int(load_number(stations.last, station))
    to_node, to_weight = 1 + limb * stations.n_nodes, station * stations.n_nodes
    hub_x, hub_y = load(rows, 0), load(rows, 1)
    weight, row = load_number(stations.weights, to_weight + first), 2 * (to_node + first)
    x, y = weight * (load(rows, row) - hub_x), weight * (load(rows, row + 1) - hub_y)
    for node in range(first + 1, last):
        weight, row = load_number(stations.weights, to_weight + node), 2 * (to_node + node)
        x = add_product(x, weight, load(rows, row) - hub_x)
        y = add_product(y, weight, load(rows, row + 1) - hub_y)
    return with_root(stations.root_weights, rows, stations, limb, station, x, y)


@kernel
def with_root(root_weights, rows, stations, limb, station, x, y):
    """(x, y) with the part of a limb's root on a body; unchanged where limbs begin at the hub."""
    if root_weights is None:
        return x, y
    weight, row = load_number(root_weights, station), stations.first_root + 2 * limb
    x = add_product(x, weight, load(rows, row) - load(rows, 0))
    return x, add_product(y, weight, load(rows, row + 1) - load(rows, 1))


@kernel
def n_limbs_of(root_weights, stations, n_rows):
    """Number of limbs of a robot with so many rows of places."""
    if root_weights is None:
        return (n_rows // 2 - 1) // stations.n_nodes
    return (n_rows // 2 - 2) // (stations.n_nodes + 1)


@kernel
def body_axis(rest, q, stations, n_limbs):
    """(cos, sin) of the rotation that fits the rest shape best to the stations around the hub; (1, 0) if none does."""
    c, s = splat(0.0), splat(0.0)
    for limb in range(n_limbs):
        for station in range(stations.n_stations):
            rest_x, rest_y = at_station(rest, stations, limb, station)
            x, y = at_station(q, stations, limb, station)
            c = add_product(add_product(c, rest_x, x), rest_y, y)
            s = add_product(s, rest_x, y) - rest_y * x
    norm = sqrt(c * c + s * s)
    lost = norm == 0.0
    return select(lost, 1.0, c / norm), select(lost, 0.0, s / norm)


@kernel
def store_turned(out, row, x, y, c, s):
    """Write the vector (x, y) as seen in a frame whose x axis is (c, s)."""
    store(out, row, x * c + y * s)
    store(out, row + 1, y * c - x * s)


@kernel
def observe_group(q, v, out, rest, limb_length, n_limbs, stations, targets, velocity_scale):
    """Fill the observations of one lane group; arguments as in `observe`, borrowed, those of arrays of one group."""
    per_length, per_velocity = 1.0 / load(limb_length, 0), 1.0 / velocity_scale
    velocities = 2 * n_limbs * stations.n_stations
    c, s = body_axis(rest, q, stations, n_limbs)
    hub_x, hub_y = load(q, 0), load(q, 1)
    for limb in range(n_limbs):
        for station in range(stations.n_stations):
            row = 2 * (limb * stations.n_stations + station)
            x, y = at_station(q, stations, limb, station)
            store_turned(out, row, x * per_length, y * per_length, c, s)
            vx, vy = at_station(v, stations, limb, station)
            store_turned(out, velocities + row, vx * per_velocity, vy * per_velocity, c, s)
    row = 2 * velocities
    store_turned(out, row, load(v, 0) * per_velocity, load(v, 1) * per_velocity, c, s)
    for k in range(2):
        x, y = load(targets, 2 * k) - hub_x, load(targets, 2 * k + 1) - hub_y
        store_turned(out, row + 2 + 2 * k, x * per_length, y * per_length, c, s)


@entry_point
def observe(rest, limb_length, q, v, stations, targets, velocity_scale, out):
    """Fill the observations of lane groups.

    rest: Rest positions [m], shape (n_groups, 2 n_nodes, N_LANES), or (1, ..) for all groups; of all places with a
        body. limb_length: Unit of lengths [m], shape (n_groups, 1, N_LANES), likewise. q, v: [m], [m/s], as `rest`.
    stations: `Stations` of the robot. targets: Current and next waypoint in the world frame [m], shape
        (n_groups, 4, N_LANES).
    out: Observations, shape (n_groups, observation size, N_LANES).
    """
    places = borrow(stations)
    n_limbs = n_limbs_of(places.root_weights, places, rest.shape[1])
    for group in range(q.shape[0]):
        own_rest, own_length = borrow(rest[group % rest.shape[0]]), borrow(limb_length[group % limb_length.shape[0]])
        observe_group(
            borrow(q[group]), borrow(v[group]), borrow(out[group]), own_rest, own_length, n_limbs, places,
            borrow(targets[group]), velocity_scale,
        )  # fmt: skip


@entry_point
def body_axes(rest, q, stations, out):
    """Fill (cos, sin) of the headings of lane groups, shape (n_groups, 2, N_LANES); arguments as in `observe`."""
    places = borrow(stations)
    n_limbs = n_limbs_of(places.root_weights, places, rest.shape[1])
    for group in range(q.shape[0]):
        rows = borrow(out[group])
        c, s = body_axis(borrow(rest[group % rest.shape[0]]), borrow(q[group]), places, n_limbs)
        store(rows, 0, c)
        store(rows, 1, s)


def to_float32(rows: NDArray[np.float64], n_robots: int) -> NDArray[np.float32]:
    """Rows (n_groups, size, N_LANES) as a fresh float32 array of shape (n_robots, size)."""
    by_robot = rows[0].T if len(rows) == 1 else rows.transpose(0, 2, 1).reshape(-1, rows.shape[1])
    return by_robot[:n_robots].astype(np.float32, order="C")


def observed_rows(simulator: Simulator, targets: Floats) -> Floats:
    """Rows that the kernel fills, shape (n_groups, k, N_LANES), k = `Layout(n_limbs).size`.

    targets: Two points of every robot in the world frame [m], shape (n_robots, 4).
    """
    own, robot, target_rows = simulator.coefficients, simulator.scene.robot, to_rows(targets)
    out = np.empty((len(target_rows), _size(robot.n_limbs), target_rows.shape[2]))
    places = stations_of(robot)
    seen = own.rest, own.limb_length, simulator.q, simulator.v
    _known.call(places.root_weights is None, observe, *seen, places, target_rows, VELOCITY_SCALE, out)
    return out


_known = KnownCode()


def rows_on_device(simulator: Simulator, targets: Floats) -> Any:
    """`observed_rows` on the simulator's device, in its groups, shape (n_groups, k, 32) on another than "cpu"."""
    if simulator.device == "cpu":
        return observed_rows(simulator, targets)
    return simulator.filled_on_device(*observing(simulator.coefficients, simulator.scene.robot, targets))


def observing(own: Coefficients, robot: Seastar, targets: Floats) -> tuple[Any, dict[str, Any], int]:
    """The kernel of observations, its numbers but for the state, and the number of its rows, see `DeviceBatch.filled`.

    own: Of the robots. targets: As in `observed_rows`.
    """
    rest, length = (rows[0, :, 0] if own.are_shared else rows for rows in (own.rest, own.limb_length))
    numbers = {
        "rest": rest, "limb_length": length, "n_limbs": robot.n_limbs, "stations": stations_of(robot),
        "targets": to_rows(targets), "velocity_scale": VELOCITY_SCALE,
    }  # fmt: skip
    return observe_group, numbers, _size(robot.n_limbs)


@functools.cache
def _size(n_limbs: int) -> int:
    """Number of the rows that the kernel fills."""
    return Layout(n_limbs).size


def axes_of(simulator: Simulator) -> Floats:
    """Cosine and sine of every robot's heading, shape (2, n_robots): the same bits for one robot and for many."""
    out = np.empty((len(simulator.q), 2, simulator.q.shape[2]))
    body_axes(simulator.coefficients.rest, simulator.q, stations_of(simulator.scene.robot), out)
    return out.transpose(1, 0, 2).reshape(2, -1)[:, : simulator.n_robots]


def lengths_of(simulator: Simulator) -> Floats:
    """Lengths of every robot's limbs, the unit of its observations [m], shape (n_robots,)."""
    rows = simulator.coefficients.limb_length
    return np.broadcast_to(rows, (len(simulator.q), *rows.shape[1:])).reshape(-1)[: simulator.n_robots]


def pictures_of(simulator: Simulator, columns: NDArray[np.intp]) -> Floats:
    """Pictures of the robots, shape (n_robots, k), see delays.py. columns: Of a `Tracker`."""
    rows = observed_rows(simulator, np.zeros((simulator.n_robots, 4)))
    of_robots = rows.transpose(0, 2, 1).reshape(-1, rows.shape[1])[: simulator.n_robots]
    return np.concatenate([simulator.hub_position(), axes_of(simulator).T, of_robots[:, columns]], axis=1)
