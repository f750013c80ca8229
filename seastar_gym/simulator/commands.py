"""Checks of the commands of limbs."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.scene import Scene
from seastar_gym.scene.checks import as_floats, shown
from seastar_gym.scene.per_robot import column

Floats = NDArray[np.float64]


def checked_commands(commands: ArrayLike, scene: Scene, strengths: Floats, name: str = "commands") -> Floats:
    """Commands as an array of the shape of `strengths`, (n_robots, n_limbs). ValueError if one cannot be followed."""
    array = as_floats(name, commands)
    if array.shape != strengths.shape:
        raise ValueError(f"{name} must have shape (n_robots, n_limbs) = {strengths.shape}, not {array.shape}.")
    good = np.abs(array) <= 1.0
    if not good.all():
        robot, limb = np.argwhere(~good)[0]
        raise ValueError(
            f"{name} must be numbers in [-1, 1]; robot {robot} has {shown(array[robot, limb])} for limb {limb + 1}."
        )
    if scene.robot.hub_hinge == "turning":
        _check_turning_hub(strengths * array, scene)
    return array


def _check_turning_hub(shares: Floats, scene: Scene) -> None:
    """ValueError if limbs turned by these shares of the peak angle, shape (n_robots, n_limbs), close a hub hinge."""
    turn = column(scene.actuator.peak_angle) * (np.roll(shares, -1, axis=1) - shares)
    angle = np.array([limb.gap for limb in scene.robot.limb_shapes()]) + turn
    closed = np.minimum(angle, 2.0 * np.pi - angle) < 1e-9
    if closed.any():
        robot, limb = np.argwhere(closed)[0]
        raise ValueError(
            f'With hub_hinge="turning" the command of robot {robot} closes the hub hinge between limbs {limb + 1} '
            f'and {(limb + 1) % shares.shape[1] + 1}, where its curvature is infinite: use hub_hinge="opening".'
        )
