"""Trajectories as Parquet files, with units and the scene in their metadata.

One row is one node of one robot at one time: robot, time [s], node, x, y [m], vx, vy [m/s].
"""

import json
import os
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet
from numpy.typing import ArrayLike

from seastar_gym.files import beside
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import as_floats, require_count
from seastar_gym.simulator import Simulator
from seastar_gym.version import __version__

UNITS = {"robot": "1", "time": "s", "node": "1", "x": "m", "y": "m", "vx": "m/s", "vy": "m/s"}
"""Columns and their units. Robots and nodes are counted from 0; node 0 is the hub."""


def write_trajectory(
    file: str | os.PathLike[str], scene: Scene, commands: ArrayLike, n_robots: int = 1, frames_per_stroke: int = 20
) -> None:
    """Swim strokes from rest and write the nodes' positions and velocities, stroke by stroke.

    commands: One row per stroke for all robots, shape (n_strokes, n_limbs), or (n_strokes, n_robots, n_limbs).
    frames_per_stroke: Frames of a stroke, besides that at rest.

    The file takes its place when it is complete.
    """
    require_count("frames_per_stroke", frames_per_stroke, 1, 10_000)
    simulator = Simulator(scene, n_robots)
    strokes = as_floats("commands", commands)
    if strokes.ndim == 2:
        strokes = np.repeat(strokes[:, None], n_robots, axis=1)
    if strokes.ndim != 3 or strokes.shape[1:] != (n_robots, scene.robot.n_limbs):
        raise ValueError(
            f"commands must have shape (n_strokes, {scene.robot.n_limbs}) or (n_strokes, {n_robots}, "
            f"{scene.robot.n_limbs}), not {np.shape(commands)}."
        )
    schema = schema_of(scene)
    with beside(Path(file)) as place, pa.parquet.ParquetWriter(place, schema, compression="zstd") as writer:
        writer.write_table(_rows(simulator, simulator.time, schema))
        for stroke in strokes:
            begin = simulator.time
            for since in simulator.stroke_in_parts(stroke, frames_per_stroke):
                writer.write_table(_rows(simulator, begin + since, schema))


def schema_of(scene: Scene) -> pa.Schema:
    """Names, types and units of the columns, and the scene as JSON."""
    whole = ("robot", "node")
    fields = [
        pa.field(name, pa.int32() if name in whole else pa.float64(), metadata={"unit": unit})
        for name, unit in UNITS.items()
    ]
    return pa.schema(fields, {"seastar_gym": json.dumps({"scene": scene.to_dict(), "version": __version__})})


def _rows(simulator: Simulator, time: np.ndarray, schema: pa.Schema) -> pa.Table:
    n_robots, n_nodes = simulator.n_robots, simulator.scene.robot.n_nodes
    columns = [
        np.repeat(np.arange(n_robots, dtype=np.int32), n_nodes), np.repeat(time, n_nodes),
        np.tile(np.arange(n_nodes, dtype=np.int32), n_robots),
        *simulator.positions.reshape(-1, 2).T, *simulator.velocities.reshape(-1, 2).T,
    ]  # fmt: skip
    return pa.Table.from_arrays([pa.array(np.ascontiguousarray(column)) for column in columns], schema=schema)
