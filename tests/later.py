"""Modules that take seconds to import are imported when a test first uses them, not while tests are collected."""

from importlib import import_module
from typing import Any


class Later:
    """A module by its name, such as `torch = Later("torch")`."""

    def __init__(self, name: str):
        self.module_name = name

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):  # pytest asks everything in a file whether it is a test
            raise AttributeError(name)
        return getattr(import_module(self.module_name), name)
