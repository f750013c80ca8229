"""Runs of a sweep: resumed, interrupted, with lost workers, on a full disk; the same bits on every executor."""

import contextlib
import itertools
import json
import os
import resource
import tracemalloc
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import pyarrow.parquet
import pytest

import works
from losing import Interrupted
from refusals import assert_refused
from seastar_gym.scene import Scene
from seastar_gym.sweep.command import as_text, axis_of
from seastar_gym.sweep.designs import Choices, Range, Sweep
from seastar_gym.sweep.executors import Outcome, Processes, RayTasks, SlurmJobs, dask_client, outcomes
from seastar_gym.sweep.run import ATTEMPTS, ResultFiles, read_results, result_file_of, run, swim

ROOT = Path(__file__).resolve().parents[2]


@contextlib.contextmanager
def of_dask():
    """Executor of a Dask cluster of this machine."""
    pytest.importorskip("distributed")
    with dask_client(workers=2) as client:
        yield client.get_executor()


def of_ray():
    pytest.importorskip("ray")
    return RayTasks(workers=2)


def of_slurm(tmp_path):
    pytest.importorskip("submitit")
    return SlurmJobs(tmp_path / "jobs", 2, "local")


EXECUTORS = {
    "threads": lambda tmp_path: ThreadPoolExecutor(2),
    "processes": lambda tmp_path: Processes(2),
    "ray": lambda tmp_path: of_ray(),
    "slurm": of_slurm,
    "dask": lambda tmp_path: of_dask(),
}


@pytest.fixture(autouse=True)
def path_of_workers(monkeypatch):
    """What Ray and submitit start finds this package and `works` as this process does."""
    monkeypatch.setenv("PYTHONPATH", f"{ROOT}{os.pathsep}{ROOT / 'tests'}")


def bits(folder):
    return {name: ResultFiles(folder).file(name).read_bytes() for name in ResultFiles(folder).names()}


def test_only_cells_without_parts_are_run(tmp_path, sweep):
    """All finished cells are there after an interrupt. Progress counts cells, designs and strokes."""
    with pytest.raises(KeyboardInterrupt):
        run(sweep.batches(), tmp_path, Interrupted(2), work=works.named)
    assert len(list(ResultFiles(tmp_path).names())) == 2
    seen = []
    run(sweep.batches(), tmp_path, None, lambda now: seen.append((now.done, now.kept, now.designs, now.strokes)),
        works.named)  # fmt: skip
    assert seen == [(1, 2, 4, 4), (2, 2, 8, 8)]
    assert set(ResultFiles(tmp_path).names()) == {batch.name for batch in sweep.batches()}


@pytest.fixture
def largest_file():
    """Function that limits the size of files that this process writes [bytes], as a quota does."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    yield lambda size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_part_that_the_disk_refuses_costs_its_cell_alone(tmp_path, sweep, largest_file, monkeypatch):
    batches = list(sweep.batches())
    monkeypatch.setenv("SWOLLEN", batches[1].name)
    largest_file(100_000)
    tally = run(iter(batches), tmp_path, None, work=works.swollen)
    assert tally.done == 3 and tally.losses == ATTEMPTS
    (sentence,) = tally.problems.values()
    assert sentence.startswith("Cannot write or read ") and sentence.endswith(": file too large.")
    written = [file for file in ResultFiles(tmp_path).folder.rglob("*") if file.is_file()]
    assert all(file.suffix == ".parquet" for file in written)
    monkeypatch.setenv("SWOLLEN", "")
    again = run(iter(batches), tmp_path, None, work=works.swollen)
    assert (again.done, again.kept, again.problems) == (1, 3, {})


def test_a_folder_that_cannot_be_written_to_costs_no_batch(tmp_path, sweep):
    (tmp_path / "file").touch()
    with pytest.raises(FileExistsError):
        run(sweep.batches(), tmp_path / "file", work=lambda batch: pytest.fail("simulated"))


def test_an_executor_that_cancels_its_tasks_ends_a_run(tmp_path, sweep):
    """What is submitted to one whose cluster has lost its head might never end."""

    class Headless(ThreadPoolExecutor):
        def submit(self, *_):
            (future := Future()).cancel()
            future.set_running_or_notify_cancel()
            return future

    with assert_refused("has cancelled its tasks"):
        run(sweep.batches(), tmp_path, Headless())


@pytest.mark.parametrize("text", ["numerics.damping=0,0.003", "robot.relaxation_time=None,0.001"])
def test_results_with_labels_of_several_kinds_are_one_table(text, tmp_path):
    run(Sweep(Scene.preset("fast"), (axis_of(text),), settling=0, measured=1).batches(), tmp_path)
    assert read_results(tmp_path).num_rows == 2


def test_parts_are_not_written_through_links(tmp_path, sweep):
    """Neither that of all nor that of some; no batch is simulated for nothing."""
    batches, others = list(sweep.batches()), tmp_path / "somebody's"
    others.mkdir()
    for place in (tmp_path / "parts", tmp_path / "parts" / batches[0].name[:2]):
        place.symlink_to(others)
        with assert_refused("is a link, and nothing is written through links"):
            run(iter(batches), tmp_path, None, lambda _: pytest.fail("simulated"), works.swollen)
        place.unlink()
        (tmp_path / "parts").mkdir(exist_ok=True)
    assert not list(others.iterdir())


def test_a_full_disk_keeps_what_is_there_and_the_same_run_goes_on(sweep, small_disk):
    """Three parts of four have room. What is refused is run again when there is."""
    place, grow = small_disk(size=44_000)
    tally = run(sweep.batches(), place, Processes(2), work=works.sized)
    assert tally.done == 3 and tally.losses == ATTEMPTS
    assert "no space left on device" in next(iter(tally.problems.values()))
    grow()
    again = run(sweep.batches(), place, None, work=works.sized)
    assert (again.done, again.kept, again.problems) == (1, 3, {})


@pytest.mark.parametrize("refused", [range(1, 99), (0, 2)], ids=["for good", "now and then"])
def test_a_disk_that_is_full_for_good_ends_the_run(refused, tmp_path, sweep, monkeypatch):
    """Parts refused in a row are counted: now and then never two, but two before the last batch."""
    write, order = ResultFiles.write, itertools.count()

    def full(self, name, part):
        if next(order) in refused:
            raise OSError(28, "No space left on device", "parts")
        write(self, name, part)

    monkeypatch.setattr(ResultFiles, "write", full)
    monkeypatch.setattr("seastar_gym.sweep.run.IN_A_ROW", 2)
    with pytest.raises(OSError, match="No space left") if len(refused) > 2 else contextlib.nullcontext():
        tally = run(sweep.batches(), tmp_path, None, work=works.named)
        assert tally.done == 4 and tally.losses == 2 and not tally.problems
    assert len(list(ResultFiles(tmp_path).names())) == (1 if len(refused) > 2 else 4)


def test_a_full_disk_of_a_worker_is_the_cell_s_problem(tmp_path, sweep):
    tally = run(sweep.batches(), tmp_path, None, work=works.refusing)
    assert tally.done == 0 and tally.losses == 4 * ATTEMPTS
    assert set(tally.problems) == {batch.name for batch in sweep.batches()}
    assert set(tally.problems.values()) == {"Cannot write or read a file: no space left on device."}


@pytest.mark.parametrize("name", [name for name in EXECUTORS if name != "threads"])
def test_a_lost_worker_costs_its_cell_alone(name, tmp_path, sweep, monkeypatch):
    """Dask runs the cell again by itself."""
    monkeypatch.setenv("DEADLY", str(tmp_path))
    batches = list(sweep.batches())
    (tmp_path / batches[1].name).touch()
    with EXECUTORS[name](tmp_path) as executor:
        found = list(outcomes(executor, works.deadly_once, iter(batches), 2))
        assert len(found) == len(batches), found
        assert {outcome.task.name for outcome in found if outcome.part is None} <= {batches[1].name}
        (tmp_path / f"{batches[1].name}.died").unlink()
        tally = run(sweep.batches(), tmp_path / "out", executor, work=works.deadly_once)
    assert tally.done == len(batches) and not tally.problems
    assert tally.losses == (0 if name == "dask" else 1)


def test_a_cell_that_kills_every_worker_is_given_up(tmp_path, sweep):
    tally = run(itertools.islice(sweep.batches(), 1), tmp_path, Processes(1), work=works.always_deadly)
    assert tally.losses == ATTEMPTS
    assert "Its worker was lost" in next(iter(tally.problems.values()))


def test_a_sweep_whose_cells_all_fail_is_ended(tmp_path, sweep, monkeypatch):
    monkeypatch.setattr("seastar_gym.sweep.run.MOST_LOST", 2)
    with pytest.raises(ValueError, match="More than 2 batches failed"):
        run(sweep.batches(), tmp_path, None, work=works.refusing)


def test_cells_are_taken_as_there_is_room_for_them(sweep):
    """An executor that read all batches at once would hold a million."""
    taken = []

    def batches():
        for batch in itertools.cycle(list(sweep.batches())):
            taken.append(batch)
            yield batch

    with Processes(2) as executor:
        found = outcomes(executor, works.named, batches(), 3)
        assert isinstance(next(found), Outcome)
        assert len(taken) <= 4
        found.close()


@pytest.mark.parametrize("workers", [1, 2])
def test_there_are_no_more_processes_than_workers(workers, sweep):
    batches = list(sweep.batches()) * 3
    with Processes(workers) as executor:
        found = {outcome.part for outcome in outcomes(executor, works.numbered, iter(batches), 12)}
    assert len(found) <= workers


@pytest.mark.parametrize("name", EXECUTORS)
def test_results_are_the_same_bits_on_every_executor(name, tmp_path, sweep):
    run(sweep.batches(), tmp_path / "here")
    with EXECUTORS[name](tmp_path) as executor:
        run(sweep.batches(), tmp_path / name, executor)
    assert bits(tmp_path / name) == bits(tmp_path / "here") and len(bits(tmp_path / name)) == 4


# What a batch's part says.


FAST = Scene.preset("fast")


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
    assert sorted(read_results(tmp_path).column("robot.n_limbs").to_pylist()) == [3, 3, 4, 4]
    pandas, polars = pytest.importorskip("pandas"), pytest.importorskip("polars")
    speeds, file = swim(batches[0])["speed"].tolist(), ResultFiles(tmp_path).file(batches[0].name)
    assert pandas.read_parquet(file)["speed"].tolist() == polars.read_parquet(file)["speed"].to_list() == speeds
    assert len(polars.read_parquet(tmp_path / "parts" / "*" / "*.parquet")) == 4


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
    "empty": lambda part, _: b"",
    "cut": lambda part, _: part[: len(part) // 2],
    "zeros": lambda part, _: part[:100] + bytes(100) + part[200:],
    "a bit of a number": lambda part, _: flipped(part),
    "a byte of the footer": lambda part, _: part[:-40] + bytes([part[-40] ^ 255]) + part[-39:],
    "no parquet": lambda part, _: b"PAR1 nothing PAR1",
    "deep text": lambda part, _: b"[" * 100_000,
    "it has another batch": lambda part, other: other,
}


@pytest.mark.parametrize("name", DAMAGES)
def test_a_damaged_part_is_named_left_out_and_simulated_again(name, tmp_path, batches):
    with pytest.raises(ValueError, match="no results"):
        read_results(tmp_path)
    assert run(iter(batches), tmp_path).done == 2
    whole, (file, other) = read_results(tmp_path), (ResultFiles(tmp_path).file(batch.name) for batch in batches)
    sound = file.read_bytes()
    file.write_bytes(DAMAGES[name](sound, other.read_bytes()))
    reason = name if name.startswith("it has") else ".*"
    words = rf"{file} is damaged: {reason}\. It is left out: the same sweep simulates its batch"
    with pytest.warns(UserWarning, match=words) as told:
        assert read_results(tmp_path).num_rows == batches[1].n_robots
    assert [warning.filename for warning in told] == [__file__]  # where the results are asked for
    again = run(iter(batches), tmp_path)
    assert (again.done, again.kept, again.damaged) == (1, 1, [file])
    assert as_text(again, tmp_path).endswith(f"Damaged before, and simulated again: {file}.")
    assert file.read_bytes() == sound and read_results(tmp_path).equals(whole)
    for each in (file, other):
        each.write_bytes(b"")
    with pytest.warns(UserWarning, match="is damaged"), pytest.raises(ValueError, match="no results"):
        read_results(tmp_path)


AXES = tuple(Range(f"robot.{name}", 1.0, 2.0) for name in ("limb_length", "density", "youngs_modulus"))


PLANS = {
    "grid": lambda n: ([axis.spaced(round(n ** (1 / 3)) + 1) for axis in AXES], 0),
    "latin": lambda n: (AXES, n),
    "one axis": lambda n: ([AXES[0].spaced(n)], 0),
}


def planned(plan, n_batches, named):
    """Most memory that a plan of so many batches holds [MB], while the first of them are named."""
    axes, samples = PLANS[plan](n_batches)
    tracemalloc.start()
    try:
        sweep = Sweep(FAST, tuple(axes), samples=samples, settling=0, measured=1, robots=1)
        assert all(batch.name for batch in itertools.islice(sweep.batches(), named))
        return tracemalloc.get_traced_memory()[1] / 1e6
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("plan", PLANS)
def test_planning_holds_less_than_a_kilobyte_for_ten_cells_and_of_a_grid_the_same_for_any_number(plan):
    planned(plan, 10, 1)  # imports
    few = planned(plan, 1_000, 500)
    assert few < 9.0 and planned(plan, 100_000, 2_000) < (few + 1.0 if plan == "grid" else 20.0)
