"""`Lanes` that carry a derivative: a value and its slope in one direction for every robot, forward differentiation.

A kernel that is compiled on these lanes in place of those of lanes.py computes what it always does, to the same bits,
and beside it the slopes of all that it computes. Every robot has a direction of its own. A row of memory that robots do
not share holds the numbers of N_LANES robots, and their slopes behind them; shared numbers have none. What robots do
is decided by values alone, so slopes are those of the branch that was taken. Where a slope does not exist it is zero,
as that of a root of zero is: kernels take roots of squared speeds, by which they multiply.

Beside the functions of lanes.py there are `slope_of` and `with_slope`.
"""

import operator

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.datamodel import models
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, register_model

from seastar_gym.simd import lanes as plain
from seastar_gym.simd.lanes import I32, VECTOR, Rows, mask
from seastar_gym.simd.lanes import N_LANES as N_LANES
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


def _pair(context, builder, value, slope):
    """Lanes of a value and its slope; None: it has none."""
    made = cgutils.create_struct_proxy(lanes)(context, builder)
    made.value, made.slope = value, ZERO if slope is None else slope
    return made._getvalue()


def _parts(context, builder, numba_type, x):
    """(value, slope) of lanes, or of a plain number, whose slope is None."""
    if numba_type == lanes:
        found = cgutils.create_struct_proxy(lanes)(context, builder, value=x)
        return found.value, found.slope
    return plain._broadcast(builder, VECTOR, x), None


def _sum(builder, a, b):
    """a + b of slopes, of which either may be None."""
    if a is None or b is None:
        return b if a is None else a
    return builder.fadd(a, b)


def _times(builder, slope, factor):
    return None if slope is None else builder.fmul(slope, factor)


def _minus(builder, slope):
    return None if slope is None else builder.fsub(ir.Constant(VECTOR, [-0.0] * WIDTH), slope)


def _add(builder, a, b):
    return builder.fadd(a[0], b[0]), _sum(builder, a[1], b[1])


def _subtract(builder, a, b):
    return builder.fsub(a[0], b[0]), _sum(builder, a[1], _minus(builder, b[1]))


def _multiply(builder, a, b):
    return builder.fmul(a[0], b[0]), _sum(builder, _times(builder, a[1], b[0]), _times(builder, b[1], a[0]))


def _divide(builder, a, b):
    quotient = builder.fdiv(a[0], b[0])
    rise = _sum(builder, a[1], _minus(builder, _times(builder, b[1], quotient)))
    return quotient, None if rise is None else builder.fdiv(rise, b[0])


def _are_operands(args):
    return lanes in args and all(a == lanes or isinstance(a, types.Number) for a in args)


def _signature(result, args):
    if _are_operands(args):
        return signature(result, *(a if a == lanes else types.float64 for a in args))
    return None


def _define(op, result, build):
    """Teach numba `op` on two of dual lanes and numbers; `build(context, builder, a, b)` gets (value, slope) twice."""

    @infer_global(op)
    class Typing(AbstractTemplate):
        def generic(self, args, kws):
            return _signature(result, args) if len(args) == 2 else None

    def lower(context, builder, sig, args):
        return build(context, builder, *(_parts(context, builder, t, a) for t, a in zip(sig.args, args, strict=True)))

    for operands in ((Lanes, Lanes), (Lanes, types.float64), (types.float64, Lanes)):
        lower_builtin(op, *operands)(lower)


for _ops, _rule in (
    ((operator.add, operator.iadd), _add),
    ((operator.sub, operator.isub), _subtract),
    ((operator.mul, operator.imul), _multiply),
    ((operator.truediv, operator.itruediv), _divide),
):
    for _op in _ops:
        _define(_op, lanes, lambda context, builder, a, b, rule=_rule: _pair(context, builder, *rule(builder, a, b)))

for _op, _symbol in (
    (operator.lt, "<"),
    (operator.le, "<="),
    (operator.gt, ">"),
    (operator.ge, ">="),
    (operator.eq, "=="),
):
    _define(_op, mask, lambda context, builder, a, b, symbol=_symbol: builder.fcmp_ordered(symbol, a[0], b[0]))


@infer_global(operator.neg)
class _Negation(AbstractTemplate):
    def generic(self, args, kws):
        return signature(lanes, lanes) if args == (lanes,) else None


@lower_builtin(operator.neg, Lanes)
def _lower_negation(context, builder, sig, args):
    return _pair(context, builder, *(_minus(builder, part) for part in _parts(context, builder, lanes, args[0])))


def _pointers(builder, rows, row):
    """Pointers to the values and to the slopes of a row that robots do not share."""
    element = builder.gep(rows, [builder.mul(row, ir.Constant(row.type, ROW))])
    behind = builder.gep(element, [ir.Constant(row.type, N_LANES)])
    return [builder.bitcast(pointer, VECTOR.as_pointer()) for pointer in (element, behind)]


@intrinsic
def load(typing_context, rows, row):
    """Row `row`: one number per robot with its slope, or one number for all robots, without."""
    if not (isinstance(rows, Rows) and isinstance(row, types.Integer)):
        return None

    def codegen(context, builder, sig, args):
        if sig.args[0].shared:
            number = builder.load(builder.gep(args[0], [args[1]]))
            return _pair(context, builder, plain._broadcast(builder, VECTOR, number), None)
        parts = []
        for pointer in _pointers(builder, *args):
            part = builder.load(pointer)
            part.align = 8
            parts.append(part)
        return _pair(context, builder, *parts)

    return lanes(rows, types.intp), codegen


@intrinsic
def load_at(typing_context, rows, row):
    """From shared rows, for every robot the number at its own row (lanes, whole numbers), without a slope."""
    if not (isinstance(rows, Rows) and rows.shared and row == lanes):
        return None

    def codegen(context, builder, sig, args):
        result = ir.Constant(VECTOR, ir.Undefined)
        value, _ = _parts(context, builder, lanes, args[1])
        indices = builder.fptosi(value, ir.VectorType(ir.IntType(64), WIDTH))
        for k in range(WIDTH):
            index = builder.extract_element(indices, ir.Constant(I32, k))
            number = builder.load(builder.gep(args[0], [index]))
            result = builder.insert_element(result, number, ir.Constant(I32, k))
        return _pair(context, builder, result, None)

    return lanes(rows, lanes), codegen


@intrinsic
def store(typing_context, rows, row, value):
    """Write `value` (lanes, or one number for all robots, without a slope) to a row that robots do not share."""
    if not (isinstance(rows, Rows) and not rows.shared and isinstance(row, types.Integer)):
        return None
    if not (value == lanes or isinstance(value, types.Number)):
        return None

    def codegen(context, builder, sig, args):
        number, slope = _parts(context, builder, sig.args[2], args[2])
        pointers = _pointers(builder, args[0], args[1])
        for pointer, part in zip(pointers, (number, ZERO if slope is None else slope), strict=True):
            builder.store(part, pointer).align = 8
        return context.get_dummy_value()

    return types.void(rows, types.intp, lanes if value == lanes else types.float64), codegen


@intrinsic
def splat(typing_context, value):
    """One number for all robots, as lanes."""
    if not isinstance(value, types.Number):
        return None

    def codegen(context, builder, sig, args):
        return _pair(context, builder, plain._broadcast(builder, VECTOR, args[0]), None)

    return lanes(types.float64), codegen


@intrinsic
def select(typing_context, condition, when_true, when_false):
    """`when_true` for the robots in the mask `condition`, `when_false` for the others; no mask (None): no robot."""
    if condition not in (mask, types.none) or lanes not in (when_true, when_false):
        return None

    def codegen(context, builder, sig, args):
        true, false = (_parts(context, builder, t, a) for t, a in zip(sig.args[1:], args[1:], strict=True))
        if condition == types.none:
            return _pair(context, builder, *false)
        chosen = (
            builder.select(args[0], ZERO if a is None else a, ZERO if b is None else b)
            for a, b in zip(true, false, strict=True)
        )
        return _pair(context, builder, *chosen)

    choices = (lanes if a == lanes else types.float64 for a in (when_true, when_false))
    return lanes(condition, *choices), codegen


def _one_argument(rule):
    """An intrinsic of one argument; `rule(builder, value, slope)` gives the value and the slope of the result."""

    def typed(typing_context, x):
        if x != lanes:
            return None

        def codegen(context, builder, sig, args):
            return _pair(context, builder, *rule(builder, *_parts(context, builder, lanes, args[0])))

        return lanes(lanes), codegen

    return typed


def _root(builder, value, slope):
    root = plain._vector_function("sqrt", 1)(builder, [value])
    rise = builder.fdiv(slope, builder.fadd(root, root))
    return root, builder.select(builder.fcmp_ordered("==", root, ZERO), ZERO, rise)


def _magnitude(builder, value, slope):
    negative = builder.fcmp_ordered("<", value, ZERO)
    return plain._vector_function("fabs", 1)(builder, [value]), builder.select(negative, _minus(builder, slope), slope)


def _whole(builder, value, slope):
    return plain._vector_function("floor", 1)(builder, [value]), None


@intrinsic
def sqrt(typing_context, x):
    """Square root; at zero its slope is zero."""
    return _one_argument(_root)(typing_context, x)


@intrinsic
def absolute(typing_context, x):
    """|x|."""
    return _one_argument(_magnitude)(typing_context, x)


@intrinsic
def floor(typing_context, x):
    """Largest whole number not above x, without a slope."""
    return _one_argument(_whole)(typing_context, x)


def _product_sum(typing_args, negate):
    sig = _signature(lanes, typing_args)
    if sig is None:
        return None

    def codegen(context, builder, sig, args):
        c, a, b = (_parts(context, builder, t, x) for t, x in zip(sig.args, args, strict=True))
        if negate:
            a = tuple(_minus(builder, part) for part in a)
        value = plain._vector_function("fma", 3)(builder, [a[0], b[0], c[0]])
        rise = _sum(builder, _times(builder, a[1], b[0]), _times(builder, b[1], a[0]))
        return _pair(context, builder, value, _sum(builder, c[1], rise))

    return sig, codegen


@intrinsic
def add_product(typing_context, c, a, b):
    """c + a b, whose value is rounded once."""
    return _product_sum((c, a, b), negate=False)


@intrinsic
def subtract_product(typing_context, c, a, b):
    """c - a b, whose value is rounded once."""
    return _product_sum((c, a, b), negate=True)


@intrinsic
def slope_of(typing_context, x):
    """The slope of lanes, as lanes without one."""
    if x != lanes:
        return None

    def codegen(context, builder, sig, args):
        return _pair(context, builder, _parts(context, builder, lanes, args[0])[1], None)

    return lanes(lanes), codegen


@intrinsic
def with_slope(typing_context, x, slope):
    """Lanes with the value of x and another slope: the value of `slope`."""
    if (x, slope) != (lanes, lanes):
        return None

    def codegen(context, builder, sig, args):
        value, rise = (_parts(context, builder, lanes, a)[0] for a in args)
        return _pair(context, builder, value, rise)

    return lanes(lanes, lanes), codegen
