"""Functions that a bundle hands to kernels, such as the slopes of a force from a user's own file.

Numba's type of one is known by a digest of its code and of all that it names. So compiled code with it is found on disk
by other processes, and is not found once anything in it has changed, wherever the file stands and whatever its name.
"""

import hashlib
from collections.abc import Callable
from functools import cache
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np
from numba.core import types
from numba.core.datamodel import models
from numba.core.errors import NumbaError
from numba.core.registry import CPUDispatcher
from numba.extending import NativeValue, register_model, unbox

from seastar_gym.lanes.compile import kernel
from seastar_gym.lanes.registers import PLAIN, Lanes, Rows

PACKAGE = "seastar_gym."
KERNELS: dict[str, Callable] = {}
"""Kernels of this process by digest."""


class HandedType(types.Callable, types.Opaque):
    """Numba's type of a function that a bundle holds."""

    def __init__(self, digest):
        self.digest = digest
        super().__init__(f"Handed({digest})")

    def get_call_type(self, context, args, kws):
        template, pysig, args, kws = KERNELS[self.digest].get_call_template(args, kws)
        found = template(context).apply(args, kws)
        return None if found is None else found.replace(pysig=pysig)

    def get_call_signatures(self):
        return KERNELS[self.digest].nopython_signatures, True

    def get_impl_key(self, sig):
        return KERNELS[self.digest].get_overload(sig.args)


register_model(HandedType)(models.OpaqueModel)


@unbox(HandedType)
def _unboxed(kind, value, frame):
    return NativeValue(frame.context.get_dummy_value())


class Handed:
    """A kernel as a member of a bundle."""

    def __init__(self, function: Callable, digest: str):
        self._kernel, self._numba_type_ = function, HandedType(digest)
        KERNELS.setdefault(digest, function)

    def __call__(self, *arguments: Any) -> Any:
        return self._kernel(*arguments)


@cache
def compiled(function: Callable) -> Callable:
    """A function on lanes as a kernel that other kernels may call; one that is a kernel already as it is."""
    return function if isinstance(function, CPUDispatcher) else kernel(function)


def handed(function: Callable) -> Callable:
    """A kernel as a member of a bundle; with NUMBA_DISABLE_JIT=1 the function that it is."""
    return Handed(function, code_digest(function)) if isinstance(function, CPUDispatcher) else function


def require_compiled(name: str, function: Callable) -> None:
    """ValueError, in one sentence, where a kernel of (rows, row, lanes, lanes) does not compile."""
    if not isinstance(function, CPUDispatcher):
        return
    try:
        function.compile((Rows(PLAIN, shared=True), types.intp, Lanes(PLAIN), Lanes(PLAIN)))
    except NumbaError as failure:
        lines = [line.strip() for line in str(failure).splitlines()]
        why = next(line for line in lines if line and not line.startswith("Failed in "))
        raise ValueError(f"{name} does not compile: {' '.join(why.split()).rstrip('.:')}.") from failure


def _python(function: Any) -> Any:
    return getattr(function, "py_func", function)


def _named(function: FunctionType) -> dict[str, Any]:
    """What a function names of its module and of those around it, and members that it names of modules."""
    names = {name for code in _codes(function.__code__) for name in code.co_names}
    found = {name: function.__globals__[name] for name in sorted(names & set(function.__globals__))}
    for cell, name in zip(function.__closure__ or (), function.__code__.co_freevars, strict=True):
        found[name] = cell.cell_contents
    of_modules = {
        f"{name}.{member}": getattr(module, member)
        for name, module in found.items() if isinstance(module, ModuleType)
        for member in sorted(names) if hasattr(module, member)
    }  # fmt: skip
    return found | of_modules


def _codes(code: CodeType) -> list[CodeType]:
    inner = [each for each in code.co_consts if isinstance(each, CodeType)]
    return [code, *(part for each in inner for part in _codes(each))]


def code_digest(function: Callable) -> str:
    """Hexadecimal digest of a function's code and of all functions and numbers that it names, at any depth.

    What the package defines at the top of a file has its name alone: its files have a digest of their own.
    """
    digest, seen = hashlib.sha256(), set()

    def add(name: str, value: Any) -> None:
        value = _python(value)
        digest.update(f"{name}\0{type(value).__name__}\0".encode())
        if isinstance(value, FunctionType) and (value.__closure__ or not value.__module__.startswith(PACKAGE)):
            if value in seen:
                return
            seen.add(value)
            for code in _codes(value.__code__):
                plain = [each for each in code.co_consts if not isinstance(each, CodeType)]
                digest.update(code.co_code + repr((plain, code.co_names, code.co_varnames)).encode())
            for inner, each in _named(value).items():
                add(inner, each)
        elif isinstance(value, np.ndarray):
            digest.update(repr((value.dtype.str, value.shape)).encode() + value.tobytes())
        elif isinstance(value, int | float | complex | str | tuple | type(None)):
            digest.update(repr(value).encode())
        else:
            digest.update(f"{getattr(value, '__module__', '')}.{getattr(value, '__qualname__', name)}".encode())

    add("", function)
    return digest.hexdigest()[:32]
