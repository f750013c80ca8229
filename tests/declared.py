"""What a room declares: defaults of public functions and classes, and public constants, as they were recorded.

Whoever leaves an argument out relies on its default, and whoever repeats a result on the constants behind it. Where one
is to change: change its line in declared.json, too, and CHANGELOG.md.
"""

import ast
import importlib
import inspect
import json
import pkgutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

RECORDED = Path(__file__).parent / "declared.json"


def assert_declared_as_recorded(room: str) -> None:
    """Assert that a package declares what the file says, number by number."""
    recorded = json.loads(RECORDED.read_text(encoding="utf-8")) if RECORDED.exists() else {}
    if room not in recorded:
        recorded[room] = declared(room)
        RECORDED.write_text(json.dumps(recorded, indent=1, sort_keys=True) + "\n", encoding="utf-8")
        pytest.fail(f"{room} is recorded: look at it.")
    ours, theirs = declared(room).items(), recorded[room].items()
    assert ours == theirs, f"declared {sorted(ours - theirs)}, recorded {sorted(theirs - ours)}"


def declared(room: str) -> dict[str, str]:
    """Defaults and constants of a package by their names, as text, but for classes, functions and paths."""
    package = importlib.import_module(room)
    inside = [name for _, name, _ in pkgutil.walk_packages(package.__path__, f"{room}.") if "__main__" not in name]
    names = [room, *inside]
    found = {
        f"{name.removeprefix(room).strip('.')}.{entry}": repr(getattr(value, "tolist", lambda value=value: value)())
        for name in names
        for entry, value in _of_module(importlib.import_module(name))
    }
    return {name: text for name, text in found.items() if "<" not in text and "Path(" not in text}


def _of_module(module: Any) -> Iterator[tuple[str, Any]]:
    for statement in ast.parse(inspect.getsource(module)).body:
        targets = getattr(statement, "targets", [getattr(statement, "target", None)])
        constants = [name.id for target in targets for name in ast.walk(target or ast.Pass()) if hasattr(name, "id")]
        yield from ((name, getattr(module, name)) for name in constants if name.isupper() and name[0] != "_")
        if isinstance(statement, ast.FunctionDef) and statement.name[0] != "_":
            yield from _defaults(statement.name, getattr(module, statement.name))
        elif isinstance(statement, ast.ClassDef):
            yield from _of_class(getattr(module, statement.name))


def _of_class(kind: type) -> Iterator[tuple[str, Any]]:
    for name, method in vars(kind).items():
        function = getattr(method, "__func__", method)
        if inspect.isfunction(function) and (name == "__init__" or name[0] != "_"):
            yield from _defaults(kind.__name__ if name == "__init__" else f"{kind.__name__}.{name}", function)


def _defaults(name: str, function: Any) -> Iterator[tuple[str, Any]]:
    for parameter in inspect.signature(function).parameters.values():
        if parameter.default is not parameter.empty:
            yield f"{name}({parameter.name})", parameter.default
