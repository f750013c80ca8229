"""Trajectories as Parquet: the simulator's numbers, with units and the scene."""

import json

import numpy as np
import pyarrow.parquet
import pytest

from refusals import assert_refused
from seastar_gym.gaits import STRAIGHT
from seastar_gym.scene import Scene
from seastar_gym.simulator import Simulator
from seastar_gym.sweep.trajectory import UNITS, write_trajectory

FAST = Scene.preset("fast")


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    place = tmp_path_factory.mktemp("swim") / "swim.parquet"
    commands = np.stack([[STRAIGHT, -STRAIGHT]] * 2)
    write_trajectory(place, FAST, commands, n_robots=2, frames_per_stroke=4)
    return place


def test_pandas_reads_the_simulator_s_numbers(file):
    table = pytest.importorskip("pandas").read_parquet(file)
    assert list(table) == list(UNITS) and len(table) == 9 * 2 * FAST.robot.n_nodes
    simulator = Simulator(FAST, 2)
    for _ in range(2):
        simulator.stroke([STRAIGHT, -STRAIGHT])
    last = table[table.time == 2.0]
    assert last[last.robot == 1][["x", "y"]].to_numpy().tolist() == simulator.positions[1].tolist()
    assert last[last.robot == 0][["vx", "vy"]].to_numpy().tolist() == simulator.velocities[0].tolist()


def test_polars_reads_the_same(file):
    pandas, polars = pytest.importorskip("pandas"), pytest.importorskip("polars")
    assert polars.read_parquet(file).to_numpy().tolist() == pandas.read_parquet(file).to_numpy().tolist()


def test_columns_have_units_and_the_file_its_scene(file):
    schema = pyarrow.parquet.read_schema(file)
    assert {field.name: field.metadata[b"unit"].decode() for field in schema} == UNITS
    assert Scene.from_dict(json.loads(schema.metadata[b"seastar_gym"])["scene"]) == FAST


def test_a_trajectory_that_is_not_finished_is_not_there(tmp_path):
    with pytest.raises(ValueError, match="must be numbers in"):
        write_trajectory(tmp_path / "swim.parquet", FAST, [STRAIGHT, 2.0 * STRAIGHT])
    assert not list(tmp_path.iterdir())


def test_bad_trajectories_are_refused(tmp_path):
    with assert_refused("commands", "shape"):
        write_trajectory(tmp_path / "swim.parquet", FAST, STRAIGHT)
    with assert_refused("frames_per_stroke"):
        write_trajectory(tmp_path / "swim.parquet", FAST, [STRAIGHT], frames_per_stroke=0)
    for commands in (np.zeros((1, 2, 5)), np.zeros((1, 1, 4)), np.zeros((1, 4)), np.zeros((1, 1, 1, 5))):
        with assert_refused("commands must have shape (n_strokes, 5) or (n_strokes, 1, 5)"):
            write_trajectory(tmp_path / "swim.parquet", FAST, commands)
    with assert_refused("frames_per_stroke must be a whole number from 1 to 10000"):
        write_trajectory(tmp_path / "swim.parquet", FAST, [STRAIGHT], frames_per_stroke=10_001)


def test_a_trajectory_has_twenty_frames_a_stroke_and_the_start(tmp_path):
    write_trajectory(tmp_path / "swim.parquet", FAST, [STRAIGHT])
    table, n = pyarrow.parquet.read_table(tmp_path / "swim.parquet").to_pydict(), FAST.robot.n_nodes
    np.testing.assert_allclose(table["time"][::n], np.arange(21) / 20.0, atol=1e-12)
    assert table["node"][:n] == [*range(n)] and set(table["robot"]) == {0}
