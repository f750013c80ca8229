"""What a batch's part says."""

import json

import numpy as np
import pyarrow.parquet
import pytest

from seastar_gym.executors.here import Here
from seastar_gym.gaits import STRAIGHT
from seastar_gym.scene import Scene, Seastar, SmaPulse
from seastar_gym.simulator import Simulator
from seastar_gym.sweep.axes import Choices
from seastar_gym.sweep.command import as_text
from seastar_gym.sweep.designs import Sweep
from seastar_gym.sweep.result_files import ResultFiles, read_results, result_file_of
from seastar_gym.sweep.run import run
from seastar_gym.sweep.swimming import REFUSED, UNITS, swim

FAST = Scene.preset("fast")


def one_cell(*axes, **options):
    (batch,) = Sweep(FAST, axes, **{"settling": 1, "measured": 2, **options}).batches()
    return batch


def test_results_are_those_of_the_simulator():
    found = swim(one_cell(Choices("robot.limb_length", (0.08, 0.1))))
    simulator = Simulator(FAST, effort=True)
    simulator.stroke([STRAIGHT])
    begin = simulator.hub_position()[0]
    reports = [simulator.stroke([STRAIGHT]) for _ in range(2)]
    way = simulator.hub_position()[0] - begin
    assert found["ahead"][1] == pytest.approx(way[0], rel=1e-12) and abs(found["aside"][1]) < 1e-12
    assert found["speed"][1] == pytest.approx(way[0] / 2.0, rel=1e-12)
    assert found["strokes_per_metre"][1] == pytest.approx(2.0 / way[0], rel=1e-12)
    for name in ("energy", "work"):
        assert found[name][1] == pytest.approx(sum(getattr(report, name)[0] for report in reports), rel=1e-12)
    assert found["peak_moment"][1] == max(report.peak_moment[0] for report in reports)
    assert abs(found["turn"][1]) < 1e-9
    assert found["status"].tolist() == [0, 0]


@pytest.mark.parametrize("order", [(0, 1, 2), (1, 2, 0), (2, 0, 1)])
def test_the_smallest_opening_angle_is_that_of_any_interval(order):
    """Whichever interval has it: neighbours turned towards each other, with force, a little, or not at all."""
    commands = np.array([[0.0, 1.0, -1.0, 0.0, 0.0], [0.0, 0.4, -0.4, 0.0, 0.0], np.zeros(5)])[list(order)]
    found = swim(one_cell(gait=commands, settling=1, measured=2))["smallest_opening_angle"]
    simulator = Simulator(FAST)
    angles = [simulator.stroke([command]).smallest_opening_angle[0] for command in commands]
    assert found.tolist() == [min(angles)] and np.ptp(angles) > 0.1
    assert angles.index(min(angles)) == order.index(0)


def test_a_turned_gait_swims_aside_and_turns_nothing():
    gait = np.roll([STRAIGHT], 1, axis=1)
    found = swim(one_cell(gait=gait))
    assert np.arctan2(found["aside"][0], found["ahead"][0]) == pytest.approx(2.0 * np.pi / 5.0, abs=1e-6)


def test_a_design_that_a_scene_refuses_costs_no_other():
    found = swim(one_cell(Choices("robot.limb_length", (-1.0, 0.1))))
    assert found["status"].tolist() == [REFUSED, 0]
    assert np.isnan(found["speed"][0])
    alone = swim(one_cell(Choices("robot.limb_length", (0.1,))))
    assert all(found[name][1] == alone[name][0] for name in UNITS)


def test_a_cell_of_refused_designs_is_a_result():
    chapter = Scene(Seastar(n_limbs=3, discretisation="chapter", nodes_per_limb=5), actuator=SmaPulse(0.1))
    axes = Choices("robot.n_limbs", (5, 3)), Choices("actuator.peak_angle", (0.8, 0.9))
    five, three = Sweep(chapter, axes, settling=0, measured=1).batches()
    assert (swim(three)["status"] == REFUSED).all() and (swim(five)["status"] == 0).all()


def test_a_design_has_the_same_bits_in_every_cell():
    lengths = Choices("robot.limb_length", tuple(np.linspace(0.05, 0.15, 12).tolist()))

    def speeds(robots):
        batches = Sweep(FAST, (lengths,), settling=0, measured=1, robots=robots).batches()
        return np.concatenate([swim(batch)["speed"] for batch in batches]).tolist()

    assert speeds(12) == speeds(5) == speeds(1)


def test_a_part_has_units_scene_and_choices(tmp_path):
    axes = Choices("robot.n_limbs", (3, 4)), Choices("robot.limb_length", (0.05, 0.1)), Choices("gait", ("1+,2-",))
    batches = list(Sweep(FAST, axes, settling=0, measured=1).batches())
    for batch in batches:
        ResultFiles(tmp_path).write(batch.name, result_file_of(batch))
    table = pyarrow.parquet.read_table(ResultFiles(tmp_path).file(batches[0].name))
    assert table.schema.field("speed").metadata == {b"unit": b"m/s"}
    assert table.schema.field("robot.limb_length").metadata == {b"unit": b"m"}
    assert table.column("gait").to_pylist() == ["1+,2-", "1+,2-"]
    told = json.loads(table.schema.metadata[b"seastar_gym"])
    assert Scene.from_dict(told["scene"]) == batches[0].configuration.scene and told["measured"] == 1
    everything = read_results(tmp_path)
    assert sorted(everything.column("robot.n_limbs").to_pylist()) == [3, 3, 4, 4]


def test_pandas_and_polars_read_the_parts(tmp_path):
    pandas, polars = pytest.importorskip("pandas"), pytest.importorskip("polars")
    batch = one_cell(Choices("robot.limb_length", (0.05, 0.1)))
    ResultFiles(tmp_path).write(batch.name, result_file_of(batch))
    speeds = swim(batch)["speed"].tolist()
    file = ResultFiles(tmp_path).file(batch.name)
    assert pandas.read_parquet(file)["speed"].tolist() == speeds
    assert polars.read_parquet(file)["speed"].to_list() == speeds
    assert polars.read_parquet(tmp_path / "parts" / "*" / "*.parquet")["speed"].to_list() == speeds


def test_an_empty_folder_has_no_results(tmp_path):
    with pytest.raises(ValueError, match="no results"):
        read_results(tmp_path)


@pytest.fixture(scope="module")
def batches():
    """Two batches of two designs each."""
    axes = Choices("robot.n_limbs", (3, 5)), Choices("robot.limb_length", (0.08, 0.1))
    return list(Sweep(FAST, axes, settling=0, measured=1).batches())


def flipped(part):
    """The part with another bit in its first page of numbers, which its checksum tells."""
    column = pyarrow.parquet.ParquetFile(pyarrow.BufferReader(part)).metadata.row_group(0).column(1)
    place = column.dictionary_page_offset + column.total_compressed_size - 1
    return part[:place] + bytes([part[place] ^ 1]) + part[place + 1 :]


DAMAGES = {
    "empty": lambda part: b"",
    "cut": lambda part: part[: len(part) // 2],
    "zeros": lambda part: part[:100] + bytes(100) + part[200:],
    "a bit of a number": flipped,
    "a byte of the footer": lambda part: part[:-40] + bytes([part[-40] ^ 255]) + part[-39:],
    "no parquet": lambda part: b"PAR1 nothing PAR1",
    "deep text": lambda part: b"[" * 100_000,
}


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES)
def test_a_damaged_part_is_named_left_out_and_simulated_again(damage, tmp_path, batches):
    first, second = batches
    assert run(iter(batches), tmp_path, Here()).done == 2
    whole, file = read_results(tmp_path), ResultFiles(tmp_path).file(first.name)
    sound = file.read_bytes()
    file.write_bytes(damage(sound))
    words = rf"{file} is damaged: .*\. It is left out: the same sweep simulates its batch"
    with pytest.warns(UserWarning, match=words) as told:
        assert read_results(tmp_path).num_rows == second.n_robots
    assert [warning.filename for warning in told] == [__file__]  # where the results are asked for
    again = run(iter(batches), tmp_path, Here())
    assert (again.done, again.kept, again.damaged) == (1, 1, [file])
    assert as_text(again, tmp_path).endswith(f"Damaged before, and simulated again: {file}.")
    assert file.read_bytes() == sound and read_results(tmp_path).equals(whole)


def test_a_part_under_the_name_of_another_cell_is_damaged(tmp_path, batches):
    first, second = batches
    run(iter(batches), tmp_path, Here())
    ResultFiles(tmp_path).file(first.name).write_bytes(ResultFiles(tmp_path).file(second.name).read_bytes())
    with pytest.warns(UserWarning, match="it has another batch"):
        assert read_results(tmp_path).num_rows == second.n_robots
    assert run(iter(batches), tmp_path, Here()).done == 1


def test_no_sound_part_is_no_result(tmp_path, batches):
    run(iter(batches[:1]), tmp_path, Here())
    ResultFiles(tmp_path).file(batches[0].name).write_bytes(b"")
    with pytest.warns(UserWarning, match="is damaged"), pytest.raises(ValueError, match="no results"):
        read_results(tmp_path)


def test_a_part_is_written_whole_or_not_at_all(tmp_path, monkeypatch):
    def full(descriptor):
        raise OSError(28, "No space left on device")

    parts = ResultFiles(tmp_path)
    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="No space"):
        parts.write("ab" * 20, b"part")
    assert not parts.has("ab" * 20)
    assert not [file for file in tmp_path.rglob("*") if file.is_file()]
