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

import functools
import hashlib

from llvmlite import ir
from numba.core import cgutils, config, types
from numba.core.datamodel import models
from numba.extending import intrinsic, register_model

from seastar_gym.simd import numpy_lanes
from seastar_gym.simd.kind import F64, I1, I32, I64, Kind, function_of, negated, teach_masks
from seastar_gym.simd.width import N_LANES as N_LANES
from seastar_gym.simd.width import WIDTH as WIDTH

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
    taken out and put in again: half of all that is compiled. Nor does anybody look in it for arrays to count.

    Its name is short, as it is part of the name of every kernel that takes one; numba's spells out all members.
    """

    def __init__(self, members, kind):
        super().__init__(members, kind)
        self.name = f"{kind.__name__}_{hashlib.blake2b(self.name.encode(), digest_size=8).hexdigest()}"

    @functools.cached_property
    def _hash(self):
        return hash(self.key)

    def __hash__(self):
        return self._hash

    def __getstate__(self):
        return {name: value for name, value in self.__dict__.items() if name != "_hash"}  # another process has others


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
    return field if isinstance(field, types.Number | types.Boolean | types.Opaque) else None


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


class Registers(Kind):
    """Numbers are vectors."""

    def plain(self, builder, value):
        undefined = ir.Constant(VECTOR, ir.Undefined)
        first = builder.insert_element(undefined, value, ir.Constant(I32, 0))
        return builder.shuffle_vector(first, undefined, ir.Constant(ir.VectorType(I32, WIDTH), [0] * WIDTH))

    def add(self, builder, a, b):
        return builder.fadd(a, b)

    def subtract(self, builder, a, b):
        return builder.fsub(a, b)

    def multiply(self, builder, a, b):
        return builder.fmul(a, b)

    def divide(self, builder, a, b):
        return builder.fdiv(a, b)

    def minus(self, builder, x):
        return negated(builder, x)

    def root(self, builder, x):
        return function_of("sqrt", builder, x)

    def magnitude(self, builder, x):
        return function_of("fabs", builder, x)

    def whole(self, builder, x):
        return function_of("floor", builder, x)

    def product_sum(self, builder, c, a, b, negate):
        return function_of("fma", builder, negated(builder, a) if negate else a, b, c)

    def chosen(self, builder, condition, when_true, when_false):
        return builder.select(condition, when_true, when_false)

    def pointer(self, builder, rows, row):
        """Pointer to the vector of a row that robots do not share."""
        element = builder.gep(rows, [builder.mul(row, ir.Constant(row.type, N_LANES))])
        return builder.bitcast(element, VECTOR.as_pointer())

    def read(self, builder, rows, row):
        value = builder.load(self.pointer(builder, rows, row))
        value.align = 8
        return value

    def write(self, builder, rows, row, number):
        builder.store(number, self.pointer(builder, rows, row)).align = 8

    def gathered(self, builder, rows, value):
        result = ir.Constant(VECTOR, ir.Undefined)
        indices = builder.fptosi(value, ir.VectorType(I64, WIDTH))
        for k in range(WIDTH):
            index = builder.extract_element(indices, ir.Constant(I32, k))
            number = builder.load(builder.gep(rows, [index]))
            result = builder.insert_element(result, number, ir.Constant(I32, k))
        return result


teach_masks(mask)
registers = Registers(lanes, mask, Rows)
load, load_at, store = intrinsic(registers.load), intrinsic(registers.load_at), intrinsic(registers.store)
splat, select = intrinsic(registers.splat), intrinsic(registers.select)
sqrt, absolute, floor = intrinsic(registers.sqrt), intrinsic(registers.absolute), intrinsic(registers.floor)
add_product, subtract_product = intrinsic(registers.add_product), intrinsic(registers.subtract_product)


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
