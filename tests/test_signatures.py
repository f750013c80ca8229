"""Signatures that a person can read, as an editor or `help` shows them."""

import inspect
from contextlib import suppress

import seastar_gym
from documented import documented, named


def signatures():
    """Signatures of what the package and the reference name, and of its methods, by name."""
    public = {name: getattr(seastar_gym, name) for name in seastar_gym.__all__}
    for name, what in {**public, **{name: named(name) for name in documented()}}.items():
        methods = vars(what) if inspect.isclass(what) else {}
        called = {f"{name}.{method}": each for method, each in methods.items() if method[0] != "_" and callable(each)}
        for each_name, each in {name: what, **called}.items():
            with suppress(TypeError, ValueError):  # what is not called, or has none in C
                yield each_name, inspect.signature(each)


def test_a_person_can_read_every_public_signature():
    """500 characters, or 60 for each parameter where there are more than seven."""
    lengths = {name: (len(str(found)), max(500, 60 * len(found.parameters))) for name, found in signatures()}
    unreadable = {name: length for name, (length, most) in lengths.items() if length > most}
    assert not unreadable
