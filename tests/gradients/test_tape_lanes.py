"""Every operation of the lanes of a tape: the values of lanes.py, and the partial derivatives of calculus."""

import numba
import numpy as np
import pytest

from seastar_gym.gradients.implicit import correct_slopes
from seastar_gym.gradients.kernels import DualKernels
from seastar_gym.gradients.replay import TapeKernels, replay_step
from seastar_gym.simd import dual_lanes, tape_lanes
from seastar_gym.simd.compilation import STRICT, Kernel
from seastar_gym.simd.tape_lanes import (
    ENTRY,
    ROW,
    absolute,
    add_product,
    any_lane,
    begin_tape,
    borrow,
    constant,
    end_of_tape,
    floor,
    less_step,
    load,
    load_at,
    pause_tape,
    resume_tape,
    select,
    splat,
    sqrt,
    store,
    subtract_product,
    tape_is_full,
)

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="lanes of a tape have compiled code alone")

X, Y, Z = 0.7, -1.3, 0.4
TABLE = np.array([5.0, 6.0, 7.0])
EXPECTED = {
    "x + y": (X + Y, 1.0, 1.0, 0.0),
    "2 - x": (2.0 - X, -1.0, 0.0, 0.0),
    "x y": (X * Y, Y, X, 0.0),
    "3 x": (3.0 * X, 3.0, 0.0, 0.0),
    "x / y": (X / Y, 1.0 / Y, -X / Y**2, 0.0),
    "1 / y": (1.0 / Y, 0.0, -1.0 / Y**2, 0.0),
    "-x": (-X, -1.0, 0.0, 0.0),
    "sqrt x": (np.sqrt(X), 0.5 / np.sqrt(X), 0.0, 0.0),
    "|y|": (-Y, 0.0, -1.0, 0.0),
    "floor y": (-2.0, 0.0, 0.0, 0.0),
    "z + x y": (Z + X * Y, Y, X, 1.0),
    "x - 2 y": (X - 2.0 * Y, 1.0, -2.0, 0.0),
    "z - y y": (Z - Y * Y, 0.0, -2.0 * Y, 1.0),
    "select x > y": (X, 1.0, 0.0, 0.0),
    "select x < y": (4.0, 0.0, 0.0, 0.0),
    "shared": (6.0, 0.0, 0.0, 0.0),
    "at floor x + 2": (7.0, 0.0, 0.0, 0.0),
    "x as a constant": (X, 0.0, 0.0, 0.0),
    "x less a step of y": (X, 0.0, -1.0, 0.0),
    "a number": (8.0, 0.0, 0.0, 0.0),
    "root of zero": (0.0, 0.0, 0.0, 0.0),
    "while paused": (X * Y, 0.0, 0.0, 0.0),
    "a product of products": (X * Y * X * Y, 2.0 * X * Y**2, 2.0 * X**2 * Y, 0.0),
    "any": (1.0, 0.0, 0.0, 0.0),
}


@numba.njit(**STRICT)
def operations(arguments, table, results, entries):
    rows, shared, out = borrow(arguments), borrow(table), borrow(results)
    begin_tape(entries, 4)
    x, y, z = load(rows, 1), load(rows, 2), load(rows, 3)
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
    store(out, 10, add_product(z, x, y))
    store(out, 11, subtract_product(x, 2.0, y))
    store(out, 12, subtract_product(z, y, y))
    store(out, 13, select(x > y, x, y))
    store(out, 14, select((x < y) | ~(y < 0.0), x, 4.0))
    store(out, 15, load(shared, 1))
    store(out, 16, load_at(shared, floor(x) + 2.0))
    store(out, 17, constant(x))
    store(out, 18, less_step(x, y))
    store(out, 19, splat(8.0))
    store(out, 20, sqrt(constant(x) - constant(x)))
    pause_tape()
    store(out, 21, load(rows, 1) * load(rows, 2))
    resume_tape()
    product = x * y
    store(out, 22, product * product)
    store(out, 23, 1.0 if any_lane((x > 0.0) & (y < 0.0)) else 0.0)
    return end_of_tape(), tape_is_full()


def swept(entries, place, end):
    """Derivatives of what stands at a place in the three arguments."""
    slopes, parents = np.zeros(end), entries.view(np.int32)
    slopes[place] = 1.0
    for k in range(end - 1, 3, -1):
        slopes[parents[k, 0]] += entries[k, 1] * slopes[k]
        slopes[parents[k, 1]] += entries[k, 2] * slopes[k]
    return slopes[1:4]


def arguments():
    rows = np.zeros((4, ROW))
    rows[1:, 0] = [X, Y, Z]
    rows.view(np.int64)[1:, 1] = [1, 2, 3]
    return rows


def test_operations_have_the_derivatives_of_calculus():
    entries, results = np.zeros((100, ENTRY)), np.full((len(EXPECTED), ROW), np.nan)
    end, full = operations(arguments(), TABLE, results, entries)
    assert full == 0
    for found, place, (name, (value, *slopes)) in zip(
        results[:, 0], results.view(np.int64)[:, 1], EXPECTED.items(), strict=True
    ):
        np.testing.assert_allclose(found, value, rtol=1e-15, err_msg=name)
        expected = np.zeros(3) if place == 0 else swept(entries, place, end)
        np.testing.assert_allclose(expected, slopes, rtol=1e-14, err_msg=name)


def test_a_tape_that_is_too_short_says_so():
    results = np.zeros((len(EXPECTED), ROW))
    end, full = operations(arguments(), TABLE, results, np.zeros((10, ENTRY)))
    assert (end, full != 0) == (10, True)


@pytest.mark.parametrize(
    ("kind", "lanes", "outside"),
    [(TapeKernels, tape_lanes, replay_step), (DualKernels, dual_lanes, correct_slopes)],
)
def test_kernels_call_kernels_on_their_own_lanes_alone(kind, lanes, outside):
    """Others would write to rows of another width, into memory that is not theirs."""
    kernels = kind()
    kernels(outside)
    values = [value for module in kernels._modules.values() for value in vars(module).values()]
    called = [value.py_func for value in values if isinstance(value, Kernel)]
    wrong = [each.__qualname__ for each in called if each.__globals__.get("load", lanes.load) is not lanes.load]
    assert len(called) > 100
    assert not wrong
