"""Parts: the results of a cell each, as Parquet files with units and the scene in their metadata."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.dataset
import pyarrow.parquet

from seastar_gym.files import beside
from seastar_gym.scene.checks import require_file
from seastar_gym.sweep.cells import Cell
from seastar_gym.sweep.swimming import OF_CONTROLLERS, UNITS, swim

OF_SCENE = {
    "limb_length": "m", "length": "m", "rod_radius": "m", "radius": "m", "youngs_modulus": "Pa", "density": "kg/m^3",
    "relaxation_time": "s", "natural_curvature": "1/m", "peak_angle": "rad", "heating_time": "s", "cooling_time": "s",
    "period": "s", "time_constant": "s", "heating_power": "W", "step": "s", "newton_tolerance": "limb lengths",
    "n_limbs": "1", "nodes_per_limb": "1", "drag_coefficient": "1", "tangential_drag_coefficient": "1",
    "added_mass_coefficient": "1", "path_tolerance": "1", "max_iterations": "1", "direction": "rad",
}  # fmt: skip
"""Units of numbers of a scene, by the last word of their names."""


def part_of(cell: Cell) -> bytes:
    """Parquet file of a cell's results."""
    columns = {**dict(cell.frame.labels), **cell.numbers, **swim(cell)}
    arrays = [pa.array([column] * cell.n_robots if name in dict(cell.frame.labels) else column)
              for name, column in columns.items()]  # fmt: skip
    schema = pa.schema(
        [_field(name, array) for name, array in zip(columns, arrays, strict=True)],
        {"seastar_gym": cell.frame.text, "cell": cell.name},
    )
    return to_parquet(pa.Table.from_arrays(arrays, schema=schema))


def _field(name: str, array: Any) -> Any:
    unit = (UNITS | OF_CONTROLLERS).get(name) or OF_SCENE.get(name.rpartition(".")[2])
    return pa.field(name, array.type, metadata={"unit": unit} if unit else None)


def to_parquet(table: Any) -> bytes:
    """A table as a Parquet file."""
    sink = pa.BufferOutputStream()
    pa.parquet.write_table(table, sink, compression="zstd")
    return sink.getvalue().to_pybytes()


class Parts:
    """Folder of a sweep's parts. It may hold those of several sweeps, and several may write into it at once."""

    def __init__(self, folder: str | os.PathLike[str]):
        self.folder = Path(folder) / "parts"

    def file(self, name: str) -> Path:
        """File of the cell of this name."""
        return self.folder / name[:2] / f"{name}.parquet"

    def has(self, name: str) -> bool:
        """Whether the cell of this name is finished."""
        return self.file(name).exists()

    def write(self, name: str, part: bytes) -> None:
        """Write a part beside its place and rename it: whoever looks finds all of it or nothing."""
        file = self.file(name)
        file.parent.mkdir(parents=True, exist_ok=True)
        with beside(file) as place, place.open("wb") as stream:
            stream.write(part)
            stream.flush()
            os.fsync(stream.fileno())

    def names(self) -> Iterator[str]:
        """Names of the finished cells."""
        for place in sorted(self.folder.glob("??/*.parquet")):
            yield place.stem


def read_parts(folder: str | os.PathLike[str]) -> Any:
    """All results of a folder as one pyarrow.Table, in the order of the cells' names."""
    require_file("folder", folder)
    files = [str(file) for file in sorted(Parts(folder).folder.glob("??/*.parquet"))]
    if not files:
        raise ValueError(f"There are no results in {folder}.")
    schema = pa.unify_schemas([pa.parquet.read_schema(file) for file in files])  # sweeps differ in their columns
    return pa.dataset.dataset(files, schema, format="parquet").to_table()
