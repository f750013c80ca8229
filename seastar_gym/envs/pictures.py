"""What the kernels of `observation.py` see of the robots of a simulator, as rows of numbers."""

import functools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.layout import VELOCITY_SCALE, Layout
from seastar_gym.envs.observation import body_axes, observe, observe_group
from seastar_gym.envs.stations import stations_of
from seastar_gym.model.coefficients import Coefficients
from seastar_gym.scene import Seastar
from seastar_gym.simd.dispatch import KnownCode
from seastar_gym.simd.rows import to_rows
from seastar_gym.simulator import Simulator

Floats = NDArray[np.float64]


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
    """Pictures of the robots, shape (n_robots, k), see tracker.py. columns: Of a `Tracker`."""
    rows = observed_rows(simulator, np.zeros((simulator.n_robots, 4)))
    of_robots = rows.transpose(0, 2, 1).reshape(-1, rows.shape[1])[: simulator.n_robots]
    return np.concatenate([simulator.hub_position(), axes_of(simulator).T, of_robots[:, columns]], axis=1)
