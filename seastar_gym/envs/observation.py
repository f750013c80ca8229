"""Observation of a robot: positions and velocities of its stations, velocity of the hub and waypoints, in a body frame.

A limb has nine stations, evenly spaced from hub to tip, whatever its nodes, see stations.py: observations, and policies
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
waypoints, which are always the last four numbers; an environment may leave the memory out. `Layout` names all these
places.

If headings are asked for (`headings.py`), four numbers more stand before the waypoints, after the memory: cosine and
sine of the turn to the heading at the current waypoint, and of that to the heading at the next.
"""

from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.stations import N_STATIONS
from seastar_gym.scene import Scene
from seastar_gym.scene.actuators.actuator import complete
from seastar_gym.scene.checks import require_count, require_flag, require_limbs
from seastar_gym.simd.compilation import entry_point, kernel
from seastar_gym.simd.lanes import add_product, borrow, load, load_number, select, splat, sqrt, store

OBSERVATION_LAYOUT = 2
"""Version of this table, which saved policies name. A change of order, unit or frame gives it another number."""
VELOCITY_SCALE = 0.025
"""Unit of velocities [m/s]: nodes and hub move at 12 to 24 mm/s root mean square after strokes of random commands."""

MOST_REMEMBERED = 1_000_000
"""Most numbers that the actuators of a robot may remember."""


class Layout(NamedTuple):
    """Places in an observation, as slices of its last axis; the table of this module tells their meaning."""

    positions: slice
    velocities: slice
    hub_velocity: slice
    actuators: slice
    headings: slice
    current_waypoint: slice
    next_waypoint: slice

    @property
    def stations_and_hub(self) -> slice:
        """Place of the positions, the velocities and the hub's velocity."""
        return slice(0, self.hub_velocity.stop)

    @property
    def waypoints(self) -> slice:
        """Place of the current waypoint and the next."""
        return slice(self.current_waypoint.start, self.next_waypoint.stop)

    @property
    def size(self) -> int:
        """Length of the observation."""
        return int(self.next_waypoint.stop)


def layout(n_limbs: int, n_remembered: int = 0, with_headings: bool = False) -> Layout:
    """Layout for a robot of n_limbs limbs whose actuators remember n_remembered numbers in all.

    with_headings: Whether headings are asked for.
    """
    require_limbs(n_limbs)
    require_count("n_remembered", n_remembered, 0, MOST_REMEMBERED)
    require_flag("with_headings", with_headings)
    return _layout(n_limbs, n_remembered, with_headings)


@cache
def _layout(n_limbs: int, n_remembered: int, with_headings: bool) -> Layout:
    along_limbs = 2 * N_STATIONS * n_limbs
    ends = np.cumsum([along_limbs, along_limbs, 2, n_remembered, 4 if with_headings else 0, 2, 2]).tolist()
    return Layout(*map(slice, [0, *ends[:-1]], ends))


def scene_layout(scene: Scene, observe_actuators: bool = True, with_headings: bool = False) -> Layout:
    """Layout for the robot of a scene, with the memory of its actuators or without, with asked headings or without."""
    actuator, n_limbs = complete(scene.actuator), scene.robot.n_limbs
    remembered = actuator.observe(actuator.rest).shape[-1] if observe_actuators else 0
    return layout(n_limbs, remembered * n_limbs, with_headings)


def observation_size(n_limbs: int) -> int:
    """Length of the observation of a robot of n_limbs limbs whose actuators remember nothing."""
    return layout(n_limbs).size


def with_more(observations: NDArray[Any], more: NDArray[Any], n_limbs: int) -> NDArray[Any]:
    """Observations, shape (n, size), with more numbers, shape (n, k), before the waypoints; unchanged if k = 0.

    more: Memory of actuators, then asked headings, as far as there are any.
    """
    if more.shape[1] == 0:
        return observations
    at = layout(n_limbs)
    parts = observations[:, at.stations_and_hub], more.astype(observations.dtype), observations[:, at.waypoints]
    return np.hstack(parts)


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


@entry_point
def observe(rest, limb_length, q, v, stations, targets, velocity_scale, out):
    """Fill the observations of lane groups.

    rest: Rest positions [m], shape (n_groups, 2 n_nodes, N_LANES), or (1, ..) for all groups; of all places with a
        body. limb_length: Unit of lengths [m], shape (n_groups, 1, N_LANES), likewise. q, v: [m], [m/s], as `rest`.
    stations: `Stations` of the robot. targets: Current and next waypoint in the world frame [m], shape
        (n_groups, 4, N_LANES).
    out: Observations, shape (n_groups, observation size, N_LANES).
    """
    places, per_velocity = borrow(stations), 1.0 / velocity_scale
    n_limbs = n_limbs_of(places.root_weights, places, rest.shape[1])
    velocities = 2 * n_limbs * stations.n_stations
    for group in range(q.shape[0]):
        rest_rows = borrow(rest[group % rest.shape[0]])
        per_length = 1.0 / load(borrow(limb_length[group % limb_length.shape[0]]), 0)
        position, velocity, target, rows = (
            borrow(q[group]),
            borrow(v[group]),
            borrow(targets[group]),
            borrow(out[group]),
        )
        c, s = body_axis(rest_rows, position, places, n_limbs)
        hub_x, hub_y = load(position, 0), load(position, 1)
        hub_vx, hub_vy = load(velocity, 0), load(velocity, 1)
        for limb in range(n_limbs):
            for station in range(stations.n_stations):
                row = 2 * (limb * stations.n_stations + station)
                x, y = at_station(position, places, limb, station)
                store_turned(rows, row, x * per_length, y * per_length, c, s)
                vx, vy = at_station(velocity, places, limb, station)
                store_turned(rows, velocities + row, vx * per_velocity, vy * per_velocity, c, s)
        row = 2 * velocities
        store_turned(rows, row, hub_vx * per_velocity, hub_vy * per_velocity, c, s)
        for k in range(2):
            x, y = load(target, 2 * k) - hub_x, load(target, 2 * k + 1) - hub_y
            store_turned(rows, row + 2 + 2 * k, x * per_length, y * per_length, c, s)


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
    return rows.transpose(0, 2, 1).reshape(-1, rows.shape[1])[:n_robots].astype(np.float32)
