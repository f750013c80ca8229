"""Coefficients of a current, for the kernels in der/terms/current.py, and its velocities."""

import math
from functools import singledispatch

import numpy as np
from numpy.typing import NDArray

from seastar_gym.der.terms.current import GRID, LINEAR, VORTEX, Current, current_velocity
from seastar_gym.scene.currents import AnyCurrent, GridCurrent, ShearCurrent, UniformCurrent, Vortex
from seastar_gym.simd.numpy_lanes import Lanes


@singledispatch
def current_rows(current: AnyCurrent) -> Current:
    """Kind and numbers of a current for the kernels."""
    raise TypeError(f"No kernel knows the current {current!r}.")


@current_rows.register
def _(current: UniformCurrent) -> Current:
    return Current(LINEAR, np.array([current.u_x, current.u_y, 0.0, 0.0, 0.0, 0.0]))


@current_rows.register
def _(current: ShearCurrent) -> Current:
    c, s = math.cos(current.direction), math.sin(current.direction)
    gradient = current.rate * np.outer([c, s], [-s, c])
    return Current(LINEAR, np.concatenate([np.zeros(2), gradient.ravel()]))


@current_rows.register
def _(current: Vortex) -> Current:
    strength = current.circulation / (2.0 * math.pi)
    return Current(VORTEX, np.array([current.x, current.y, strength, current.core_radius**2]))


@current_rows.register
def _(current: GridCurrent) -> Current:
    array = np.array(current.velocities)
    n_x, n_y, _ = array.shape
    return Current(GRID, np.array([*current.corner, 1.0 / current.spacing]), n_x, n_y, array.reshape(-1))


def velocities_at(current: AnyCurrent, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Velocities of the fluid [m/s] at points [m], both of shape (..., 2), in a current of one robot."""
    x, y = (Lanes(points[..., axis]) for axis in (0, 1))
    found = np.empty(points.shape)
    for axis, velocity in enumerate(current_velocity(current_rows(current), x, y)):
        found[..., axis] = velocity.numbers
    return found
