"""Old names of this release's changes still work, and say what the new ones are."""

import importlib
import sys

import pytest

from seastar_gym import renamed


def attribute_of(path: str):
    module, _, name = path.rpartition(".")
    return getattr(importlib.import_module(module), name)


@pytest.mark.parametrize("old, new", renamed.MODULES.items())
def test_a_module_is_imported_by_its_old_name(old, new, monkeypatch):
    monkeypatch.delitem(sys.modules, old, raising=False)
    with pytest.warns(DeprecationWarning, match=f"{old} is called {new} now"):
        assert importlib.import_module(old) is importlib.import_module(new)
    monkeypatch.delitem(sys.modules, old)


@pytest.mark.parametrize("old, new", renamed.NAMES.items())
def test_a_class_or_function_is_found_by_its_old_name(old, new):
    with pytest.warns(DeprecationWarning, match=f"{old} is called {new} now"):
        assert attribute_of(old) is attribute_of(new)


@pytest.mark.parametrize("module", ["seastar_gym", *dict.fromkeys(old.rpartition(".")[0] for old in renamed.NAMES)])
def test_names_that_never_were_are_not_there(module):
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        attribute_of(f"{module}.nothing")


def test_options_are_taken_by_their_old_names():
    with pytest.warns(DeprecationWarning, match="--ship is called --publish now"):
        assert renamed.options(["--ship", "--out", "ship"]) == ["--publish", "--out", "ship"]
    with pytest.warns(DeprecationWarning, match="--ship-anyway"):
        assert renamed.option("--ship-anyway=True") == "--publish-anyway=True"
