"""The kernels as plain Python, beside the compiled ones: to be called one by one, stepped through, counted.

    potential, c_speed, c_over_speed = drag_slopes.plain(Lanes(0.3), Lanes(wx), Lanes(wy))

The modules of `der` are loaded a second time, on numpy_lanes.py and without a compiler.
"""

import importlib
import importlib.util
import pkgutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from seastar_gym.simd import numpy_lanes
from seastar_gym.simd.lanes import N_LANES

DER = "seastar_gym.der"
FOLDER = Path(__file__).parent.parent / "der"
LANES, COMPILATION = f"{__package__}.lanes", f"{__package__}.compilation"
KEPT = (__name__, numpy_lanes.__name__)  # modules without kernels: one of each is enough


class PlainKernels:
    """The kernels once more, as plain functions; the compiled ones stay what they are.

    n_lanes: Number of robots in a row of memory. folder: Source of `der`. functions: Replacements for functions of the
    interface that numpy_lanes.py describes, by name.

    Called with a kernel, or with anything else that a module with kernels defines, it returns its own version.
    """

    def __init__(self, n_lanes: int = N_LANES, folder: Path = FOLDER, **functions: Callable):
        interface = {name: getattr(numpy_lanes, name) for name in numpy_lanes.FUNCTIONS} | functions
        quiet = np.errstate(all="ignore")  # as machine code is where it divides by zero
        self._modules = {
            DER: _module(DER, __path__=[str(folder)]),
            LANES: _module(LANES, N_LANES=n_lanes, **interface),
            COMPILATION: _module(COMPILATION, kernel=_itself, inlined_kernel=_itself, entry_point=quiet),
        }
        with self._in_place():
            for module in pkgutil.walk_packages([str(folder)], f"{DER}."):
                importlib.import_module(module.name)

    def __call__(self, kernel: Any) -> Any:
        return getattr(self._module_of(kernel.__module__), kernel.__name__)

    def _module_of(self, name: str) -> ModuleType:
        """The module of that name; one from outside `der` is loaded when it is asked for."""
        if name not in self._modules:
            spec = importlib.util.find_spec(name)
            assert spec is not None and spec.loader is not None
            module = importlib.util.module_from_spec(spec)
            with self._in_place():
                spec.loader.exec_module(module)
            self._modules[name] = module
        return self._modules[name]

    @contextmanager
    def _in_place(self) -> Iterator[None]:
        """Let imports find these modules in place of the compiled ones, and keep those that are found."""
        own = dict(sys.modules)
        for name in _names_of_kernels():
            del sys.modules[name]
        sys.modules.update(self._modules)
        try:
            yield
            self._modules.update({name: sys.modules[name] for name in _names_of_kernels()})
        finally:
            for name in _names_of_kernels():
                del sys.modules[name]
            sys.modules.update({name: module for name, module in own.items() if name not in sys.modules})


def _module(name: str, **contents: Any) -> ModuleType:
    module = ModuleType(name)
    vars(module).update(contents)
    return module


def _itself(function: Callable) -> Callable:
    return function


def _names_of_kernels() -> list[str]:
    """Names of the modules, as far as they are loaded, that are there once for every kind of lanes."""
    return [
        name
        for name in sys.modules
        if name in (LANES, COMPILATION) or (f"{name}.".startswith(f"{DER}.") and name not in KEPT)
    ]


@cache
def plain_kernels() -> PlainKernels:
    """The kernels on N_LANES robots, loaded when first asked for."""
    return PlainKernels()
