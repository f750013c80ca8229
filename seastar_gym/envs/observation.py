"""Observation of a robot: states of its nodes, velocity of the hub and waypoints, in a frame that turns with it.

The body frame has its origin at the hub. Its x axis is the direction of limb 1 of the rest shape, after the rotation
that fits the rest shape best to the nodes (least squares over all nodes). Every number is of order one; lengths are in
units of the robot's own limb length:

index                 meaning                                           unit
0 .. 2m-1             node positions relative to the hub, x and y       limb lengths
2m .. 4m-1            node velocities relative to the hub, x and y      VELOCITY_SCALE
4m, 4m+1              hub velocity, x and y                             VELOCITY_SCALE
4m+2, 4m+3            current waypoint relative to the hub, x and y     limb lengths
4m+4, 4m+5            next waypoint relative to the hub, x and y        limb lengths

with m = n_nodes - 1 nodes in the order {1,1}..{1,N-1}, {2,1}.. (m = 45 for the chapter's robot: 186 numbers). On the
last leg the next waypoint is the current one. Distances of waypoints are not clipped.

If actuators have a memory (a `StatefulActuator`), the numbers of its `observe` for limb 1, limb 2, .. stand before the
waypoints, which are always the last four numbers. `Layout` names all these places.
"""

from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene import Scene
from seastar_gym.scene.actuators.actuator import StatefulActuator
from seastar_gym.simd.compilation import entry_point, kernel
from seastar_gym.simd.lanes import add_product, borrow, load, select, splat, sqrt, store

OBSERVATION_LAYOUT = 1
"""Version of this table, which saved policies name. A change of order, unit or frame gives it another number."""
VELOCITY_SCALE = 0.025
"""Unit of velocities [m/s]: nodes and hub move at 12 to 24 mm/s root mean square after strokes of random commands."""


class Layout(NamedTuple):
    """Places in an observation, as slices of its last axis; the table of this module tells their meaning."""

    positions: slice
    velocities: slice
    hub_velocity: slice
    actuators: slice
    current_waypoint: slice
    next_waypoint: slice

    @property
    def nodes_and_hub(self) -> slice:
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


@cache
def layout(n_nodes: int, n_remembered: int = 0) -> Layout:
    """Layout for a robot of n_nodes nodes whose actuators remember n_remembered numbers in all."""
    nodes = 2 * (n_nodes - 1)
    ends = np.cumsum([nodes, nodes, 2, n_remembered, 2, 2]).tolist()
    return Layout(*map(slice, [0, *ends[:-1]], ends))


def layout_of_size(size: int) -> Layout:
    """Layout of an observation of `size` numbers, for actuators that remember nothing."""
    return layout((size - 6) // 4 + 1)


def scene_layout(scene: Scene) -> Layout:
    """Layout for the robot of a scene."""
    actuator, robot = scene.actuator, scene.robot
    remembered = actuator.observe(actuator.rest).shape[-1] if isinstance(actuator, StatefulActuator) else 0
    return layout(robot.n_nodes, remembered * robot.n_limbs)


def observation_size(n_nodes: int) -> int:
    """Length of the observation of a robot of n_nodes nodes whose actuators remember nothing."""
    return layout(n_nodes).size


def with_memory(observations: NDArray[Any], remembered: NDArray[Any]) -> NDArray[Any]:
    """Observations, shape (n, size), with the memory of actuators, shape (n, k), in its place; unchanged if k = 0."""
    if remembered.shape[1] == 0:
        return observations
    bare = layout_of_size(observations.shape[1])
    parts = observations[:, bare.nodes_and_hub], remembered.astype(observations.dtype), observations[:, bare.waypoints]
    return np.hstack(parts)


@kernel
def body_axis(rest, q, n_nodes):
    """(cos, sin) of the rotation that fits the rest shape best to the nodes around the hub; (1, 0) if none does."""
    c, s = splat(0.0), splat(0.0)
    hub_x, hub_y = load(q, 0), load(q, 1)
    for node in range(1, n_nodes):
        rest_x, rest_y = load(rest, 2 * node), load(rest, 2 * node + 1)
        x, y = load(q, 2 * node) - hub_x, load(q, 2 * node + 1) - hub_y
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
def observe(rest, limb_length, q, v, targets, velocity_scale, out):
    """Fill the observations of lane groups.

    rest: Rest positions [m], shape (n_groups, 2 n_nodes, N_LANES), or (1, ..) for all groups. limb_length: Unit of
        lengths [m], shape (n_groups, 1, N_LANES), likewise. q, v: [m], [m/s], shape (n_groups, 2 n_nodes, N_LANES).
    targets: Current and next waypoint in the world frame [m], shape (n_groups, 4, N_LANES).
    out: Observations, shape (n_groups, observation size, N_LANES).
    """
    n_nodes, per_velocity = rest.shape[1] // 2, 1.0 / velocity_scale
    for group in range(q.shape[0]):
        rest_rows = borrow(rest[group % rest.shape[0]])
        per_length = 1.0 / load(borrow(limb_length[group % limb_length.shape[0]]), 0)
        position, velocity, target, rows = (
            borrow(q[group]),
            borrow(v[group]),
            borrow(targets[group]),
            borrow(out[group]),
        )
        c, s = body_axis(rest_rows, position, n_nodes)
        hub_x, hub_y = load(position, 0), load(position, 1)
        hub_vx, hub_vy = load(velocity, 0), load(velocity, 1)
        velocities = 2 * (n_nodes - 1)
        for node in range(1, n_nodes):
            row = 2 * (node - 1)
            x, y = load(position, 2 * node) - hub_x, load(position, 2 * node + 1) - hub_y
            store_turned(rows, row, x * per_length, y * per_length, c, s)
            vx, vy = load(velocity, 2 * node) - hub_vx, load(velocity, 2 * node + 1) - hub_vy
            store_turned(rows, velocities + row, vx * per_velocity, vy * per_velocity, c, s)
        row = 2 * velocities
        store_turned(rows, row, hub_vx * per_velocity, hub_vy * per_velocity, c, s)
        for k in range(2):
            x, y = load(target, 2 * k) - hub_x, load(target, 2 * k + 1) - hub_y
            store_turned(rows, row + 2 + 2 * k, x * per_length, y * per_length, c, s)


def to_float32(rows: NDArray[np.float64], n_robots: int) -> NDArray[np.float32]:
    """Rows (n_groups, size, N_LANES) as a fresh float32 array of shape (n_robots, size)."""
    return rows.transpose(0, 2, 1).reshape(-1, rows.shape[1])[:n_robots].astype(np.float32)
