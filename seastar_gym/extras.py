"""Optional dependencies: what is missing is said in a sentence with the command that installs it."""

import sys
from importlib.util import find_spec


class MissingExtra(ModuleNotFoundError):  # noqa: N818, what it is a kind of is named so
    """A module of an extra is missing; its text is a sentence with the command that installs it."""


def require_extra(who: str, extra: str, *modules: str) -> None:
    """End a command `python -m ..` with a sentence where modules of an extra are missing; else MissingExtra.

    who: Who needs them, in the plural: "The studies".
    """
    missing = [name for name in modules if find_spec(name) is None]
    if not missing:
        return
    sentence = f'{who} need {", ".join(missing)}: pip install "seastar-gym[{extra}]".'
    if is_command():
        sys.exit(sentence)
    raise MissingExtra(sentence, name=missing[0])


def is_command() -> bool:
    """Whether the packages of a module are being imported that will be run by `python -m`."""
    return sys.argv[:1] == ["-m"]
