"""Files of results: those of a batch each, as Parquet files with units and the scene in their metadata."""

import os
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet

from seastar_gym.files import within, write_atomically
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import require_file
from seastar_gym.scene.per_robot import unit_of
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
    require_file("folder", folder)
    tables = []
    for file in sorted(ResultFiles(folder).folder.glob("??/*.parquet")):
        try:
            tables.append(read_result_file(file))
        except ValueError as damaged:
            warnings.warn(f"{damaged} It is left out: the same sweep simulates its batch again.", stacklevel=2)
    if not tables:
        raise ValueError(f"There are no results in {folder}.")
    return pa.concat_tables(tables, promote_options="default")  # sweeps differ in their columns
