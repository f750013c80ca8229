"""Every operation of the lanes that are differentiated: the values of registers.py, and the derivatives of calculus."""

from functools import cache

import numba
import numpy as np
import pytest

from seastar_gym.gradients.tape import DUAL, TAPED
from seastar_gym.lanes import dual as dual_lanes
from seastar_gym.lanes import registers as lanes
from seastar_gym.lanes import tape as tape_lanes
from seastar_gym.lanes.compile import STRICT
from seastar_gym.lanes.pipeline import compiler_of
from seastar_gym.lanes.registers import N_LANES

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="these lanes have compiled code alone")

X, Y, Z = POINT = 0.7, -1.3, 0.4
DIRECTION = 0.3, 0.2, -0.6
TABLE = np.array([5.0, 6.0, 7.0])
BEYOND = 4
"""Rows of arguments, of which the first holds nothing; places behind them are those of the tape."""
EXPECTED = {
    "x + y": (X + Y, 1.0, 1.0, 0.0),
    "2.0 - x": (2.0 - X, -1.0, 0.0, 0.0),
    "x * y": (X * Y, Y, X, 0.0),
    "3.0 * x": (3.0 * X, 3.0, 0.0, 0.0),
    "x / y": (X / Y, 1.0 / Y, -X / Y**2, 0.0),
    "1.0 / y": (1.0 / Y, 0.0, -1.0 / Y**2, 0.0),
    "-x": (-X, -1.0, 0.0, 0.0),
    "sqrt(x)": (np.sqrt(X), 0.5 / np.sqrt(X), 0.0, 0.0),
    "absolute(y)": (-Y, 0.0, -1.0, 0.0),
    "floor(y)": (-2.0, 0.0, 0.0, 0.0),
    "add_product(z, x, y)": (Z + X * Y, Y, X, 1.0),
    "add_product(x, y, y)": (X + Y * Y, 1.0, 2.0 * Y, 0.0),
    "subtract_product(x, 2.0, y)": (X - 2.0 * Y, 1.0, -2.0, 0.0),
    "subtract_product(z, y, y)": (Z - Y * Y, 0.0, -2.0 * Y, 1.0),
    "select(x > y, x, y)": (X, 1.0, 0.0, 0.0),
    "select((x < y) | (y > 0.0), x, 4.0)": (4.0, 0.0, 0.0, 0.0),
    "select((x < y) | ~(y < 0.0), x, 4.0)": (4.0, 0.0, 0.0, 0.0),
    "load(shared, 1)": (6.0, 0.0, 0.0, 0.0),
    "load_at(shared, floor(x) + 2.0)": (7.0, 0.0, 0.0, 0.0),
    "splat(8.0)": (8.0, 0.0, 0.0, 0.0),
    "sqrt(x - x)": (0.0, 0.0, 0.0, 0.0),
    "(x * y) * (x * y)": (X * Y * X * Y, 2.0 * X * Y**2, 2.0 * X**2 * Y, 0.0),
    "1.0 if any_lane((x > 0.0) & (y < 0.0)) else 0.0": (1.0, 0.0, 0.0, 0.0),
}
OF_DUALS = {"slope_of(x)": (DIRECTION[0], 0.0), "with_slope(x, y)": (X, Y)}
OF_TAPES = {
    "at_place(x, 2)": (X, 0.0, 1.0, 0.0),
}


@cache
def compiled(form, lines, before="", behind=""):
    """function(arguments, table, results, entries) that stores every line in a row of its own."""
    stores = "".join(f"    store(out, {k}, {line})\n" for k, line in enumerate(lines))
    source = f"""\
def function(arguments, table, results, entries):
    rows, shared, out = borrow(arguments), borrow(table), borrow(results)
{before}    x, y, z = load(rows, 1), load(rows, 2), load(rows, 3)
{stores}{behind}"""
    namespace = {**vars(lanes), **vars(dual_lanes), **vars(tape_lanes)}
    exec(source, namespace)
    return numba.njit(**{**STRICT, "pipeline_class": compiler_of(form)})(namespace["function"])


def test_duals_have_the_slopes_of_calculus():
    expected = {line: (value, np.dot(slopes, DIRECTION)) for line, (value, *slopes) in EXPECTED.items()} | OF_DUALS
    n, row = N_LANES, dual_lanes.ROW
    arguments, results = np.zeros((BEYOND, row)), np.full((len(expected), row), np.nan)
    arguments[1:, :n], arguments[1:, n:] = np.transpose([POINT]), np.transpose([DIRECTION])
    compiled(DUAL, tuple(expected))(arguments, TABLE, results, None)
    for found, (line, (value, slope)) in zip(results, expected.items(), strict=True):
        np.testing.assert_allclose(found[:n], value, rtol=1e-15, err_msg=line)
        np.testing.assert_allclose(found[n:], slope, rtol=1e-14, err_msg=line)


def on_tape(lines, capacity=100, x=(X,), seed=1.0):
    """Lines on a tape of a given length: (values, derivatives in the arguments, end, whether it is full).

    x: Of the robots, in turn. seed: Factor of the arguments.
    """
    n, entries = N_LANES, np.zeros((capacity, tape_lanes.ENTRY))
    arguments, results = np.zeros((BEYOND, tape_lanes.ROW)), np.full((len(lines), tape_lanes.ROW), np.nan)
    arguments[1:, :n], arguments[1:, n : 2 * n] = np.transpose([POINT]), seed
    arguments[1, :n] = np.resize(x, n)
    arguments.view(np.int64)[1:, tape_lanes.PLACE] = range(1, BEYOND)
    behind = "    return end_of_tape(), tape_is_full()\n"
    function = compiled(TAPED, tuple(lines), f"    begin_tape(entries, {BEYOND})\n", behind)
    end, full = function(arguments, TABLE, results, entries.ravel())
    places, factors = results.view(np.int64)[:, tape_lanes.PLACE], results[:, n : 2 * n]
    swept_back = [swept(entries, *each, end) for each in zip(places, factors, strict=True)] if not full else None
    return results[:, :n], swept_back, end, full


def swept(entries, place, factors, end):
    """Derivatives of a number with a place and factors in the three arguments, of every robot; of none at place 0."""
    n, slopes, parents = len(factors), np.zeros((end, len(factors))), entries.view(np.int32)
    slopes[place] = factors if place else 0.0
    for k in range(end - 1, BEYOND - 1, -1):
        slopes[parents[k, 0]] += entries[k, 1 : 1 + n] * slopes[k]
        slopes[parents[k, 1]] += entries[k, 1 + n :] * slopes[k]
    return slopes[1:BEYOND]


def test_a_tape_has_the_derivatives_of_calculus_and_says_when_it_is_too_short():
    values, derivatives, _, full = on_tape(EXPECTED | OF_TAPES)
    assert full == 0
    for value, slopes, (line, (expected, *wanted)) in zip(
        values, derivatives, (EXPECTED | OF_TAPES).items(), strict=True
    ):
        np.testing.assert_allclose(value, expected, rtol=1e-15, err_msg=line)
        np.testing.assert_allclose(slopes, np.transpose([wanted]) * np.ones(len(value)), rtol=1e-14, err_msg=line)
    *_, end, full = on_tape(EXPECTED | OF_TAPES, 10)
    assert (end, full != 0) == (10, True)


def test_every_robot_has_the_derivatives_of_its_choice():
    choices = {
        "select(x > y, x, y)": (2.0, 0.0), "select(x > y, 3.0, x)": (0.0, 2.0),
        "select(x > y, 5.0 * x, x)": (2.0 * 5.0, 2.0), "select(x > y, x * z, y)": (2.0 * Z, 0.0),
    }  # fmt: skip
    _, derivatives, *_ = on_tape(choices, x=(Y + 1.0, Y - 1.0), seed=2.0)
    for slopes, (line, of_x) in zip(derivatives, choices.items(), strict=True):
        np.testing.assert_allclose(slopes[0], np.resize(of_x, len(slopes[0])), rtol=1e-14, err_msg=line)
