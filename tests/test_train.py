"""train.py goes all the way, stops in good order, and continues where it stopped."""

import csv
import html
import json
import os
import shlex
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

import train
from agents import policy as policies
from agents.ppo import load

REPOSITORY = Path(train.__file__).parent
TINY = shlex.split(
    "--fidelity fast --num-envs 16 --rollout 8 --batch-size 64 --epochs 2 --hidden 16 16 --max-episode-steps 20 "
    "--save-freq 256 --no-video --num-threads 1"
)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """The folder of a tiny run."""
    folder = tmp_path_factory.mktemp("runs") / "tiny"
    assert train.main([*TINY, "--strokes", "512", "--seed", "4", "--out", str(folder)]) == 0
    return folder


def scalars(folder):
    events = EventAccumulator(str(folder / "tensorboard"))
    events.Reload()
    return {tag: [(one.step, one.value) for one in events.Scalars(tag)] for tag in events.Tags()["scalars"]}


def test_a_run_leaves_everything_in_its_folder(finished):
    files = {str(file.relative_to(finished)) for file in finished.rglob("*") if file.is_file()}
    expected = {
        "config.json", "model.zip", "progress.csv", "policy.json", "policy.safetensors",
        "checkpoints/model_000000256.zip", "checkpoints/model_000000512.zip",
        "evaluation/evaluation.csv", "evaluation/traces.png", "evaluation/report.html",
    }  # fmt: skip
    logs = {file for file in files if file.startswith("tensorboard/")}
    assert files - logs == expected
    assert len(logs) == 1


def test_the_config_says_which_command_made_it(finished):
    config = json.loads((finished / "config.json").read_text())
    (command,) = config["commands"]
    assert shlex.split(command)[:2] == ["python", "train.py"]
    again = train.read_options(shlex.split(command)[2:])
    assert again == train.Options(
        **{**train.saved_options(finished).__dict__, "resume": None},
    )
    assert config["versions"]["stable_baselines3"]


def test_logs_have_the_customary_names(finished):
    logs = scalars(finished)
    for tag in ("rollout/ep_rew_mean", "rollout/success_rate", "time/fps", "eval/pentagon_strokes", "train/loss"):
        assert logs[tag], tag
    shares = [logs[f"time/share_{name}"][-1][1] for name in ("simulator", "policy", "update")]
    assert sum(shares) == pytest.approx(1.0)
    assert min(shares) > 0.0


def test_the_report_has_the_numbers_of_the_table(finished):
    report = (finished / "evaluation" / "report.html").read_text()
    with (finished / "evaluation" / "evaluation.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["agent"] for row in rows] == ["learned", "script"]
    for row in rows:
        first_cell = f'<tr><td class="words" data-name="agent">{row["agent"]}<'
        (line,) = [line for line in report.splitlines() if line.startswith(first_cell)]
        assert f">{float(row['mean_cross_track_error_mm']):.1f}<" in line
    assert int(rows[1]["strokes_to_finish"]) <= 250
    assert "Trained for 512 strokes, seed 4" in report
    assert html.escape(json.loads((finished / "config.json").read_text())["commands"][0]) in report
    assert 'id="curves"' in report


def test_the_model_is_that_of_the_last_checkpoint(finished):
    model = (finished / "model.zip").read_bytes()
    assert model == (finished / "checkpoints" / "model_000000512.zip").read_bytes()
    assert load(finished / "model.zip").actions == "pairs"


def test_the_exported_policy_is_the_model_s(finished):
    policy, model = policies.load(finished / "policy.safetensors"), load(finished / "model.zip")
    for name, array in model.weights.items():
        np.testing.assert_array_equal(policy.weights[name], array)
    config = json.loads((finished / "config.json").read_text())
    assert policy.training["commands"] == config["commands"]
    assert policy.training["versions"] == config["versions"]
    assert (policy.training["seed"], policy.training["strokes"]) == (4, 512)
    assert [trained for trained, *_ in policy.training["progress"]] == [256, 512]


def test_one_option_puts_the_policy_in_the_box(finished, tmp_path, monkeypatch):
    shutil.copytree(finished, tmp_path / "tiny")
    monkeypatch.setattr(train, "SHIPPED", tmp_path / "box" / "seastar.safetensors")
    assert train.main(["--resume", str(tmp_path / "tiny")]) == 0
    assert not (tmp_path / "box").exists()
    assert train.main(["--resume", str(tmp_path / "tiny"), "--ship"]) == 0
    shipped = policies.load(tmp_path / "box" / "seastar.safetensors")
    assert shipped.training["seed"] == 4


def test_a_finished_run_can_be_trained_for_more_strokes(finished, tmp_path, capsys):
    folder = tmp_path / "tiny"
    shutil.copytree(finished, folder)
    assert train.main(["--resume", str(folder), "--strokes", "768"]) == 0
    assert (folder / "checkpoints" / "model_000000768.zip").is_file()
    config = json.loads((folder / "config.json").read_text())
    assert len(config["commands"]) == 2
    assert train.saved_options(folder).ppo == train.saved_options(finished).ppo
    steps = [step for step, _ in scalars(folder)["time/fps"]]
    assert steps == sorted(steps) and steps[-1] == 768
    trained = np.loadtxt(folder / "progress.csv", delimiter=",")[:, 0]
    np.testing.assert_array_equal(trained, [256, 512, 768])
    capsys.readouterr()
    for option in (["--seed", "5"], ["--learning-rate", "0.1"], ["--path", "pentagon"]):
        assert train.main(["--resume", str(folder), *option]) == 2
        assert "cannot continue with another" in capsys.readouterr().err


@pytest.mark.parametrize("request_to_stop", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_leaves_a_usable_model_and_says_how_to_go_on(tmp_path, request_to_stop):
    folder = tmp_path / "stopped"
    command = [sys.executable, "train.py", *TINY, "--strokes", "10000000", "--out", str(folder)]
    with subprocess.Popen(command, cwd=REPOSITORY, stdout=subprocess.PIPE, text=True) as process:
        deadline = time.monotonic() + 120
        while not (folder / "progress.csv").exists() and time.monotonic() < deadline:
            time.sleep(0.1)
        os.kill(process.pid, request_to_stop)
        output, _ = process.communicate(timeout=60)
    assert process.returncode == 130
    assert f"python train.py --resume {folder}" in output
    assert not list(folder.rglob("*.part"))
    policy = policies.load(folder / "policy.safetensors")
    assert policy.predict(np.zeros(186, np.float32), deterministic=True)[0].shape == ()
    trained = int((folder / "progress.csv").read_text().splitlines()[-1].split(",")[0])
    assert f"Stopped after {trained} strokes" in output
    assert train.main(["--resume", str(folder), "--strokes", str(trained + 128)]) == 0
    assert "Learned against scripted" in (folder / "evaluation" / "report.html").read_text()


def test_a_kill_leaves_the_last_checkpoint(tmp_path):
    folder = tmp_path / "killed"
    command = [sys.executable, "train.py", *TINY, "--strokes", "10000000", "--out", str(folder)]
    with subprocess.Popen(command, cwd=REPOSITORY, stdout=subprocess.DEVNULL) as process:
        deadline = time.monotonic() + 120
        while not (folder / "progress.csv").exists() and time.monotonic() < deadline:
            time.sleep(0.1)
        process.kill()
    assert load(folder / "model.zip").actions == "pairs"


@pytest.mark.parametrize(
    "make, sentence",
    [
        (lambda folder: None, "There is no run to continue in"),
        (lambda folder: (folder / "config.json").write_text("{"), "is damaged or from another version"),
        (lambda folder: (folder / "config.json").write_text('{"options": {}}'), "is damaged or from another version"),
    ],
)
def test_a_folder_without_a_run_cannot_be_resumed(tmp_path, capsys, make, sentence):
    make(tmp_path)
    assert train.main(["--resume", str(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert sentence in error and error.count("\n") == 1


def test_a_run_without_its_model_cannot_be_resumed(finished, tmp_path, capsys):
    (tmp_path / "config.json").write_bytes((finished / "config.json").read_bytes())
    assert train.main(["--resume", str(tmp_path), "--strokes", "1024"]) == 2
    assert "There is no trained policy at" in capsys.readouterr().err


def test_a_folder_in_use_is_not_written_over(finished, capsys):
    before = (finished / "model.zip").read_bytes()
    assert train.main([*TINY, "--strokes", "128", "--out", str(finished)]) == 2
    assert "exists already" in capsys.readouterr().err
    assert (finished / "model.zip").read_bytes() == before


def test_quick_is_short_and_fast():
    options = train.read_options(["--quick"])
    assert options.strokes < 100_000 < train.Options().strokes
    assert options.fidelity == "fast"


@pytest.mark.slow
def test_the_short_form_of_the_training_command_goes_all_the_way(tmp_path):
    command = [sys.executable, "train.py", "--quick", "--out", str(tmp_path / "quick")]
    output = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=True).stdout
    assert "Report: " in output
    with (tmp_path / "quick" / "evaluation" / "evaluation.csv").open() as file:
        learned, script = csv.DictReader(file)
    assert int(learned["strokes_to_finish"]) < int(script["strokes_to_finish"])
    assert (tmp_path / "quick" / "evaluation" / "learned.mp4").stat().st_size > 10_000
