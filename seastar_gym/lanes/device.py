"""The kernels once more, for processors with a thread for each robot: the same source, and the same bits.

A kernel computes for one robot at a time, where a row of memory holds the numbers of N_LANES robots: neighbouring
threads read neighbouring numbers. Numba makes the code of LLVM of it, which knows no processor yet, and LLVM makes of
that either code for NVIDIA's processors (cuda.py), or for the one that we run on (scalar.py), which is how it is tested
where there is no other. No sum and product are contracted, quotients and roots are rounded to nearest, and sines or
exponentials do not occur in kernels.

Numbers of rows, offsets and switches are constants of the code, so a machine's code is that of one mesh.
"""

import hashlib
import re
from functools import cached_property
from typing import Any, NamedTuple

import llvmlite.binding as llvm
import numpy as np
from llvmlite import ir
from numba.core import config, types
from numba.core.registry import cpu_target

from seastar_gym.lanes import compile as compilation
from seastar_gym.lanes.pipeline import linked
from seastar_gym.lanes.registers import Form, Rows, absent, registers

N_LANES = 32
"""Robots in a row of memory: as many as threads that run in step."""
FORM = Form("device", registers, width=1, stride=N_LANES)
"""What robots share as they work, such as the list of contacts, each has for itself."""
I64, F64 = ir.IntType(64), ir.DoubleType()
POINTER = ir.PointerType(F64)
CONSTANT = {types.int64: I64, types.float64: F64, types.boolean: ir.IntType(8)}  # as numba passes them
DEFINITION = re.compile(r"^(define .*) \{$", re.MULTILINE)
"""Head of a function in LLVM's text: llvmlite 0.45 gives the attributes of a function to its result."""
ROBOT, ALL_ROBOTS = "swim_robot", "swim_robots"
GIVEN = ("times", "n_intervals", "shape")
"""Arguments of the code that every call has anew; the others are in memory, or constants."""


class Operand(NamedTuple):
    """What a kernel gets in one place: an offset in the robots' own memory or in the shared one, a constant, or one of
    GIVEN. kind: "own", "shared", "constant" or "given"."""

    kind: str
    value: Any
    type: Any


class Memory:
    """Where rows of robots lie in one array (n_groups, n_rows, N_LANES), and numbers that all share in another.

    rows: Rows of everything that robots own, by dotted name. shared: Numbers of everything else, by name.
    """

    def __init__(self) -> None:
        self.rows: dict[str, slice] = {}
        self.shared: dict[str, slice] = {}
        self.n_rows = self.n_shared = 0

    def place(self, name: str, count: int, own: bool) -> Operand:
        """Give `count` rows of robots, or shared numbers, a place."""
        if own:
            self.rows[name] = slice(self.n_rows, self.n_rows + count)
            self.n_rows += count
            return Operand("own", self.rows[name].start * N_LANES, None)
        self.shared[name] = slice(self.n_shared, self.n_shared + count)
        self.n_shared += count
        return Operand("shared", self.shared[name].start, None)


def leaves(bundle: Any, name: str) -> list[tuple[str, np.ndarray]]:
    """Arrays of a bundle by dotted name, in the order of its fields."""
    if isinstance(bundle, np.ndarray):
        return [(name, bundle)]
    if hasattr(bundle, "_fields"):
        return [leaf for field in bundle._fields for leaf in leaves(getattr(bundle, field), f"{name}.{field}")]
    return []


class Program:
    """The code of a kernel that advances one robot, and the memory that it works in.

    kernel: One that returns nothing. bundles: What it gets, by the name
    of its argument: named tuples of arrays, of numbers and of None. Arrays of shape (rows,) are shared by all robots,
    those of shape (rows, any) are their own. memory: Names of bundles whose arrays are all their own.
    """

    def __init__(self, kernel: Any, bundles: dict[str, Any], memory: tuple[str, ...]):
        if config.DISABLE_JIT:
            raise RuntimeError('With NUMBA_DISABLE_JIT=1 nothing is compiled, and devices have no code: use "cpu".')
        self._kernel = kernel
        self.memory = Memory()
        self._operands: list[Operand] = []
        self._types = [self._describe(value, name, name in memory) for name, value in bundles.items()]

    def _describe(self, value: Any, name: str, own: bool) -> types.Type:
        """Numba's type of an argument, whose operands are noted in the order in which numba passes them."""
        if name in GIVEN:
            is_count = isinstance(value, int)
            shared = is_count or value.ndim == 1
            self._operands.append(Operand("given", name if shared else "own_shape", None))
            return types.int64 if is_count else Rows(FORM, shared)
        if isinstance(value, np.ndarray):
            is_own = own or value.ndim > 1
            self._operands.append(self.memory.place(name, len(value), is_own))
            return Rows(FORM, not is_own)
        if hasattr(value, "_fields"):
            fields = [self._describe(getattr(value, field), f"{name}.{field}", own) for field in value._fields]
            return types.containers.BaseTuple.from_types(fields, type(value))
        if value is None:
            return absent
        kind = _type_of_number(value)
        self._operands.append(Operand("constant", kind.cast_python_value(value), kind))
        return kind

    @cached_property
    def key(self) -> str:
        """Digest of all that the code depends on."""
        parts = (
            compilation.digest_of_this_process(),
            self._kernel.__name__,
            self._types,
            self._operands,
            self.memory.n_rows,
        )
        return hashlib.sha256(repr(parts).encode()).hexdigest()[:32]

    @cached_property
    def _linked(self) -> tuple[Any, llvm.ModuleRef]:
        """The kernel as numba types and lowers it, with all that it calls."""
        self._kernel.compile(tuple(self._types))
        return linked(self._kernel, tuple(self._types))

    def code(self, machine: llvm.TargetMachine, triple: str, add_entry: Any) -> llvm.ModuleRef:
        """Optimised code of a processor. add_entry: Adds the entry that calls ROBOT to a module of `ir`."""
        description, kernels = self._linked
        module = ir.Module()
        entry = add_entry(module, self._add_robot(module, description))
        joined = _parsed(str(module), triple, machine)
        # Calls would pass the fifty pointers of rods and work through memory: rare kernels are inlined, too.
        inlined = DEFINITION.sub(r"\1 alwaysinline {", str(kernels).replace(" noinline", " alwaysinline"))
        joined.link_in(_parsed(inlined, triple, machine))
        for function in joined.functions:
            if not (function.is_declaration or function.name == entry):
                function.linkage = "internal"
        joined.verify()
        options = llvm.create_pipeline_tuning_options(speed_level=3)
        options.loop_vectorization = options.slp_vectorization = False
        builder = llvm.create_pass_builder(machine, options)
        builder.getModulePassManager().run(joined, builder)
        return joined

    def _add_robot(self, module: ir.Module, description: Any) -> ir.Function:
        """ROBOT(own, shared, times, n_intervals, shape, group's numbers of shape, robot) advances one robot."""
        calls = cpu_target.target_context.call_conv
        callee_type = calls.get_function_type(description.restype, description.argtypes)
        callee = ir.Function(module, callee_type, description.llvm_func_name)
        robot = ir.Function(module, ir.FunctionType(ir.VoidType(), [*PARAMETERS, I64]), ROBOT)
        robot.attributes.add("alwaysinline")
        own, shared, times, n_intervals, shape, per_group, index = robot.args
        for pointer in (own, shared, times, shape):
            pointer.add_attribute("noalias")
        build = ir.IRBuilder(robot.append_basic_block())
        group, lane = build.udiv(index, I64(N_LANES)), build.urem(index, I64(N_LANES))
        mine = build.gep(own, [build.add(build.mul(group, I64(self.memory.n_rows * N_LANES)), lane)])
        own_shape = build.gep(shape, [build.add(build.mul(group, per_group), lane)])
        given = {"times": times, "n_intervals": n_intervals, "shape": shape, "own_shape": own_shape}
        base = {"own": mine, "shared": shared}
        arguments = [
            given[value] if kind == "given"
            else ir.Constant(CONSTANT[number], int(value) if number is types.boolean else value) if kind == "constant"
            else build.gep(base[kind], [I64(value)])
            for kind, value, number in self._operands
        ]  # fmt: skip
        result, failure = (build.alloca(pointer.pointee) for pointer in callee_type.args[:2])
        build.call(callee, [result, failure, *arguments])
        build.ret_void()
        return robot


PARAMETERS = [POINTER, POINTER, POINTER, I64, POINTER, I64]
"""Own memory, shared memory, times, number of intervals, shape, and numbers of the shape of a group of robots."""


def _type_of_number(value: Any) -> Any:
    if isinstance(value, bool | np.bool_):
        return types.boolean
    return types.int64 if isinstance(value, int | np.integer) else types.float64


def _parsed(code: str, triple: str, machine: llvm.TargetMachine) -> llvm.ModuleRef:
    """Code of LLVM for another processor than the one that it names."""
    lines = (line for line in code.splitlines() if not line.startswith(("target triple", "target datalayout")))
    module = llvm.parse_assembly("\n".join(lines))
    module.triple, module.data_layout = triple, str(machine.target_data)
    return module
