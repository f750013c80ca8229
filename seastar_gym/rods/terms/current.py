"""Currents: the velocity u of the fluid at a place, for the relative velocity w = v - u of (13.8).

A current does not change with time.
"""

from typing import NamedTuple

import numpy as np

from seastar_gym.lanes.compile import kernel
from seastar_gym.lanes.registers import add_product, floor, load, load_at, select, subtract_product

LINEAR, VORTEX, GRID = range(3)


class Current(NamedTuple):
    """A current of some kind; one type for all kinds, so that one machine code serves them.

    kind: LINEAR, VORTEX or GRID.
    numbers: For a linear current u_x, u_y at the origin [m/s], then their gradient u_x,x u_x,y u_y,x u_y,y [1/s]. For
        a vortex x and y of the centre [m], circulation/(2 pi) [m^2/s], core radius squared [m^2]. For a grid x and y of
        its first point [m], one over its spacing [1/m].
    n_x, n_y: Numbers of points of a grid.
    velocities: u_x, u_y [m/s] at the points of a grid, y running fastest.
    """

    kind: int
    numbers: np.ndarray
    n_x: int = 0
    n_y: int = 0
    velocities: np.ndarray = np.zeros(0)


@kernel
def linear_velocity(numbers, x, y):
    """(u_x, u_y) of a uniform current or a shear [m/s]."""
    u_x = add_product(add_product(load(numbers, 0), load(numbers, 2), x), load(numbers, 3), y)
    u_y = add_product(add_product(load(numbers, 1), load(numbers, 4), x), load(numbers, 5), y)
    return u_x, u_y


@kernel
def vortex_velocity(numbers, x, y):
    """(u_x, u_y) of a vortex with a smooth core [m/s]."""
    dx, dy = x - load(numbers, 0), y - load(numbers, 1)
    turning = load(numbers, 2) / add_product(add_product(load(numbers, 3), dx, dx), dy, dy)
    return -dy * turning, dx * turning


@kernel
def cell(coordinate, n):
    """(index of the cell's first point, place in the cell from 0 to 1) of a coordinate in spacings, kept in the grid.

    A coordinate that is not a number goes to the first point.
    """
    inside = select(coordinate > 0.0, coordinate, 0.0)
    inside = select(inside < n - 1.0, inside, n - 1.0)
    first = floor(inside)
    first = select(first < n - 2.0, first, n - 2.0)
    return first, inside - first


@kernel
def grid_velocity(grid, x, y):
    """(u_x, u_y) between the points of a grid [m/s]."""
    i, a = cell((x - load(grid.numbers, 0)) * load(grid.numbers, 2), grid.n_x)
    j, b = cell((y - load(grid.numbers, 1)) * load(grid.numbers, 2), grid.n_y)
    row = 2.0 * add_product(j, i, float(grid.n_y))
    next_row = row + 2.0 * grid.n_y
    return (
        bilinear(grid.velocities, row, next_row, a, b),
        bilinear(grid.velocities, row + 1.0, next_row + 1.0, a, b),
    )


@kernel
def bilinear(values, row, next_row, a, b):
    """Bilinear interpolation in a cell: rows `row` and the next one (in y), and `next_row` (in x) and the next one."""
    before = mix(load_at(values, row), load_at(values, row + 2.0), b)
    after = mix(load_at(values, next_row), load_at(values, next_row + 2.0), b)
    return mix(before, after, a)


@kernel
def mix(first, second, share):
    """Number at a share of the way from the first to the second."""
    return add_product(subtract_product(first, share, first), share, second)


@kernel
def current_velocity(current, x, y):
    """(u_x, u_y) [m/s] at (x, y) [m]."""
    if current.kind == LINEAR:
        return linear_velocity(current.numbers, x, y)
    if current.kind == VORTEX:
        return vortex_velocity(current.numbers, x, y)
    return grid_velocity(current, x, y)
