"""train.py goes all the way, stops in good order, and continues where it stopped."""

import contextlib
import csv
import errno
import hashlib
import html
import itertools
import json
import math
import os
import re
import shlex
import shutil
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from later import Later
from refusals import assert_told
from seastar_gym import DomainRandomization, Numerics, Scene, Seastar, SmaWires, Uniform
from seastar_gym.cli.main import main as seastar
from seastar_gym.controllers import learned as policies
from seastar_gym.controllers.contract import actions_of, require_fit
from seastar_gym.controllers.learned import load
from seastar_gym.envs.paths import PATHS
from seastar_gym.files import part_name

train = Later("train")
publishing = Later("agents.cards")
training = Later("agents.options")
run_folder = Later("agents.run")

REPOSITORY = Path(__file__).parents[1]
TINY = shlex.split(
    "--fidelity fast --num-envs 16 --rollout 8 --batch-size 64 --epochs 2 --hidden 16 16 --max-episode-time 20 "
    "--save-freq 256 --no-video --num-threads 1"
)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """The folder of a tiny run."""
    folder = tmp_path_factory.mktemp("runs") / "tiny"
    assert train.main([*TINY, "--strokes", "512", "--seed", "4", "--out", str(folder)]) == 0
    return folder


@pytest.fixture
def short_swims(monkeypatch):
    """Swims that are given up after 20 s: what is measured of them stands in the folder of `finished`."""
    monkeypatch.setattr("agents.options.TIME_LIMIT", 20.0)


OWN_ROBOT = """
from seastar_gym import Scene, Seastar
scene = Scene(Seastar(nodes_per_limb=7, youngs_modulus=1.1e6))
"""


def test_a_robot_of_a_file_is_trained_compared_and_continued(tmp_path, capsys, short_swims):
    file, intervals, folder = tmp_path / "own.py", tmp_path / "intervals.json", tmp_path / "run"
    file.write_text(OWN_ROBOT)
    intervals.write_text('{"robot.youngs_modulus": [9e5, 1.2e6]}')
    own = ["--scene", str(file), "--intervals", str(intervals), "--out", str(folder)]
    assert train.main([*TINY, *own, "--strokes", "256"]) == 0
    file.unlink()
    intervals.unlink()
    robot = run_folder.robot_of(training.saved_options(folder), folder)
    assert robot.scene == Scene(Seastar(nodes_per_limb=7, youngs_modulus=1.1e6), numerics=Numerics.preset("fast"))
    assert robot.draws == DomainRandomization({"robot.youngs_modulus": Uniform(9e5, 1.2e6)})
    with contextlib.closing(train.training_env(training.saved_options(folder), robot)) as env:
        assert env.env.unwrapped.randomization == robot.draws
    assert policies.load(folder / "policy.safetensors").description.scene.robot == robot.scene.robot
    report = html.unescape((folder / "evaluation" / "report.html").read_text())
    assert f"Swum by the robot of {file}." in report
    assert f"--agents {folder / 'policy.safetensors'} pentagon --scene {folder / 'scene.json'} --report" in report
    assert train.main(["--resume", str(folder), "--strokes", "384"]) == 0
    assert run_folder.robot_of(training.saved_options(folder), folder) == robot
    capsys.readouterr()
    assert train.main(["--resume", str(folder), "--scene", "another.py"]) == 2
    assert "cannot continue with another scene" in capsys.readouterr().err
    (folder / "scene.json").unlink()
    assert train.main(["--resume", str(folder), "--strokes", "512"]) == 2
    assert capsys.readouterr().err.endswith("scene.json is no file.\n")


OWN_PATH = """
from seastar_gym.envs.paths import register_path

@register_path("bent")
def bent(rng):
    return [[0.1, 0.1], [0.2, 0.0]]
"""


def test_a_path_of_ones_own_comes_with_the_file_of_the_scene(tmp_path, capsys, short_swims):
    file, folder = tmp_path / "own.py", tmp_path / "run"
    file.write_text(OWN_ROBOT + OWN_PATH)
    assert train.main([*TINY, "--scene", str(file), "--path", "bent", "--strokes", "128", "--out", str(folder)]) == 0
    file.unlink()
    del PATHS["bent"]
    again = "--resume", str(folder), "--strokes", "256"
    assert train.main([*again]) == 2 and "with --run-scene only" in capsys.readouterr().err
    assert train.main([*again, "--run-scene"]) == 0
    del PATHS["bent"]
    file.write_text(OWN_ROBOT + OWN_PATH)
    words = ["evaluate", "--path", "bent", "--agents", "straight", "--seconds", "2", "--fidelity", "fast", "--scene"]
    assert seastar([*words, str(file)]) == 0
    del PATHS["bent"]


@pytest.mark.parametrize(
    "scene, intervals, words",
    [
        ("no_such.py", None, "no_such.py is no file."),
        (None, "[1, 2]", "must be JSON such as"),
        (None, '{"robot.youngs_modulus": 1e6}', "must be JSON such as"),
    ],
)
def test_robots_that_cannot_be_trained_are_refused_before_there_is_a_folder(tmp_path, capsys, scene, intervals, words):
    arguments = [] if scene is None else ["--scene", scene]
    if intervals is not None:
        (tmp_path / "intervals.json").write_text(intervals)
        arguments += ["--intervals", str(tmp_path / "intervals.json")]
    assert train.main([*TINY, *arguments, "--out", str(tmp_path / "run")]) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


def scalars(folder):
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    events = EventAccumulator(str(folder / "tensorboard"))
    events.Reload()
    return {tag: [(one.step, one.value) for one in events.Scalars(tag)] for tag in events.Tags()["scalars"]}


def test_a_run_leaves_everything_in_its_folder(finished):
    """Among it the model of the last checkpoint, and the policy of that model with what it was trained by."""
    files = {str(file.relative_to(finished)) for file in finished.rglob("*") if file.is_file()}
    expected = {
        "config.json", "model.zip", "progress.csv", "efficiency.json", "policy.json", "policy.safetensors",
        "checkpoints/model_000000256.zip", "checkpoints/model_000000512.zip",
        "evaluation/evaluation.csv", "evaluation/traces.png", "evaluation/report.html",
    }  # fmt: skip
    logs = {file for file in files if file.startswith("tensorboard/")}
    assert files - logs == expected and len(logs) == 1
    model = (finished / "model.zip").read_bytes()
    assert model == (finished / "checkpoints" / "model_000000512.zip").read_bytes()
    policy, model = policies.load(finished / "policy.safetensors"), load(finished / "model.zip")
    assert model.actions == "pairs"
    for name, array in model.weights.items():
        np.testing.assert_array_equal(policy.weights[name], array)
    config = json.loads((finished / "config.json").read_text())
    assert policy.training["commands"] == config["commands"] and policy.training["versions"] == config["versions"]
    assert (policy.training["seed"], policy.training["strokes"]) == (4, 512)
    assert [trained for trained, *_ in policy.training["progress"]] == [0, 256, 512]


def test_the_config_says_which_command_made_it_and_logs_have_the_customary_names(finished):
    config = json.loads((finished / "config.json").read_text())
    (command,) = config["commands"]
    assert shlex.split(command)[:2] == ["python", "train.py"] and config["versions"]["stable_baselines3"]
    assert training.read_options(shlex.split(command)[2:]) == training.Options(
        **{**training.saved_options(finished).__dict__, "resume": None}
    )
    logs = scalars(finished)
    for tag in ("rollout/ep_rew_mean", "rollout/success_rate", "time/fps", "eval/pentagon_strokes", "train/loss"):
        assert logs[tag], tag
    shares = [logs[f"time/share_{name}"][-1][1] for name in ("simulator", "policy", "update")]
    assert sum(shares) == pytest.approx(1.0) and min(shares) > 0.0


@pytest.fixture
def short_cards(monkeypatch):
    """Cards that are written in a second: test_cards.py looks at whole ones."""
    monkeypatch.setattr("agents.cards.FIDELITIES", ("fast",))
    monkeypatch.setattr("agents.cards.HELD_OUT_PATHS", 1)


def test_a_finished_run_can_be_trained_for_more_strokes(finished, tmp_path, capsys):
    folder = tmp_path / "tiny"
    shutil.copytree(finished, folder)
    assert train.main(["--resume", str(folder), "--strokes", "768"]) == 0
    assert (folder / "checkpoints" / "model_000000768.zip").is_file()
    config = json.loads((folder / "config.json").read_text())
    assert len(config["commands"]) == 2
    assert training.saved_options(folder).ppo == training.saved_options(finished).ppo
    steps = [step for step, _ in scalars(folder)["time/fps"]]
    assert steps == sorted(steps) and steps[-1] == 768
    trained = np.loadtxt(folder / "progress.csv", delimiter=",")[:, 0]
    np.testing.assert_array_equal(trained, [0, 256, 512, 768])
    capsys.readouterr()
    for option in (["--seed", "5"], ["--learning-rate", "0.1"], ["--path", "pentagon"]):
        assert train.main(["--resume", str(folder), *option]) == 2
        assert "cannot continue with another" in capsys.readouterr().err
    for more, words in (
        (["--out", str(tmp_path / "new")], "leave out --out"),
        (["--quick"], "--quick is for new runs"),
    ):
        assert train.main(["--resume", str(finished), *more]) == 2
        assert words in capsys.readouterr().err


@pytest.mark.parametrize(
    "name, sight, more, words",
    [
        ("camera", {"sees": "nodes"}, [], "sees all nodes, as the run's policy does"),
        ("evaluation", {}, [], "has a folder evaluation already"),
        ("camera", {}, ["--strokes", "1024"], "cannot continue with another strokes"),
    ],
)
def test_a_camera_for_which_no_policy_can_be_made_is_refused(name, sight, more, words, finished, tmp_path, capsys):
    file, before = tmp_path / f"{name}.json", sorted(finished.rglob("*"))
    file.write_text(json.dumps(sight))
    assert train.main(["--resume", str(finished), "--for-camera", str(file), *more]) == 2
    assert_told(capsys, words)
    assert sorted(finished.rglob("*")) == before


def test_the_policy_for_a_camera_is_not_replaced(finished, tmp_path, capsys):
    folder, file = tmp_path / "run", tmp_path / "camera.json"
    shutil.copytree(finished, folder)
    shutil.copytree(finished, folder / "camera")
    before = (folder / "camera" / "policy.safetensors").read_bytes()
    file.write_text("{}")
    assert train.main(["--resume", str(folder), "--for-camera", str(file), "--quick"]) == 2
    assert_told(capsys, "camera has a policy already")
    assert (folder / "camera" / "policy.safetensors").read_bytes() == before


@pytest.mark.parametrize("has_policy", [True, False])
def test_a_run_that_is_not_finished_teaches_no_policy_for_a_camera(has_policy, finished, tmp_path, capsys):
    folder, file = tmp_path / "run", tmp_path / "camera.json"
    shutil.copytree(finished, folder)
    file.write_text("{}")
    config = json.loads((folder / "config.json").read_text())
    config["options"]["strokes"] = 1024
    (folder / "config.json").write_text(json.dumps(config))
    if not has_policy:
        (folder / "policy.safetensors").unlink()
    assert train.main(["--resume", str(folder), "--for-camera", str(file)]) == 2
    assert_told(capsys, "is not finished, after", "of 1024 decisions")


def test_a_training_that_is_asked_to_end_leaves_a_usable_model_and_says_how_to_go_on(tmp_path, short_swims):
    """By SIGTERM; ways/test_own_robot.py presses Ctrl-C."""
    folder, deadline = tmp_path / "stopped", time.monotonic() + 120
    command = [sys.executable, "train.py", *TINY, "--strokes", "10000000", "--out", str(folder)]
    with subprocess.Popen(command, cwd=REPOSITORY, stdout=subprocess.PIPE, text=True) as process:
        while not (folder / "checkpoints").exists() and time.monotonic() < deadline:
            time.sleep(0.1)
        process.terminate()
        output, _ = process.communicate(timeout=60)
    assert process.returncode == 130
    assert f"python train.py --resume {folder}" in output
    assert not list(folder.rglob("*.part"))
    policy = policies.load(folder / "policy.safetensors")
    assert policy.predict(np.zeros(186, np.float32), deterministic=True)[0].shape == ()
    trained = int((folder / "progress.csv").read_text().splitlines()[-1].split(",")[0])
    assert f"Stopped after {trained} decisions" in output
    assert train.main(["--resume", str(folder), "--strokes", str(trained + 128)]) == 0
    assert "Learned against scripted" in (folder / "evaluation" / "report.html").read_text()


def test_a_training_that_stops_in_its_first_rollout_has_measured_the_untrained_policy(
    tmp_path, monkeypatch, short_swims
):
    asked, folder = threading.Event(), tmp_path / "run"
    asked.set()
    monkeypatch.setattr("train.stoppable", lambda: contextlib.nullcontext(asked))
    assert train.main([*TINY, "--strokes", "256", "--out", str(folder)]) == 130
    assert [trained for trained, *_ in run_folder.recorded(folder)] == [0, 16]


def test_a_folder_is_taken_while_it_is_empty_and_never_written_over(finished, tmp_path, capsys):
    (tmp_path / part_name("config.json")).write_text("{")
    with run_folder.held(tmp_path, new=True):
        (tmp_path / "somebody's").write_text("work")
    with pytest.raises(ValueError, match="exists already"), run_folder.held(tmp_path, new=True):
        pass
    before = (finished / "model.zip").read_bytes()
    assert train.main([*TINY, "--strokes", "128", "--out", str(finished)]) == 2
    assert_told(capsys, "exists already")
    assert (finished / "model.zip").read_bytes() == before


def test_two_never_train_in_one_folder(finished, tmp_path, capsys):
    before = (finished / "progress.csv").read_text()
    with run_folder.held(finished, new=False):
        assert train.main(["--resume", str(finished), "--strokes", "1024"]) == 2
        assert_told(capsys, "Another process trains in", str(finished))
    with run_folder.held(tmp_path / "new", new=True):
        assert train.main([*TINY, "--strokes", "128", "--out", str(tmp_path / "new")]) == 2
        assert_told(capsys, "Another process trains in")
    assert (finished / "progress.csv").read_text() == before and not list((tmp_path / "new").iterdir())
    with run_folder.held(finished, new=False):
        pass


RUN = ("config.json", "model.zip", "progress.csv", "efficiency.json", "policy.json", "checkpoints", "tensorboard",
       "evaluation", "config.json.part", "scene.json")  # fmt: skip


KINDS = ("link", "dangling", "pipe", "folder of somebody")


def linked(name, kind):
    """Function that puts a pipe, or a link to what is somebody's, into a folder."""

    def damage(folder):
        somebodys, place = folder.parent / "somebody", folder / name
        shutil.rmtree(place) if place.is_dir() else place.unlink(missing_ok=True)
        if kind == "pipe":
            os.mkfifo(place)
        else:
            place.symlink_to(somebodys / {"link": "file", "dangling": "new", "folder of somebody": ""}[kind])

    return damage


def damaged_config(change):
    """Function that changes the config.json in a folder."""

    def damage(folder):
        config = json.loads((folder / "config.json").read_text())
        change(config)
        (folder / "config.json").write_text(json.dumps(config))

    return damage


def damaged_ppo(**changes):
    return damaged_config(lambda config: config["options"]["ppo"].update(changes))


def damaged_options(**changes):
    return damaged_config(lambda config: config["options"].update(changes))


def damaged_file(name, text):
    return lambda folder: (folder / name).write_text(text)


DEEP = "[" * 100_000
DAMAGES = {
    **{f"{name}: {kind}": linked(name, kind) for name in RUN for kind in KINDS},
    "no run": (lambda folder: (folder / "config.json").unlink(), "There is no run to continue in"),
    "no model": (lambda folder: (folder / "model.zip").unlink(), "There is no trained policy at", "checkpoint"),
    "half a config": (damaged_file("config.json", "{"), "is damaged or from another version"),
    "an empty config": (damaged_file("config.json", '{"options": {}}'), "is damaged or from another version"),
    "no commands": damaged_config(lambda config: config.pop("commands")),
    "commands of numbers": damaged_config(lambda config: config.update(commands=[1])),
    "options null": damaged_config(lambda config: config.update(options=None)),
    "no versions": damaged_config(lambda config: config.pop("versions")),
    **{f"{name} {value}"[:30]: damaged_ppo(**{name: value}) for name, value in (
        ("rollout", 10**9), ("hidden", [2**20] * 2), ("hidden", [2**20] * 10**5), ("hidden", None), ("reward", None),
        ("discount", math.inf),
    )},
    **{f"{name} {value!r}": damaged_options(**{name: value}) for name, value in (
        ("ppo", []), ("seed", 10**30), ("seed", "0"), ("strokes", "many"), ("save_freq", math.nan), ("fidelity", 3),
        ("device", None), ("video", 1), ("path", 7), ("num_threads", -1),
    )},
    **{f"{name} {text[:5]}": damaged_file(name, text) for text in (DEEP, "null")
       for name in ("config.json", "efficiency.json", "progress.csv")},
    **{f"efficiency {text}": (damaged_file("efficiency.json", text), "efficiency.json is damaged")
       for text in ('{"seconds": "long"}', '{"strokes": null}', '{"seconds": NaN}', '{"hours": 3}')},
    "no zip": (damaged_file("model.zip", "PK"), "The last checkpoint is"),
    "deep scene": lambda folder: (damaged_options(scene="x.py")(folder), damaged_file("scene.json", DEEP)(folder)),
}  # fmt: skip
"""What happens to a run's folder, some with words of the sentence."""


@pytest.mark.parametrize("name", DAMAGES)
def test_a_damaged_folder_is_refused_in_a_sentence(name, finished, tmp_path, capsys):
    folder, (damage, *words) = tmp_path / "run", DAMAGES[name] if isinstance(DAMAGES[name], tuple) else [DAMAGES[name]]
    shutil.copytree(finished, folder)
    (tmp_path / "somebody").mkdir()
    (tmp_path / "somebody" / "file").write_text("work")
    damage(folder)
    assert train.main(["--resume", str(folder), "--strokes", "1024"]) == 2
    assert_told(capsys, *words)
    assert [(file.name, file.read_text()) for file in (tmp_path / "somebody").iterdir()] == [("file", "work")]


# What cannot be


@pytest.mark.parametrize("out", ["taken/run", "taken", "\0", "x" * 300, "/proc/none/run", "/dev/full/run", ""])
def test_a_folder_that_cannot_be_is_refused_in_a_sentence(out, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "taken").write_text("a file")
    assert train.main([*TINY, "--strokes", "128", "--out", out]) in (1, 2)
    assert_told(capsys)


@pytest.mark.parametrize(
    "call, at, code",
    [
        *(("mkdir", 1, code) for code in (errno.EROFS, errno.EACCES, errno.EDQUOT)),
        ("fsync", 2, errno.ENOSPC),
        ("replace", 3, errno.ENOSPC),
    ],
)
def test_a_disk_that_refuses_is_said_in_a_sentence(call, at, code, tmp_path, capsys, monkeypatch, short_swims):
    calls, done = itertools.count(1), getattr(os, call)

    def refuse(*arguments, **options):
        if ("run" in str(arguments[0]) or call == "fsync") and next(calls) >= at:
            raise OSError(code, os.strerror(code), str(arguments[0]))
        return done(*arguments, **options)

    with monkeypatch.context() as broken:
        broken.setattr(os, call, refuse)
        assert train.main([*TINY, "--strokes", "256", "--out", str(tmp_path / "run")]) == 1
    assert_told(capsys, "Cannot write", os.strerror(code).lower())
    assert not list(tmp_path.rglob("*.part"))
    again = ["--resume", str(tmp_path / "run")]
    if not (tmp_path / "run" / "config.json").exists():
        again = [*TINY, "--strokes", "256", "--out", str(tmp_path / "run")]
    if code == errno.ENOSPC:
        assert train.main(again) == 0


def test_a_device_that_is_not_there_is_refused_before_anything_is_written(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(train.torch.cuda, "is_available", lambda: False)
    assert train.main([*TINY, "--device", "cuda", "--out", str(tmp_path / "run")]) == 2
    assert_told(capsys, "There is no CUDA device")
    assert not (tmp_path / "run").exists()


# The bundled policy


@pytest.fixture
def box(tmp_path, monkeypatch):
    """The box with the policy that swims best, to be overwritten without regret."""
    file = tmp_path / "box" / "strokes.safetensors"
    shutil.copytree(policies.BUNDLED.parent, file.parent)
    monkeypatch.setattr("agents.cards.BUNDLED", file)
    return file


def test_a_worse_policy_goes_into_the_box_only_when_asked_twice(finished, tmp_path, box, capsys, short_cards):
    folder = tmp_path / "tiny"
    shutil.copytree(finished, folder)
    before = box.read_bytes()
    assert train.main(["--resume", str(folder), "--publish"]) == 1
    printed = capsys.readouterr().err
    assert re.search(r"stays: it takes 1[0-9.]+ strokes on 1 held-out random paths, the new one [0-9.]+", printed)
    assert f"--resume {folder} --publish --publish-anyway" in printed
    assert box.read_bytes() == before
    assert train.main(["--resume", str(folder)]) == 0 and box.read_bytes() == before
    assert train.main(["--resume", str(folder), "--publish", "--publish-anyway"]) == 0
    assert policies.load(box).training["seed"] == 4
    card = box.with_suffix(".md").read_text(encoding="utf-8")
    assert hashlib.sha256(box.read_bytes()).hexdigest() in card and "seed: 4" in card and "processors" in card
    assert "not recorded" not in card


def test_a_quick_run_is_published_only_when_asked_twice(tmp_path, capsys):
    for asked, words in (("--quick --publish", "only with --publish-anyway"), ("--publish-anyway", "give both")):
        assert train.main([*asked.split(), "--out", str(tmp_path / "run")]) == 2
        assert_told(capsys, words)
    assert not (tmp_path / "run").exists()


def test_a_run_says_how_long_it_took_to_round_the_pentagon_in_time(finished):
    found = run_folder.read(finished)
    assert found.strokes == 512 and found.seconds > 0.0
    pentagon, waypoints = run_folder.recorded(finished)[-1][1:]
    assert (found.strokes_to_target is not None) == (waypoints == 5 and pentagon <= 170)
    report = (finished / "evaluation" / "report.html").read_text(encoding="utf-8")
    assert html.escape(json.loads((finished / "config.json").read_text())["commands"][0]) in report


def test_several_seeds_are_runs_of_their_own(tmp_path, capsys, short_swims):
    assert train.main([*TINY, "--strokes", "128", "--seeds", "3", "4", "--out", str(tmp_path)]) == 0
    assert {file.name for file in tmp_path.iterdir()} == {"seed_3", "seed_4"}
    trained = [policies.load(tmp_path / f"seed_{seed}" / "policy.safetensors").training["seed"] for seed in (3, 4)]
    assert trained == [3, 4]
    table = capsys.readouterr().out.splitlines()[-3:]
    assert table[0].startswith("seed, time round the pentagon [s]") and [line[0] for line in table[1:]] == ["3", "4"]
    assert all(" waypoints, -, -" in line for line in table[1:])  # no lap was finished
    assert train.main(["--resume", str(tmp_path / "seed_3"), "--strokes", "256"]) == 0
    assert train.main(["--resume", str(tmp_path)]) == 2
    assert_told(capsys, f"such as {tmp_path / 'seed_3'}.")
    for wrong in (["--seeds", "1", "1"], ["--seeds", "1", "--publish"]):
        with pytest.raises(SystemExit):
            train.main([*TINY, *wrong])


def test_seeds_that_a_stop_left_are_named(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("train.run", lambda options, _: 130 * (options.seed == 4))
    assert train.main([*TINY, "--seeds", "3", "4", "5", "6", "--out", str(tmp_path)]) == 130
    assert f"--seeds 5 6 --out {tmp_path}" in capsys.readouterr().out


def filmed(folder, *arguments):
    """Bytes of the film of the script of a tiny training."""
    options = [word for word in TINY if word != "--no-video"]
    assert train.main([*options, "--strokes", "128", *arguments, "--out", str(folder)]) == 0
    assert sorted(file.name for file in (folder / "evaluation").iterdir()) == [
        "evaluation.csv", "learned.mp4", "report.html", "script.mp4", "traces.png",
    ]  # fmt: skip
    return (folder / "evaluation" / "script.mp4").read_bytes()


def no_process(*arguments, **options):
    raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))


def lost_process(command, **options):
    return subprocess.Popen([sys.executable, "-c", "raise SystemExit(1)"], **options)


def test_the_script_is_filmed_beside_the_training_and_else_afterwards(tmp_path, monkeypatch):
    """The film has the same bytes wherever it is made: beside, here on one processor, and where a process is lost."""
    monkeypatch.setattr("agents.options.TIME_LIMIT", 3.0)
    monkeypatch.setattr("agents.comparison.processors", lambda: 2)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    there, made = {}, train.compare

    def compare(agents, options, robot, remarks, folder, filmed):
        there[folder] = filmed["script"]()
        made(agents, options, robot, remarks, folder, filmed)

    monkeypatch.setattr("train.compare", compare)
    beside = filmed(tmp_path / "beside", "--decision-period", "0.5")
    assert there[tmp_path / "beside"] is not None
    for name, popen in {"none": no_process, "lost": lost_process}.items():
        monkeypatch.setattr("agents.comparison.subprocess", SimpleNamespace(DEVNULL=subprocess.DEVNULL, Popen=popen))
        assert filmed(tmp_path / name, "--decision-period", "0.5") == beside
    monkeypatch.setattr("agents.comparison.processors", lambda: 1)
    assert filmed(tmp_path / "alone", "--decision-period", "0.5") == beside
    assert [there[tmp_path / name] for name in ("none", "lost", "alone")] == [None] * 3
    assert not list(tmp_path.glob("seastar-film-*"))


def test_a_training_that_is_stopped_ends_the_process_that_films(tmp_path, monkeypatch):
    monkeypatch.setattr("agents.comparison.processors", lambda: 2)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    from agents.comparison import _begun as begin

    begun = []
    monkeypatch.setattr("agents.comparison._begun", lambda words: begun.append(begin(words)) or begun[-1])
    monkeypatch.setattr("train.train", lambda *given: (_ for _ in ()).throw(KeyboardInterrupt))
    options = [word for word in TINY if word != "--no-video"]
    assert train.main([*options, "--out", str(tmp_path / "run")]) == 130
    (process,) = begun
    assert process.poll() is not None and not list(tmp_path.glob("seastar-film-*"))
    assert not (tmp_path / "run" / "evaluation").exists()


def test_a_timed_training_is_evaluated_and_kept_in_its_own_decisions(tmp_path, monkeypatch, short_cards):
    """Its policy file says the decision period, and the script that it is compared with is the lagged one."""
    monkeypatch.setattr("agents.options.TIME_LIMIT", 125.0)  # the script needs less
    folder = tmp_path / "timed"
    arguments = [*TINY, "--strokes", "256", "--decision-period", "0.5", "--out", str(folder)]
    assert train.main(arguments) == 0
    policy = policies.load(folder / "policy.safetensors")
    assert policy.decision_period == 0.5
    with (folder / "evaluation" / "evaluation.csv").open() as stream:
        rows = {row["agent"]: row for row in csv.DictReader(stream)}
    assert float(rows["script"]["simulated_time_s"]) < 120 < 2 * int(rows["script"]["strokes_to_finish"])
    assert float(rows["learned"]["simulated_time_s"]) <= 125.0
    assert "--decision-period 0.5" in (folder / "evaluation" / "report.html").read_text()
    assert training.saved_options(folder).ppo.decision_period == 0.5
    monkeypatch.setattr("agents.cards.BUNDLED", tmp_path / "box" / "strokes.safetensors")
    monkeypatch.setattr("agents.cards.HELD_OUT_PATHS", 2)
    assert train.main(["--resume", str(folder), "--publish"]) == 0
    shipped = policies.bundled_file(0.5, tmp_path / "box" / "strokes.safetensors")
    assert policies.load(shipped).decision_period == 0.5
    assert publishing.why_not(policy, training.saved_options(folder)) is None
    assert train.rivals(0.3) == {} and train.rivals(None)["script"].decision_period is None  # 0.3 s is of no gait


@pytest.mark.parametrize(
    "n_limbs, period, name",
    [(5, None, "pentagon"), (5, 0.2, "lagged-pentagon"), (5, 0.3, None), (3, None, "greedy"), (4, 0.2, "greedy")],
)
def test_a_robot_of_any_number_of_limbs_has_a_rival_that_fits(n_limbs, period, name):
    scene = Scene(Seastar(n_limbs, 3), numerics=Scene.preset("fast").numerics)
    scene = scene if period is None else replace(scene, actuator=SmaWires())
    assert train.rival_of(period, scene) == name
    if name is not None:
        (policy,) = train.rivals(period, scene).values()
        require_fit(policy, scene, actions_of(policy, n_limbs), period)
        with pytest.raises(ValueError, match=f"of {n_limbs} limbs, the environment's has 6"):
            require_fit(policy, replace(scene, robot=Seastar(6, 3)), actions_of(policy, n_limbs), period)
