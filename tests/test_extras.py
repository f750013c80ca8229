"""Without an optional dependency there is one sentence with the command that installs it, and no traceback."""

import json
import os
import re
import subprocess
import sys
from argparse import Namespace
from pathlib import Path

import pytest

from seastar_gym.command import run_command
from seastar_gym.files import MissingExtra

ROOT = Path(__file__).resolve().parent.parent
OF_STUDIES = ("matplotlib", "rich", "tqdm", "tyro")
OF_EXTRAS = ("h5py", "imageio", "matplotlib", "onnx", "optuna", "pandas", "PIL", "plotly", "pyarrow",
             "pygame", "rich", "serial", "sqlalchemy", "stable_baselines3", "tables", "tensorboard", "tqdm",
             "tyro")  # fmt: skip
OF_TRAIN = ("imageio", "plotly", "stable_baselines3", "tensorboard", "torch", "tyro")


def python(folder, missing, *arguments):
    """The command's result on a machine that lacks these modules."""
    (folder / "sitecustomize.py").write_text(f"import sys; sys.modules.update(dict.fromkeys({missing!r}))")
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(folder), str(ROOT)])}
    done = subprocess.run([sys.executable, *arguments], cwd=ROOT, env=env, capture_output=True, text=True, check=False)
    done.stderr = re.sub("^seastar_gym compiles .*\n", "", done.stderr)  # where its cache is empty
    return done


def assert_says(done, extra, missing):
    assert done.returncode in (1, 2) and done.stdout == ""
    assert done.stderr.count("\n") == 1, done.stderr
    assert done.stderr.endswith(f': pip install "seastar-gym[{extra}]".\n'), done.stderr
    assert any(name in done.stderr for name in missing)


@pytest.mark.parametrize(
    "end, code, sentence",
    [
        (OSError(28, "No space left on device", "a.csv"), 1, "Cannot write or read a.csv: no space left on device.\n"),
        (OSError(28, "No space left on device"), 1, "Cannot write or read a file: no space left on device.\n"),
        (FileNotFoundError("There is no file out.csv."), 2, "There is no file out.csv.\n"),
        (KeyboardInterrupt(), 130, "Interrupted.\n"),
        *((code, code, "") for code in (None, 0, 2)),
    ],
)
def test_a_command_keeps_its_exit_code_or_says_in_a_sentence_what_the_disk_refuses(end, code, sentence, capsys):
    def main():
        if isinstance(end, BaseException):
            raise end
        return end

    with pytest.raises(SystemExit) as ended:
        run_command(main)
    assert (ended.value.code, capsys.readouterr().err) == (code, sentence)


PICTURE = (
    "import gymnasium, seastar_gym\n"
    "try: env = gymnasium.make('SeastarSwim-v0', render_mode='rgb_array'); env.reset(seed=0); env.render()\n"
    "except ImportError as missing: raise SystemExit(str(missing))"
)
PORT = (
    "from seastar_gym.plant.lines import open_serial\n"
    "try: open_serial('/dev/none')\n"
    "except ImportError as missing: raise SystemExit(str(missing))"
)
SWEEP = "-m", "seastar_gym.cli", "sweep", "robot.limb_length=0.08:0.1:3", "--out", os.devnull
WITHOUT = [
    ("studies", OF_STUDIES, ("-m", "studies", "--help")),
    *(("train", OF_TRAIN, ("-m", command, "--help")) for command in ("agents.cards", "agents.tasks")),
    *(("train", missing, ("train.py", "--help"))
      for missing in (("tyro",), ("torch", "stable_baselines3"))),
    ("sweep", ("pyarrow",), SWEEP),
    ("search", ("optuna", "sqlalchemy"), (*SWEEP, "--optuna", "2")),
    ("studies", ("matplotlib",), ("-m", "seastar_gym.cli", "identify", "a.csv", "b.csv", "--picture", "fit.png")),
    ("render", ("pygame",), ("-c", PICTURE)),
    ("plant", ("serial",), ("-c", PORT)),
]  # fmt: skip
"""Extra, modules that are missing without it, and a command that needs them."""


@pytest.mark.parametrize("extra, missing, command", WITHOUT)
def test_a_command_without_its_extra_says_how_to_get_it(extra, missing, command, tmp_path):
    assert_says(python(tmp_path, missing, *command), extra, missing)


@pytest.mark.parametrize("extra, module", [("ray", "ray"), ("slurm", "submitit"), ("dask", "distributed")])
def test_an_executor_without_its_extra_says_how_to_get_it(extra, module, tmp_path, monkeypatch):
    executors = pytest.importorskip("seastar_gym.sweep.executors")
    monkeypatch.setitem(sys.modules, module, None)
    options = Namespace(executor=extra, workers=None, address=None, partition=None, minutes=None, out=tmp_path)
    install = re.escape(f'need {module}: pip install "seastar-gym[{extra}]".')
    with pytest.raises(MissingExtra, match=install), executors.executor_of(options):
        pass


def test_sweeps_need_no_optuna(tmp_path):
    counted = python(tmp_path, ("optuna", "sqlalchemy"), *SWEEP, "--count")
    assert counted.returncode == 0 and counted.stdout.startswith("3 designs in "), counted.stderr


HELPS = """
import contextlib, io, json
from seastar_gym.cli.main import COMMANDS, main
found = {}
for command in COMMANDS:
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = main([command, "--help"])
        except SystemExit as ended:
            code = ended.code
    found[command] = code, out.getvalue(), err.getvalue()
print(json.dumps(found))
"""


def test_help_of_every_command_needs_no_extra_or_says_which(tmp_path):
    """With the base dependencies alone."""
    found = json.loads(python(tmp_path, OF_EXTRAS, "-c", HELPS).stdout)
    for command, (code, told, error) in found.items():
        if code:
            assert error.endswith(f': pip install "seastar-gym[{command}]".\n') and not told, command
        else:
            assert told.startswith(f"usage: seastar {command} ") and not error, command
    assert {command for command, (code, *_) in found.items() if code} == {"sweep", "train"}
