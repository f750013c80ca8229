"""Runs of a sweep: resumed, interrupted, with lost workers, on a full disk; the same bits on every executor."""

import itertools
import os
import resource
from pathlib import Path

import pytest

import works
from seastar_gym.executors import Outcome
from seastar_gym.executors.here import Here
from seastar_gym.executors.processes import Processes
from seastar_gym.sweep.result_files import ResultFiles
from seastar_gym.sweep.run import ATTEMPTS, run

ROOT = Path(__file__).resolve().parents[2]


def ray_tasks(tmp_path):
    pytest.importorskip("ray")
    from seastar_gym.executors.on_ray import RayTasks

    return RayTasks(workers=2)


def jobs(tmp_path):
    pytest.importorskip("submitit")
    from seastar_gym.executors.slurm import SlurmArrays

    return SlurmArrays(tmp_path / "jobs", "local", 2, tasks_per_job=2)


EXECUTORS = {
    "here": lambda tmp_path: Here(),
    "one process": lambda tmp_path: Processes(1),
    "two processes": lambda tmp_path: Processes(2),
    "ray": ray_tasks,
    "slurm": jobs,
}


@pytest.fixture(autouse=True)
def path_of_workers(monkeypatch):
    """What Ray and submitit start finds this package and `works` as this process does."""
    monkeypatch.setenv("PYTHONPATH", f"{ROOT}{os.pathsep}{ROOT / 'tests'}")


def bits(folder):
    return {name: ResultFiles(folder).file(name).read_bytes() for name in ResultFiles(folder).names()}


class Interrupted:
    """An executor that is interrupted after some batches."""

    def __init__(self, after):
        self.after = after

    def run(self, work, batches):
        yield from itertools.islice(Here().run(work, batches), self.after)
        raise KeyboardInterrupt


def test_only_cells_without_parts_are_run(tmp_path, sweep):
    first = run(itertools.islice(sweep.batches(), 3), tmp_path, Here(), work=works.named)
    assert (first.done, first.kept, first.designs, first.intervals) == (3, 0, 12, 12)
    again = run(sweep.batches(), tmp_path, Here(), work=works.named)
    assert (again.done, again.kept) == (1, 3)
    assert set(ResultFiles(tmp_path).names()) == {batch.name for batch in sweep.batches()}


def test_an_interrupt_leaves_all_finished_cells(tmp_path, sweep):
    with pytest.raises(KeyboardInterrupt):
        run(sweep.batches(), tmp_path, Interrupted(2), work=works.named)
    assert len(list(ResultFiles(tmp_path).names())) == 2
    assert run(sweep.batches(), tmp_path, Here(), work=works.named).kept == 2


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
    tally = run(iter(batches), tmp_path, Here(), work=works.swollen)
    assert tally.done == 3 and tally.losses == ATTEMPTS
    (sentence,) = tally.problems.values()
    assert sentence.startswith("Cannot write or read ") and sentence.endswith(": file too large.")
    written = [file for file in ResultFiles(tmp_path).folder.rglob("*") if file.is_file()]
    assert all(file.suffix == ".parquet" for file in written)
    monkeypatch.setenv("SWOLLEN", "")
    again = run(iter(batches), tmp_path, Here(), work=works.swollen)
    assert (again.done, again.kept, again.problems) == (1, 3, {})


def test_a_full_disk_keeps_what_is_there_and_the_same_run_goes_on(sweep, small_disk):
    """Three parts of four have room. What is refused is run again when there is."""
    place, grow = small_disk(size=44_000)
    tally = run(sweep.batches(), place, Processes(2), work=works.sized)
    assert tally.done == 3 and tally.losses == ATTEMPTS
    assert "no space left on device" in next(iter(tally.problems.values()))
    grow()
    again = run(sweep.batches(), place, Processes(2), work=works.sized)
    assert (again.done, again.kept, again.problems) == (1, 3, {})


def test_a_disk_that_gets_room_in_mid_sweep_costs_nothing(sweep, small_disk):
    place, grow = small_disk(size=44_000)
    tally = run(sweep.batches(), place, Here(), lambda tally: tally.losses and grow(), works.sized)
    assert tally.done == 4 and tally.losses == 1 and not tally.problems


def test_a_disk_that_is_full_for_good_ends_the_run(tmp_path, sweep, monkeypatch):
    write = ResultFiles.write

    def full(self, name, part):
        if len(list(self.names())) == 1:
            raise OSError(28, "No space left on device", "parts")
        write(self, name, part)

    monkeypatch.setattr(ResultFiles, "write", full)
    monkeypatch.setattr("seastar_gym.sweep.run.UNWRITTEN", 2)
    with pytest.raises(OSError, match="No space left"):
        run(sweep.batches(), tmp_path, Processes(2), work=works.named)
    assert len(list(ResultFiles(tmp_path).names())) == 1


def test_parts_that_the_disk_refuses_now_and_then_end_no_run(tmp_path, sweep, monkeypatch):
    """Those refused in a row are counted: here never two, but two before the last batch."""
    write, order = ResultFiles.write, itertools.count()

    def flickering(self, name, part):
        if next(order) in (0, 2):
            raise OSError(28, "No space left on device", "parts")
        write(self, name, part)

    monkeypatch.setattr(ResultFiles, "write", flickering)
    monkeypatch.setattr("seastar_gym.sweep.run.UNWRITTEN", 2)
    tally = run(sweep.batches(), tmp_path, Here(), work=works.named)
    assert tally.done == 4 and tally.losses == 2 and not tally.problems


def test_a_full_disk_of_a_worker_is_the_cell_s_problem(tmp_path, sweep):
    tally = run(sweep.batches(), tmp_path, Here(), work=works.refusing)
    assert tally.done == 0 and tally.losses == 4 * ATTEMPTS
    assert set(tally.problems) == {batch.name for batch in sweep.batches()}
    assert set(tally.problems.values()) == {"Cannot write or read a file: no space left on device."}


@pytest.mark.parametrize("name", [name for name in EXECUTORS if name != "here"])
def test_a_lost_worker_costs_its_cell_alone(name, tmp_path, sweep, monkeypatch):
    executor = EXECUTORS[name](tmp_path)
    monkeypatch.setenv("DEADLY", str(tmp_path))
    batches = list(sweep.batches())
    (tmp_path / batches[1].name).touch()
    outcomes = list(executor.run(works.deadly_once, iter(batches)))
    lost = {outcome.task.name for outcome in outcomes if outcome.part is None}
    job = {batches[0].name, batches[1].name} if name == "slurm" else {batches[1].name}  # a job has two batches there
    assert lost == job and len(outcomes) == len(batches), outcomes
    tally = run(sweep.batches(), tmp_path / "out", executor, work=works.deadly_once)
    assert tally.done == len(batches) and not tally.problems


def test_a_cell_that_kills_every_worker_is_given_up(tmp_path, sweep):
    tally = run(itertools.islice(sweep.batches(), 1), tmp_path, Processes(1), work=works.always_deadly)
    assert tally.losses == ATTEMPTS
    assert "exit code -9" in next(iter(tally.problems.values()))


def test_a_sweep_whose_cells_all_fail_is_ended(tmp_path, sweep, monkeypatch):
    monkeypatch.setattr("seastar_gym.sweep.run.MOST_LOST", 2)
    with pytest.raises(ValueError, match="More than 2 batches failed"):
        run(sweep.batches(), tmp_path, Here(), work=works.refusing)


def test_cells_are_taken_as_there_is_room_for_them(sweep):
    """An executor that read all batches at once would hold a million."""
    taken = []

    def batches():
        for batch in itertools.cycle(list(sweep.batches())):
            taken.append(batch)
            yield batch

    outcomes = Processes(2).run(works.named, batches())
    assert isinstance(next(outcomes), Outcome)
    assert len(taken) <= 4
    outcomes.close()


@pytest.mark.parametrize("workers", [1, 2])
def test_there_are_no_more_processes_than_workers(workers, sweep):
    batches = list(sweep.batches()) * 3
    found = {outcome.part for outcome in Processes(workers).run(works.numbered, iter(batches))}
    assert len(found) <= workers


def test_progress_counts_cells_and_strokes(tmp_path, sweep):
    seen = []
    run(sweep.batches(), tmp_path, Here(), lambda tally: seen.append((tally.done, tally.intervals)), works.named)
    assert seen == [(1, 4), (2, 8), (3, 12), (4, 16)]


def test_results_are_the_same_bits_on_every_executor(tmp_path, sweep):
    run(sweep.batches(), tmp_path / "here", Here())
    expected = bits(tmp_path / "here")
    assert len(expected) == 4
    for name in ("one process", "two processes"):
        run(sweep.batches(), tmp_path / name, EXECUTORS[name](tmp_path))
        assert bits(tmp_path / name) == expected, name


@pytest.mark.parametrize("name", ["ray", "slurm"])
def test_results_are_the_same_bits_on_a_cluster(name, tmp_path, sweep):
    executor = EXECUTORS[name](tmp_path)
    run(sweep.batches(), tmp_path / "here", Here())
    run(sweep.batches(), tmp_path / name, executor)
    assert bits(tmp_path / name) == bits(tmp_path / "here")
