"""Files are written all at once and never through a link, and JSON that is damaged is refused in a sentence."""

import os
import stat
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from refusals import assert_refused
from seastar_gym import Seastar
from seastar_gym.accuracy import timed_certificate
from seastar_gym.accuracy.command import draw
from seastar_gym.controllers.learned import load, save
from seastar_gym.evaluation import scores
from seastar_gym.evaluation.films import film
from seastar_gym.evaluation.pictures import draw_traces
from seastar_gym.evaluation.results import results, write_csv
from seastar_gym.evaluation.scores import Scores
from seastar_gym.evaluation.swim import Swim
from seastar_gym.files import beside, is_left_behind, part_name, read_json, read_rows, write_atomically, write_json
from seastar_gym.identify.measurement import Measurement
from seastar_gym.plant.swim import Logs
from seastar_gym.scene.scene import load_scene

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture
def somebodys(tmp_path):
    """A file of somebody else."""
    file = tmp_path / "somebody's"
    file.write_text("work")
    return file


def names(folder):
    return {file.name for file in folder.iterdir()}


def test_a_link_is_replaced_and_what_it_points_to_stays(tmp_path, somebodys):
    target = tmp_path / "run" / "config.json"
    target.parent.mkdir()
    for name in (".config.json", "config.json.part", f".config.json.{os.getpid()}", f".config.json.{os.getpid()}.part"):
        (target.parent / name).symlink_to(somebodys)
    target.symlink_to(somebodys)
    before = names(target.parent)
    write_atomically(target, "mine")
    assert somebodys.read_text() == "work" and target.read_text() == "mine" and not target.is_symlink()
    assert names(target.parent) == before
    hard = tmp_path / "hard"
    os.link(somebodys, hard)
    write_atomically(hard, b"mine")
    assert somebodys.read_text() == "work" and hard.read_bytes() == b"mine"


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir], ids=["pipe", "folder"])
def test_what_is_no_file_is_not_written_over(make, tmp_path):
    make(tmp_path / "results.json")
    (tmp_path / "link.json").symlink_to(tmp_path / "results.json")
    for name in ("results.json", "link.json"):
        with pytest.raises(OSError, match=r"is no file that can be written over\.$"):
            write_atomically(tmp_path / name, "mine")
    assert names(tmp_path) == {"results.json", "link.json"}


def test_only_what_an_ended_process_was_writing_is_left_behind(tmp_path):
    """Not what this one writes, nor files and folders of others that end in the same way."""
    code = "from seastar_gym.files import part_name; print(part_name('model.zip'))"
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    names = ended.stdout.strip(), part_name("model.zip"), ".notes.part", ".my.2.zip.part"
    for name in names:
        (tmp_path / name).touch()
    assert [name for name in names if is_left_behind(tmp_path / name)] == [names[0]]
    (tmp_path / names[0]).unlink()
    (tmp_path / names[0]).mkdir()
    assert not is_left_behind(tmp_path / names[0])


def test_two_at_once_do_not_meet_and_files_are_as_readable_as_any_other(tmp_path):
    """Not even two threads of one process; the later of them counts."""
    file = tmp_path / "new" / "file"
    with beside(file) as first:
        with beside(file) as second:
            assert first != second
            second.write_text("second")
        first.write_text("first")
    assert file.read_text() == "first" and names(file.parent) == {"file"}
    (tmp_path / "theirs").write_text("text")
    ours, theirs = (stat.S_IMODE(each.stat().st_mode) for each in (file, tmp_path / "theirs"))
    assert ours == theirs


FULL = OSError(28, "No space left on device")


@pytest.mark.parametrize("failure", [FULL, KeyboardInterrupt()], ids=repr)
def test_whatever_goes_wrong_leaves_the_file_as_it_was(failure, tmp_path, monkeypatch):
    """While it is written, or when a full disk does not take what was."""

    def full(descriptor):
        raise FULL

    (tmp_path / "file").write_text("before")
    writing = beside(tmp_path / "file")
    writing.__enter__().write_text("half")
    with pytest.raises(type(failure)):
        writing.gen.throw(failure)
    monkeypatch.setattr("os.fsync", full)
    for name in ("file", "new"):
        with pytest.raises(OSError, match="No space left"):
            write_atomically(tmp_path / name, b"after")
    assert (tmp_path / "file").read_text() == "before" and names(tmp_path) == {"file"}


def swims():
    hub, ends, one = np.array([[0.0, 0.0], [0.01, 0.0]]), np.array([0, 1]), np.zeros(1)
    return [Swim("a$b", hub[1:], hub, ends, ends.astype(float), one, one, one, None)]


def filmed(file):
    with film(file, 10.0) as add:
        add(np.zeros((64, 64, 3), np.uint8))


def measured():
    return Measurement(np.array([0.5]), np.zeros((1, 1, 2)), (0,), np.zeros((1, 5)))


SCORES = [Scores("SeastarSwim-v0", "a", None, "time", "s", "less", [1000], [1.0], [True], [1.0], [1])]
WRITERS = {
    "evaluation.csv": lambda file: write_csv(results(swims()), file),
    "traces.png": lambda file: draw_traces(swims(), 0.01, file),
    "film.gif": filmed,
    "film.mp4": filmed,
    **{f"{name}.csv": lambda file: Logs(file.parent, Seastar(), 0).close() for name in ("tracking", "poses")},
    "trajectory.csv": lambda file: measured().to_csv(file, file.with_name("other.csv")),
    "commands.csv": lambda file: measured().to_csv(file.with_name("other.csv"), file),
    "policy.safetensors": lambda file: save(load(), file),
    "policy.json": lambda file: save(load(), file.with_suffix(".safetensors")),
    "scores.json": lambda file: scores.write(SCORES, file),
    "scores.csv": lambda file: scores.write(SCORES, file),
    "config.json": lambda file: write_json(file, {"a": 1}),
    "certificate.json": lambda file: timed_certificate(0.2).save(file),
    "certificate.png": lambda file: draw(timed_certificate(0.2), file),
}


@pytest.mark.parametrize("name", WRITERS)
def test_no_writer_writes_through_a_link(name, tmp_path, somebodys):
    place = tmp_path / "out" / name
    place.parent.mkdir()
    place.symlink_to(somebodys)
    WRITERS[name](place)
    assert somebodys.read_text() == "work"
    assert place.is_file() and not place.is_symlink() and place.stat().st_size > 0
    assert not [file for file in place.parent.iterdir() if file.name.startswith(".")]


DAMAGED = {
    "empty": "", "cut": '{"a": ', "deep": "[" * 100_000, "deep names": '{"a":' * 100_000, "nan": "[NaN]",
    "infinite": '{"a": -Infinity}', "long": "9" * 10_000, "no text": b"\xff\xfe", "overflowing": "[1e999]",
}  # fmt: skip


def test_json_is_read_or_refused_by_its_name(tmp_path):
    for text in DAMAGED.values():
        (tmp_path / "data.json").write_bytes(text if isinstance(text, bytes) else text.encode())
        with assert_refused("data.json is no JSON that can be read"):
            read_json(tmp_path / "data.json")
    os.mkfifo(tmp_path / "pipe")
    for name in ("pipe", "", "none"):
        with pytest.raises(FileNotFoundError, match="There is no file"):
            read_json(tmp_path / name)
    with (tmp_path / "large.json").open("wb") as large:
        large.truncate(2**30 + 1)  # which takes no room
    for read in (read_json, read_rows, load_scene):
        with assert_refused("large.json", "has 1,073,741,825 bytes"):
            read(tmp_path / "large.json")
    (tmp_path / "data.json").write_text("\ufeff[1, 2.5]", encoding="utf-8")
    assert read_json(tmp_path / "data.json") == [1, 2.5]
