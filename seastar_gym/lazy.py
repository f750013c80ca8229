"""Names of a package that are imported when somebody asks for them (PEP 562): a policy swims without a compiler."""

import ast
import sys
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import Any


def lazily(package: str) -> tuple[list[str], Callable[[str], Any], Callable[[], list[str]]]:
    """`__all__`, `__getattr__` and `__dir__` of a package, whose modules are its attributes, too.

    Its names are those that it imports for type checkers, below `if TYPE_CHECKING:`. A module that has the name of what
    it holds, such as `controllers.scripted`, is no attribute, whoever imports it first.
    """
    module = sys.modules[package]
    homes = _imported_for_type_checkers(module.__loader__.get_source(package))  # type: ignore[union-attr]

    class Package(ModuleType):
        def __setattr__(self, name: str, value: Any) -> None:
            if not (name in homes and isinstance(value, ModuleType)):
                super().__setattr__(name, value)

    def get(name: str) -> Any:
        if name in homes:
            found = getattr(import_module(homes[name]), name)
        elif not name.startswith("_") and find_spec(f"{package}.{name}"):
            found = import_module(f"{package}.{name}")
        else:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        setattr(module, name, found)
        return found

    module.__class__ = Package
    return sorted(homes), get, lambda: sorted({*vars(module), *homes})


def _imported_for_type_checkers(source: str) -> dict[str, str]:
    """Modules of the names that a file imports below its one `if`."""
    (block,) = (node for node in ast.parse(source).body if isinstance(node, ast.If))
    lines = (node for node in block.body if isinstance(node, ast.ImportFrom))
    return {alias.name: str(line.module) for line in lines for alias in line.names}
