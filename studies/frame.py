"""What a study is, and the numbers that it keeps. A study is a module with `STUDY = Study(...)`."""

import importlib.metadata
import json
import os
import platform
import re
import subprocess
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.files import write_atomically
from seastar_gym.version import __version__

Floats = NDArray[np.float64]
DOCS = Path(__file__).parents[1] / "docs"


@dataclass(frozen=True)
class Study:
    """A study: what it runs, what it keeps, and what follows from the numbers that it keeps.

    name: That of its module, as the command has it.
    run: Fills the results, which come after the options; returns a sentence if something failed.
    options: Dataclass of the options, without --out, which every study has. None: there are no others.
    file: File of the numbers as docs/results/ has it, such as "speed/gpu.json"; empty for none.
    out: Where a run writes unless --out says; by default the folder that docs/ has for the numbers.
    settings: What all numbers of a file have in common, of the options if there are any. A study that tells it resumes.
    pictures: By their names, how they are drawn from the numbers into a file beside them.
    tables: By the names that pages give them, tables in Markdown.
    """

    name: str
    run: Callable[..., str | None] | None = None
    options: type[Any] | None = None
    file: str = ""
    out: Path | None = None
    settings: Callable[..., Mapping[str, Any]] | None = None
    pictures: Mapping[str, Callable[[Any, Path], None]] = field(default_factory=dict)
    tables: Mapping[str, Callable[[Any], str]] = field(default_factory=dict)

    @property
    def default_out(self) -> Path:
        """Where a run writes unless --out says."""
        return self.out or (Path("docs") / "results" / self.file).parent


class Results(dict[str, Any]):
    """Numbers of a study, which begin with those of its file if the study resumes.

    about: Command, machine and versions, which head the file. file: None for numbers that are not kept.
    settings: Of `Study`. out: The folder for what else a run writes, or a file.
    """

    def __init__(self, about: Mapping[str, Any], file: Path | None = None, settings: Any = None, out: Path = Path()):
        super().__init__({} if settings is None else {"settings": dict(settings)})
        self.about, self.file, self.out = about, file, out
        if settings is not None:
            self.read()

    @property
    def folder(self) -> Path:
        """The folder `out`, which is made."""
        self.out.mkdir(parents=True, exist_ok=True)
        return self.out

    def read(self) -> None:
        """Take what is in the file, if there is one; ValueError if it has other settings."""
        if self.file is not None and self.file.is_file():
            kept, settings = json.loads(self.file.read_text(encoding="utf-8")), self.get("settings")
            if (found := kept.get("settings")) != settings:
                raise ValueError(f"{self.file} has results of {found}, not of {settings}: give another --out.")
            self.update(kept)

    def save(self) -> None:
        """Write the file, with one line for every list of numbers; ValueError where a number is not finite."""
        if self.file is not None:
            text = json.dumps({**self.about, **self}, indent=1, ensure_ascii=False, allow_nan=False)
            text = re.sub(r"\[\n([^\[\]{}]*)\n\s*\]", lambda found: f"[{' '.join(found[1].split())}]", text)
            self.file.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(self.file, f"{text}\n".encode())

    def fill(self, cells: Mapping[Any, Callable[[], Any]], tell: Callable[[Any], str]) -> None:
        """Compute the cells that are missing, and write the file after each. Several processes may fill one file.

        cells: How to compute a cell, by its keys from the outermost to its own. tell: What is printed of a new one.
        """
        for (*keys, name), compute in cells.items():
            self.read()
            if name not in self.row(keys):
                began, found = time.perf_counter(), compute()
                self.read()
                self.update(self.about)
                self.row(keys)[name] = found
                self.save()
                took = time.perf_counter() - began
                print(f"{', '.join([*keys[1:], name])}: {tell(found)} ({took:.0f} s)", flush=True)

    def row(self, keys: Sequence[str]) -> dict[str, Any]:
        """Cells that have these keys in common."""
        row: dict[str, Any] = self
        for key in keys:
            row = row.setdefault(key, {})
        return row


def provenance(command: str) -> dict[str, Any]:
    """Command, machine and versions."""
    versions = {"seastar-gym": __version__, "python": platform.python_version()}
    versions |= {name: importlib.metadata.version(name) for name in ("numpy", "numba", "llvmlite")}
    lines = facts.read_text("utf-8").splitlines() if (facts := Path("/proc/cpuinfo")).is_file() else []
    models = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    machine = f"{os.cpu_count()} cores of {next(models, platform.machine())}"
    return {"command": command, "machine": machine, "versions": versions}


def commit_of(checkout: Path = Path()) -> str:
    """Short name of the commit in a folder; empty outside a checkout."""
    words = ["git", "rev-parse", "--short=8", "HEAD"]
    return subprocess.run(words, cwd=checkout, capture_output=True, text=True, check=False).stdout.strip()


def require_known(kind: str, asked: Collection[str], known: Collection[str]) -> None:
    """ValueError where an unknown name is asked for. kind: What is named, in the singular."""
    if unknown := set(asked) - set(known):
        raise ValueError(f"Unknown {kind} {min(unknown)!r}: choose of {'; '.join(known)}.")


def rounded(value: float, digits: int = 4) -> float:
    """A number with a few significant digits."""
    return float(f"{value:.{digits}g}")
