"""The kernels on an NVIDIA GPU, one robot per thread; its arrays are CuPy's.

LLVM makes the portable code (PTX) that the processor's own driver turns into machine code, and keeps: no compiler of
CUDA is needed. What a driver makes of it rounds as we do, see device.py.
"""

from importlib.util import find_spec
from typing import Any

import llvmlite.binding as llvm
import numpy as np
from llvmlite import ir
from numba.core.compiler_lock import global_compiler_lock

from seastar_gym.lanes.compile import kept_code
from seastar_gym.lanes.device import ALL_ROBOTS, I64, PARAMETERS, Program

TRIPLE, ARCHITECTURE, VERSION = "nvptx64-nvidia-cuda", "sm_70", "ptx70"  # drivers assemble it for newer
THREADS = 64
"""Threads of a block, a choice: 32 to 128 are alike."""
I32 = ir.IntType(32)
_LOADED: dict[tuple[str, int], Any] = {}


def ptx_of(program: Program, architecture: str = ARCHITECTURE) -> str:
    """The program in PTX, the assembly language of all of NVIDIA's processors."""
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    target = llvm.Target.from_triple(TRIPLE)
    machine = target.create_target_machine(architecture, f"+{VERSION}", opt=3)
    return str(machine.emit_assembly(program.code(machine, TRIPLE, _add_entry)))


def arrays() -> Any:
    """The module that makes arrays on the device (CuPy). ValueError without one, or without a GPU."""
    if find_spec("cupy") is None:
        raise ValueError('device="cuda" needs CuPy and an NVIDIA GPU: pip install "seastar-gym[gpu]".')
    try:
        import cupy

        cupy.cuda.runtime.getDeviceCount()
    except Exception as problem:  # a driver that is missing or too old, or a fork, has several ways to say so
        why = str(problem).partition("\n")[0].rstrip(".")
        raise ValueError(
            f'device="cuda" finds no NVIDIA GPU ({why}); processes that use one have to be spawned, not forked.'
        ) from None
    return cupy


@global_compiler_lock
def load(program: Program) -> Any:
    """The program as a function, see `run`."""
    from cupy.cuda import Device
    from cupy.cuda.function import Module

    key = program.key, int(Device())
    if key not in _LOADED:
        module = Module()
        module.load(kept_code(f"{program.key}-{ARCHITECTURE}.ptx", lambda: ptx_of(program).encode()))
        _LOADED[key] = module.get_function(ALL_ROBOTS)
    return _LOADED[key]


def run(code: Any, own: Any, shared: Any, times: Any, shape: Any, n_robots: int) -> None:
    """Advance robots through the intervals between `times`; arrays as in device.py, changed in place."""
    n_intervals, per_group, n = np.int64(times.size - 1), np.int64(shape[0].size), np.int64(n_robots)
    code((-(-n_robots // THREADS),), (THREADS,), (own, shared, times, n_intervals, shape, per_group, n))


def _add_entry(module: ir.Module, robot: ir.Function) -> str:
    """ALL_ROBOTS(..., n_robots) advances the robot whose number is that of the thread."""
    entry = ir.Function(module, ir.FunctionType(ir.VoidType(), [*PARAMETERS, I64]), ALL_ROBOTS)
    entry.calling_convention = "ptx_kernel"
    for pointer in entry.args[:3] + entry.args[4:5]:
        pointer.add_attribute("noalias")
    start, swim, end = (entry.append_basic_block(name) for name in ("start", "swim", "end"))
    build = ir.IRBuilder(start)
    names = (f"llvm.nvvm.read.ptx.sreg.{name}" for name in ("ctaid.x", "ntid.x", "tid.x"))
    registers = [ir.Function(module, ir.FunctionType(I32, []), name) for name in names]
    block, threads, thread = (build.zext(build.call(register, []), I64) for register in registers)
    index = build.add(build.mul(block, threads), thread)
    build.cbranch(build.icmp_unsigned("<", index, entry.args[-1]), swim, end)
    build = ir.IRBuilder(swim)
    build.call(robot, [*entry.args[:-1], index])
    build.branch(end)
    ir.IRBuilder(end).ret_void()
    return ALL_ROBOTS
