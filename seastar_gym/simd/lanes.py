"""`Lanes`: one float64 per robot in one SIMD register, for kernels that read like scalar code.

A kernel written on `Lanes` runs on `N_LANES` robots at once:

    @kernel
    def edge_length(q, tail, head):
        ex = load(q, 2 * head) - load(q, 2 * tail)
        ey = load(q, 2 * head + 1) - load(q, 2 * tail + 1)
        return sqrt(ex * ex + ey * ey)

Here `q` is borrowed (see `borrow`) from an array of shape (rows, N_LANES): row r holds the same number of every robot.
From an array of shape (rows,) `load` reads one number for all robots, so a coefficient may be shared or differ from
robot to robot without a change in the kernel.

Arithmetic is strict IEEE (no fastmath; a fused multiply-add only where `add_product` or `subtract_product` says
so), so a robot's bits depend neither on its lane nor on its neighbours. Comparisons give a `Mask`; `select` picks
by mask. Loads and stores are unaligned on purpose: numpy does not align to 64 bytes.

numpy_lanes.py lists all that kernels may ask of lanes, and does the same on numpy; with NUMBA_DISABLE_JIT=1 the names
here are those there.
"""

import operator
from collections.abc import Callable

from llvmlite import ir
from numba.core import cgutils, config, types
from numba.core.datamodel import models
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, register_model

from seastar_gym.simd import numpy_lanes
from seastar_gym.simd.width import N_LANES as N_LANES
from seastar_gym.simd.width import WIDTH as WIDTH

I1, I32, F64 = ir.IntType(1), ir.IntType(32), ir.DoubleType()
VECTOR = ir.VectorType(F64, WIDTH)
MASK = ir.VectorType(I1, WIDTH)


class Lanes(types.Type):
    def __init__(self):
        super().__init__(name=f"Lanes({WIDTH} of {N_LANES})")


class Mask(types.Type):
    def __init__(self):
        super().__init__(name=f"Mask({WIDTH} of {N_LANES})")


lanes = Lanes()
mask = Mask()


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, dmm, fe_type):
        super().__init__(dmm, fe_type, VECTOR)


@register_model(Mask)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, dmm, fe_type):
        super().__init__(dmm, fe_type, MASK)


def _broadcast(builder, vector_type, value):
    undefined = ir.Constant(vector_type, ir.Undefined)
    first = builder.insert_element(undefined, value, ir.Constant(I32, 0))
    return builder.shuffle_vector(first, undefined, ir.Constant(ir.VectorType(I32, WIDTH), [0] * WIDTH))


def _as_vector(builder, numba_type, value):
    return value if numba_type == lanes else _broadcast(builder, VECTOR, value)


def _lanes_signature(result, args):
    """`result(args)` with plain numbers taken as float64, or None where an argument is neither lanes nor number."""
    if lanes in args and all(a == lanes or isinstance(a, types.Number) for a in args):
        return signature(result, *(a if a == lanes else types.float64 for a in args))
    return None


def _define_binary(op: Callable, result: types.Type, build: Callable) -> None:
    """Teach numba `op` on lanes and numbers; `build(builder, a, b)` emits the instruction."""

    @infer_global(op)
    class Typing(AbstractTemplate):
        def generic(self, args, kws):
            return _lanes_signature(result, args) if len(args) == 2 else None

    def lower(context, builder, sig, args):
        return build(builder, *(_as_vector(builder, t, a) for t, a in zip(sig.args, args, strict=True)))

    for operands in ((Lanes, Lanes), (Lanes, types.float64), (types.float64, Lanes)):
        lower_builtin(op, *operands)(lower)


for _op, _instruction in (
    (operator.add, "fadd"),
    (operator.iadd, "fadd"),
    (operator.sub, "fsub"),
    (operator.isub, "fsub"),
    (operator.mul, "fmul"),
    (operator.imul, "fmul"),
    (operator.truediv, "fdiv"),
    (operator.itruediv, "fdiv"),
):
    _define_binary(_op, lanes, lambda builder, a, b, name=_instruction: getattr(builder, name)(a, b))

# Ordered comparisons: a NaN compares false with everything, so it never passes a test for being good.
for _op, _symbol in (
    (operator.lt, "<"),
    (operator.le, "<="),
    (operator.gt, ">"),
    (operator.ge, ">="),
    (operator.eq, "=="),
):
    _define_binary(_op, mask, lambda builder, a, b, symbol=_symbol: builder.fcmp_ordered(symbol, a, b))


@infer_global(operator.neg)
class _Negation(AbstractTemplate):
    def generic(self, args, kws):
        return signature(lanes, lanes) if args == (lanes,) else None


@lower_builtin(operator.neg, Lanes)
def _lower_negation(context, builder, sig, args):
    return builder.fsub(ir.Constant(VECTOR, [-0.0] * WIDTH), args[0])


def _define_mask_operator(op: Callable, n_args: int, build: Callable) -> None:
    @infer_global(op)
    class Typing(AbstractTemplate):
        def generic(self, args, kws):
            return signature(mask, *args) if args == (mask,) * n_args else None

    @lower_builtin(op, *(Mask,) * n_args)
    def lower(context, builder, sig, args):
        return build(builder, *args)


_define_mask_operator(operator.and_, 2, lambda builder, a, b: builder.and_(a, b))
_define_mask_operator(operator.or_, 2, lambda builder, a, b: builder.or_(a, b))
_define_mask_operator(operator.invert, 1, lambda builder, a: builder.not_(a))


class Rows(types.Type):
    """A borrowed pointer to the rows of an array: of N_LANES numbers each, or of one number shared by all robots.

    Numba counts references to arrays at every call, which costs more than a small kernel does; a pointer is free. The
    array must outlive it, as the arguments of an entry point do.
    """

    def __init__(self, shared):
        self.shared = shared
        super().__init__(name=f"Rows(shared={shared}, {WIDTH} of {N_LANES})")


@register_model(Rows)
class _RowsModel(models.PrimitiveModel):
    def __init__(self, dmm, fe_type):
        super().__init__(dmm, fe_type, F64.as_pointer())


class Absent(types.misc.Omitted):
    """None in a borrowed bundle, known to `is None`: as an argument it takes no place, unlike numba's own None."""

    def __init__(self):
        super().__init__(None)


absent = Absent()
NOTHING = ir.LiteralStructType([])


@register_model(Absent)
class _AbsentModel(models.DataModel):
    def get_value_type(self):
        return NOTHING

    def get_argument_type(self):
        return ()

    def as_argument(self, builder, value):
        return ()

    def from_argument(self, builder, value):
        return ir.Constant(NOTHING, None)


class Bundle(types.containers.NamedTuple):
    """A borrowed named tuple. It goes to another kernel as one value, where numba's own would go member by member, each
    taken out and put in again: half of all that is compiled. Nor does anybody look in it for arrays to count."""


@register_model(Bundle)
class _BundleModel(models.TupleModel):
    def get_argument_type(self):
        return self.get_value_type()

    def as_argument(self, builder, value):
        return value

    def from_argument(self, builder, value):
        return value

    def traverse(self, builder):
        return []


def _borrowed(field):
    """Type of a borrowed array or bundle of arrays; numbers stay what they are; None for anything else."""
    if isinstance(field, types.Array):
        is_rows = field.dtype == types.float64 and field.layout == "C" and field.ndim in (1, 2)
        return Rows(shared=field.ndim == 1) if is_rows else None
    if isinstance(field, types.BaseNamedTuple):
        fields = [_borrowed(f) for f in field]
        return None if None in fields else Bundle(tuple(fields), field.instance_class)
    if isinstance(field, types.NoneType):
        return absent
    return field if isinstance(field, types.Number | types.Boolean) else None


def _borrow_value(context, builder, field, value):
    if isinstance(field, types.Array):
        return context.make_array(field)(context, builder, value).data
    if isinstance(field, types.BaseNamedTuple):
        parts = cgutils.unpack_tuple(builder, value, len(field))
        values = [_borrow_value(context, builder, f, part) for f, part in zip(field, parts, strict=True)]
        return context.make_tuple(builder, _borrowed(field), values)
    if isinstance(field, types.NoneType):
        return ir.Constant(NOTHING, None)
    return value


@intrinsic
def borrow(typing_context, bundle):
    """Pointers to the rows of an array, or of every array in a named tuple, for kernels to `load` from.

    Arrays are C-contiguous float64 of shape (rows, N_LANES), or (rows,) for rows that all robots share.
    """
    result = _borrowed(bundle)
    if result is None:
        return None

    def codegen(context, builder, sig, args):
        return _borrow_value(context, builder, sig.args[0], args[0])

    return result(bundle), codegen


def _vector_pointer(builder, pointer, row):
    element = builder.gep(pointer, [builder.mul(row, ir.Constant(row.type, N_LANES))])
    return builder.bitcast(element, VECTOR.as_pointer())


@intrinsic
def load(typing_context, rows, row):
    """Row `row`: one number per robot, or one number for all robots if the rows are shared."""
    if not (isinstance(rows, Rows) and isinstance(row, types.Integer)):
        return None

    def codegen(context, builder, sig, args):
        if sig.args[0].shared:
            return _broadcast(builder, VECTOR, builder.load(builder.gep(args[0], [args[1]])))
        value = builder.load(_vector_pointer(builder, *args))
        value.align = 8
        return value

    return lanes(rows, types.intp), codegen


def _holds_numbers(rows):
    return isinstance(rows, Rows) and (rows.shared or WIDTH == 1)


def _number_pointer(builder, rows, args):
    row = args[1] if rows.shared else builder.mul(args[1], ir.Constant(args[1].type, N_LANES))
    return builder.gep(args[0], [row])


@intrinsic
def load_number(typing_context, rows, row):
    """Row `row` of shared rows, as a plain number; of any rows where a kernel computes for one robot at a time."""
    if not (_holds_numbers(rows) and isinstance(row, types.Integer)):
        return None

    def codegen(context, builder, sig, args):
        return builder.load(_number_pointer(builder, sig.args[0], args))

    return types.float64(rows, types.intp), codegen


@intrinsic
def store_number(typing_context, rows, row, value):
    """Write a plain number to row `row` of shared rows; of any rows where a kernel computes for one robot at a time."""
    if not (_holds_numbers(rows) and isinstance(row, types.Integer)):
        return None

    def codegen(context, builder, sig, args):
        builder.store(args[2], _number_pointer(builder, sig.args[0], args))
        return context.get_dummy_value()

    return types.void(rows, types.intp, types.float64), codegen


@intrinsic
def load_at(typing_context, rows, row):
    """From shared rows, for every robot the number at its own row (lanes, whole numbers)."""
    if not (isinstance(rows, Rows) and rows.shared and row == lanes):
        return None

    def codegen(context, builder, sig, args):
        result = ir.Constant(VECTOR, ir.Undefined)
        indices = builder.fptosi(args[1], ir.VectorType(ir.IntType(64), WIDTH))
        for k in range(WIDTH):
            index = builder.extract_element(indices, ir.Constant(I32, k))
            number = builder.load(builder.gep(args[0], [index]))
            result = builder.insert_element(result, number, ir.Constant(I32, k))
        return result

    return lanes(rows, lanes), codegen


@intrinsic
def store(typing_context, rows, row, value):
    """Write `value` (lanes, or one number for all robots) to row `row` of rows that are not shared."""
    if not (isinstance(rows, Rows) and not rows.shared and isinstance(row, types.Integer)):
        return None
    if not (value == lanes or isinstance(value, types.Number)):
        return None

    def codegen(context, builder, sig, args):
        pointer = _vector_pointer(builder, args[0], args[1])
        builder.store(_as_vector(builder, sig.args[2], args[2]), pointer).align = 8
        return context.get_dummy_value()

    return types.void(rows, types.intp, lanes if value == lanes else types.float64), codegen


@intrinsic
def splat(typing_context, value):
    """One number for all robots, as lanes."""
    if not isinstance(value, types.Number):
        return None

    def codegen(context, builder, sig, args):
        return _broadcast(builder, VECTOR, args[0])

    return lanes(types.float64), codegen


@intrinsic
def select(typing_context, condition, when_true, when_false):
    """`when_true` for the robots in the mask `condition`, `when_false` for the others; no mask (None): no robot."""
    if condition not in (mask, types.none) or lanes not in (when_true, when_false):
        return None

    def codegen(context, builder, sig, args):
        if condition == types.none:
            return _as_vector(builder, sig.args[2], args[2])
        chosen = (_as_vector(builder, t, a) for t, a in zip(sig.args[1:], args[1:], strict=True))
        return builder.select(args[0], *chosen)

    choices = (lanes if a == lanes else types.float64 for a in (when_true, when_false))
    return lanes(condition, *choices), codegen


def _vector_function(name, n_args):
    """An intrinsic that calls LLVM's vector function `name`, exact or correctly rounded for every lane."""

    def build(builder, args):
        function_type = ir.FunctionType(VECTOR, [VECTOR] * n_args)
        function_name = f"llvm.{name}.v{WIDTH}f64"
        function = builder.module.globals.get(function_name)
        if function is None:
            function = ir.Function(builder.module, function_type, name=function_name)
        return builder.call(function, args)

    return build


@intrinsic
def sqrt(typing_context, x):
    """Square root, correctly rounded."""
    if x != lanes:
        return None
    return lanes(lanes), lambda context, builder, sig, args: _vector_function("sqrt", 1)(builder, args)


@intrinsic
def floor(typing_context, x):
    """Largest whole number not above x."""
    if x != lanes:
        return None
    return lanes(lanes), lambda context, builder, sig, args: _vector_function("floor", 1)(builder, args)


@intrinsic
def absolute(typing_context, x):
    """|x|."""
    if x != lanes:
        return None
    return lanes(lanes), lambda context, builder, sig, args: _vector_function("fabs", 1)(builder, args)


def _product_sum(typing_args, negate):
    sig = _lanes_signature(lanes, typing_args)
    if sig is None:
        return None

    def codegen(context, builder, sig, args):
        c, a, b = (_as_vector(builder, t, x) for t, x in zip(sig.args, args, strict=True))
        if negate:
            a = builder.fsub(ir.Constant(VECTOR, [-0.0] * WIDTH), a)
        return _vector_function("fma", 3)(builder, [a, b, c])

    return sig, codegen


@intrinsic
def add_product(typing_context, c, a, b):
    """c + a b, rounded once."""
    return _product_sum((c, a, b), negate=False)


@intrinsic
def subtract_product(typing_context, c, a, b):
    """c - a b, rounded once."""
    return _product_sum((c, a, b), negate=True)


@intrinsic
def any_lane(typing_context, condition):
    """True if the mask holds for at least one robot."""
    if condition != mask:
        return None

    def codegen(context, builder, sig, args):
        bits = ir.IntType(WIDTH)
        return builder.icmp_unsigned("!=", builder.bitcast(args[0], bits), ir.Constant(bits, 0))

    return types.boolean(mask), codegen


if config.DISABLE_JIT:
    globals().update({name: getattr(numpy_lanes, name) for name in numpy_lanes.FUNCTIONS})
