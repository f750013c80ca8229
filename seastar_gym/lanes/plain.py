"""The plain twin of registers.py on numpy: kernels run on it as the Python that they are, slowly, step by step.

A kernel that Python calls does, to be called one by one, stepped through or counted, and with NUMBA_DISABLE_JIT=1 the
whole package:

    potential, c_speed, c_over_speed = drag_slopes(Lanes(0.3), Lanes(wx), Lanes(wy))

What kernels may ask of lanes is this and no more, and another processor would need no more either:

Lanes           one float64 per robot, a value: + - * / with lanes and plain numbers, -x, and += -= *= /=, which make a
                new value; < <= > >= == give a mask, in which NaN is false
Mask            one truth per robot: & | ~ with masks; neither `if` nor `and` can ask it
N_LANES         number of robots in a row (here values have any shape: that of the rows they come from, or none)
borrow          an array of rows, or a named tuple of such, of numbers and of None, as kernels read it
load            load(rows, row) -> Lanes: shape (rows, N_LANES), or (rows,) for numbers that all robots share
store           store(rows, row, lanes or number), in rows that are not shared
load_number     load_number(rows, row) -> float, from shared rows
store_number    store_number(rows, row, number), in shared rows
load_at         load_at(rows, lanes) -> Lanes: for every robot the number at its own row of shared rows
splat           splat(number) -> Lanes
select          select(mask or None, x, y) -> Lanes: x where the mask holds, y elsewhere; one of them may be a number
sqrt            sqrt(lanes) -> Lanes, correctly rounded
floor           floor(lanes) -> Lanes
absolute        absolute(lanes) -> Lanes
add_product     add_product(c, a, b) -> Lanes: c + a b, rounded once; two of the three may be numbers
subtract_product
                subtract_product(c, a, b) -> Lanes: c - a b, likewise
any_lane        any_lane(mask) -> bool

Results are those of the machine code to the last bit, but for products in sums: before Python 3.13, which brings
`math.fma`, they are rounded twice. Whatever lanes cannot do raises a TypeError, as it would not compile; rows that do
not exist raise an IndexError, where machine code would read what lies there.
"""

import math
import operator
import sys
from collections.abc import Callable
from typing import Any

import numpy as np

FUNCTIONS = (
    "borrow", "load", "store", "load_number", "store_number", "load_at", "splat", "select", "sqrt", "floor",
    "absolute", "add_product", "subtract_product", "any_lane",
)  # fmt: skip
"""Names of the functions of the interface."""


def _operand(x: Any) -> Any:
    """The numbers of lanes, or a plain number; NotImplemented for anything else."""
    if isinstance(x, Lanes):
        return x.numbers
    return x if isinstance(x, float | int | np.floating) and not isinstance(x, bool) else NotImplemented


def _operator(name: str, function: Callable) -> Any:
    """An operator on lanes and numbers, and its reflection."""

    def forth(self, other):
        b = _operand(other)
        return b if b is NotImplemented else self.made(name, function(self.numbers, b))

    def back(self, other):
        a = _operand(other)
        return a if a is NotImplemented else self.made(name, function(a, self.numbers))

    return forth, back


def _comparison(function: Callable) -> Any:
    def compare(self, other):
        b = _operand(other)
        return b if b is NotImplemented else Mask(function(self.numbers, b))

    return compare


class Lanes:
    """One float64 per robot, or one for all; numbers: an array, or a numpy number."""

    __slots__ = ("numbers",)
    __array_ufunc__ = None  # numpy's numbers leave operators to us

    def __init__(self, numbers: Any):
        self.numbers = numbers if isinstance(numbers, np.ndarray) else np.float64(numbers)

    def made(self, operation: str, numbers: Any) -> "Lanes":
        """The result of an operation on lanes, by name: add, multiply, divide, negate, fused, root, floor, absolute or
        select."""
        return Lanes(numbers)

    __add__, __radd__ = _operator("add", operator.add)
    __sub__, __rsub__ = _operator("add", operator.sub)
    __mul__, __rmul__ = _operator("multiply", operator.mul)
    __truediv__, __rtruediv__ = _operator("divide", operator.truediv)

    def __neg__(self) -> "Lanes":
        return self.made("negate", -self.numbers)

    __lt__ = _comparison(operator.lt)
    __le__ = _comparison(operator.le)
    __gt__ = _comparison(operator.gt)
    __ge__ = _comparison(operator.ge)
    __eq__ = _comparison(operator.eq)
    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"Lanes({self.numbers})"


def _logic(function: Callable) -> Any:
    def combine(self, other):
        return Mask(function(self.robots, other.robots)) if isinstance(other, Mask) else NotImplemented

    return combine


class Mask:
    """One truth per robot, or one for all; robots: an array of booleans, or a numpy boolean."""

    __slots__ = ("robots",)

    def __init__(self, robots: Any):
        self.robots = np.asarray(robots, bool)

    __and__ = _logic(operator.and_)
    __or__ = _logic(operator.or_)

    def __invert__(self) -> "Mask":
        return Mask(~self.robots)

    def __bool__(self) -> bool:
        raise TypeError("A mask holds for some robots and not for others: ask any_lane.")

    def __eq__(self, other: object) -> Any:
        raise TypeError("Masks are not compared: use & | ~.")

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"Mask({self.robots})"


def _lanes_among(*operands: Any) -> Lanes:
    """The first of the operands that is lanes; all have to be lanes or numbers."""
    for x in operands:
        if _operand(x) is NotImplemented:
            raise TypeError(f"Needs lanes or numbers, not {x!r}.")
    for x in operands:
        if isinstance(x, Lanes):
            return x
    raise TypeError(f"Needs lanes among {operands}.")


def _mask(condition: Any) -> Any:
    if not isinstance(condition, Mask):
        raise TypeError(f"Needs a mask, not {condition!r}.")
    return condition.robots


def borrow(bundle):
    return bundle


def _row(row):
    """The number of a row; compiled kernels would read before the first where numpy counts from the last."""
    if row < 0:
        raise IndexError(f"There is no row {row}.")
    return operator.index(row)


def load(rows, row):
    return Lanes(rows[_row(row)].copy())


def store(rows, row, value):
    numbers = _operand(value)
    if numbers is NotImplemented:
        raise TypeError(f"Needs lanes or a number to store, not {value!r}.")
    rows[_row(row)] = numbers


def load_number(rows, row):
    return float(rows[_row(row)])


def store_number(rows, row, value):
    rows[_row(row)] = float(value)


def load_at(rows, row):
    return Lanes(rows[row.numbers.astype(np.intp)])


def splat(value):
    if isinstance(value, Lanes) or _operand(value) is NotImplemented:
        raise TypeError(f"Needs a number, not {value!r}.")
    return Lanes(value)


def select(condition, when_true, when_false):
    one = _lanes_among(when_true, when_false)
    if condition is None:
        return one.made("select", _operand(when_false))
    return one.made("select", np.where(_mask(condition), _operand(when_true), _operand(when_false)))


def sqrt(x):
    return _lanes_among(x).made("root", np.sqrt(_operand(x)))


def floor(x):
    return _lanes_among(x).made("floor", np.floor(_operand(x)))


def absolute(x):
    return _lanes_among(x).made("absolute", np.abs(_operand(x)))


if sys.version_info >= (3, 13):

    def _rounded_once(a, b, c):
        try:
            return math.fma(a, b, c)
        except (OverflowError, ValueError):  # what IEEE calls infinite, or not a number
            return a * b + c

    _elementwise = np.frompyfunc(_rounded_once, 3, 1)

    def _fused(a, b, c):
        return np.asarray(_elementwise(a, b, c), dtype=float)

else:

    def _fused(a, b, c):
        return a * b + c


def add_product(c, a, b):
    return _lanes_among(c, a, b).made("fused", _fused(_operand(a), _operand(b), _operand(c)))


def subtract_product(c, a, b):
    return _lanes_among(c, a, b).made("fused", _fused(-_operand(a), _operand(b), _operand(c)))


def any_lane(condition):
    return bool(np.any(_mask(condition)))
