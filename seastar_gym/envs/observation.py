"""Observations of robots, filled by kernels: what they see, in the order and the units of `layout.py`."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.layout import VELOCITY_SCALE, Layout
from seastar_gym.envs.stations import stations_of
from seastar_gym.lanes.compile import entry_point, kernel
from seastar_gym.lanes.dispatch import KnownCode
from seastar_gym.lanes.registers import add_product, borrow, load, load_number, select, splat, sqrt, store
from seastar_gym.lanes.rows import to_rows
from seastar_gym.model import Coefficients
from seastar_gym.scene import Seastar
from seastar_gym.simulator import Simulator

Floats = NDArray[np.float64]


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
