"""`Lanes` of one robot that write down how they were computed: reverse differentiation.

A kernel that is compiled on these lanes in place of those of lanes.py computes what it always does for one robot, to
the same bits. Beside it, every operation leaves an entry on a tape: which numbers went in, and the partial derivatives
in them. Read from its end, the tape gives the derivatives of one number in all that it was computed from.

A number is a value and its place on the tape, which is 0 for what is constant: nothing is written down for that. A row
of memory that robots do not share holds a value and, behind it, the place as a whole number; shared numbers are
constant. An entry has two parents, three numbers in a row: both places as int32, then the partial derivatives. As for
dual lanes, what robots do is decided by values alone, and where a slope does not exist it is zero.

There is one tape in a process at a time. Beside the functions of lanes.py there are `begin_tape`, `end_of_tape`,
`pause_tape`, `resume_tape`, `tape_is_full`, `constant` and `less_step`.
"""

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.datamodel import models
from numba.extending import intrinsic, register_model

from seastar_gym.simd.kind import F64, I1, I32, I64, Kind, function_of, negated, teach_masks
from seastar_gym.simd.lanes import N_LANES as N_LANES
from seastar_gym.simd.lanes import WIDTH as WIDTH
from seastar_gym.simd.lanes import Rows
from seastar_gym.simd.lanes import borrow as borrow
from seastar_gym.simd.lanes import load_number as load_number
from seastar_gym.simd.lanes import store_number as store_number

ROW = 2
"""Numbers in a row of memory that robots do not share."""
ENTRY = 3
"""Numbers in an entry of the tape."""
NOWHERE = ir.Constant(I64, 0)
ZERO, ONE, MINUS_ONE = (ir.Constant(F64, number) for number in (0.0, 1.0, -1.0))
TAPE, RECORD, RECORD_THREE = "seastar_tape", "seastar_record", "seastar_record_three"
COUNT, LIMIT, CAPACITY, BEGIN, FULL = range(5)
"""State of the tape: place of the next entry; where it ends, 0 while it is paused; where it ends otherwise; its memory;
not 0 once an entry did not fit."""


class Lanes(types.Type):
    def __init__(self):
        super().__init__(name="TapeLanes")


class Mask(types.Type):
    def __init__(self):
        super().__init__(name="TapeMask")


lanes, mask = Lanes(), Mask()


@register_model(Lanes)
class _LanesModel(models.StructModel):
    def __init__(self, dmm, fe_type):
        super().__init__(dmm, fe_type, [("value", types.float64), ("place", types.int64)])


@register_model(Mask)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, dmm, fe_type):
        super().__init__(dmm, fe_type, I1)


# The tape, and what writes on it; one of each once the parts of an entry point are linked


def _once(module, name, make):
    return module.globals.get(name) or make(module, name)


def _make_tape(module, name):
    state = ir.GlobalVariable(module, ir.ArrayType(I64, 5), name)
    state.linkage, state.initializer = "linkonce_odr", ir.Constant(state.value_type, None)
    return state


def _state(builder, which):
    """Pointer to a number of the tape's state."""
    return builder.gep(_once(builder.module, TAPE, _make_tape), [NOWHERE, ir.Constant(I64, which)])


def _function(module, name, n_parents):
    function = ir.Function(module, ir.FunctionType(I64, [I64, F64] * n_parents), name)
    function.linkage = "linkonce_odr"
    function.attributes.add("noinline")
    function.attributes.add("nounwind")
    set.add(function.attributes, "willreturn")  # which llvmlite does not know
    return function, ir.IRBuilder(function.append_basic_block())


def _make_record(module, name):
    """record(place, partial, place, partial) -> the place of a new entry with these parents; 0 if both are constant."""
    function, build = _function(module, name, 2)
    a, of_a, b, of_b = function.args
    with build.if_then(build.icmp_unsigned("==", build.or_(a, b), NOWHERE)):
        build.ret(NOWHERE)
    place, limit = build.load(_state(build, COUNT)), build.load(_state(build, LIMIT))
    with build.if_then(build.icmp_signed(">=", place, limit), likely=False):
        build.store(build.or_(build.load(_state(build, FULL)), limit), _state(build, FULL))
        build.ret(NOWHERE)
    begin = build.inttoptr(build.load(_state(build, BEGIN)), F64.as_pointer())
    entry = build.gep(begin, [build.mul(place, ir.Constant(I64, ENTRY))])
    parents = build.bitcast(entry, I32.as_pointer())
    for k, parent in enumerate((a, b)):
        build.store(build.trunc(parent, I32), build.gep(parents, [ir.Constant(I64, k)]))
    for k, partial in enumerate((of_a, of_b)):
        build.store(partial, build.gep(entry, [ir.Constant(I64, 1 + k)]))
    build.store(build.add(place, ir.Constant(I64, 1)), _state(build, COUNT))
    build.ret(place)
    return function


def _make_record_three(module, name):
    """As record, of three parents: two entries, or one where a parent is constant."""
    function, build = _function(module, name, 3)
    record, parents = _once(module, RECORD, _make_record), [function.args[k : k + 2] for k in (0, 2, 4)]
    for k in range(3):
        with build.if_then(build.icmp_unsigned("==", parents[k][0], NOWHERE)):
            build.ret(build.call(record, [x for other in range(3) if other != k for x in parents[other]]))
    first = build.call(record, [*parents[0], *parents[1]])
    build.ret(build.call(record, [first, ONE, *parents[2]]))
    return function


def _place(builder, *parents):
    """Place of a number with these (place, partial); a place of None is constant.

    Calls are said to touch no memory: what nobody reads is neither computed nor written down.
    """
    known = [parent for parent in parents if parent[0] is not None and parent[0] is not NOWHERE]
    if not known:
        return NOWHERE
    active = known[0][0]
    for place, _ in known[1:]:
        active = builder.or_(active, place)
    arguments = [x for parent in known for x in parent] + ([NOWHERE, ONE] if len(known) == 1 else [])
    name, make = (RECORD, _make_record) if len(known) < 3 else (RECORD_THREE, _make_record_three)
    before = builder.block
    with builder.if_then(builder.icmp_unsigned("!=", active, NOWHERE)):
        made = builder.call(_once(builder.module, name, make), arguments, attrs=("readnone", "nounwind"))
        behind = builder.block
    place = builder.phi(I64)
    place.add_incoming(NOWHERE, before)
    place.add_incoming(made, behind)
    return place


class Recorded(Kind):
    """Numbers are (value, place), scalars; a place of None is constant."""

    def opened(self, context, builder, value):
        found = cgutils.create_struct_proxy(lanes)(context, builder, value=value)
        return found.value, found.place

    def closed(self, context, builder, number):
        made = cgutils.create_struct_proxy(lanes)(context, builder)
        made.value, made.place = number[0], NOWHERE if number[1] is None else number[1]
        return made._getvalue()

    def plain(self, builder, value):
        return value, None

    def value(self, number):
        return number[0]

    def add(self, builder, a, b):
        return builder.fadd(a[0], b[0]), _place(builder, (a[1], ONE), (b[1], ONE))

    def subtract(self, builder, a, b):
        return builder.fsub(a[0], b[0]), _place(builder, (a[1], ONE), (b[1], MINUS_ONE))

    def multiply(self, builder, a, b):
        return builder.fmul(a[0], b[0]), _place(builder, (a[1], b[0]), (b[1], a[0]))

    def divide(self, builder, a, b):
        quotient, inverse = builder.fdiv(a[0], b[0]), builder.fdiv(ONE, b[0])
        return quotient, _place(builder, (a[1], inverse), (b[1], builder.fmul(negated(builder, quotient), inverse)))

    def minus(self, builder, x):
        return negated(builder, x[0]), _place(builder, (x[1], MINUS_ONE))

    def root(self, builder, x):
        root = function_of("sqrt", builder, x[0])
        partial = builder.fdiv(ONE, builder.fadd(root, root))
        partial = builder.select(builder.fcmp_ordered("==", root, ZERO), ZERO, partial)
        return root, _place(builder, (x[1], partial))

    def magnitude(self, builder, x):
        negative = builder.fcmp_ordered("<", x[0], ZERO)
        partial = builder.select(negative, MINUS_ONE, ONE)
        return function_of("fabs", builder, x[0]), _place(builder, (x[1], partial))

    def whole(self, builder, x):
        return function_of("floor", builder, x[0]), None

    def product_sum(self, builder, c, a, b, negate):
        x, y = (negated(builder, a[0]), negated(builder, b[0])) if negate else (a[0], b[0])
        return function_of("fma", builder, x, b[0], c[0]), _place(builder, (c[1], ONE), (a[1], y), (b[1], x))

    def chosen(self, builder, condition, when_true, when_false):
        places = (NOWHERE if place is None else place for place in (when_true[1], when_false[1]))
        return builder.select(condition, when_true[0], when_false[0]), builder.select(condition, *places)

    def pointers(self, builder, rows, row):
        """Pointers to the value and to the place of a row that robots do not share."""
        element = builder.gep(rows, [builder.mul(row, ir.Constant(row.type, ROW))])
        behind = builder.gep(element, [ir.Constant(row.type, 1)])
        return element, builder.bitcast(behind, I64.as_pointer())

    def read(self, builder, rows, row):
        return [builder.load(pointer) for pointer in self.pointers(builder, rows, row)]

    def write(self, builder, rows, row, number):
        of_value, of_place = self.pointers(builder, rows, row)
        builder.store(number[0], of_value)
        builder.store(NOWHERE if number[1] is None else number[1], of_place)

    def gathered(self, builder, rows, value):
        return builder.load(builder.gep(rows, [builder.fptosi(value, I64)])), None


teach_masks(mask)
recorded = Recorded(lanes, mask, Rows)
load, load_at, store = intrinsic(recorded.load), intrinsic(recorded.load_at), intrinsic(recorded.store)
splat, select = intrinsic(recorded.splat), intrinsic(recorded.select)
sqrt, absolute, floor = intrinsic(recorded.sqrt), intrinsic(recorded.absolute), intrinsic(recorded.floor)
add_product, subtract_product = intrinsic(recorded.add_product), intrinsic(recorded.subtract_product)


@intrinsic
def any_lane(typing_context, condition):
    """Whether the mask holds for the robot."""
    if condition != mask:
        return None
    return types.boolean(mask), lambda context, builder, sig, args: args[0]


@intrinsic
def constant(typing_context, x):
    """The value of x, as a constant."""
    return recorded.function((x,), lambda builder, number: (number[0], None))


@intrinsic
def less_step(typing_context, x, step):
    """x as x - step is differentiated, with the value of x, which is taken for a constant."""
    return recorded.function(
        (x, step), lambda builder, number, other: (number[0], _place(builder, (other[1], MINUS_ONE)))
    )


def _memory_of(context, builder, array_type, array):
    return builder.ptrtoint(context.make_array(array_type)(context, builder, array).data, I64)


@intrinsic
def begin_tape(typing_context, entries, first):
    """Begin a tape in `entries`, shape (capacity, ENTRY), behind what stands at places below `first`."""
    if not (isinstance(entries, types.Array) and isinstance(first, types.Integer)):
        return None

    def codegen(context, builder, sig, args):
        capacity = builder.extract_value(context.make_array(sig.args[0])(context, builder, args[0]).shape, 0)
        begin = _memory_of(context, builder, sig.args[0], args[0])
        for which, number in ((COUNT, args[1]), (LIMIT, capacity), (CAPACITY, capacity), (BEGIN, begin)):
            builder.store(number, _state(builder, which))
        builder.store(NOWHERE, _state(builder, FULL))
        return context.get_dummy_value()

    return types.void(entries, types.intp), codegen


def _number_of_state(which):
    def codegen(context, builder, sig, args):
        return builder.load(_state(builder, which))

    return types.intp(), codegen


@intrinsic
def end_of_tape(typing_context):
    """The place behind the last entry."""
    return _number_of_state(COUNT)


@intrinsic
def tape_is_full(typing_context):
    """Not zero once an entry did not fit."""
    return _number_of_state(FULL)


@intrinsic
def pause_tape(typing_context):
    """Write nothing down until `resume_tape`: all that is computed is constant."""

    def codegen(context, builder, sig, args):
        builder.store(NOWHERE, _state(builder, LIMIT))
        return context.get_dummy_value()

    return types.void(), codegen


@intrinsic
def resume_tape(typing_context):
    """Write down again."""

    def codegen(context, builder, sig, args):
        builder.store(builder.load(_state(builder, CAPACITY)), _state(builder, LIMIT))
        return context.get_dummy_value()

    return types.void(), codegen
