"""Runs the batches of a sweep that have no part yet, and writes their parts.

Files of results: those of a batch each, as Parquet files with units and the scene in their metadata.

Axes as text, NAME=VALUES, see command.py.
"""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet

from seastar_gym.command import refused_by_disk
from seastar_gym.files import read_json, within, write_atomically
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import require_callable, require_count, require_file, require_flag, require_kind, shown
from seastar_gym.scene.number import numbers_of, unit_of, with_numbers
from seastar_gym.scene.serial import KINDS, from_dict
from seastar_gym.sweep.designs import PARTS, Axis, Batch, Choices, Range
from seastar_gym.sweep.executors import Outcome, Work, outcomes
from seastar_gym.sweep.swimming import OF_CONTROLLERS, UNITS, swim


def result_file_of(batch: Batch, device: str = "cpu") -> bytes:
    """Parquet file of a batch's results. device: Where robots swim, see `Simulator`; the results are the same."""
    columns = {**dict(batch.configuration.labels), **batch.numbers, **swim(batch, device)}
    arrays = [pa.array([column] * batch.n_robots if name in dict(batch.configuration.labels) else column)
              for name, column in columns.items()]  # fmt: skip
    schema = pa.schema(
        [_field(name, array, batch.configuration.scene) for name, array in zip(columns, arrays, strict=True)],
        {"seastar_gym": batch.configuration.text, "cell": batch.name},
    )
    return to_parquet(pa.Table.from_arrays(arrays, schema=schema))


def _field(name: str, array: Any, scene: Scene) -> Any:
    unit = (UNITS | OF_CONTROLLERS).get(name) or unit_of(scene, name)
    return pa.field(name, array.type, metadata={"unit": unit} if unit else None)


def to_parquet(table: Any) -> bytes:
    """A table as a Parquet file."""
    sink = pa.BufferOutputStream()
    pa.parquet.write_table(table, sink, compression="zstd", write_page_checksum=True)
    return sink.getvalue().to_pybytes()


def read_result_file(file: Path) -> Any:
    """Table of a part. ValueError, with one sentence, if it is damaged."""
    try:
        with pa.parquet.ParquetFile(file, page_checksum_verification=True) as part:
            table = part.read()
    except (OSError, pa.ArrowException) as damaged:
        raise ValueError(f"{file} is damaged: {str(damaged).splitlines()[0].rstrip('.')}.") from damaged
    if (table.schema.metadata or {}).get(b"cell") != file.stem.encode():
        raise ValueError(f"{file} is damaged: it has another batch.")
    return table


class ResultFiles:
    """Folder of a sweep's parts. It may hold those of several sweeps, and several may write into it at once."""

    def __init__(self, folder: str | os.PathLike[str]):
        self.folder = Path(folder) / "parts"

    def file(self, name: str) -> Path:
        """File of the batch of this name. ValueError where it would be written through a link."""
        return within(self.folder.parent, self.folder.name, name[:2]) / f"{name}.parquet"

    def has(self, name: str) -> bool:
        """Whether the batch of this name is finished: its part is there and sound."""
        try:
            read_result_file(self.file(name))
        except ValueError:
            return False
        return True

    def write(self, name: str, part: bytes) -> None:
        """Write a part: whoever looks finds all of it or nothing."""
        write_atomically(self.file(name), part)

    def names(self) -> Iterator[str]:
        """Names of the batches that have parts."""
        for place in sorted(self.folder.glob("??/*.parquet")):
            yield place.stem


def read_results(folder: str | os.PathLike[str]) -> Any:
    """All results of a folder as one pyarrow.Table, in the order of the batches' names.

    Parts that are damaged are left out with a warning: the same sweep simulates their batches again.
    """
    return pa.concat_tables(list(_tables(folder)), promote_options="default")  # sweeps differ in their columns


def _tables(folder: str | os.PathLike[str]) -> Iterator[Any]:
    """Tables of all parts that are not damaged, see `read_results`. ValueError if there is none."""
    require_file("folder", folder)
    files, found = sorted(ResultFiles(folder).folder.glob("??/*.parquet")), 0
    for file in files:
        try:
            yield read_result_file(file)
            found += 1
        except ValueError as damaged:
            warnings.warn(f"{damaged} It is left out: the same sweep simulates its batch again.", stacklevel=3)
    if not found:
        raise ValueError(f"There are no results in {folder}.")


class Best(NamedTuple):
    """The best design of a sweep. value: Of its objective. design: Values of the axes by name. scene: With them."""

    value: float
    design: dict[str, Any]
    scene: Scene


def best_result(folder: str | os.PathLike[str], objective: str = "speed", is_largest_best: bool = True) -> Best | None:
    """Best of all results of a folder that have the objective, a column; None if there is none.

    Robots whose limbs crossed do not count.
    """
    require_kind("objective", objective, str, "the name of a column")
    require_flag("is_largest_best", is_largest_best)
    best, sign = None, 1.0 if is_largest_best else -1.0
    for table in _tables(folder):
        if objective not in table.column_names:
            continue
        values = sign * table[objective].to_numpy().astype(float)
        values[~(table["smallest_opening_angle"].to_numpy() >= 0.0) | np.isnan(values)] = -np.inf
        row = int(values.argmax())
        if values[row] > (-np.inf if best is None else sign * best.value):
            told = json.loads(table.schema.metadata[b"seastar_gym"])
            scene = Scene.from_dict(told["scene"])
            labels = dict(told["labels"])
            numbers = {name: table[name][row].as_py() for name in numbers_of(scene)
                       if name in table.column_names and name not in labels}  # fmt: skip
            best = Best(sign * float(values[row]), labels | numbers, with_numbers(scene, numbers))
    return best


AT_ONCE = 1000
"""Batches that an executor has at a time, unless somebody says it."""
ATTEMPTS = 3
"""How often a batch is tried whose worker is lost."""
MOST_LOST = 1000
"""Batches that wait for another attempt at most. With more, something is wrong with all of them."""
UNWRITTEN = 10
"""Parts in a row that the disk refuses at most. With more it is full for good, and what is simulated would be lost."""


@dataclass
class Progress:
    """Counts of a run.

    kept: Batches that had parts before. damaged: Parts that were damaged before, whose batches are run again.
    done: Batches and, in them, designs and intervals (such as strokes) that were run.
    losses: Attempts that failed. problems: Why batches have no part after all attempts, by the name of the batch.
    """

    kept: int = 0
    damaged: list[Path] = field(default_factory=list)
    done: int = 0
    designs: int = 0
    intervals: int = 0
    losses: int = 0
    problems: dict[str, str] = field(default_factory=dict)

    def count(self, batch: Batch) -> None:
        """Count a finished batch."""
        self.done += 1
        self.designs += batch.n_robots
        self.intervals += batch.n_robots * batch.configuration.intervals


OnProgress = Callable[[Progress], None]
"""Called after every batch."""


def run(
    batches: Iterable[Batch], folder: str | os.PathLike[str], executor: Executor | None = None,
    progress: OnProgress | None = None, work: Work = result_file_of, at_once: int = AT_ONCE,
) -> Progress:  # fmt: skip
    """Run the batches that have no part in the folder; those that were lost again at the end.

    An interrupt, such as Ctrl-C, leaves the parts of all finished batches. A part that the disk refuses costs its
    batch, which is lost; OSError if the disk refuses UNWRITTEN in a row.

    executor: Any of `concurrent.futures`; None runs batches in this process, one after the other. A lost worker costs
        its batch alone, but where its executor is broken then, as ProcessPoolExecutor is: the same run goes on with
        another. work: What makes a part of a batch. at_once: Batches that the executor has at a time at most.
    """
    require_file("folder", folder)
    require_count("at_once", at_once, 1, 1_000_000)
    if executor is not None:
        require_kind("executor", executor, Executor, "an executor of concurrent.futures, such as Processes()")
    if progress is not None:
        require_callable("progress", progress)
    parts, tally = ResultFiles(folder), Progress()
    waiting, lost = unfinished(batches, parts, tally), list[Outcome]()
    for _ in range(ATTEMPTS):
        lost = _attempt(outcomes(executor, work, waiting, at_once), parts, tally, progress)
        if not lost:
            return tally
        waiting = iter([outcome.task for outcome in lost])
    tally.problems = {outcome.task.name: outcome.problem for outcome in lost}
    return tally


def unfinished(batches: Iterable[Batch], parts: ResultFiles, tally: Progress) -> Iterator[Batch]:
    """Batches without a sound part; others are counted."""
    try:
        each = iter(batches)
    except TypeError:
        raise ValueError(f"batches must be batches, as Sweep.batches gives them, not {shown(batches)}.") from None
    for batch in each:
        require_kind("A batch", batch, Batch, "a Batch, as Sweep.batches gives it")
        if parts.has(batch.name):
            tally.kept += 1
            continue
        if parts.file(batch.name).exists():
            tally.damaged.append(parts.file(batch.name))
        yield batch


def _attempt(
    found: Iterator[Outcome], parts: ResultFiles, tally: Progress, progress: OnProgress | None
) -> list[Outcome]:
    """Write the parts of outcomes; returns those without."""
    lost = list[Outcome]()
    refused = 0
    for outcome in found:
        try:
            if outcome.part is not None:
                parts.write(outcome.task.name, outcome.part)
                refused = 0
        except OSError as failure:
            refused += 1
            if refused == UNWRITTEN:
                raise
            outcome = Outcome(outcome.task, None, refused_by_disk(failure))
        _count(outcome, lost, tally)
        if progress is not None:
            progress(tally)
    return lost


def _count(outcome: Outcome, lost: list[Outcome], tally: Progress) -> None:
    """Count an outcome. ValueError if too many are lost."""
    if outcome.part is not None:
        tally.count(outcome.task)
        return
    lost.append(outcome)
    tally.losses += 1
    if len(lost) > MOST_LOST:
        raise ValueError(f"More than {MOST_LOST} batches failed, the last one so: {outcome.problem}")


def axis_of(text: str) -> Axis:
    """Axis of a text such as "robot.limb_length=0.05:0.15"."""
    name, equals, values = text.partition("=")
    if not equals or not name or not values:
        raise ValueError(f"An axis is written NAME=VALUES, such as robot.n_limbs=3,4,5, not {shown(text)}.")
    if name == "gait":
        return Choices(name, tuple(values.split("/")))
    if name == "controller":
        return Choices(name, tuple(values.split(",")))
    if ":" in values and not values.startswith("@"):
        return _spaced(name, values.split(":"))
    tokens = values.split(",")
    return Choices(name, tuple(_value(name, token) for token in tokens), tuple(map(_label, tokens)))


def _spaced(name: str, words: list[str]) -> Axis:
    """Axis from low to high, of a number of values or of all in between."""
    is_log = words[-1] == "log"
    words = words[: len(words) - is_log]
    numbers = [_number(word) for word in words]
    if not 2 <= len(numbers) <= 3 or any(isinstance(number, str) for number in numbers):
        raise ValueError(
            f"{name} is written LOW:HIGH, LOW:HIGH:COUNT or either with :log, not {shown(':'.join(words))}."
        )
    low, high, *count = numbers
    axis = Range(name, float(low), float(high), is_log)
    if not count:
        return axis
    if not isinstance(count[0], int) or not 2 <= count[0] <= 1_000_000:
        raise ValueError(f"{name} needs a count from 2 to 1000000 as its third number, not {shown(count[0])}.")
    return axis.spaced(count[0])


def _number(word: str) -> Any:
    """A whole number, a number, or the word itself."""
    for kind in (int, float):
        try:
            return kind(word)
        except ValueError:
            pass
    return word


def _value(name: str, word: str) -> Any:
    if word.startswith("@"):
        return _part_of_file(Path(word[1:]))
    if name in PARTS:
        if word == "None":
            return None
        if word not in KINDS:
            raise ValueError(f"{name} is a class of seastar_gym such as SmaPulse, or @FILE.json, not {shown(word)}.")
        return KINDS[word]()
    return None if word == "None" else _number(word)


def _label(word: str) -> Any:
    return Path(word[1:]).stem if word.startswith("@") else _number(word)


def _part_of_file(file: Path) -> Any:
    return from_dict(read_json(file), object)
