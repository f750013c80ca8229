"""The kernels as plain Python, beside the compiled ones: to be called one by one, stepped through, counted.

    der = plain_kernels()
    potential, c_speed, c_over_speed = der.drag.drag_slopes(Lanes(0.3), Lanes(wx), Lanes(wy))
"""

import importlib
import pkgutil
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from seastar_gym.der import numpy_lanes
from seastar_gym.der.lanes import N_LANES

DER = "seastar_gym.der"
FOLDER = Path(__file__).parent


def _module(name: str, **contents: Any) -> ModuleType:
    module = ModuleType(f"{DER}.{name}" if name else DER)
    vars(module).update(contents)
    return module


def plain_kernels(n_lanes: int = N_LANES, folder: Path = FOLDER, **functions: Callable) -> Any:
    """The package `der` once more, its modules as attributes, with plain functions on numpy_lanes.py for kernels.

    n_lanes: Number of robots in a row of memory. folder: Source of the kernels. functions: Of the interface that
    numpy_lanes.py describes, those that are replaced by other ones.
    """
    interface = {name: getattr(numpy_lanes, name) for name in numpy_lanes.FUNCTIONS} | functions
    lanes = _module("lanes", N_LANES=n_lanes, **interface)
    compilation = _module(
        "compilation", kernel=_as_it_is, inlined_kernel=_as_it_is, entry_point=np.errstate(all="ignore")
    )
    package = _module("", __path__=[str(folder)], lanes=lanes, compilation=compilation)
    own = {name: module for name, module in sys.modules.items() if f"{name}.".startswith(f"{DER}.")}
    for name in own:
        del sys.modules[name]
    sys.modules.update({DER: package, lanes.__name__: lanes, compilation.__name__: compilation})
    try:
        for module in pkgutil.iter_modules([str(folder)]):
            importlib.import_module(f"{DER}.{module.name}")
    finally:
        for name in [name for name in sys.modules if f"{name}.".startswith(f"{DER}.")]:
            del sys.modules[name]
        sys.modules.update(own)
    return package


def _as_it_is(function: Callable) -> Callable:
    return function
