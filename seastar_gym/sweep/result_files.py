"""Files of results: those of a batch each, as Parquet files with units and the scene in their metadata."""

import json
import os
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet

from seastar_gym.files import within, write_atomically
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import require_file, require_flag, require_kind
from seastar_gym.scene.per_robot import numbers_of, unit_of, with_numbers
from seastar_gym.sweep.batches import Batch
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
