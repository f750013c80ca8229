"""Whether the tests notice that one line of the package is wrong.

    python -m studies.mutants --count 300 --kernels 120 --seed 1

draws mutants of the package by a seed, from its rooms in turn, and writes one after the other into a copy of the
repository. Each meets the tests of its room: the core, and if it lives, with --all. A line of JSON says what came of
it. What has its line is not run again, so the study can be broken off and continued.
"""

import ast
import json
import os
import random
import subprocess
import sys
import tempfile
import time
import tokenize
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

from seastar_gym.lanes.compile import kernel_sources
from studies.frame import Results, Study

PACKAGE = "seastar_gym"
SWAPS = {"<": ">=", "<=": ">", "==": "!=", "+": "-", "*": "/", "and": "or", "True": "False", "minimum": "maximum"}
SWAPS |= {new: old for old, new in SWAPS.items()} | {"min": "max", "max": "min", "not": ""}
Mutant = tuple[str, int, int, int, str]  # file, line, columns from begin to end, and what replaces them


def mutants_of(root: Path, file: str) -> Iterator[Mutant]:
    """Changes of operators, truths, numbers and limits of a file, but not in messages and imports."""
    first, last, lines = "", "", (root / file).read_text(encoding="utf-8").splitlines(keepends=True)
    for token in tokenize.generate_tokens(iter(lines).__next__):
        first, new = "" if token.type == tokenize.NEWLINE else first or token.string.strip(), SWAPS.get(token.string)
        if token.type == tokenize.NUMBER:
            value = ast.literal_eval(token.string)
            new = repr(value + 1 if isinstance(value, int) else 2.0 * value or 1.0)
        of_arguments = token.string in ("*", "/") and last in ("", "(", "[", "{", ",", ":", "=", "lambda", "return")
        if new is not None and not of_arguments and first not in ("raise", "import", "from", "@"):
            yield file, *token.start, token.end[1], new
        last = token.string.strip()


def changed(root: Path, file: str, line: int, begin: int, end: int, new: str) -> tuple[str, str, str]:
    """The line before and after the change, and the text of the file with it."""
    lines = (root / file).read_text(encoding="utf-8").splitlines(keepends=True)
    before, lines[line - 1] = lines[line - 1], f"{lines[line - 1][:begin]}{new}{lines[line - 1][end:]}"
    return before.strip(), lines[line - 1].strip(), "".join(lines)


def drawn(root: Path, count: int, kernels: int, seed: int) -> list[Mutant]:
    """Mutants of the package, so many of them of files with kernels, in any order."""
    rng, compiled, taken = random.Random(seed), set(kernel_sources(root / PACKAGE)), list[Mutant]()
    rooms: dict[tuple[bool | str, ...], list[Mutant]] = {}
    for path in sorted((root / PACKAGE).rglob("*.py")):
        file = path.relative_to(root)
        rooms.setdefault((path in compiled, *file.parent.parts[:2]), []).extend(mutants_of(root, file.as_posix()))
    for of_kernels, most in ((True, kernels), (False, count)):
        turns = zip_longest(*(rng.sample(each, len(each)) for room, each in rooms.items() if room[0] == of_kernels))
        taken += [mutant for turn in turns for mutant in turn if mutant is not None][: most - len(taken)]
    return rng.sample(taken, len(taken))


@dataclass(frozen=True)
class Options:
    """Which mutants are drawn."""

    count: int = 300
    """Number of mutants."""
    kernels: int = 120
    """How many of them are of kernels."""
    seed: int = 0
    """Which are drawn."""


def passes(root: Path, *words: str, **environment: str) -> bool:
    """Whether pytest passes in the copy within an hour. Bytecode of an equally long mutant would stay."""
    command = ["timeout", "1h", sys.executable, "-m", "pytest", "-xq", *words]
    own = os.environ | {"PYTHONPATH": str(root), "PYTHONDONTWRITEBYTECODE": "1", **environment}
    return subprocess.run(command, cwd=root, env=own, capture_output=True, check=False).returncode == 0


def killed_by(root: Path, file: str) -> str:
    """By what a mutant is killed: core, all or nothing. Code of a mutated kernel has a folder of its own."""
    room = f"tests/{Path(file).parts[1]}"
    tests = room if (root / room).exists() else "tests"
    with tempfile.TemporaryDirectory() as cache:
        own = {"NUMBA_CACHE_DIR": cache} if root / file in kernel_sources(root / PACKAGE) else {}
        return next((by for by in ("core", "all") if not passes(root, tests, f"--{by}", **own)), "nothing")


def run(options: Options, results: Results) -> None:
    """Draw mutants and add a line for each that has none yet."""
    file = results.folder / "mutants.jsonl"
    known = file.read_text(encoding="utf-8") if file.exists() else ""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder).resolve()
        subprocess.run(["git", "checkout-index", "--all", f"--prefix={root}/"], check=True)
        if not passes(root, "--collect-only"):
            raise ValueError("Without a change the tests cannot be collected.")
        for mutant in drawn(root, options.count, options.kernels, options.seed):
            name, (before, after, text) = mutant[0], changed(root, *mutant)
            told = {"file": name, "line": mutant[1], "before": before, "after": after}
            if json.dumps(told)[:-1] not in known:
                original, began = (root / name).read_bytes(), time.perf_counter()
                (root / name).write_text(text, encoding="utf-8")
                told |= {"killed by": killed_by(root, name), "seconds": time.perf_counter() - began}
                (root / name).write_bytes(original)
                with file.open("a", encoding="utf-8") as lines:
                    print(json.dumps(told), file=lines)


STUDY = Study("mutants", run, Options, out=Path("runs/mutants"))
