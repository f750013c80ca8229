"""Command lines: how they end where the disk refuses."""

import sys
from collections.abc import Callable
from typing import NoReturn


def refused_by_disk(failure: OSError) -> str:
    """The error in a sentence."""
    if failure.errno is None:  # raised by this package, with a sentence of its own
        return str(failure)
    where = "a file" if failure.filename is None else failure.filename
    return f"Cannot write or read {where}: {(failure.strerror or 'unknown error').lower()}."


def run_command(main: Callable[[], int | None]) -> NoReturn:
    """Run a command line and exit with its code, or with a sentence and 1 where the disk refuses a file."""
    try:
        code = main()
    except OSError as failure:
        sys.exit(refused_by_disk(failure))
    sys.exit(code)
