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
so), so a robot's bits depend neither on its lane nor on its neighbours. Comparisons give a `Mask`; `select` picks by
mask. They are ordered: a NaN compares false with everything, so it never passes a test for being good. Loads and stores
are unaligned on purpose: numpy does not align to 64 bytes.

The type of rows says what they hold and how kernels compute on it, their `Form`: registers of N_LANES robots or of
fewer, one robot of 32 for devices, numbers with a slope (dual.py) or with a place on a tape (tape.py). One
source serves all: lanes that are loaded from rows are of the rows' form, and so is what is computed from them.

plain.py lists all that kernels may ask of lanes, and does the same on numpy: what Python calls is that.
"""

import functools
import hashlib
import operator
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import llvmlite.binding
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.datamodel import models
from numba.core.errors import TypingError
from numba.core.extending import _Intrinsic
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, register_model

from seastar_gym.lanes import plain as numpy_lanes

I1, I32, I64, F64 = ir.IntType(1), ir.IntType(32), ir.IntType(64), ir.DoubleType()


def _lanes_for_this_processor() -> int:
    """Eight float64 fill an AVX-512 register, four an AVX2 or two NEON registers."""
    forced = os.environ.get("SEASTAR_LANES")
    if forced is not None:
        if forced not in {"2", "4", "8", "16"}:
            raise ValueError(f"SEASTAR_LANES={forced!r} is not a lane width: use 2, 4, 8 or 16.")
        return int(forced)
    return 8 if llvmlite.binding.get_host_cpu_features().get("avx512f", False) else 4


N_LANES = _lanes_for_this_processor()
"""Numbers in a row of memory, one of each robot of a lane group."""


@dataclass(frozen=True)
class Form:
    """What rows of memory hold, and how kernels compute on it.

    name: In names of types and of compiled code. numbers: How kernels compute.
    width: Robots for whom a kernel computes at a time, the first of every row. stride: Robots in a row.
    instead: Kernels, and others that are called in their place; a kernel that takes a place calls the one it replaces.
    """

    name: str
    numbers: "Numbers" = field(compare=False)
    width: int = N_LANES
    stride: int = N_LANES
    instead: Mapping[Any, Any] = field(default_factory=dict, compare=False)

    def __str__(self) -> str:
        return f"{self.name} {self.width} of {self.stride}"


# Types


class Lanes(types.Type):
    """A number of every robot."""

    def __init__(self, form):
        self.form = form
        super().__init__(f"Lanes({form})")


class Mask(types.Type):
    """A truth of every robot, LLVM's."""

    def __init__(self, form):
        self.form = form
        super().__init__(f"Mask({form})")


class Rows(types.Type):
    """A borrowed pointer to the rows of an array: of the numbers of robots, or of one number shared by all robots.

    Numba counts references to arrays at every call, which costs more than a small kernel does; a pointer is free. The
    array must outlive it, as the arguments of an entry point do.
    """

    def __init__(self, form, shared):
        self.form, self.shared = form, shared
        super().__init__(f"Rows({form}{', shared' * shared})")


register_model(Lanes)(lambda manager, kind: kind.form.numbers.model(manager, kind))
register_model(Mask)(lambda manager, kind: models.PrimitiveModel(manager, kind, ir.VectorType(I1, kind.form.width)))
register_model(Rows)(lambda manager, kind: models.PrimitiveModel(manager, kind, F64.as_pointer()))


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

    def __init__(self, form, members, kind):
        super().__init__(members, kind)
        self.form = form
        digest = hashlib.blake2b(f"{form} {self.name}".encode(), digest_size=8).hexdigest()
        self.name = f"{kind.__name__}_{digest}"

    @property
    def key(self):
        return self.form, *super().key

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


# How numbers compute


def negated(builder, x):
    """-x of floating point numbers or vectors, by which -0.0 is 0.0's."""
    return builder.fsub(ir.Constant(x.type, [-0.0] * x.type.count), x)


def function_of(name, builder, *args):
    """LLVM's function `name` of vectors: exact or correctly rounded for every lane."""
    kind = args[0].type
    full = f"llvm.{name}.v{kind.count}f64"
    function = builder.module.globals.get(full)
    if function is None:
        function = ir.Function(builder.module, ir.FunctionType(kind, [kind] * len(args)), name=full)
    return builder.call(function, args)


class Numbers:
    """How kernels compute on a form of lanes: how its numbers look to LLVM, and which instructions compute on them.

    A *number* is what is computed with in place of a value of `Lanes`, as `opened` and `plain` return it.
    """

    def model(self, manager, kind):
        """Numba's model of a type of lanes."""
        raise NotImplementedError

    def opened(self, context, builder, kind, value):
        """The number of a value of lanes of type `kind`."""
        return value

    def closed(self, context, builder, kind, number):
        """The value of lanes of type `kind` of a number."""
        return number

    def plain(self, builder, value, width):
        """The number of a plain one, for so many robots."""
        raise NotImplementedError

    def value(self, number):
        """What a number is without what it carries."""
        return number

    add: Callable
    subtract: Callable
    multiply: Callable
    divide: Callable
    """rule(builder, a, b) -> number."""
    negate: Callable
    sqrt: Callable
    absolute: Callable
    floor: Callable
    """rule(builder, x) -> number."""

    def product_sum(self, builder, c, a, b, negate):
        """c + a b, or c - a b, whose value is rounded once."""
        raise NotImplementedError

    def add_product(self, builder, c, a, b):
        return self.product_sum(builder, c, a, b, negate=False)

    def subtract_product(self, builder, c, a, b):
        return self.product_sum(builder, c, a, b, negate=True)

    def chosen(self, builder, condition, when_true, when_false):
        """One of two numbers, by a mask."""
        raise NotImplementedError

    def read(self, builder, rows, row, form):
        """The number in a row that robots do not share."""
        raise NotImplementedError

    def write(self, builder, rows, row, number, form):
        """Write a number to a row that robots do not share."""
        raise NotImplementedError

    def gathered(self, builder, rows, value):
        """From shared rows, the number at the rows in a value."""
        raise NotImplementedError


class Registers(Numbers):
    """Numbers are vectors."""

    def model(self, manager, kind):
        return models.PrimitiveModel(manager, kind, ir.VectorType(F64, kind.form.width))

    def plain(self, builder, value, width):
        undefined = ir.Constant(ir.VectorType(F64, width), ir.Undefined)
        first = builder.insert_element(undefined, value, ir.Constant(I32, 0))
        return builder.shuffle_vector(first, undefined, ir.Constant(ir.VectorType(I32, width), [0] * width))

    def add(self, builder, a, b):
        return builder.fadd(a, b)

    def subtract(self, builder, a, b):
        return builder.fsub(a, b)

    def multiply(self, builder, a, b):
        return builder.fmul(a, b)

    def divide(self, builder, a, b):
        return builder.fdiv(a, b)

    def negate(self, builder, x):
        return negated(builder, x)

    def sqrt(self, builder, x):
        return function_of("sqrt", builder, x)

    def absolute(self, builder, x):
        return function_of("fabs", builder, x)

    def floor(self, builder, x):
        return function_of("floor", builder, x)

    def product_sum(self, builder, c, a, b, negate):
        return function_of("fma", builder, negated(builder, a) if negate else a, b, c)

    def chosen(self, builder, condition, when_true, when_false):
        return builder.select(condition, when_true, when_false)

    def pointer(self, builder, rows, row, form):
        """Pointer to the vector of a row that robots do not share."""
        element = builder.gep(rows, [builder.mul(row, ir.Constant(row.type, form.stride))])
        return builder.bitcast(element, ir.VectorType(F64, form.width).as_pointer())

    def read(self, builder, rows, row, form):
        value = builder.load(self.pointer(builder, rows, row, form))
        value.align = 8
        return value

    def write(self, builder, rows, row, number, form):
        builder.store(number, self.pointer(builder, rows, row, form)).align = 8

    def gathered(self, builder, rows, value):
        width = value.type.count
        result = ir.Constant(value.type, ir.Undefined)
        indices = builder.fptosi(value, ir.VectorType(I64, width))
        for k in range(width):
            index = builder.extract_element(indices, ir.Constant(I32, k))
            number = builder.load(builder.gep(rows, [index]))
            result = builder.insert_element(result, number, ir.Constant(I32, k))
        return result


registers = Registers()
PLAIN = Form("plain", registers)
"""Rows of `Simulator`, with all of their robots."""
NARROW = replace(PLAIN, width=N_LANES // 2)
"""The same rows, with the first half of their robots alone."""


# Operators


def _numbers(context, builder, form, kinds, args):
    """Numbers of values of these types, lanes or plain numbers."""
    numbers = form.numbers
    return [
        numbers.opened(context, builder, kind, x) if isinstance(kind, Lanes) else numbers.plain(builder, x, form.width)
        for kind, x in zip(kinds, args, strict=True)
    ]


def _signature(result, args):
    """Signature of operands, plain numbers taken as float64; None unless lanes of one form are among them.

    result: `Lanes` or `Mask`.
    """
    forms = {each.form for each in args if isinstance(each, Lanes)}
    if len(forms) != 1 or not all(isinstance(each, Lanes | types.Number) for each in args):
        return None
    return signature(result(forms.pop()), *map(_operand, args))


def _operand(kind):
    return kind if isinstance(kind, Lanes) else types.float64


def _computed(rule):
    """Emits the number that the rule of this name gives of the arguments' numbers."""

    def codegen(context, builder, sig, args):
        form = sig.return_type.form
        number = getattr(form.numbers, rule)(builder, *_numbers(context, builder, form, sig.args, args))
        return form.numbers.closed(context, builder, sig.return_type, number)

    return codegen


def _compared(symbol):
    def codegen(context, builder, sig, args):
        form = sig.return_type.form
        a, b = map(form.numbers.value, _numbers(context, builder, form, sig.args, args))
        return builder.fcmp_ordered(symbol, a, b)

    return codegen


def _of_masks(instruction):
    def codegen(context, builder, sig, args):
        return getattr(builder, instruction)(*args)

    return codegen


def _teach(op: Callable, signature_of: Callable, operands: tuple[tuple, ...], build: Callable) -> None:
    """Teach numba `op`: its signature for types of arguments, or None, and what emits it for these operands."""

    @infer_global(op)
    class Typing(AbstractTemplate):
        metadata = {"target": "cpu"}  # asked before numba's own, of which none is for lanes

        def generic(self, args, kws):
            return signature_of(args)

    for each in operands:
        lower_builtin(op, *each)(build)


def _signature_of_masks(args):
    same = isinstance(args[0], Mask) and len(set(args)) == 1
    return signature(args[0], *args) if same else None


ARITHMETIC: dict[Callable, str] = {
    operator.add: "add", operator.iadd: "add", operator.sub: "subtract", operator.isub: "subtract",
    operator.mul: "multiply", operator.imul: "multiply", operator.truediv: "divide", operator.itruediv: "divide",
}  # fmt: skip
COMPARISONS: dict[Callable, str] = {
    operator.lt: "<", operator.le: "<=", operator.gt: ">", operator.ge: ">=", operator.eq: "==",
}  # fmt: skip
LOGIC: dict[Callable, tuple[str, int]] = {
    operator.and_: ("and_", 2), operator.or_: ("or_", 2), operator.invert: ("not_", 1),
}  # fmt: skip
BINARY = (Lanes, Lanes), (Lanes, types.float64), (types.float64, Lanes)
for _op, _rule in ARITHMETIC.items():
    _teach(_op, functools.partial(_signature, Lanes), BINARY, _computed(_rule))
for _op, _symbol in COMPARISONS.items():
    _teach(_op, functools.partial(_signature, Mask), BINARY, _compared(_symbol))
for _op, (_instruction, _n) in LOGIC.items():
    _teach(_op, _signature_of_masks, ((Mask,) * _n,), _of_masks(_instruction))
_teach(operator.neg, functools.partial(_signature, Lanes), ((Lanes,),), _computed("negate"))


# Functions


class Operation(_Intrinsic):  # type: ignore[misc]  # final, to mypy
    """A function that kernels may ask of lanes. Called in Python, it is that of plain.py."""

    at: Callable[[Form], "Operation"]

    def __call__(self, *args):
        return getattr(numpy_lanes, self._name)(*args)


def operation(typed):
    """The operation that a function gives the types and the code of, as numba's intrinsics."""
    made = intrinsic(typed)
    made.__class__ = Operation  # numba offers no other way to say what Python calls
    return made


def of_form(make):
    """An operation whose arguments do not tell the form: the compiler puts `at(form)` of its kernel in its place."""

    def unknown(typing_context, value):
        raise TypingError(f"{make.__name__} needs lanes, rows or a bundle of rows among the arguments of its kernel.")

    unknown.__name__, unknown.__doc__ = make.__name__, make.__doc__
    made = operation(unknown)
    made.at = functools.cache(lambda form: operation(make(form)))
    return made


@of_form
def borrow(form):
    """Pointers to the rows of an array, or of every array in a named tuple, for kernels to `load` from.

    Arrays are C-contiguous float64 of shape (rows, N_LANES), or (rows,) for rows that all robots share.
    """

    def borrow(typing_context, bundle):
        result = _borrowed(form, bundle)

        def codegen(context, builder, sig, args):
            return _borrow_value(context, builder, form, sig.args[0], args[0])

        return None if result is None else (result(bundle), codegen)

    return borrow


def _borrowed(form, kind):
    """Type of a borrowed array or bundle of arrays; numbers stay what they are; None for anything else."""
    if isinstance(kind, types.Array):
        is_rows = kind.dtype == types.float64 and kind.layout == "C" and kind.ndim in (1, 2)
        return Rows(form, shared=kind.ndim == 1) if is_rows else None
    if isinstance(kind, types.BaseNamedTuple):
        members = [_borrowed(form, each) for each in kind]
        return None if None in members else Bundle(form, tuple(members), kind.instance_class)
    if isinstance(kind, types.NoneType):
        return absent
    return kind if isinstance(kind, types.Number | types.Boolean | types.Opaque) else None


def _borrow_value(context, builder, form, kind, value):
    if isinstance(kind, types.Array):
        return context.make_array(kind)(context, builder, value).data
    if isinstance(kind, types.BaseNamedTuple):
        parts = cgutils.unpack_tuple(builder, value, len(kind))
        values = [_borrow_value(context, builder, form, *each) for each in zip(kind, parts, strict=True)]
        return context.make_tuple(builder, _borrowed(form, kind), values)
    if isinstance(kind, types.NoneType):
        return ir.Constant(NOTHING, None)
    return value


@of_form
def splat(form):
    """One number for all robots, as lanes."""

    def splat(typing_context, value):
        def codegen(context, builder, sig, args):
            (number,) = _numbers(context, builder, form, sig.args, args)
            return form.numbers.closed(context, builder, sig.return_type, number)

        return (Lanes(form)(types.float64), codegen) if isinstance(value, types.Number) else None

    return splat


@operation
def load(typing_context, rows, row):
    """Row `row`: one number per robot, or one number for all robots if the rows are shared."""
    if not (isinstance(rows, Rows) and isinstance(row, types.Integer)):
        return None
    form, numbers = rows.form, rows.form.numbers

    def codegen(context, builder, sig, args):
        if rows.shared:
            number = numbers.plain(builder, builder.load(builder.gep(args[0], [args[1]])), form.width)
        else:
            number = numbers.read(builder, *args, form)
        return numbers.closed(context, builder, sig.return_type, number)

    return Lanes(form)(rows, types.intp), codegen


@operation
def load_at(typing_context, rows, row):
    """From shared rows, for every robot the number at its own row (lanes, whole numbers)."""
    if not (isinstance(rows, Rows) and rows.shared and row == Lanes(rows.form)):
        return None
    numbers = rows.form.numbers

    def codegen(context, builder, sig, args):
        value = numbers.value(numbers.opened(context, builder, row, args[1]))
        return numbers.closed(context, builder, row, numbers.gathered(builder, args[0], value))

    return row(rows, row), codegen


@operation
def store(typing_context, rows, row, value):
    """Write `value` (lanes, or one number for all robots) to row `row` of rows that are not shared."""
    if not (isinstance(rows, Rows) and not rows.shared and isinstance(row, types.Integer)):
        return None
    if not (value == Lanes(rows.form) or isinstance(value, types.Number)):
        return None

    def codegen(context, builder, sig, args):
        (number,) = _numbers(context, builder, rows.form, sig.args[2:], args[2:])
        rows.form.numbers.write(builder, args[0], args[1], number, rows.form)
        return context.get_dummy_value()

    return types.void(rows, types.intp, _operand(value)), codegen


def _holds_numbers(rows):
    return isinstance(rows, Rows) and (rows.shared or rows.form.width == 1)


def _number_pointer(builder, rows, args):
    row = args[1] if rows.shared else builder.mul(args[1], ir.Constant(args[1].type, rows.form.stride))
    return builder.gep(args[0], [row])


@operation
def load_number(typing_context, rows, row):
    """Row `row` of shared rows, as a plain number; of any rows where a kernel computes for one robot at a time."""
    if not (_holds_numbers(rows) and isinstance(row, types.Integer)):
        return None

    def codegen(context, builder, sig, args):
        return builder.load(_number_pointer(builder, rows, args))

    return types.float64(rows, types.intp), codegen


@operation
def store_number(typing_context, rows, row, value):
    """Write a plain number to row `row` of shared rows; of any rows where a kernel computes for one robot at a time."""
    if not (_holds_numbers(rows) and isinstance(row, types.Integer)):
        return None

    def codegen(context, builder, sig, args):
        builder.store(args[2], _number_pointer(builder, rows, args))
        return context.get_dummy_value()

    return types.void(rows, types.intp, types.float64), codegen


@operation
def select(typing_context, condition, when_true, when_false):
    """`when_true` for the robots in the mask `condition`, `when_false` for the others; no mask (None): no robot."""
    sig = _signature(Lanes, (when_true, when_false))
    if sig is None or condition not in (Mask(sig.return_type.form), types.none):
        return None
    form = sig.return_type.form

    def codegen(context, builder, sig, args):
        true, false = _numbers(context, builder, form, sig.args[1:], args[1:])
        number = false if condition == types.none else form.numbers.chosen(builder, args[0], true, false)
        return form.numbers.closed(context, builder, sig.return_type, number)

    return sig.return_type(condition, *sig.args), codegen


def of_lanes(rule, args, numbers=Numbers):
    """Types and code of a function of lanes alone, of forms with these numbers, by the name of their rule."""
    if not all(isinstance(each, Lanes) and isinstance(each.form.numbers, numbers) for each in args):
        return None
    sig = _signature(Lanes, args)
    return None if sig is None else (sig, _computed(rule))


@operation
def sqrt(typing_context, x):
    """Square root, correctly rounded; at zero its slope is zero."""
    return of_lanes("sqrt", (x,))


@operation
def absolute(typing_context, x):
    """|x|."""
    return of_lanes("absolute", (x,))


@operation
def floor(typing_context, x):
    """Largest whole number not above x, which has no slope."""
    return of_lanes("floor", (x,))


@operation
def add_product(typing_context, c, a, b):
    """c + a b, rounded once."""
    sig = _signature(Lanes, (c, a, b))
    return None if sig is None else (sig, _computed("add_product"))


@operation
def subtract_product(typing_context, c, a, b):
    """c - a b, rounded once."""
    sig = _signature(Lanes, (c, a, b))
    return None if sig is None else (sig, _computed("subtract_product"))


@operation
def any_lane(typing_context, condition):
    """True if the mask holds for at least one robot."""
    if not isinstance(condition, Mask):
        return None

    def codegen(context, builder, sig, args):
        bits = ir.IntType(condition.form.width)
        return builder.icmp_unsigned("!=", builder.bitcast(args[0], bits), ir.Constant(bits, 0))

    return types.boolean(condition), codegen
