"""Files are written all at once and never through a link, and JSON that is damaged is refused in a sentence."""

import os
import stat

import pytest

from refusals import assert_refused
from seastar_gym.files import beside, read_json, write_atomically


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
    for link in (False, True):
        target = tmp_path / "link.json" if link else tmp_path / "results.json"
        if link:
            target.symlink_to(tmp_path / "results.json")
        with pytest.raises(OSError, match=r"is no file that can be written over\.$"):
            write_atomically(target, "mine")
    assert names(tmp_path) == {"results.json", "link.json"}


def test_a_file_is_as_readable_as_any_other(tmp_path):
    write_atomically(tmp_path / "new" / "ours", "text")
    (tmp_path / "theirs").write_text("text")
    ours, theirs = (stat.S_IMODE(file.stat().st_mode) for file in (tmp_path / "new" / "ours", tmp_path / "theirs"))
    assert ours == theirs


def test_two_at_once_do_not_meet(tmp_path):
    """Not even two threads of one process; the later of them counts."""
    with beside(tmp_path / "file") as first:
        with beside(tmp_path / "file") as second:
            assert first != second
            second.write_text("second")
        first.write_text("first")
    assert (tmp_path / "file").read_text() == "first" and names(tmp_path) == {"file"}


@pytest.mark.parametrize("failure", [OSError(28, "No space left on device"), KeyboardInterrupt()], ids=repr)
def test_whatever_goes_wrong_leaves_the_file_as_it_was(failure, tmp_path):
    (tmp_path / "file").write_text("before")
    writing = beside(tmp_path / "file")
    writing.__enter__().write_text("half")
    with pytest.raises(type(failure)):
        writing.gen.throw(failure)
    assert (tmp_path / "file").read_text() == "before" and names(tmp_path) == {"file"}


DAMAGED = {
    "empty": "", "cut": '{"a": ', "deep": "[" * 100_000, "deep names": '{"a":' * 100_000, "nan": "[NaN]",
    "infinite": '{"a": -Infinity}', "long": "9" * 10_000, "no text": b"\xff\xfe", "overflowing": "[1e999]",
}  # fmt: skip


@pytest.mark.parametrize("text", DAMAGED.values(), ids=DAMAGED)
def test_damaged_json_is_refused_by_its_name(text, tmp_path):
    (tmp_path / "data.json").write_bytes(text if isinstance(text, bytes) else text.encode())
    with assert_refused("data.json is no JSON that can be read"):
        read_json(tmp_path / "data.json")


def test_json_that_is_no_file_is_missing(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for name in ("pipe", "", "none"):
        with pytest.raises(FileNotFoundError, match="There is no file"):
            read_json(tmp_path / name)
    (tmp_path / "data.json").write_text("\ufeff[1, 2.5]", encoding="utf-8")
    assert read_json(tmp_path / "data.json") == [1, 2.5]
