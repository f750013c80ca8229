"""Stations: the places along the limbs where a robot is observed, the same ones whatever its nodes.

Station k of a limb lies at k/9 of its length, k = 1..9. Between nodes, the limb is the cubic spline through its nodes
and the hub, or its root on a body, in arc length and with not-a-knot ends; with fewer than four nodes it is the
polynomial through them. So the stations of a robot of ten nodes per limb are its nodes, and its observation converges
with the fourth power of the edge length.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.layout import N_STATIONS
from seastar_gym.scene import Seastar
from seastar_gym.simulator import Simulator
from seastar_gym.simulator.state import best_fit_heading, root_places

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
    degree, knots = min(3, n - 1), np.linspace(0.0, 1.0, n)[2:-2]
    knots = np.concatenate([np.zeros(degree + 1), knots, np.ones(degree + 1)])
    at_points, at_values = (b_splines(np.linspace(0.0, 1.0, k), knots, degree) for k in (n, m))
    return np.asarray(np.linalg.solve(at_points.T, at_values.T).T)


def b_splines(x: Floats, knots: Floats, degree: int) -> Floats:
    """Values of all B-splines at x, shape (len(x), len(knots) - degree - 1), by de Boor's recursion.

    As scipy.interpolate.BSpline.design_matrix, which takes half a second to import: every start would.
    """
    last = np.searchsorted(knots, knots[-1]) - 1
    interval = np.minimum(np.searchsorted(knots, x, "right") - 1, last)
    found = (np.arange(len(knots) - 1) == interval[:, None]).astype(np.float64)
    for k in range(1, degree + 1):
        rise, fall = knots[k:-1] - knots[: -k - 1], knots[k + 1 :] - knots[1:-k]
        none = np.zeros((len(x), len(rise)))
        up = np.divide(x[:, None] - knots[: -k - 1], rise, out=none.copy(), where=rise > 0.0)
        down = np.divide(knots[k + 1 :] - x[:, None], fall, out=none.copy(), where=fall > 0.0)
        found = up * found[:, :-1] + down * found[:, 1:]
    return found


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
    """Direction of the body frame's x axis [rad], shape (n_robots,), see `layout.py`.

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
