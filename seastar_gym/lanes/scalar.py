"""The code for graphics processors on the processor that we run on: one robot after the other, by numpy's arrays.

It is slow, and there for tests: what this gives to the last bit, a graphics processor does.
"""

import ctypes
import hashlib
from functools import partial
from typing import Any

import llvmlite.binding as llvm
import numpy as np
from llvmlite import ir
from numba.core.compiler_lock import global_compiler_lock

from seastar_gym.lanes.compile import kept_code
from seastar_gym.lanes.device import ALL_ROBOTS, I64, PARAMETERS, Program

_LOADED: dict[str, Any] = {}


def arrays() -> Any:
    """The module that makes this processor's arrays."""
    return np


@global_compiler_lock
def load(program: Program) -> Any:
    """The program as a function, see `run`."""
    if program.key not in _LOADED:
        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        features = llvm.get_host_cpu_features().flatten()
        name = llvm.get_host_cpu_name()
        machine = llvm.Target.from_default_triple().create_target_machine(name, features, opt=3, jit=True)
        made = partial(program.code, machine, llvm.get_process_triple(), _add_loop)
        of_processor = hashlib.sha256(features.encode()).hexdigest()[:8]
        code = kept_code(f"{program.key}-{name}-{of_processor}.o", lambda: machine.emit_object(made()))
        engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
        engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        engine.finalize_object()
        pointer, count = ctypes.c_void_p, ctypes.c_int64
        kind = ctypes.CFUNCTYPE(None, pointer, pointer, pointer, count, pointer, count, count)
        _LOADED[program.key] = engine, kind(engine.get_function_address(ALL_ROBOTS))
    return _LOADED[program.key][1]


def run(code: Any, own: Any, shared: Any, times: Any, shape: Any, n_robots: int) -> None:
    """Advance robots through the intervals between `times`; arrays as in device.py, changed in place."""
    code(
        own.ctypes.data, shared.ctypes.data, times.ctypes.data, times.size - 1, shape.ctypes.data,
        shape[0].size, n_robots,
    )  # fmt: skip


def _add_loop(module: ir.Module, robot: ir.Function) -> str:
    """ALL_ROBOTS(..., n_robots) advances one robot after the other."""
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), [*PARAMETERS, I64]), ALL_ROBOTS)
    start, loop, end = (function.append_basic_block(name) for name in ("start", "loop", "end"))
    ir.IRBuilder(start).branch(loop)
    build = ir.IRBuilder(loop)
    index = build.phi(I64)
    build.call(robot, [*function.args[:-1], index])
    following = build.add(index, I64(1))
    index.add_incoming(I64(0), start)
    index.add_incoming(following, loop)
    build.cbranch(build.icmp_unsigned("<", following, function.args[-1]), loop, end)
    ir.IRBuilder(end).ret_void()
    return ALL_ROBOTS
