"""Every operation of dual lanes: the values of lanes.py, and the slopes of calculus."""

import numba
import numpy as np
import pytest

from seastar_gym.simd.compilation import STRICT
from seastar_gym.simd.dual_lanes import (
    N_LANES,
    ROW,
    absolute,
    add_product,
    borrow,
    floor,
    load,
    load_at,
    select,
    slope_of,
    splat,
    sqrt,
    store,
    subtract_product,
    with_slope,
)

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="dual lanes have compiled code alone")

X, Y, DX, DY = 0.7, -1.3, 0.3, 0.2
TABLE = np.array([5.0, 6.0, 7.0])
EXPECTED = {
    "x + y": (X + Y, DX + DY),
    "2 - x": (2.0 - X, -DX),
    "x y": (X * Y, DX * Y + X * DY),
    "3 x": (3.0 * X, 3.0 * DX),
    "x / y": (X / Y, DX / Y - X * DY / Y**2),
    "1 / y": (1.0 / Y, -DY / Y**2),
    "-x": (-X, -DX),
    "sqrt x": (np.sqrt(X), 0.5 * DX / np.sqrt(X)),
    "|y|": (-Y, -DY),
    "floor y": (-2.0, 0.0),
    "x + y y": (X + Y * Y, DX + 2.0 * Y * DY),
    "x - 2 y": (X - 2.0 * Y, DX - 2.0 * DY),
    "select x > y": (X, DX),
    "select x < y": (4.0, 0.0),
    "shared": (6.0, 0.0),
    "at floor x + 2": (7.0, 0.0),
    "slope of x": (DX, 0.0),
    "x with y's slope": (X, Y),
    "a number": (8.0, 0.0),
    "root of zero": (0.0, 0.0),
}


@numba.njit(**STRICT)
def operations(arguments, table, results):
    rows, shared, out = borrow(arguments), borrow(table), borrow(results)
    x, y = load(rows, 0), load(rows, 1)
    store(out, 0, x + y)
    store(out, 1, 2.0 - x)
    store(out, 2, x * y)
    store(out, 3, 3.0 * x)
    store(out, 4, x / y)
    store(out, 5, 1.0 / y)
    store(out, 6, -x)
    store(out, 7, sqrt(x))
    store(out, 8, absolute(y))
    store(out, 9, floor(y))
    store(out, 10, add_product(x, y, y))
    store(out, 11, subtract_product(x, 2.0, y))
    store(out, 12, select(x > y, x, y))
    store(out, 13, select((x < y) | (y > 0.0), x, 4.0))
    store(out, 14, load(shared, 1))
    store(out, 15, load_at(shared, floor(x) + 2.0))
    store(out, 16, slope_of(x))
    store(out, 17, with_slope(x, y))
    store(out, 18, splat(8.0))
    store(out, 19, sqrt(x - x))


def test_operations_have_the_slopes_of_calculus():
    arguments, results = np.zeros((2, ROW)), np.full((len(EXPECTED), ROW), np.nan)
    arguments[:, :N_LANES] = [[X], [Y]]
    arguments[:, N_LANES:] = [[DX], [DY]]
    operations(arguments, TABLE, results)
    for found, (name, (value, slope)) in zip(results, EXPECTED.items(), strict=True):
        np.testing.assert_allclose(found[:N_LANES], value, rtol=1e-15, err_msg=name)
        np.testing.assert_allclose(found[N_LANES:], slope, rtol=1e-14, err_msg=name)
