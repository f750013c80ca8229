"""Designs that Optuna proposes: told once, put back when they were lost, in SQLite and in PostgreSQL."""

import math
import os
import pwd
import shutil
import socket
import subprocess
import tempfile
from pathlib import Path

import pyarrow.parquet
import pytest

from losing import Losing, first
from refusals import assert_refused
from seastar_gym.scene import Scene
from seastar_gym.sweep.designs import Choices, Range, Sweep
from seastar_gym.sweep.executors import Outcome
from seastar_gym.sweep.proposals import Proposals, Search, explore, put_back, put_back_stale, study_of
from seastar_gym.sweep.run import ResultFiles, read_results, result_file_of, run

AXES = (
    Range("robot.limb_length", 0.05, 0.15),
    Choices("robot.n_limbs", (3, 5)),
    Choices("actuator.peak_angle", (0.2, 0.6)),
)
SWEEP = Sweep(Scene.preset("fast"), AXES, settling=0, measured=1, samples=1, robots=4)


@pytest.fixture
def sqlite(tmp_path):
    return f"sqlite:///{tmp_path}/study.db"


@pytest.fixture(scope="module")
def postgresql():
    """A PostgreSQL server of our own, which does not run as root."""
    pytest.importorskip("psycopg2")
    programs = shutil.which("initdb"), shutil.which("pg_ctl")
    if None in programs:
        pytest.skip("no PostgreSQL here")
    initdb, pg_ctl = (Path(program).resolve() for program in programs)
    user = {}
    if os.geteuid() == 0:
        if "postgres" not in {entry.pw_name for entry in pwd.getpwall()}:
            pytest.skip("PostgreSQL does not run as root")
        user = {"user": "postgres", "group": "postgres", "extra_groups": []}
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    folder = Path(tempfile.mkdtemp(prefix="pg"))
    if user:
        shutil.chown(folder, "postgres", "postgres")
    quiet = {"stdout": subprocess.DEVNULL, "check": True, "cwd": folder, **user}
    try:
        subprocess.run([initdb, "-D", folder / "data", "-A", "trust", "-U", "sweep", "--no-sync"], **quiet)
        options = f"-p {port} -h 127.0.0.1 -k {folder}"
        subprocess.run([pg_ctl, "-D", folder / "data", "-o", options, "-l", folder / "log", "-w", "start"], **quiet)
        yield f"postgresql+psycopg2://sweep@127.0.0.1:{port}/postgres"
        subprocess.run([pg_ctl, "-D", folder / "data", "-m", "immediate", "-w", "stop"], **quiet)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture(params=["sqlite", "postgresql"])
def storage(request):
    return request.getfixturevalue(request.param)


def states(study):
    """Names of the states of all trials."""
    return [trial.state.name for trial in study.get_trials(deepcopy=False)]


def test_proposals_are_simulated_and_told(storage, tmp_path):
    study = explore(SWEEP, Search(), storage, 10, tmp_path)
    assert states(study) == ["COMPLETE"] * 10
    batches = list(ResultFiles(tmp_path).names())
    assert len(batches) >= 3
    best, folder = study.best_trial, tmp_path / "again"
    axes = tuple(Choices(name, (value,)) for name, value in best.params.items())
    again = Sweep(SWEEP.scene, axes, settling=0, measured=1)
    run(again.batches(), folder)
    assert read_results(folder).column("speed").to_pylist() == [best.value]
    assert best.value == max(trial.value for trial in study.trials)


def test_a_search_goes_on_where_it_was_and_keeps_to_its_number(sqlite, tmp_path):
    explore(SWEEP, Search(), sqlite, 5, tmp_path)
    seen = []
    study = explore(SWEEP, Search(), sqlite, 8, tmp_path, None, lambda tally: seen.append(tally.designs))
    assert len(study.trials) == 8 and seen[-1] == 3
    assert len(explore(SWEEP, Search(), sqlite, 8, tmp_path).trials) == 8


def test_another_sweep_or_another_file_of_a_controller_is_another_study(sqlite, tmp_path):
    file = tmp_path / "second.zip"
    other = Sweep(SWEEP.scene, AXES[:2], settling=0, measured=1, samples=1)
    names = [study_of(*each, sqlite).study_name for each in ((SWEEP, Search()), (other, Search()),
             (SWEEP, Search("turn")), (SWEEP, Search("speed", False)))]  # fmt: skip
    for contents in (b"one", b"two", b"one"):
        file.write_bytes(contents)
        axes = *AXES[:2], Choices("controller", ("straight", "rest", str(file)))
        names.append(study_of(Sweep(SWEEP.scene, axes, samples=1), Search(), sqlite).study_name)
    assert len(set(names)) == 6 and names[-1] == names[-3]


def test_proposals_of_a_lost_cell_are_proposed_again(sqlite, tmp_path):
    study = explore(SWEEP, Search(), sqlite, 6, tmp_path, Losing(first(1)))
    lost = [trial for trial in study.trials if trial.state.name == "FAIL"]
    again = {trial.user_attrs["put back"]: trial for trial in study.trials if "put back" in trial.user_attrs}
    assert lost and set(again) == {trial.number for trial in lost}
    assert all(again[trial.number].params == trial.params for trial in lost)
    assert states(study).count("COMPLETE") == 6


def test_stale_proposals_are_put_back_once(storage, tmp_path):
    study = study_of(SWEEP, Search("ahead"), storage)
    lost = Proposals(SWEEP, study, Search("ahead"), 4)
    n_batches = len(lost._asked(4))  # and the process is gone
    assert states(study) == ["RUNNING"] * 4 and n_batches
    assert put_back_stale(study, 3600.0) == 0
    assert put_back_stale(study, 0.0, {0, 1, 2, 3}) == 0
    assert put_back_stale(study, 1e-3) == 4
    assert put_back_stale(study, 1e-3) == 0
    assert states(study) == ["FAIL"] * 4 + ["WAITING"] * 4
    found = explore(SWEEP, Search("ahead"), storage, 4, tmp_path)
    assert states(found) == ["FAIL"] * 4 + ["COMPLETE"] * 4
    assert [trial.params for trial in found.trials[:4]] == [trial.params for trial in found.trials[4:]]


def test_a_result_that_comes_too_late_changes_nothing(sqlite):
    study = study_of(SWEEP, Search(), sqlite)
    slow = Proposals(SWEEP, study, Search(), 2)
    batches = slow._asked(2)
    assert put_back(study, 0) and not put_back(study, 0) and put_back_stale(study, 0.0) == 1
    for batch in batches:
        slow.tell(Outcome(batch, result_file_of(batch)))
    assert states(study) == ["FAIL"] * 2 + ["WAITING"] * 2


@pytest.mark.parametrize("is_largest_best", [True, False])
def test_designs_that_do_not_count_are_the_worst_and_not_tried_for_ever(is_largest_best, sqlite, monkeypatch):
    """One without the objective, such as a time; one whose limbs crossed; one that stands still; one that counts."""
    columns = {"ahead": [math.nan, 2.0, 0.5, 1.0], "speed": [1.0, 1.0, 0.0, 1.0]}
    columns["smallest_opening_angle"] = [1.0, -0.1, 1.0, 1.0]
    pyarrow.parquet.write_table(pyarrow.table(columns), part := pyarrow.BufferOutputStream())
    search = Search("ahead", is_largest_best=is_largest_best)
    study = study_of(SWEEP, search, sqlite)
    proposals = Proposals(SWEEP, study, search, 4)
    monkeypatch.setattr(proposals, "_waiting", {"batch": [study.ask() for _ in range(4)]})
    proposals.tell(Outcome(type("Batch", (), {"name": "batch"})(), part.getvalue()))
    assert states(study) == ["COMPLETE"] * 4 and study.best_value == 1.0
    assert list(proposals.batches()) == []


def test_a_search_whose_batches_all_fail_ends_and_says_why(sqlite, tmp_path):
    def failing(batch):
        raise ValueError("No water.")

    with assert_refused("10 batches in a row have no result", "No water."):
        explore(SWEEP, Search(), sqlite, 6, tmp_path, work=failing)


@pytest.mark.parametrize(
    "sweep, search, words",
    [
        (SWEEP, Search("beauty"), ("objective", "beauty")),
        (SWEEP, Search(stale_after=-1.0), ("stale_after",)),
        (Sweep(SWEEP.scene, ()), Search(), ("something to vary",)),
        (SWEEP, Search(), ("nowhere",)),
    ],
)
def test_bad_searches_are_refused(sweep, search, words, sqlite):
    with assert_refused(*words):
        study_of(sweep, search, "sqlite:////nowhere/study.db" if words == ("nowhere",) else sqlite)
