"""The kernels of `der` once more, on other lanes: their modules are loaded again, beside those that are there."""

import importlib
import importlib.util
import pkgutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

from numba.core.compiler_lock import global_compiler_lock

DER = "seastar_gym.der"
FOLDER = Path(__file__).parent.parent / "der"
WIDTH, LANES, COMPILATION = (f"{__package__}.{name}" for name in ("width", "lanes", "compilation"))


class KernelModules:
    """The modules of `der`, loaded on other lanes than those of `Simulator`, which stay what they are.

    given: Modules that they find in place of those of `simd`, by name. folder: Source of `der`.

    Called with a kernel, or with anything else that a module with kernels defines, it returns its own version.
    """

    def __init__(self, given: dict[str, ModuleType], folder: Path = FOLDER):
        self._modules = {DER: made_module(DER, __path__=[str(folder)]), **given}
        if LANES not in given:
            self._module_of(LANES)
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
        with global_compiler_lock:  # numba imports what its cache names
            own = dict(sys.modules)
            try:
                for name in self._names():
                    del sys.modules[name]
                sys.modules.update(self._modules)
                yield
                self._modules.update({name: sys.modules[name] for name in self._names()})
            finally:
                for name in self._names():
                    del sys.modules[name]
                sys.modules.update({name: module for name, module in own.items() if name not in sys.modules})

    def _names(self) -> list[str]:
        """Names of the modules, as far as they are loaded, that are there once for every kind of lanes."""
        return [name for name in list(sys.modules) if name in self._modules or f"{name}.".startswith(f"{DER}.")]


def made_module(name: str, **contents: Any) -> ModuleType:
    """A module of these contents."""
    module = ModuleType(name)
    vars(module).update(contents)
    return module
