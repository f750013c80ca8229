"""Names that changed in this release: the old ones work until the next, with a DeprecationWarning that names the new.

One table for each sort of name, and one function that reads it. To take an old name away, take its line away.
"""

import functools
import inspect
import sys
import warnings
from collections.abc import Callable, Sequence
from importlib import import_module
from importlib.abc import Loader
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any, TypeVar

Class = TypeVar("Class", bound=type[Any])

MODULES: dict[str, str] = {
    "seastar_gym.controllers.foreign": "seastar_gym.controllers.third_party",
    "seastar_gym.controllers.learner_zip": "seastar_gym.controllers.checkpoint",
    "seastar_gym.controllers.roster": "seastar_gym.controllers.registry",
    "seastar_gym.sweep.cells": "seastar_gym.sweep.batches",
    "seastar_gym.sweep.frames": "seastar_gym.sweep.configurations",
    "seastar_gym.sweep.parts": "seastar_gym.sweep.result_files",
    "seastar_gym.sweep.pilots": "seastar_gym.sweep.controllers",
}
"""Modules of the package."""
NAMES: dict[str, str] = {
    "seastar_gym.Headings": "seastar_gym.envs.headings.HeadingTargets",
    "seastar_gym.controllers.in_the_box": "seastar_gym.controllers.learned.bundled_file",
    "seastar_gym.controllers.learned.in_the_box": "seastar_gym.controllers.learned.bundled_file",
    "seastar_gym.envs.headings.Headings": "seastar_gym.envs.headings.HeadingTargets",
    "seastar_gym.envs.symmetry.Recollection": "seastar_gym.envs.symmetry.FrameStack",
    "seastar_gym.envs.symmetry.VectorMemory": "seastar_gym.envs.symmetry.VectorFrameStack",
    "seastar_gym.gaits.in_time": "seastar_gym.gaits.timed",
    "seastar_gym.sweep.controllers.Course": "seastar_gym.sweep.controllers.Route",
    "seastar_gym.sweep.result_files.read_parts": "seastar_gym.sweep.result_files.read_results",
    "seastar_gym.sweep.run.Tally": "seastar_gym.sweep.run.Progress",
}
"""Classes and functions, by the modules that they are imported from."""
ARGUMENTS: dict[str, dict[str, str]] = {
    "HeadingTargets": {"asked": "target"},
    "SmaWires": {"deaf": "refractory"},
    "Sweep": {"course": "route"},
    "Options": {"ship": "publish", "ship_anyway": "publish_anyway"},  # of train.py, in the config.json of runs
}
"""Arguments of constructors by the name of the class, which are its attributes, too, and entries of its plain form."""
METHODS: dict[str, dict[str, str]] = {
    "ActuatorBase": {"can_be_deaf": "can_be_refractory", "deaf_wires": "refractory_wires"},
    "FrameStack": {"told": "features", "shown": "stacked"},
    "LearnedPolicy": {"recollection": "frame_stack"},
    "Setting": {"endures": "is_energy_stable"},
    "Simulator": {"deaf_wires": "refractory_wires"},
    "Sweep": {
        "cells": "batches",
        "n_cells": "n_batches",
        "frames": "configurations",
        "frame": "configuration",
        "n_frames": "n_configurations",
        "designs_per_frame": "designs_per_configuration",
    },
    "Swimming": {"_wanted": "_task_observation", "_score": "_reward_terms", "_goal_facts": "_task_info"},
    "VectorFrameStack": {"recollection": "frame_stack"},
}
"""Methods and properties by the name of the class, also where a class derived from it defines them."""
KINDS: dict[str, str] = {"Headings": "HeadingTargets"}
"""Parts in their plain form."""
OPTIONS: dict[str, str] = {"--ship": "--publish", "--ship-anyway": "--publish-anyway"}
"""Options of commands."""
POLICIES: dict[str, str] = {"seastar": "strokes", "seastar-0.2s": "timed-0.2s", "seastar-0.5s": "timed-0.5s"}
"""Bundled policies."""


def warn(old: str, new: str, stacklevel: int = 3) -> None:
    """Tell who calls the caller of this that a name has changed."""
    sentence = f"{old} is called {new} now: the old name works until the next release."
    warnings.warn(sentence, DeprecationWarning, stacklevel)


def attribute(module: str, name: str) -> Any:
    """What a module once had by this name. AttributeError where it never had."""
    new = NAMES.get(f"{module}.{name}")
    if new is None:
        raise AttributeError(f"module {module!r} has no attribute {name!r}")
    warn(f"{module}.{name}", new, 4)
    home, _, present = new.rpartition(".")
    return getattr(import_module(home), present)


def names_of(module: str) -> Callable[[str], Any]:
    """The `__getattr__` of a module that has old names."""
    return functools.partial(attribute, module)


def option(argument: str) -> str:
    """The argument of a command line by its present name."""
    name, equals, value = argument.partition("=")
    if name not in OPTIONS:
        return argument
    warn(name, OPTIONS[name])
    return OPTIONS[name] + equals + value


def options(arguments: Sequence[str]) -> list[str]:
    """Arguments of a command line with the present names of its options."""
    return [option(argument) for argument in arguments]


def policy(name: str) -> str:
    """Present name of a bundled policy."""
    if name not in POLICIES:
        return name
    warn(f"The policy {name}", POLICIES[name])
    return POLICIES[name]


def arguments(kind: Class) -> Class:
    """Have a class take the old names of its arguments. A decorator."""
    old = ARGUMENTS.get(kind.__name__)
    if not old:
        return kind
    construct: Callable[..., None] = vars(kind)["__init__"]

    @functools.wraps(construct)
    def with_old_names(self: Any, *given: Any, **named: Any) -> None:
        for before, now in old.items():
            if before in named:
                warn(f"{kind.__name__}({before}=...)", f"{kind.__name__}({now}=...)")
                named[now] = named.pop(before)
        construct(self, *given, **named)

    setattr(kind, "__init__", with_old_names)  # noqa: B010 - mypy knows no class of which to replace it
    for before, now in old.items():
        setattr(kind, before, _old_field(kind.__name__, before, now))
    return kind


def methods(kind: Class) -> Class:
    """Have a class, and those derived from it, keep the old names of its methods. A decorator."""

    def take_over(derived: type[Any], /, **named: Any) -> None:
        super(kind, derived).__init_subclass__(**named)  # type: ignore[arg-type]
        _take_over(kind.__name__, derived)

    setattr(kind, "__init_subclass__", classmethod(take_over))  # noqa: B010
    for before, now in METHODS[kind.__name__].items():
        setattr(kind, before, _old_attribute(kind, before, now))
    return kind


def _take_over(kind: str, derived: type[Any]) -> None:
    """Give methods of a derived class their present names, and the old ones beside them for `super()`."""
    for before, now in METHODS[kind].items():
        if before in vars(derived):
            warn(f"{kind}.{before}", now, 4)
            setattr(derived, now, vars(derived)[before])
        if now in vars(derived):
            setattr(derived, before, _old_attribute(derived, before, now))


def fields(kind: str, data: dict[Any, Any]) -> dict[Any, Any]:
    """Arguments of a class that a file has, by their present names, without a warning."""
    return {ARGUMENTS.get(kind, {}).get(name, name): value for name, value in data.items()}


def name_in(value: object, kind: str, name: str) -> str | None:
    """Name by which an object has a method of a class, which may be an old one; None if it has none."""
    if hasattr(value, name):
        return name
    for before, now in METHODS.get(kind, {}).items():
        if now == name and hasattr(value, before):
            warn(f"{kind}.{before}", now, 4)
            return before
    return None


def _old_field(kind: str, before: str, now: str) -> property:
    def get(self: Any) -> Any:
        warn(f"{kind}.{before}", now)
        return getattr(self, now)

    return property(get)


def _old_attribute(kind: type[Any], before: str, now: str) -> property:
    """What a class has by its present name, for an object that is asked by the old one."""

    def get(self: Any) -> Any:
        warn(f"{kind.__name__}.{before}", now)
        if not hasattr(kind, now):  # an attribute of the object
            return getattr(self, now)
        own = inspect.getattr_static(kind, now)
        return own.__get__(self, type(self)) if hasattr(own, "__get__") else own

    return property(get)


class _OldModules(Loader):
    """Imports modules by their old names."""

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        return ModuleSpec(name, self) if name in MODULES else None

    def create_module(self, spec: ModuleSpec) -> None:
        """Leave it to Python to make one, which is thrown away."""

    def exec_module(self, module: ModuleType) -> None:
        name = module.__name__
        warn(f"The module {name}", MODULES[name])
        sys.modules[name] = import_module(MODULES[name])


sys.meta_path.append(_OldModules())
