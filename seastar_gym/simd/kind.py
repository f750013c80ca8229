"""What numba is taught of lanes, whatever a number of theirs is: a register, with a slope, or with a place on a tape.

A `Kind` is told how its numbers look to LLVM and which instructions compute on them. It teaches numba their operators,
and has the functions of numpy_lanes.py as numba types them, for `intrinsic`. Comparisons are ordered: a NaN compares
false with everything, so it never passes a test for being good.
"""

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.core import types
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import lower_builtin

I1, I32, I64, F64 = ir.IntType(1), ir.IntType(32), ir.IntType(64), ir.DoubleType()
ARITHMETIC = {
    "add": (operator.add, operator.iadd),
    "subtract": (operator.sub, operator.isub),
    "multiply": (operator.mul, operator.imul),
    "divide": (operator.truediv, operator.itruediv),
}
"""Python's operators, by the name of what a kind has for them."""
COMPARISONS = {operator.lt: "<", operator.le: "<=", operator.gt: ">", operator.ge: ">=", operator.eq: "=="}


def negated(builder, x):
    """-x of floating point numbers or vectors, by which -0.0 is 0.0's."""
    return builder.fsub(ir.Constant(x.type, [-0.0] * x.type.count if isinstance(x.type, ir.VectorType) else -0.0), x)


def function_of(name, builder, *args):
    """LLVM's function `name` of numbers, or of vectors: exact or correctly rounded for every lane."""
    kind = args[0].type
    full = f"llvm.{name}.v{kind.count}f64" if isinstance(kind, ir.VectorType) else f"llvm.{name}.f64"
    function = builder.module.globals.get(full)
    if function is None:
        function = ir.Function(builder.module, ir.FunctionType(kind, [kind] * len(args)), name=full)
    return builder.call(function, args)


def _teach(op: Callable, result_of: Callable, operands: tuple[tuple, ...], build: Callable) -> None:
    """Teach numba `op`: its signature for types of arguments, or None, and what emits it for these operands."""

    @infer_global(op)
    class Typing(AbstractTemplate):
        metadata = {"target": "cpu"}  # asked before numba's own, of which none is for lanes

        def generic(self, args, kws):
            return result_of(args)

    for each in operands:
        lower_builtin(op, *each)(build)


class Kind:
    """One kind of lanes. Masks are LLVM's truths, of which a vector's width or one is compared at a time.

    lanes, mask: Numba's types of a number and of a truth of every robot. rows: Class of the type of rows of memory.

    A *number* is what a kind computes with in place of the value of `lanes`, as `opened` and `plain` return it.
    """

    def __init__(self, lanes: types.Type, mask: types.Type, rows: type):
        self.lanes, self.mask, self.rows = lanes, mask, rows
        for name, operators in ARITHMETIC.items():
            for op in operators:
                self._teach_binary(op, lanes, self._arithmetic(getattr(self, name)))
        for op, symbol in COMPARISONS.items():
            self._teach_binary(op, mask, self._comparison(symbol))
        _teach(operator.neg, self._unary, ((type(lanes),),), self._lower_negation)

    # What a kind says of its numbers

    def opened(self, context, builder, value):
        """The number of a value of `lanes`."""
        return value

    def closed(self, context, builder, number):
        """The value of `lanes` of a number."""
        return number

    def plain(self, builder, value):
        """The number of a plain one."""
        raise NotImplementedError

    def value(self, number):
        """What a number is without what it carries."""
        return number

    add: Callable
    subtract: Callable
    multiply: Callable
    divide: Callable
    """rule(builder, a, b) -> number."""
    minus: Callable
    root: Callable
    magnitude: Callable
    whole: Callable
    """rule(builder, x) -> number."""

    def product_sum(self, builder, c, a, b, negate):
        """c + a b, or c - a b, whose value is rounded once."""
        raise NotImplementedError

    def chosen(self, builder, condition, when_true, when_false):
        """One of two numbers, by a mask."""
        raise NotImplementedError

    def read(self, builder, rows, row):
        """The number in a row that robots do not share."""
        raise NotImplementedError

    def write(self, builder, rows, row, number):
        """Write a number to a row that robots do not share."""
        raise NotImplementedError

    def gathered(self, builder, rows, value):
        """From shared rows, the plain number, or vector of such, at the rows in a value."""
        raise NotImplementedError

    # Operators

    def _numbers(self, context, builder, kinds, args):
        """Numbers of operands, of lanes or plain ones."""
        return (
            self.opened(context, builder, x) if kind == self.lanes else self.plain(builder, x)
            for kind, x in zip(kinds, args, strict=True)
        )

    def _signature(self, result, args):
        """`result(args)` with plain numbers taken as float64; None where an argument is neither lanes nor number."""
        if self.lanes in args and all(a == self.lanes or isinstance(a, types.Number) for a in args):
            return signature(result, *(self._operand(a) for a in args))
        return None

    def _operand(self, kind):
        return kind if kind == self.lanes else types.float64

    def _unary(self, args):
        return signature(self.lanes, self.lanes) if args == (self.lanes,) else None

    def _teach_binary(self, op, result, build):
        own = type(self.lanes)
        operands = ((own, own), (own, types.float64), (types.float64, own))
        _teach(op, lambda args: self._signature(result, args) if len(args) == 2 else None, operands, build)

    def _arithmetic(self, rule):
        def lower(context, builder, sig, args):
            return self.closed(context, builder, rule(builder, *self._numbers(context, builder, sig.args, args)))

        return lower

    def _comparison(self, symbol):
        def lower(context, builder, sig, args):
            a, b = (self.value(x) for x in self._numbers(context, builder, sig.args, args))
            return builder.fcmp_ordered(symbol, a, b)

        return lower

    def _lower_negation(self, context, builder, sig, args):
        return self.closed(context, builder, self.minus(builder, self.opened(context, builder, args[0])))

    # Functions, as numba types them

    def load(self, typing_context, rows, row):
        """Row `row`: one number per robot, or one number for all robots if the rows are shared."""
        if not (isinstance(rows, self.rows) and isinstance(row, types.Integer)):
            return None

        def codegen(context, builder, sig, args):
            if sig.args[0].shared:
                number = self.plain(builder, builder.load(builder.gep(args[0], [args[1]])))
            else:
                number = self.read(builder, *args)
            return self.closed(context, builder, number)

        return self.lanes(rows, types.intp), codegen

    def load_at(self, typing_context, rows, row):
        """From shared rows, for every robot the number at its own row (lanes, whole numbers)."""
        if not (isinstance(rows, self.rows) and rows.shared and row == self.lanes):
            return None

        def codegen(context, builder, sig, args):
            value = self.value(self.opened(context, builder, args[1]))
            return self.closed(context, builder, self.gathered(builder, args[0], value))

        return self.lanes(rows, self.lanes), codegen

    def store(self, typing_context, rows, row, value):
        """Write `value` (lanes, or one number for all robots) to row `row` of rows that are not shared."""
        if not (isinstance(rows, self.rows) and not rows.shared and isinstance(row, types.Integer)):
            return None
        if not (value == self.lanes or isinstance(value, types.Number)):
            return None

        def codegen(context, builder, sig, args):
            (number,) = self._numbers(context, builder, sig.args[2:], args[2:])
            self.write(builder, args[0], args[1], number)
            return context.get_dummy_value()

        return types.void(rows, types.intp, self._operand(value)), codegen

    def splat(self, typing_context, value):
        """One number for all robots, as lanes."""
        if not isinstance(value, types.Number):
            return None

        def codegen(context, builder, sig, args):
            return self.closed(context, builder, self.plain(builder, args[0]))

        return self.lanes(types.float64), codegen

    def select(self, typing_context, condition, when_true, when_false):
        """`when_true` for the robots in the mask `condition`, `when_false` for the others; no mask (None): no robot."""
        if condition not in (self.mask, types.none) or self.lanes not in (when_true, when_false):
            return None

        def codegen(context, builder, sig, args):
            true, false = self._numbers(context, builder, sig.args[1:], args[1:])
            number = false if condition == types.none else self.chosen(builder, args[0], true, false)
            return self.closed(context, builder, number)

        return self.lanes(condition, self._operand(when_true), self._operand(when_false)), codegen

    def sqrt(self, typing_context, x):
        """Square root, correctly rounded; at zero its slope is zero."""
        return self.function((x,), self.root)

    def absolute(self, typing_context, x):
        """|x|."""
        return self.function((x,), self.magnitude)

    def floor(self, typing_context, x):
        """Largest whole number not above x, which has no slope."""
        return self.function((x,), self.whole)

    def function(self, kinds: tuple[types.Type, ...], rule: Callable) -> Any:
        """A function of lanes alone: `rule` gives its number from theirs."""
        if any(kind != self.lanes for kind in kinds):
            return None

        def codegen(context, builder, sig, args):
            return self.closed(context, builder, rule(builder, *self._numbers(context, builder, sig.args, args)))

        return self.lanes(*kinds), codegen

    def add_product(self, typing_context, c, a, b):
        """c + a b, rounded once."""
        return self._product_sum((c, a, b), negate=False)

    def subtract_product(self, typing_context, c, a, b):
        """c - a b, rounded once."""
        return self._product_sum((c, a, b), negate=True)

    def _product_sum(self, arguments, negate):
        sig = self._signature(self.lanes, arguments)
        if sig is None:
            return None

        def codegen(context, builder, sig, args):
            numbers = self._numbers(context, builder, sig.args, args)
            return self.closed(context, builder, self.product_sum(builder, *numbers, negate))

        return sig, codegen


def teach_masks(mask: types.Type) -> None:
    """Teach numba & | ~ of masks."""
    for op, n_args, build in (
        (operator.and_, 2, lambda context, builder, sig, args: builder.and_(*args)),
        (operator.or_, 2, lambda context, builder, sig, args: builder.or_(*args)),
        (operator.invert, 1, lambda context, builder, sig, args: builder.not_(*args)),
    ):
        masks, classes = (mask,) * n_args, (type(mask),) * n_args
        _teach(op, lambda args, masks=masks: signature(mask, *args) if args == masks else None, (classes,), build)
