"""Command lines: their parsers, and how they end where the disk refuses."""

import argparse
import shutil
import sys
import textwrap
from collections.abc import Callable, Sequence
from os.path import isfile, samefile
from pathlib import Path
from typing import NoReturn

INTERRUPTED = 130
"""Exit code after Ctrl-C."""
DEFAULT = "(default: %(default)s)"
"""End of the help of an option that has a default."""


def command_parser(prog: str, doc: str | None) -> argparse.ArgumentParser:
    """Parser of a command; its help begins with a docstring, paragraph by paragraph."""
    width = shutil.get_terminal_size().columns - 2
    paragraphs = [textwrap.fill(" ".join(paragraph.split()), width) for paragraph in (doc or "").split("\n\n")]
    return argparse.ArgumentParser(
        prog=prog,
        description="\n\n".join(paragraphs),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )


def refused_by_disk(failure: OSError) -> str:
    """The error in a sentence."""
    if failure.errno is None:  # raised by this package, with a sentence of its own
        return str(failure)
    where = "a file" if failure.filename is None else failure.filename
    return f"Cannot write or read {where}: {(failure.strerror or 'unknown error').lower()}."


def ended_by_disk(failure: OSError) -> int:
    """Print the error in a sentence; returns the exit code: 1 where the disk refuses, 2 where this package does."""
    print(refused_by_disk(failure), file=sys.stderr)
    return 2 if failure.errno is None else 1


WRITTEN = "out", "chosen", "intervals", "picture", "film"
"""Options that name files to write, in all commands but those of trainings."""
POLICY = ".safetensors"
"""Ending of a file of weights, beside which one of JSON has the description."""


def require_inputs_kept(options: argparse.Namespace) -> None:
    """ValueError where an option names a file to write that another one names to read, as a file or as a policy's."""
    written = {name: file for name in WRITTEN if isinstance(file := getattr(options, name, None), Path)}
    values = [value for name, value in vars(options).items() if name not in WRITTEN]
    named = [each for value in values for each in (value if isinstance(value, list) else [value])]
    read = [str(each) for each in named if isinstance(each, str | Path)]
    read += [f"{file.removesuffix(POLICY)}.json" for file in read if file.endswith(POLICY)]
    for name, file in written.items():
        if isfile(file) and any(isfile(each) and samefile(each, file) for each in read):
            raise ValueError(f"--{name} {file} would replace a file that is read: name another one.")


def answered(work: Callable[[], int | None], options: argparse.Namespace | None = None) -> int:
    """Exit code of a command's work: 2, after a sentence, where it refuses its options or lacks a module."""
    try:
        if options is not None:
            require_inputs_kept(options)
        return work() or 0
    except FileNotFoundError as missing:
        return ended_by_disk(missing)
    except (ValueError, ImportError) as refusal:
        print(refusal, file=sys.stderr)
        return 2


def main_of(
    parser: Callable[[], argparse.ArgumentParser], work: Callable[[argparse.Namespace], str | int | None]
) -> Callable[[Sequence[str] | None], int]:
    """Command line: from words to the exit code of the work that a parser's options ask for; texts are printed."""

    def main(arguments: Sequence[str] | None = None) -> int:
        options = parser().parse_args(arguments)

        def done() -> int | None:
            answer = work(options)
            return print(answer) if isinstance(answer, str) else answer

        return answered(done, options)

    return main


def run_command(main: Callable[[], int | None]) -> NoReturn:
    """Run a command line and exit with its code, as `ended_by_disk` where it cannot write or read a file, or, after
    Ctrl-C, with INTERRUPTED."""
    try:
        code = main()
    except OSError as failure:
        code = ended_by_disk(failure)
    except KeyboardInterrupt:
        print("Interrupted.", file=sys.stderr)
        code = INTERRUPTED
    sys.exit(code)
