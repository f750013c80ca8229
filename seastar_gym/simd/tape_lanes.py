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

import operator

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.datamodel import models
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, register_model

from seastar_gym.simd.lanes import F64, I1, I32, Rows
from seastar_gym.simd.lanes import N_LANES as N_LANES
from seastar_gym.simd.lanes import WIDTH as WIDTH
from seastar_gym.simd.lanes import borrow as borrow
from seastar_gym.simd.lanes import load_number as load_number
from seastar_gym.simd.lanes import store_number as store_number

ROW = 2
"""Numbers in a row of memory that robots do not share."""
ENTRY = 3
"""Numbers in an entry of the tape."""
I64 = ir.IntType(64)
NOWHERE, ONE, MINUS_ONE = ir.Constant(I64, 0), ir.Constant(F64, 1.0), ir.Constant(F64, -1.0)
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


def _pair(context, builder, value, place):
    """Lanes of a value and its place; None: it is constant."""
    made = cgutils.create_struct_proxy(lanes)(context, builder)
    made.value, made.place = value, NOWHERE if place is None else place
    return made._getvalue()


def _parts(context, builder, numba_type, x):
    """(value, place) of lanes, or of a plain number, whose place is None."""
    if numba_type == lanes:
        found = cgutils.create_struct_proxy(lanes)(context, builder, value=x)
        return found.value, found.place
    return x, None


def _add(builder, a, b):
    return builder.fadd(a[0], b[0]), _place(builder, (a[1], ONE), (b[1], ONE))


def _subtract(builder, a, b):
    return builder.fsub(a[0], b[0]), _place(builder, (a[1], ONE), (b[1], MINUS_ONE))


def _multiply(builder, a, b):
    return builder.fmul(a[0], b[0]), _place(builder, (a[1], b[0]), (b[1], a[0]))


def _divide(builder, a, b):
    quotient, inverse = builder.fdiv(a[0], b[0]), builder.fdiv(ONE, b[0])
    return quotient, _place(builder, (a[1], inverse), (b[1], builder.fmul(_minus(builder, quotient), inverse)))


def _minus(builder, x):
    return builder.fsub(ir.Constant(F64, -0.0), x)


def _are_operands(args):
    return lanes in args and all(a == lanes or isinstance(a, types.Number) for a in args)


def _signature(result, args):
    if _are_operands(args):
        return signature(result, *(a if a == lanes else types.float64 for a in args))
    return None


def _define(op, result, build):
    """Teach numba `op` on two of these lanes and numbers; `build(context, builder, a, b)` gets (value, place) twice."""

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


def _define_mask_operator(op, n_args, build):
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


@infer_global(operator.neg)
class _Negation(AbstractTemplate):
    def generic(self, args, kws):
        return signature(lanes, lanes) if args == (lanes,) else None


@lower_builtin(operator.neg, Lanes)
def _lower_negation(context, builder, sig, args):
    value, place = _parts(context, builder, lanes, args[0])
    return _pair(context, builder, _minus(builder, value), _place(builder, (place, MINUS_ONE)))


def _pointers(builder, rows, row):
    """Pointers to the value and to the place of a row that robots do not share."""
    element = builder.gep(rows, [builder.mul(row, ir.Constant(row.type, ROW))])
    behind = builder.gep(element, [ir.Constant(row.type, 1)])
    return element, builder.bitcast(behind, I64.as_pointer())


@intrinsic
def load(typing_context, rows, row):
    """Row `row`: the robot's number with its place, or one number for all robots, constant."""
    if not (isinstance(rows, Rows) and isinstance(row, types.Integer)):
        return None

    def codegen(context, builder, sig, args):
        if sig.args[0].shared:
            return _pair(context, builder, builder.load(builder.gep(args[0], [args[1]])), None)
        value, place = _pointers(builder, *args)
        return _pair(context, builder, builder.load(value), builder.load(place))

    return lanes(rows, types.intp), codegen


@intrinsic
def load_at(typing_context, rows, row):
    """From shared rows the number at the robot's own row (lanes, a whole number), constant."""
    if not (isinstance(rows, Rows) and rows.shared and row == lanes):
        return None

    def codegen(context, builder, sig, args):
        value, _ = _parts(context, builder, lanes, args[1])
        number = builder.load(builder.gep(args[0], [builder.fptosi(value, I64)]))
        return _pair(context, builder, number, None)

    return lanes(rows, lanes), codegen


@intrinsic
def store(typing_context, rows, row, value):
    """Write `value` (lanes, or a number, which is constant) to a row that robots do not share."""
    if not (isinstance(rows, Rows) and not rows.shared and isinstance(row, types.Integer)):
        return None
    if not (value == lanes or isinstance(value, types.Number)):
        return None

    def codegen(context, builder, sig, args):
        number, place = _parts(context, builder, sig.args[2], args[2])
        of_value, of_place = _pointers(builder, args[0], args[1])
        builder.store(number, of_value)
        builder.store(NOWHERE if place is None else place, of_place)
        return context.get_dummy_value()

    return types.void(rows, types.intp, lanes if value == lanes else types.float64), codegen


@intrinsic
def splat(typing_context, value):
    """A number as lanes, constant."""
    if not isinstance(value, types.Number):
        return None
    return lanes(types.float64), lambda context, builder, sig, args: _pair(context, builder, args[0], None)


@intrinsic
def select(typing_context, condition, when_true, when_false):
    """`when_true` if the mask `condition` holds, else `when_false`; no mask (None): it does not hold."""
    if condition not in (mask, types.none) or lanes not in (when_true, when_false):
        return None

    def codegen(context, builder, sig, args):
        true, false = (_parts(context, builder, t, a) for t, a in zip(sig.args[1:], args[1:], strict=True))
        if condition == types.none:
            return _pair(context, builder, *false)
        places = (NOWHERE if place is None else place for place in (true[1], false[1]))
        return _pair(context, builder, builder.select(args[0], true[0], false[0]), builder.select(args[0], *places))

    choices = (lanes if a == lanes else types.float64 for a in (when_true, when_false))
    return lanes(condition, *choices), codegen


def _function_of(name, builder, *args):
    """LLVM's function `name` of numbers."""
    full = f"llvm.{name}.f64"
    function = builder.module.globals.get(full)
    if function is None:
        function = ir.Function(builder.module, ir.FunctionType(F64, [F64] * len(args)), name=full)
    return builder.call(function, args)


def _one_argument(rule):
    """An intrinsic of one argument; `rule(builder, value, place)` gives the value and the place of the result."""

    def typed(typing_context, x):
        if x != lanes:
            return None

        def codegen(context, builder, sig, args):
            return _pair(context, builder, *rule(builder, *_parts(context, builder, lanes, args[0])))

        return lanes(lanes), codegen

    return typed


def _root(builder, value, place):
    root, zero = _function_of("sqrt", builder, value), ir.Constant(F64, 0.0)
    partial = builder.fdiv(ONE, builder.fadd(root, root))
    partial = builder.select(builder.fcmp_ordered("==", root, zero), zero, partial)
    return root, _place(builder, (place, partial))


def _magnitude(builder, value, place):
    negative = builder.fcmp_ordered("<", value, ir.Constant(F64, 0.0))
    return _function_of("fabs", builder, value), _place(builder, (place, builder.select(negative, MINUS_ONE, ONE)))


def _whole(builder, value, place):
    return _function_of("floor", builder, value), None


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
    """Largest whole number not above x, a constant."""
    return _one_argument(_whole)(typing_context, x)


def _product_sum(typing_args, negate):
    sig = _signature(lanes, typing_args)
    if sig is None:
        return None

    def codegen(context, builder, sig, args):
        c, a, b = (_parts(context, builder, t, x) for t, x in zip(sig.args, args, strict=True))
        x, y = (_minus(builder, a[0]), _minus(builder, b[0])) if negate else (a[0], b[0])
        value = _function_of("fma", builder, x, b[0], c[0])
        return _pair(context, builder, value, _place(builder, (c[1], ONE), (a[1], y), (b[1], x)))

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
def any_lane(typing_context, condition):
    """Whether the mask holds for the robot."""
    if condition != mask:
        return None
    return types.boolean(mask), lambda context, builder, sig, args: args[0]


@intrinsic
def constant(typing_context, x):
    """The value of x, as a constant."""
    if x != lanes:
        return None

    def codegen(context, builder, sig, args):
        return _pair(context, builder, _parts(context, builder, lanes, args[0])[0], None)

    return lanes(lanes), codegen


@intrinsic
def less_step(typing_context, x, step):
    """x as x - step is differentiated, with the value of x, which is taken for a constant."""
    if (x, step) != (lanes, lanes):
        return None

    def codegen(context, builder, sig, args):
        (value, _), (_, place) = (_parts(context, builder, lanes, a) for a in args)
        return _pair(context, builder, value, _place(builder, (place, MINUS_ONE)))

    return lanes(lanes, lanes), codegen


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
