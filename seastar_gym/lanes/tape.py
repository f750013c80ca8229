"""`Lanes` that write down how they were computed: reverse differentiation.

A kernel that is compiled on these lanes in place of plain ones computes what it always does, to the same bits.
Beside it, operations leave entries on a tape: which numbers went in, and the partial derivatives of every robot. Read
from its end, the tape gives the derivatives of one number of a robot in all that it was computed from.

A number is the robots' values, a place on the tape that they share, and a factor for each, its derivative in what
stands there: 1 where an entry was written for it. What has one parent alone keeps the place and changes the factors, so
that nothing is written down for it; nor is for what is constant, whose place and factors are 0. A row of memory that
robots do not share holds the values, the factors behind them and the place as a whole number; shared numbers are
constant. An entry has two parents: both places as int32 in one number, then the partial derivatives of all robots. As
for dual lanes, what robots do is decided by values alone, and where a slope does not exist it is zero.

There is one tape in a process at a time. Beside the functions of registers.py there are `begin_tape`, `end_of_tape`,
`leave_places`, `tape_is_full` and `at_place`. The form is `TAPED` of gradients/tape.py.
"""

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.datamodel import models

from seastar_gym.lanes.registers import (
    F64,
    I1,
    I32,
    I64,
    N_LANES,
    PLAIN,
    Lanes,
    Numbers,
    function_of,
    negated,
    operation,
    registers,
)

FACTOR, PLACE, ROW = N_LANES, 2 * N_LANES, 2 * N_LANES + 1
"""Where factors and place stand in a row of memory that robots do not share, behind the values, and its numbers."""
ENTRY = 1 + 2 * N_LANES
"""Numbers in an entry of the tape: places, then partial derivatives in the first parent and in the second."""
VECTOR = ir.VectorType(F64, N_LANES)
NOWHERE = ir.Constant(I64, 0)
ZERO, ONE, MINUS_ONE = (ir.Constant(VECTOR, [number] * N_LANES) for number in (0.0, 1.0, -1.0))
TAPE, RECORD, JOIN_THREE, CHOOSE = "seastar_tape", "seastar_record", "seastar_join_three", "seastar_choose"
COUNT, LIMIT, BEGIN, FULL = range(4)
"""State of the tape: place of the next entry; where it ends; its memory; not 0 once an entry did not fit."""


# The tape, and what writes on it; one of each once the parts of an entry point are linked


def _once(module, name, make):
    return module.globals.get(name) or make(module, name)


def _make_tape(module, name):
    state = ir.GlobalVariable(module, ir.ArrayType(I64, 4), name)
    state.linkage, state.initializer = "linkonce_odr", ir.Constant(state.value_type, None)
    return state


def _state(builder, which):
    """Pointer to a number of the tape's state."""
    return builder.gep(_once(builder.module, TAPE, _make_tape), [NOWHERE, ir.Constant(I64, which)])


JOINED = ir.LiteralStructType([I64, VECTOR])
"""Place and factors."""


def _function(module, name, result, *arguments):
    function = ir.Function(module, ir.FunctionType(result, arguments), name)
    function.linkage = "linkonce_odr"
    function.attributes.add("noinline")
    function.attributes.add("nounwind")
    set.add(function.attributes, "willreturn")  # which llvmlite does not know
    return function, ir.IRBuilder(function.append_basic_block())


def _make_record(module, name):
    """record(place, partial, place, partial) -> the place of a new entry with these parents."""
    function, build = _function(module, name, I64, *(I64, VECTOR) * 2)
    a, of_a, b, of_b = function.args
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
        behind = build.gep(entry, [ir.Constant(I64, 1 + k * N_LANES)])
        build.store(partial, build.bitcast(behind, VECTOR.as_pointer())).align = 8
    build.store(build.add(place, ir.Constant(I64, 1)), _state(build, COUNT))
    build.ret(place)
    return function


def _make_join_three(module, name):
    """join_three(place, slope, place, slope, place, slope) -> (place, factor)."""
    function, build = _function(module, name, JOINED, *(I64, VECTOR) * 3)
    parents = [tuple(function.args[k : k + 2]) for k in (0, 2, 4)]
    build.ret(_as_joined(build, *_joined(build, [_joined(build, parents[:2]), parents[2]])))
    return function


def _make_choose(module, name):
    """choose(robots, place, factor, place, factor) -> (place, factor): the first two for these robots."""
    robots = ir.IntType(N_LANES)
    function, build = _function(module, name, JOINED, robots, *(I64, VECTOR) * 2)
    which, *parents = function.args
    for all_or_none, parent in ((-1, parents[:2]), (0, parents[2:])):
        with build.if_then(build.icmp_unsigned("==", which, ir.Constant(robots, all_or_none))):
            build.ret(_as_joined(build, *parent))
    robot = build.bitcast(which, ir.VectorType(I1, N_LANES))
    first = parents[0], build.select(robot, parents[1], ZERO)
    build.ret(_as_joined(build, *_joined(build, [first, (parents[2], build.select(robot, ZERO, parents[3]))])))
    return function


def _as_joined(build, place, factor):
    return build.insert_value(build.insert_value(ir.Constant(JOINED, ir.Undefined), place, 0), factor, 1)


def _apart(builder, a, b):
    """Whether two places are neither the same nor constant."""
    active = builder.and_(builder.icmp_unsigned("!=", a, NOWHERE), builder.icmp_unsigned("!=", b, NOWHERE))
    return builder.and_(active, builder.icmp_unsigned("!=", a, b))


def _joined(builder, parents):
    """(place, factor) of a number with these (place, slope): an entry for it only where their places are apart."""
    place, factor = parents[0]
    apart = None
    for other, slope in parents[1:]:
        now = _apart(builder, place, other)
        apart = now if apart is None else builder.or_(apart, now)
        place, factor = builder.or_(place, other), builder.fadd(factor, slope)
    if apart is None:
        return place, factor
    arguments = [x for parent in parents for x in parent]
    if len(parents) == 2:
        return _unless(builder, apart, (place, factor), RECORD, _make_record, arguments)
    return _unless(builder, apart, (place, factor), JOIN_THREE, _make_join_three, arguments)


def _unless(builder, condition, otherwise, name, make, arguments):
    """(place, factor): `otherwise`, but what a function returns where the condition holds.

    Calls are said to touch no memory: what nobody reads is neither computed nor written down.
    """
    before = builder.block
    with builder.if_then(condition):
        made = builder.call(_once(builder.module, name, make), arguments, attrs=("readnone", "nounwind"))
        of_made = (made, ONE) if made.type == I64 else [builder.extract_value(made, k) for k in range(2)]
        behind = builder.block
    joined = []
    for alone, together in zip(otherwise, of_made, strict=True):
        found = builder.phi(alone.type)
        found.add_incoming(alone, before)
        found.add_incoming(together, behind)
        joined.append(found)
    return tuple(joined)


def _grown(builder, value, *parents):
    """The number of this value whose parents are such (number, partial derivative)."""
    slopes = [
        (place, factor if partial is ONE else builder.fmul(factor, partial))
        for (_, place, factor), partial in parents
        if place is not None and place is not NOWHERE
    ]
    return (value, *_joined(builder, slopes)) if slopes else (value, None, None)


class Recorded(Numbers):
    """Numbers are (value, place, factor): a vector, one place and a vector; a place of None is constant."""

    def model(self, manager, kind):
        parts = [("value", Lanes(PLAIN)), ("place", types.int64), ("factor", Lanes(PLAIN))]
        return models.StructModel(manager, kind, parts)

    def opened(self, context, builder, kind, value):
        found = cgutils.create_struct_proxy(kind)(context, builder, value=value)
        return found.value, found.place, found.factor

    def closed(self, context, builder, kind, number):
        made = cgutils.create_struct_proxy(kind)(context, builder)
        made.value, made.place, made.factor = known(number)
        return made._getvalue()

    def plain(self, builder, value, width):
        return registers.plain(builder, value, width), None, None

    def value(self, number):
        return number[0]

    def add(self, builder, a, b):
        return _grown(builder, builder.fadd(a[0], b[0]), (a, ONE), (b, ONE))

    def subtract(self, builder, a, b):
        return _grown(builder, builder.fsub(a[0], b[0]), (a, ONE), (b, MINUS_ONE))

    def multiply(self, builder, a, b):
        return _grown(builder, builder.fmul(a[0], b[0]), (a, b[0]), (b, a[0]))

    def divide(self, builder, a, b):
        quotient, inverse = builder.fdiv(a[0], b[0]), builder.fdiv(ONE, b[0])
        return _grown(builder, quotient, (a, inverse), (b, builder.fmul(negated(builder, quotient), inverse)))

    def negate(self, builder, x):
        return _grown(builder, negated(builder, x[0]), (x, MINUS_ONE))

    def sqrt(self, builder, x):
        root = function_of("sqrt", builder, x[0])
        partial = builder.fdiv(ONE, builder.fadd(root, root))
        partial = builder.select(builder.fcmp_ordered("==", root, ZERO), ZERO, partial)
        return _grown(builder, root, (x, partial))

    def absolute(self, builder, x):
        negative = builder.fcmp_ordered("<", x[0], ZERO)
        partial = builder.select(negative, MINUS_ONE, ONE)
        return _grown(builder, function_of("fabs", builder, x[0]), (x, partial))

    def floor(self, builder, x):
        return function_of("floor", builder, x[0]), None, None

    def product_sum(self, builder, c, a, b, negate):
        x, y = (negated(builder, a[0]), negated(builder, b[0])) if negate else (a[0], b[0])
        return _grown(builder, function_of("fma", builder, x, b[0], c[0]), (c, ONE), (a, y), (b, x))

    def chosen(self, builder, condition, when_true, when_false):
        value = builder.select(condition, when_true[0], when_false[0])
        if when_true[1] is None and when_false[1] is None:
            return value, None, None
        (_, a, of_a), (_, b, of_b) = known(when_true), known(when_false)
        same, which = (a, builder.select(condition, of_a, of_b)), builder.bitcast(condition, ir.IntType(N_LANES))
        apart = builder.icmp_unsigned("!=", a, b)
        return value, *_unless(builder, apart, same, CHOOSE, _make_choose, [which, a, of_a, b, of_b])

    def pointers(self, builder, rows, row):
        """Pointers to the values, the place and the factors of a row that robots do not share."""
        first = builder.gep(rows, [builder.mul(row, ir.Constant(row.type, ROW))])
        parts = ((0, VECTOR), (PLACE, I64), (FACTOR, VECTOR))
        return [
            builder.bitcast(builder.gep(first, [ir.Constant(row.type, at)]), kind.as_pointer()) for at, kind in parts
        ]

    def read(self, builder, rows, row, form):
        parts = [builder.load(pointer) for pointer in self.pointers(builder, rows, row)]
        for part in parts:
            part.align = 8
        return tuple(parts)

    def write(self, builder, rows, row, number, form):
        for part, pointer in zip(known(number), self.pointers(builder, rows, row), strict=True):
            builder.store(part, pointer).align = 8

    def gathered(self, builder, rows, value):
        return registers.gathered(builder, rows, value), None, None


def known(number):
    """A number whose place and factor are LLVM's, of a constant, too."""
    value, place, factor = number
    return (value, NOWHERE, ZERO) if place is None else (value, place, factor)


recorded = Recorded()


@operation
def at_place(typing_context, x, place):
    """The value of x, as what stands at a place."""
    if not (isinstance(x, Lanes) and x.form.numbers is recorded and isinstance(place, types.Integer)):
        return None

    def codegen(context, builder, sig, args):
        return recorded.closed(context, builder, x, (recorded.opened(context, builder, x, args[0])[0], args[1], ONE))

    return x(x, types.int64), codegen


def _memory_of(context, builder, array_type, array):
    return builder.ptrtoint(context.make_array(array_type)(context, builder, array).data, I64)


@operation
def begin_tape(typing_context, entries, first):
    """Begin a tape in `entries`, ENTRY numbers each, behind what stands at places below `first`."""
    if not (isinstance(entries, types.Array) and isinstance(first, types.Integer)):
        return None

    def codegen(context, builder, sig, args):
        size = context.make_array(sig.args[0])(context, builder, args[0]).nitems
        capacity = builder.sdiv(size, ir.Constant(I64, ENTRY))
        begin = _memory_of(context, builder, sig.args[0], args[0])
        for which, number in ((COUNT, args[1]), (LIMIT, capacity), (BEGIN, begin)):
            builder.store(number, _state(builder, which))
        builder.store(NOWHERE, _state(builder, FULL))
        return context.get_dummy_value()

    return types.void(entries, types.intp), codegen


def _number_of_state(which):
    def codegen(context, builder, sig, args):
        return builder.load(_state(builder, which))

    return types.intp(), codegen


@operation
def end_of_tape(typing_context):
    """The place behind the last entry."""
    return _number_of_state(COUNT)


@operation
def leave_places(typing_context, number):
    """Leave out so many places, for what has no parents."""
    if not isinstance(number, types.Integer):
        return None

    def codegen(context, builder, sig, args):
        behind = builder.add(builder.load(_state(builder, COUNT)), args[0])
        beyond = builder.icmp_signed(">", behind, builder.load(_state(builder, LIMIT)))
        builder.store(behind, _state(builder, COUNT))
        full = builder.load(_state(builder, FULL))
        builder.store(builder.or_(full, builder.zext(beyond, I64)), _state(builder, FULL))
        return context.get_dummy_value()

    return types.void(types.intp), codegen


@operation
def tape_is_full(typing_context):
    """Not zero once an entry did not fit."""
    return _number_of_state(FULL)
