"""However a training ends, what is on the disk can be read, and the training can be continued to its end.

Continued runs begin new episodes, so they need not end at the weights of a run that was left alone; but those that
continue from the same checkpoint, or from none, all end at the same weights. `--slow` takes 78 ends instead of three.
"""

import json
import os
import random
import shlex
import subprocess
import sys
import time
import zipfile
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("tensorboard", reason="train.py writes its log for TensorBoard")

from fuzz.killed_training import SECONDS
from later import Later
from seastar_gym.controllers import learned as policies
from seastar_gym.controllers.learned import load
from seastar_gym.evaluation.report import read_progress

train = Later("train")

DRIVER = Path(__file__).with_name("killed_training.py")
STROKES, BETWEEN = 512, 128
TINY = shlex.split(
    f"--strokes {STROKES} --save-freq {BETWEEN} --seed 4 --fidelity fast --num-envs 16 --rollout 8 --batch-size 64 "
    "--epochs 2 --hidden 16 16 --max-episode-time 20 --no-video --num-threads 1"
)


@pytest.fixture(scope="module", autouse=True)
def short_swims():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("agents.options.TIME_LIMIT", SECONDS)
        yield


def start(fate, at, folder):
    command = [sys.executable, str(DRIVER), fate, str(at), str(folder), *TINY, "--out", str(folder)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def weights_in(folder):
    return policies.load(folder / "policy.safetensors").weights


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """A training that is left alone: its folder, seconds, and touches of files, by what may come of them."""
    folder, began = tmp_path_factory.mktemp("alone") / "run", time.monotonic()
    output, _ = start("kill", 0, folder).communicate()
    killed, full = map(int, output.rsplit("touches: ", 1)[1].split())
    return SimpleNamespace(folder=folder, touches={"kill": killed, "full": full}, seconds=time.monotonic() - began)


@pytest.fixture(scope="module")
def ends(alone):
    """Weights at the end of a training by the strokes it was continued from, at first of one that was left alone."""
    return {0: weights_in(alone.folder), STROKES: weights_in(alone.folder)}


def assert_readable(folder):
    """Every checkpoint is whole, and so is every other file that is there, but for a policy that lacks its half.

    Where progress of a training was written there is a model that can be continued.
    """
    for file in folder.rglob("*.zip"):
        with zipfile.ZipFile(file) as archive:
            assert archive.testzip() is None
        assert load(file).actions == "pairs"
    if (folder / "config.json").exists():
        assert len(json.loads((folder / "config.json").read_text())["commands"]) == 1
    if (folder / "progress.csv").exists():
        rows = read_progress(folder)
        assert all(len(row) == 3 for row in rows)
        assert trained_in(folder) > 0 or [strokes for strokes, *_ in rows] == [0]
    with suppress(ValueError, FileNotFoundError):
        weights_in(folder)


def trained_in(folder):
    """Strokes that the model in the folder is trained for; 0 where there is none."""
    if not (folder / "model.zip").exists():
        return 0
    with zipfile.ZipFile(folder / "model.zip") as archive:
        return int(json.loads(archive.read("learner.json"))["strokes"])


def assert_continues(folder, ends):
    """The run goes on to its end, and ends where others do that go on from the same checkpoint."""
    before = trained_in(folder)
    begun = (folder / "config.json").exists()
    assert train.main(["--resume", str(folder)] if begun else [*TINY, "--out", str(folder)]) == 0
    assert [strokes for strokes, *_ in read_progress(folder)] == list(range(0, STROKES + 1, BETWEEN))
    assert (folder / "evaluation" / "report.html").is_file()
    assert not list(folder.rglob("*.part"))
    assert_every_checkpoint(folder)
    weights = weights_in(folder)
    for name, expected in ends.setdefault(before, weights).items():
        np.testing.assert_array_equal(weights[name], expected, err_msg=f"continued from {before} strokes")


def assert_every_checkpoint(folder):
    for strokes in range(BETWEEN, STROKES + 1, BETWEEN):
        assert load(folder / "checkpoints" / f"model_{strokes:09d}.zip").actions == "pairs"


def some(end, many):
    """An end and its seeds: one, the others only with --slow."""
    return [(end, 0), *(pytest.param(end, seed, marks=pytest.mark.slow) for seed in range(1, many))]


def assert_one_sentence(process):
    _, errors = process.communicate()
    assert process.returncode == 1
    assert errors.count("\n") == 1 and errors.endswith("no space left on device.\n"), errors


@pytest.mark.parametrize("end, seed", [*some("touch", 30), *some("moment", 24), *some("full disk", 12)])
def test_a_run_continues_that_is_killed_at_any_touch_of_a_file_or_moment_or_meets_a_full_disk(
    end, seed, tmp_path, alone, ends
):
    rng, folder = random.Random(seed), tmp_path / "run"
    if end == "full disk":
        assert_one_sentence(start("full", rng.randint(1, alone.touches["full"]), folder))
    else:
        process = start("kill", rng.randint(1, alone.touches["kill"]) if end == "touch" else 0, folder)
        with suppress(subprocess.TimeoutExpired):
            process.communicate(timeout=None if end == "touch" else rng.uniform(0.3, 1.0) * alone.seconds)
        process.kill()
        process.communicate()
        assert process.returncode == -9 or end == "moment"
    assert_readable(folder)
    assert_continues(folder, ends)


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="mounts a small disk")
@pytest.mark.parametrize("kilobytes", [4, 8, 16, 64, 128, 200, 300, 400, 500, 600, 800, 1200])
def test_a_run_on_a_disk_that_fills_up_ends_in_a_sentence_and_continues(kilobytes, small_disk, ends):
    place, grow = small_disk(kilobytes << 10)
    folder = place / "run"
    assert_one_sentence(start("kill", 0, folder))
    assert_readable(folder)
    grow()
    assert_continues(folder, ends)
