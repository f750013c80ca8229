"""`Lanes` that carry a derivative: a value and its slope in one direction for every robot, forward differentiation.

A kernel that is compiled on these lanes in place of those of lanes.py computes what it always does, to the same bits,
and beside it the slopes of all that it computes. Every robot has a direction of its own. A row of memory that robots do
not share holds the numbers of N_LANES robots, and their slopes behind them; shared numbers have none. What robots do
is decided by values alone, so slopes are those of the branch that was taken. Where a slope does not exist it is zero,
as that of a root of zero is: kernels take roots of squared speeds, by which they multiply.

Beside the functions of lanes.py there are `slope_of` and `with_slope`.
"""

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.datamodel import models
from numba.extending import intrinsic, register_model

from seastar_gym.simd import lanes as plain
from seastar_gym.simd.kind import Kind, function_of, negated
from seastar_gym.simd.lanes import N_LANES as N_LANES
from seastar_gym.simd.lanes import VECTOR, Rows, mask, registers
from seastar_gym.simd.lanes import WIDTH as WIDTH
from seastar_gym.simd.lanes import any_lane as any_lane
from seastar_gym.simd.lanes import borrow as borrow
from seastar_gym.simd.lanes import load_number as load_number
from seastar_gym.simd.lanes import store_number as store_number

ROW = 2 * N_LANES
"""Numbers in a row of memory that robots do not share."""
ZERO = ir.Constant(VECTOR, [0.0] * WIDTH)


class Lanes(types.Type):
    def __init__(self):
        super().__init__(name=f"DualLanes({WIDTH} of {N_LANES})")


lanes = Lanes()


@register_model(Lanes)
class _LanesModel(models.StructModel):
    def __init__(self, dmm, fe_type):
        super().__init__(dmm, fe_type, [("value", plain.lanes), ("slope", plain.lanes)])


def _sum(builder, a, b):
    """a + b of slopes, of which either may be None."""
    if a is None or b is None:
        return b if a is None else a
    return builder.fadd(a, b)


def _times(builder, slope, factor):
    return None if slope is None else builder.fmul(slope, factor)


def _minus(builder, slope):
    return None if slope is None else negated(builder, slope)


class Duals(Kind):
    """Numbers are (value, slope), vectors; a slope of None is zero."""

    def opened(self, context, builder, value):
        found = cgutils.create_struct_proxy(lanes)(context, builder, value=value)
        return found.value, found.slope

    def closed(self, context, builder, number):
        made = cgutils.create_struct_proxy(lanes)(context, builder)
        made.value, made.slope = (ZERO if part is None else part for part in number)
        return made._getvalue()

    def plain(self, builder, value):
        return registers.plain(builder, value), None

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

    def minus(self, builder, x):
        return tuple(_minus(builder, part) for part in x)

    def root(self, builder, x):
        root = function_of("sqrt", builder, x[0])
        rise = builder.fdiv(x[1], builder.fadd(root, root))
        return root, builder.select(builder.fcmp_ordered("==", root, ZERO), ZERO, rise)

    def magnitude(self, builder, x):
        negative = builder.fcmp_ordered("<", x[0], ZERO)
        return function_of("fabs", builder, x[0]), builder.select(negative, _minus(builder, x[1]), x[1])

    def whole(self, builder, x):
        return function_of("floor", builder, x[0]), None

    def product_sum(self, builder, c, a, b, negate):
        if negate:
            a = self.minus(builder, a)
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

    def read(self, builder, rows, row):
        parts = []
        for pointer in self.pointers(builder, rows, row):
            part = builder.load(pointer)
            part.align = 8
            parts.append(part)
        return parts

    def write(self, builder, rows, row, number):
        for pointer, part in zip(self.pointers(builder, rows, row), number, strict=True):
            builder.store(ZERO if part is None else part, pointer).align = 8

    def gathered(self, builder, rows, value):
        return registers.gathered(builder, rows, value), None


duals = Duals(lanes, mask, Rows)
load, load_at, store = intrinsic(duals.load), intrinsic(duals.load_at), intrinsic(duals.store)
splat, select = intrinsic(duals.splat), intrinsic(duals.select)
sqrt, absolute, floor = intrinsic(duals.sqrt), intrinsic(duals.absolute), intrinsic(duals.floor)
add_product, subtract_product = intrinsic(duals.add_product), intrinsic(duals.subtract_product)


@intrinsic
def slope_of(typing_context, x):
    """The slope of lanes, as lanes without one."""
    return duals.function((x,), lambda builder, number: (number[1], None))


@intrinsic
def with_slope(typing_context, x, slope):
    """Lanes with the value of x and another slope: the value of `slope`."""
    return duals.function((x, slope), lambda builder, number, other: (number[0], other[0]))
