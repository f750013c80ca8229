"""`Lanes` that carry a derivative: a value and its slope in one direction for every robot, forward differentiation.

A kernel that is compiled on these lanes in place of plain ones computes what it always does, to the same bits,
and beside it the slopes of all that it computes. Every robot has a direction of its own. A row of memory that robots do
not share holds the numbers of N_LANES robots, and their slopes behind them; shared numbers have none. What robots do
is decided by values alone, so slopes are those of the branch that was taken. Where a slope does not exist it is zero,
as that of a root of zero is: kernels take roots of squared speeds, by which they multiply.

Beside the functions of registers.py there are `slope_of` and `with_slope`. The form is `DUAL` of gradients/tape.py.
"""

from llvmlite import ir
from numba.core import cgutils
from numba.core.datamodel import models

from seastar_gym.lanes.registers import (
    F64,
    N_LANES,
    PLAIN,
    Lanes,
    Numbers,
    function_of,
    negated,
    of_lanes,
    operation,
    registers,
)

ROW = 2 * N_LANES
"""Numbers in a row of memory that robots do not share."""
VECTOR = ir.VectorType(F64, N_LANES)
ZERO = ir.Constant(VECTOR, [0.0] * N_LANES)


def _sum(builder, a, b):
    """a + b of slopes, of which either may be None."""
    if a is None or b is None:
        return b if a is None else a
    return builder.fadd(a, b)


def _times(builder, slope, factor):
    return None if slope is None else builder.fmul(slope, factor)


def _minus(builder, slope):
    return None if slope is None else negated(builder, slope)


class Duals(Numbers):
    """Numbers are (value, slope), vectors; a slope of None is zero."""

    def model(self, manager, kind):
        return models.StructModel(manager, kind, [("value", Lanes(PLAIN)), ("slope", Lanes(PLAIN))])

    def opened(self, context, builder, kind, value):
        found = cgutils.create_struct_proxy(kind)(context, builder, value=value)
        return found.value, found.slope

    def closed(self, context, builder, kind, number):
        made = cgutils.create_struct_proxy(kind)(context, builder)
        made.value, made.slope = (ZERO if part is None else part for part in number)
        return made._getvalue()

    def plain(self, builder, value, width):
        return registers.plain(builder, value, width), None

    def value(self, number):
        return number[0]

    def add(self, builder, a, b):
        return builder.fadd(a[0], b[0]), _sum(builder, a[1], b[1])

    def subtract(self, builder, a, b):
        return builder.fsub(a[0], b[0]), _sum(builder, a[1], _minus(builder, b[1]))

    def multiply(self, builder, a, b):
        return builder.fmul(a[0], b[0]), _sum(builder, _times(builder, a[1], b[0]), _times(builder, b[1], a[0]))

    def divide(self, builder, a, b):
        quotient = builder.fdiv(a[0], b[0])
        rise = _sum(builder, a[1], _minus(builder, _times(builder, b[1], quotient)))
        return quotient, None if rise is None else builder.fdiv(rise, b[0])

    def negate(self, builder, x):
        return tuple(_minus(builder, part) for part in x)

    def sqrt(self, builder, x):
        root = function_of("sqrt", builder, x[0])
        rise = builder.fdiv(x[1], builder.fadd(root, root))
        return root, builder.select(builder.fcmp_ordered("==", root, ZERO), ZERO, rise)

    def absolute(self, builder, x):
        negative = builder.fcmp_ordered("<", x[0], ZERO)
        return function_of("fabs", builder, x[0]), builder.select(negative, _minus(builder, x[1]), x[1])

    def floor(self, builder, x):
        return function_of("floor", builder, x[0]), None

    def product_sum(self, builder, c, a, b, negate):
        if negate:
            a = self.negate(builder, a)
        value = function_of("fma", builder, a[0], b[0], c[0])
        rise = _sum(builder, _times(builder, a[1], b[0]), _times(builder, b[1], a[0]))
        return value, _sum(builder, c[1], rise)

    def chosen(self, builder, condition, when_true, when_false):
        return tuple(
            builder.select(condition, ZERO if a is None else a, ZERO if b is None else b)
            for a, b in zip(when_true, when_false, strict=True)
        )

    def pointers(self, builder, rows, row):
        """Pointers to the values and to the slopes of a row that robots do not share."""
        element = builder.gep(rows, [builder.mul(row, ir.Constant(row.type, ROW))])
        behind = builder.gep(element, [ir.Constant(row.type, N_LANES)])
        return [builder.bitcast(pointer, VECTOR.as_pointer()) for pointer in (element, behind)]

    def read(self, builder, rows, row, form):
        parts = []
        for pointer in self.pointers(builder, rows, row):
            part = builder.load(pointer)
            part.align = 8
            parts.append(part)
        return parts

    def write(self, builder, rows, row, number, form):
        for pointer, part in zip(self.pointers(builder, rows, row), number, strict=True):
            builder.store(ZERO if part is None else part, pointer).align = 8

    def gathered(self, builder, rows, value):
        return registers.gathered(builder, rows, value), None

    def slope_of(self, builder, x):
        return x[1], None

    def with_slope(self, builder, x, slope):
        return x[0], slope[0]


duals = Duals()


@operation
def slope_of(typing_context, x):
    """The slope of lanes, as lanes without one."""
    return of_lanes("slope_of", (x,), Duals)


@operation
def with_slope(typing_context, x, slope):
    """Lanes with the value of x and another slope: the value of `slope`."""
    return of_lanes("with_slope", (x, slope), Duals)
