"""Kernels on `Lanes` compute the numbers of float64 arithmetic for every robot, to the last bit; so does their twin."""

import sys
from fractions import Fraction
from types import SimpleNamespace
from typing import NamedTuple

import numba
import numpy as np
import pytest

from seastar_gym.lanes import plain as numpy_lanes
from seastar_gym.lanes import registers as lanes
from seastar_gym.lanes.compile import STRICT
from seastar_gym.lanes.pipeline import compiler_of
from seastar_gym.lanes.registers import N_LANES, NARROW, PLAIN, any_lane, borrow, load, load_number, splat, store

ONLY_COMPILED = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="numba alone looks at the types of arrays")
ROUNDS_TWICE = sys.version_info < (3, 13)  # the plain twin, before math.fma
SPECIAL = [0.0, -0.0, 1.0, -1.0, np.inf, -np.inf, np.nan, 5e-324, -2.2e-308, 1.8e308, 1e-160, 1e200, 1.0 + 2**-52]


compiled = numba.njit(**STRICT)


def rows_of(values) -> np.ndarray:
    """Numbers as rows of N_LANES, the last row filled up with ones."""
    flat = np.ravel(values)
    padded = np.ones((-(-len(flat) // N_LANES), N_LANES))
    padded.reshape(-1)[: len(flat)] = flat
    return padded


@pytest.fixture(scope="module")
def operands():
    """Three columns of numbers: every pair of special values with every third one, and random ones of all sizes."""
    special = np.array(np.meshgrid(SPECIAL, SPECIAL, SPECIAL)).reshape(3, -1)
    rng = np.random.default_rng(0)
    random = rng.standard_normal((3, 4000)) * 10.0 ** rng.integers(-30, 30, (3, 4000))
    a, b, c = np.concatenate([special, random], axis=1)
    return SimpleNamespace(a=rows_of(a), b=rows_of(b), c=rows_of(c))


def assert_same_bits(found, expected, line=""):
    """Equal numbers, equal signs of zero, NaN where NaN is expected."""
    np.testing.assert_array_equal(found, expected, err_msg=line)
    known = ~np.isnan(expected)
    np.testing.assert_array_equal(np.signbit(found)[known], np.signbit(expected)[known], err_msg=line)


ARITHMETIC = [
    "a + b", "a - b", "a * b", "a / b", "-a", "a + 0.1", "0.1 + a", "a - 3", "3 - a", "0.1 * a", "a * 3", "1.0 / a",
    "a / 3", "a * b + c", "a * b - a * c", "sqrt(a)", "absolute(a)", "select(a < b, a, b)", "select(a < b, 2, b)",
    "select(a < b, a, 2.0)",
]  # fmt: skip
COMPARISONS = [
    "a < b", "a <= b", "a > b", "a >= b", "a == b", "a < 1.0", "1.0 < a", "a <= 1.0", "1 <= a", "a > 1", "1.0 > a",
    "a >= 1.0", "1.0 >= a", "a == 0.0", "0 == a", "(a < b) & (a > 0.0)", "(a < b) | (a > 0.0)", "~(a < b)",
]  # fmt: skip


def by_numpy(line: str, operands) -> np.ndarray:
    with np.errstate(all="ignore"):
        return eval(line, {"sqrt": np.sqrt, "absolute": np.abs, "select": np.where}, vars(operands))


def kernel_of(twin: str, template: str, body: str, lines: list[str], form=PLAIN):
    """A function made of one line of `template` for every line: `store` its value in a row of its own."""
    line_of = f"        store(out, {len(lines)} * r + {{}}, {{}})\n".format
    stores = "".join(line_of(k, template.format(line)) for k, line in enumerate(lines))
    source = f"def function(a_rows, b_rows, c_rows, out_rows):\n{body}{stores}"
    namespace = dict(vars(numpy_lanes if twin == "plain" else lanes))
    exec(source, namespace)
    function, options = namespace["function"], {**STRICT, "pipeline_class": compiler_of(form)}
    return function if twin == "plain" else numba.njit(**options)(function)


LOOP = """\
    a_in, b_in, c_in, out = borrow(a_rows), borrow(b_rows), borrow(c_rows), borrow(out_rows)
    for r in range(a_rows.shape[0]):
        a, b, c = load(a_in, r), load(b_in, r), load(c_in, r)
"""


@pytest.fixture(params=["compiled", "plain"])
def twin(request):
    return request.param


@pytest.fixture
def run_all(twin):
    def run(template: str, lines: list[str], operands, body: str = LOOP) -> np.ndarray:
        """Values of every line for every row of operands, shape (n_lines, n_rows, N_LANES)."""
        out = np.full((len(lines) * len(operands.a), N_LANES), 0.5)
        kernel_of(twin, template, body, lines)(operands.a, operands.b, operands.c, out)
        return out.reshape(len(operands.a), len(lines), N_LANES).transpose(1, 0, 2)

    return run


# Arithmetic


def test_arithmetic_is_that_of_float64_to_the_last_bit_with_no_hidden_contraction(run_all, operands):
    found = run_all("{}", ARITHMETIC, operands)
    for value, line in zip(found, ARITHMETIC, strict=True):
        assert_same_bits(value, by_numpy(line, operands), line)


def exact_product_sum(c: float, a: float, b: float) -> float:
    """c + a b rounded once: a fraction has no rounding of its own, and its conversion rounds to nearest."""
    return float(Fraction(c) + Fraction(a) * Fraction(b))


def test_product_sums_are_rounded_once(run_all, twin):
    if ROUNDS_TWICE and (twin == "plain" or numba.config.DISABLE_JIT):
        pytest.skip("the plain twin rounds twice before Python 3.13")
    rng = np.random.default_rng(1)
    a, b = rng.standard_normal((2, 400 * N_LANES))
    c = -a * b * (1.0 + 2.0 ** -rng.integers(20, 60, a.size))  # cancels: the second rounding would show
    operands = SimpleNamespace(a=rows_of(a), b=rows_of(b), c=rows_of(c))
    lines = ["add_product(c, a, b)", "subtract_product(c, a, -b)", "add_product(0.5, a, b)"]
    lines += ["subtract_product(c, 3, b)"]
    found = run_all("{}", lines, operands).reshape(len(lines), -1)
    twice = c + a * b
    assert np.count_nonzero(found[0] != twice) > 300
    assert found[0].tolist() == [exact_product_sum(*x) for x in zip(c, a, b, strict=True)]
    assert found[1].tolist() == found[0].tolist()
    assert found[2].tolist() == [exact_product_sum(0.5, *x) for x in zip(a, b, strict=True)]
    assert found[3].tolist() == [exact_product_sum(x, -3.0, y) for x, y in zip(c, b, strict=True)]


def test_product_sums_keep_the_signs_of_zero_and_pass_nan_on(run_all, operands):
    plus, minus = run_all("{}", ["add_product(c, a, b)", "subtract_product(c, a, b)"], operands)
    # Where neither the product nor the sum is rounded, two operations give what one gives.
    exact = np.isin(operands.a, [0, 1, -1, np.inf, -np.inf, np.nan]) & np.isin(operands.c, SPECIAL)
    exact &= np.abs(operands.b) != 5e-324
    assert exact.sum() > 500
    a, b, c = operands.a[exact], operands.b[exact], operands.c[exact]
    with np.errstate(all="ignore"):
        assert_same_bits(plus[exact], c + a * b)
        assert_same_bits(minus[exact], c - a * b)


# Masks


def test_comparisons_and_masks_are_those_of_numpy_and_nan_compares_false(run_all, operands):
    found = run_all("select({}, 1.0, splat(0.0))", COMPARISONS, operands)
    for value, line in zip(found, COMPARISONS, strict=True):
        np.testing.assert_array_equal(value == 1.0, by_numpy(line, operands), err_msg=line)
        assert set(np.unique(value)) == {0.0, 1.0}


def test_any_looks_at_every_lane():
    @compiled
    def function(rows):
        condition = load(borrow(rows), 0) > 0.0
        return any_lane(condition), any_lane(~condition)

    for rows in (np.zeros((1, N_LANES)), *np.eye(N_LANES)[:, None]):
        assert function(rows) == (rows.any(), True)
        assert function(1.0 - rows) == (True, rows.any())


# Memory


class Bundle(NamedTuple):
    count: int
    flag: bool
    per_robot: np.ndarray
    shared: np.ndarray


def test_load_reads_per_robot_and_shared_rows_and_store_writes_lanes_or_one_number():
    @compiled
    def function(bundle, rows):
        fields, out = borrow(bundle), borrow(rows)
        store(out, 0, load(fields.per_robot, 1))
        store(out, 1, load(fields.shared, 2))
        store(out, 2, splat(load_number(fields.shared, 0)))
        store(out, 3, 7)
        if fields.flag:
            store(out, fields.count, 0.25)

    shared, out = np.array([1.5, 2.5, 3.5]), np.ones((6, N_LANES))
    per_robot = np.random.default_rng(0).random((2, N_LANES))
    function(Bundle(4, True, per_robot, shared), out)
    np.testing.assert_array_equal(out[0], per_robot[1])
    np.testing.assert_array_equal(out[1:].T, np.tile([3.5, 1.5, 7.0, 0.25, 1.0], (N_LANES, 1)))


@ONLY_COMPILED
def test_narrow_lanes_compute_for_the_first_robots_of_a_row_to_the_same_bits_and_touch_no_other(operands):
    wide, narrow = (np.full((len(ARITHMETIC) * len(operands.a), N_LANES), 0.5) for _ in range(2))
    for form, out in ((PLAIN, wide), (NARROW, narrow)):
        kernel_of("compiled", "{}", LOOP, ARITHMETIC, form)(operands.a, operands.b, operands.c, out)
    assert_same_bits(narrow[:, : NARROW.width], wide[:, : NARROW.width])
    np.testing.assert_array_equal(narrow[:, NARROW.width :], 0.5)
