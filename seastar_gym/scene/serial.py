"""Scenes as plain data: numbers, texts, lists and dicts that any JSON library can write and read.

    data = json.loads(json.dumps(scene.to_dict()))
    assert Scene.from_dict(data) == scene  # to the last bit

A part of a scene is a dict of its `kind` and its constructor's arguments. Those that nobody named, so that a fidelity
chooses them, are None. Arguments that are left out have their defaults. A tuple is a list, and numbers of each robot
are a kind of their own. The outermost dict also has the `version` of this form. What could not be read back is refused
when it is written. Reading constructs parts of registered classes only: it evaluates no text and imports nothing.

Summaries fit a screen: a part as a line of Python, and a scene as a table for notebooks.
"""

import html
import inspect
import json
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import MISSING, Field, fields, is_dataclass
from typing import Any, TypeVar

import numpy as np

from seastar_gym.scene.checks import is_finite_number, require_few, require_unmasked, shown
from seastar_gym.scene.number import MOST_ENTRIES, PerRobot, Unnamed, declared

VERSION = 1
"""Version of the plain form."""
DEEPEST = 32
"""Largest depth of nested lists and dicts that is read."""

Part = TypeVar("Part")

KINDS: dict[str, type] = {}
"""Registered classes by name. They are written by the arguments of their constructors."""
FROM_FILES = {"<run_path>"}
"""Modules that scenes' files were run as. Another file may have a class of the same name: the last one counts."""
COLLECTIONS: dict[str, type] = {"per robot": PerRobot, "mapping": dict}
"""Classes that are written by their items. Items of a dict are pairs, since JSON libraries may sort its names."""


def register_part(kind: type[Part]) -> type[Part]:
    """Register a class, such as an actuator of your own, so that scenes with it can be written and read. A decorator.

    The class must keep its constructor's arguments as attributes of the same names and compare by value, as a dataclass
    does. The arguments may be numbers, texts, None, tuples of at most MOST_ENTRIES, dicts and parts of registered
    classes. The class must be registered before a scene with it is read.
    """
    known = KINDS.setdefault(kind.__name__, kind)
    is_same = (known.__module__, known.__qualname__) == (kind.__module__, kind.__qualname__)
    if not (is_same or {known.__module__, kind.__module__} <= FROM_FILES):
        raise ValueError(f"There is a part of the name {kind.__name__} already: give this class another one.")
    KINDS[kind.__name__] = kind
    return kind


def _arguments(kind: type) -> list[str]:
    return list(inspect.signature(kind).parameters)


def to_dict(part: Any) -> dict[str, Any]:
    """Plain data of a part. ValueError if it could not be read back unchanged."""
    name = type(part).__name__
    data = {"version": VERSION, **_written(part, name)}
    if from_dict(data, type(part)) != part:
        raise ValueError(f"{name} could not be read back as it is: its parts have to compare by value.")
    return data


def _written(value: Any, where: str) -> Any:
    kind = type(value).__name__
    if KINDS.get(kind) is type(value):
        missing = [name for name in _arguments(type(value)) if not hasattr(value, name)]
        if missing:
            raise ValueError(f"{where} could not be read back: a {kind} keeps no {', '.join(missing)}.")
        fields = {name: getattr(value, name) for name in _arguments(type(value))}
        return {"kind": kind, **{name: _written(one, f"{where}.{name}") for name, one in fields.items()}}
    match value:
        case Unnamed():
            return None
        case None | bool() | str():
            return value
        case np.bool_():
            return bool(value)
        case int() | np.integer():
            return int(value)
        case float():
            return float(value)
        case PerRobot():
            return {"kind": "per robot", "items": _written_items(value, where)}
        case Mapping():
            return {"kind": "mapping", "items": _written_items(tuple(value.items()), where)}
        case tuple():
            return _written_items(value, where)
        case np.floating():
            raise ValueError(f"{where} is a {kind}, which computes to another precision: make it a float.")
    raise ValueError(
        f"{where} is a {kind}, which could not be read back: use a part of seastar_gym, or register the class of yours "
        "with the decorator seastar_gym.register_part."
    )


def has_own_kinds(part: Any) -> bool:
    """Whether a part has any of a class from outside the package, which a process has to import before it is read."""
    kinds = re.findall(r'"kind": "(\w+)"', json.dumps(to_dict(part)))
    return not all(KINDS[kind].__module__.startswith("seastar_gym.") for kind in {*kinds} & {*KINDS})


def _written_items(values: tuple[Any, ...], where: str) -> list[Any]:
    if set(map(type, values)) == {float}:
        return list(values)
    return [_written(value, f"{where}[{k}]") for k, value in enumerate(values)]


def read(part: Part | Mapping[str, Any], kind: type[Any]) -> Part:
    """Part that was given as an object or in plain form."""
    return from_dict(part, kind) if isinstance(part, Mapping) else part


def from_dict(data: object, kind: type[Part]) -> Part:
    """Part of the plain data that `to_dict` returned, in any mappings and sequences. ValueError for anything else."""
    if not isinstance(data, Mapping) or "version" not in data:
        raise ValueError(f"A plain {kind.__name__} is a dict with a version, as to_dict writes it, not {shown(data)}.")
    version = data["version"]
    if type(version) is not int or version != VERSION:
        raise ValueError(f"A plain {kind.__name__} of version {shown(version)} cannot be read here, only of {VERSION}.")
    part = _read({name: value for name, value in data.items() if name != "version"}, kind.__name__)
    if not isinstance(part, kind):
        raise ValueError(f"This is a plain {type(part).__name__}, not a {kind.__name__}.")
    return part


def _read(value: object, where: str, depth: int = 0) -> Any:
    if depth > DEEPEST:
        raise ValueError(f"{where.split('.')[0]} is nested too deeply: more than {DEEPEST} levels.")
    require_unmasked(where, value)
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    match value:
        case None | bool() | str():
            return value
        case int() | float() if abs(value) <= sys.float_info.max:
            return value
        case list() if set(map(type, value)) <= {int, float} and all(map(is_finite_number, value)):
            return tuple(value)  # of numbers, as many as there are robots
        case Sequence() if not isinstance(value, bytes | bytearray | memoryview):
            require_few(where, value, MOST_ENTRIES)
            return tuple(_read(one, f"{where}[{k}]", depth + 1) for k, one in enumerate(value))
        case {"kind": str(kind), **fields} if kind in KINDS:
            return _read_part(kind, fields, where, depth)
        case {"kind": str(kind), "items": [*items], **others} if kind in COLLECTIONS and not others:
            return _made(COLLECTIONS[kind], where, _read(items, where, depth + 1))
        case {"kind": kind}:
            raise ValueError(
                f"{where} is of the kind {shown(kind)}, which is not known: a class of your own has to be registered "
                "with seastar_gym.register_part before it is read, in a shell by the Python file that --scene names."
            )
    raise ValueError(f"{where} must be a finite number, a text, a list or a part with its kind, not {shown(value)}.")


def _read_part(kind: str, fields: dict[Any, object], where: str, depth: int) -> Any:
    parameters = inspect.signature(KINDS[kind]).parameters
    names = list(parameters)
    unknown = [name for name in fields if name not in names]
    missing = [name for name in names if name not in fields and parameters[name].default is inspect.Parameter.empty]
    if unknown or missing:
        problem = f"says {shown(unknown[0])}, which no {kind} has" if unknown else f"does not say {shown(missing[0])}"
        raise ValueError(f"{where} {problem}: a {kind} is written with {', '.join(names) or 'nothing'}.")
    values = {name: _read(fields[name], f"{where}.{name}", depth + 1) for name in names if name in fields}
    return _made(KINDS[kind], where, **values)


def _made(kind: type, where: str, *arguments: Any, **fields: Any) -> Any:
    try:
        return kind(*arguments, **fields)
    except (TypeError, ArithmeticError) as unfit:
        raise ValueError(f"{where} is no {kind.__name__}: {' '.join(str(unfit).split()).rstrip('.')}.") from unfit


Term = TypeVar("Term")

FUNCTIONS = "energy", "dissipation"
"""What a term may have, at least one of them."""


def register_term(kind: type[Term]) -> type[Term]:
    """Register a force of your own on the nodes of limbs, for `Scene(terms=(kind(...),))`. A decorator.

    The class is a frozen dataclass, as for `register_part`, and has

    coefficients(self, mesh): One number per node, shape (n_nodes,), or a tuple of such. `mesh.dl` is the length of
        every node [m], `mesh.per_node(mesh.at_nodes.width)` its diameter [m]; see seastar_gym/rods/star.py.
    dissipation(c, wx, wy): Static; a convex dissipation potential D [W] of a node's velocity relative to the water
        [m/s], least at rest. The force is -grad D.
    energy(c, x, y): Static; the energy U [J] of a node at (x, y) [m]. The force is -grad U.

    One of the two is enough. Each returns (value, (slope in the first, in the second number), (second slopes xx, xy,
    yy)) of c, a node's coefficients as `coefficients` gives them, with the operators and functions of
    seastar_gym/lanes/registers.py alone; other functions that it calls are kernels (seastar_gym/lanes/compile.py).
    isotropic = True in the class tells wrappers of symmetry that turns and mirrors do not change it.
    """
    has = [name for name in FUNCTIONS if callable(getattr(kind, name, None))] if isinstance(kind, type) else []
    if not (has and callable(getattr(kind, "coefficients", None)) and is_dataclass(kind)):
        raise ValueError(
            f"A term is a frozen dataclass with coefficients(self, mesh) and a static energy(c, x, y) or "
            f"dissipation(c, wx, wy), or both, which {shown(kind)} is not."
        )
    for name in has:
        if not isinstance(vars(kind).get(name, None), staticmethod | None):
            raise ValueError(f"{kind.__name__}.{name} must be a staticmethod: compiled code has no self.")
    return register_part(kind)


def is_term(value: Any) -> bool:
    """Whether a value is of a class that `register_term` has registered."""
    kind = type(value)
    return KINDS.get(kind.__name__) is kind and any(hasattr(kind, name) for name in FUNCTIONS)


def short_repr(part: Any) -> str:
    """Call that makes a part, without arguments that have their defaults; values are cut where they are long."""
    if isinstance(part, tuple) and part and all(map(is_dataclass, part)):
        inner = [short_repr(one) for one in part]
        return f"({inner[0]},) * {len(part)}" if len(part) > 1 and len(set(inner)) == 1 else f"({', '.join(inner)},)"
    if not is_dataclass(part) or isinstance(part, type):
        return shown(part)
    named = [each.name for each in fields(part) if each.compare and not _is_usual(part, each)]
    return f"{type(part).__name__}({', '.join(f'{name}={short_repr(getattr(part, name))}' for name in named)})"


def _is_usual(part: Any, each: Field[Any]) -> bool:
    """Whether a field has its default, or a value that nobody named."""
    value = getattr(part, each.name)
    usual = each.default if each.default_factory is MISSING else each.default_factory()
    return isinstance(value, Unnamed) or bool(value == usual)


def html_table(title: str, heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table as HTML, with a title."""

    def line(cells: Sequence[str], tag: str) -> str:
        style = ' style="text-align: left; vertical-align: top"'
        return "<tr>" + "".join(f"<{tag}{style}>{html.escape(cell)}</{tag}>" for cell in cells) + "</tr>"

    lines = [line(heads, "th"), *(line(row, "td") for row in rows)]
    return f"<table><caption>{html.escape(title)}</caption>{''.join(lines)}</table>"


def scene_html(scene: Any) -> str:
    """Parts of a scene with all numbers that are set, and their units, as a table."""
    rows = [(each.name, *_kind_and_numbers(getattr(scene, each.name))) for each in fields(scene)]
    return html_table(type(scene).__name__, ("part", "kind", "numbers"), [row for row in rows if row[2]])


def _kind_and_numbers(part: Any) -> tuple[str, str]:
    if not is_dataclass(part):
        return "", "" if part in (None, ()) else short_repr(part)
    units = {name: each.number.unit for name, each in declared(part.__class__).items()}
    values = {each.name: getattr(part, each.name) for each in fields(part) if each.compare}
    return type(part).__name__, ", ".join(
        f"{name} {short_repr(value)}" + (f" {units[name]}" if units.get(name, "1") != "1" else "")
        for name, value in values.items() if value is not None and value != ()
    )  # fmt: skip
