"""What a study is, the numbers that it keeps, and what is drawn and told from them.

A study is a module with `STUDY = Study(...)`. `python -m studies NAME` runs it, and `studies.NAME` is that module, or
its room, whose module is `study`.
"""

import csv
import io
import json
import re
import time
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.files import write_atomically

Floats = NDArray[np.float64]

DOCS = Path(__file__).parents[1] / "docs"
RESULTS = Path("results")
"""Folder in docs/ of numbers and their pictures, in a folder for every claim that they support."""


@dataclass(frozen=True)
class Study:
    """A study: what it runs, what it keeps, and what follows from the numbers that it keeps.

    name: As the command has it: the module's without "studies." and ".study".
    run: Computes and fills the results, which come after the options; returns a sentence if something failed. None:
        there is nothing to run.
    options: Dataclass of the options, without --out, which every study has. None: there are no others.
    file: File of the numbers as docs/results/ has it, such as "learning/bound.json"; empty for none.
    out: Where a run writes unless --out says; by default the folder that docs/ has for the numbers.
    settings: What all numbers of a file have in common, of the options if there are any. A study that tells it goes on
        with the file that is there.
    pictures: By their names, how they are drawn from the numbers into a file beside them.
    tables: By the names that pages give them, tables in Markdown.
    drawn: Pictures in docs/results/ that only a run draws.
    packages: Packages whose versions count, beside those of every study.
    extra: What brings them, where a run needs more than the module does.
    """

    name: str
    run: Callable[..., str | None] | None = None
    options: type[Any] | None = None
    file: str = ""
    out: Path | None = None
    settings: Callable[..., Mapping[str, Any]] | None = None
    pictures: Mapping[str, Callable[[Any, Path], None]] = field(default_factory=dict)
    tables: Mapping[str, Callable[[Any], str]] = field(default_factory=dict)
    drawn: tuple[str, ...] = ()
    packages: tuple[str, ...] = ()
    extra: str = ""

    def place(self, out: Path, name: str) -> Path:
        """Where a file of the study goes: into the folder `out`, or beside the file `out`, by its name."""
        last = Path(name).name
        return out.with_name(last.replace(Path(self.file).stem, out.stem)) if out.suffix else out / last

    def committed(self, docs: Path, name: str) -> Path:
        """File of the numbers, or picture, in a folder such as docs/."""
        return self.place((docs / RESULTS / self.file).parent, name)

    @property
    def default_out(self) -> Path:
        """Where a run writes unless --out says."""
        return self.out or (Path("docs") / RESULTS / self.file).parent

    def write(self, results: Any, out: Path) -> list[Path]:
        """Draw the pictures; returns their files."""
        for name, draw in self.pictures.items():
            draw(results, self.place(out, name))
        return [self.place(out, name) for name in self.pictures]


class Results(dict[str, Any]):
    """Numbers of a study, which begin with those of its file if the study resumes.

    about: Command, machine and versions, which head the file. file: None for numbers that are not kept.
    out: The folder for what else a run writes, or a file.
    """

    def __init__(
        self,
        about: Mapping[str, Any],
        file: Path | None = None,
        settings: Mapping[str, Any] | None = None,
        out: Path = Path(),
    ):
        super().__init__()
        self.about, self.file, self.out = about, file, out
        if settings is not None:
            self["settings"] = dict(settings)
            self.read()

    @property
    def folder(self) -> Path:
        """The folder `out`, which is made."""
        self.out.mkdir(parents=True, exist_ok=True)
        return self.out

    def read(self) -> None:
        """Take what is in the file, if there is one; ValueError if it has other settings."""
        if self.file is None or not self.file.is_file():
            return
        kept, settings = json.loads(self.file.read_text(encoding="utf-8")), self.get("settings")
        found = kept.get("settings") if isinstance(kept, dict) else None
        if found != settings:
            of = "something else" if found is None else found
            raise ValueError(f"{self.file} has results of {of}, not of {settings}: give another --out.")
        self.update(kept)

    def save(self) -> None:
        """Write the file."""
        if self.file is not None:
            keep({**self.about, **self}, self.file)

    def fill(
        self,
        cells: Mapping[Any, Callable[[], Any]],
        tell: Callable[[Any], str],
        is_done: Callable[[Any], bool] = lambda _: True,
    ) -> None:
        """Compute the cells that are missing, and write the file after each. Several processes may fill one file.

        Cells whose names are numbers of seeds stand in that order, others as they come.

        cells: How to compute a cell, by its keys from the outermost to its own. tell: What is printed of a new one.
        is_done: Whether a cell that is there counts.
        """
        for (*keys, name), compute in cells.items():
            self.read()
            if name in self.row(keys) and is_done(self.row(keys)[name]):
                continue
            began, found = time.perf_counter(), compute()
            self.read()
            self.update(self.about)
            row = self.row(keys) | {name: found}
            self.row(keys).clear()
            self.row(keys).update(sorted(row.items(), key=seed))
            self.save()
            print(f"{', '.join([*keys[1:], name])}: {tell(found)} ({time.perf_counter() - began:.0f} s)", flush=True)

    def row(self, keys: Sequence[str]) -> dict[str, Any]:
        """Cells that have these keys in common."""
        row: dict[str, Any] = self
        for key in keys:
            row = row.setdefault(key, {})
        return row


def require_known(kind: str, asked: Collection[str], known: Collection[str]) -> None:
    """ValueError where an unknown name is asked for. kind: What is named, in the singular."""
    if unknown := set(asked) - set(known):
        raise ValueError(f"Unknown {kind} {min(unknown)!r}: choose of {', '.join(known)}.")


def seed(cell: tuple[str, Any]) -> int:
    """Number of a cell that is named by its seed; 0 for others."""
    return int(cell[0]) if cell[0].isdecimal() else 0


# Numbers as JSON that a person can read: one line for every list of numbers.


INNERMOST = re.compile(r"\[\n([^\[\]{}]*)\n\s*\]")
BREAK = re.compile(r"\n\s*")


def as_json(results: Mapping[str, Any]) -> str:
    """Plain data as JSON; ValueError where a number is not finite."""
    text = json.dumps(results, indent=1, ensure_ascii=False, allow_nan=False)
    return INNERMOST.sub(lambda found: f"[{BREAK.sub(' ', found[1]).strip()}]", text) + "\n"


def keep(results: Mapping[str, Any], file: Path) -> None:
    """Write plain data into a file, whose folder is made."""
    file.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(file, as_json(results).encode())


def write_rows(file: Path, head: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    """Write rows below a head as CSV into a file, all at once; its folder is made."""
    text = io.StringIO()
    csv.writer(text).writerows([head, *rows])
    file.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(file, text.getvalue())


def rounded(value: float, digits: int = 4) -> float:
    """A number with a few significant digits."""
    return float(f"{value:.{digits}g}")
