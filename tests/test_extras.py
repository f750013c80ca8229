"""Without an optional dependency there is one sentence with the command that installs it, and no traceback."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from seastar_gym.cli.main import COMMANDS
from seastar_gym.command import run_command

ROOT = Path(__file__).resolve().parent.parent
OF_STUDIES = ("matplotlib", "rich", "tqdm", "tyro")
OF_EXTRAS = ("h5py", "imageio", "matplotlib", "minari", "onnx", "optuna", "pandas", "PIL", "plotly", "pyarrow",
             "pygame", "rich", "sqlalchemy", "stable_baselines3", "tensorboard", "tqdm", "tyro")  # fmt: skip
OF_TRAIN = ("imageio", "plotly", "stable_baselines3", "tensorboard", "torch", "tyro")


def commands(folder: str) -> list[str]:
    """Every module of a folder that `python -m` runs, a room by the name of its folder."""
    files = [
        file
        for file in sorted((ROOT / folder).rglob("*.py"))
        if file.stem == "__main__" or '__name__ == "__main__"' in file.read_text(encoding="utf-8")
    ]
    names = [".".join(file.relative_to(ROOT).with_suffix("").parts) for file in files]
    return [name.removesuffix(".__main__") for name in names]


STUDIES, AGENTS = ("studies", "studies.tasks", "studies.gallery"), commands("agents")


def python(tmp_path, missing, *arguments):
    """The command's result on a machine that lacks these modules."""
    (tmp_path / "sitecustomize.py").write_text(f"import sys; sys.modules.update(dict.fromkeys({missing!r}))")
    path = os.pathsep.join([str(tmp_path), str(ROOT)])
    done = subprocess.run(
        [sys.executable, *arguments], cwd=ROOT, env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    done.stderr = re.sub("^seastar_gym compiles .*\n", "", done.stderr)  # where its cache is empty
    return done


def assert_says(done, extra, missing):
    assert done.returncode in (1, 2) and done.stdout == ""
    assert done.stderr.count("\n") == 1, done.stderr
    assert done.stderr.endswith(f': pip install "seastar-gym[{extra}]".\n'), done.stderr
    assert any(name in done.stderr for name in missing)


def test_there_are_commands_to_test():
    assert set(AGENTS) == {"agents.cards", "agents.evaluate", "agents.rllib", "agents.tasks", "agents.trials"}


@pytest.mark.parametrize("command", ["studies", *AGENTS, "seastar_gym.identify", "seastar_gym.sweep"])
def test_every_command_says_in_a_sentence_what_the_disk_refuses(command):
    place = ROOT.joinpath(*command.split("."))
    file = place / "__main__.py" if place.is_dir() else place.with_suffix(".py")
    last_line = file.read_text(encoding="utf-8").splitlines()[-1]
    assert last_line.strip() == "run_command(main)"


@pytest.mark.parametrize(
    "failure, sentence",
    [
        (OSError(28, "No space left on device", "out.csv"), "Cannot write or read out.csv: no space left on device."),
        (OSError(28, "No space left on device"), "Cannot write or read a file: no space left on device."),
        (FileNotFoundError("There is no file out.csv."), "There is no file out.csv."),
    ],
)
def test_what_the_disk_refuses_is_said_in_a_sentence(failure, sentence, capsys):
    def main():
        raise failure

    with pytest.raises(SystemExit) as ended:
        run_command(main)
    assert capsys.readouterr().err == f"{sentence}\n"
    assert ended.value.code == (2 if failure.errno is None else 1)


def test_a_command_keeps_its_exit_code():
    for code in (None, 0, 2):
        with pytest.raises(SystemExit) as ended:
            run_command(lambda code=code: code)
        assert ended.value.code == code


PICTURE = (
    "import gymnasium, seastar_gym\n"
    "try: env = gymnasium.make('SeastarSwim-v0', render_mode='rgb_array'); env.reset(seed=0); env.render()\n"
    "except ImportError as missing: raise SystemExit(str(missing))"
)
WITHOUT = [
    *(("studies", OF_STUDIES, ("-m", command, "--help")) for command in STUDIES),
    *(("train", OF_TRAIN, ("-m", command, "--help")) for command in AGENTS),
    *(("train", missing, ("train.py", "--help"))
      for missing in (("tyro",), ("tensorboard",), ("torch", "stable_baselines3"), ("plotly",))),
    ("train", ("torch", "stable_baselines3"), ("-m", "studies.robustness")),
    ("sweep", ("pyarrow",), ("-m", "seastar_gym.sweep", "--help")),
    ("studies", ("matplotlib",), ("-m", "seastar_gym.identify", "--synthetic", "--picture", "fit.png")),
    ("render", ("pygame",), ("-c", PICTURE)),
]  # fmt: skip
"""Extra, modules that are missing without it, and a command that needs them."""


@pytest.mark.parametrize("extra, missing, command", WITHOUT)
def test_a_command_without_its_extra_says_how_to_get_it(extra, missing, command, tmp_path):
    assert_says(python(tmp_path, missing, *command), extra, missing)


def test_sweeps_need_no_optuna_and_searches_say_how_to_get_it(tmp_path):
    pytest.importorskip("pyarrow")
    sweep = "-m", "seastar_gym.sweep", "robot.limb_length=0.08:0.1:3", "--out", str(tmp_path / "out")
    missing = ("optuna", "sqlalchemy")
    counted = python(tmp_path, missing, *sweep, "--count")
    assert counted.returncode == 0 and counted.stdout.startswith("3 designs in "), counted.stderr
    assert_says(python(tmp_path, missing, *sweep, "--optuna", "2"), "search", missing)


@pytest.mark.parametrize("command", sorted(COMMANDS))
def test_help_of_every_command_needs_no_extra_or_says_which(command, tmp_path):
    """With the base dependencies alone."""
    code = f"from seastar_gym.cli.main import main; raise SystemExit(main([{command!r}, '--help']))"
    done = python(tmp_path, OF_EXTRAS, "-c", code)
    if done.returncode:
        extra = {"sweep": "sweep", "train": "train"}[command]
        assert_says(done, extra, OF_EXTRAS)
    else:
        assert done.stdout.startswith(f"usage: seastar {command} ") and not done.stderr


@pytest.mark.parametrize("extra, module", [("ray", "ray"), ("slurm", "submitit")])
def test_an_executor_without_its_extra_says_how_to_get_it(extra, module, tmp_path):
    pytest.importorskip("pyarrow")
    words = "-m", "seastar_gym.sweep", "--executor", extra, "--out", str(tmp_path / "out")
    done = python(tmp_path, (module,), *words)
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].endswith(f'need {module}: pip install "seastar-gym[{extra}]".')


def test_importing_a_study_without_its_extra_is_a_missing_module(tmp_path):
    code = "import studies.operations"
    done = python(tmp_path, ("rich",), "-c", code)
    assert done.stderr.splitlines()[-1] == (
        'seastar_gym.extras.MissingExtra: The studies need rich: pip install "seastar-gym[studies]".'
    )
