"""`seastar drive`: it plans, asks, drives and reports, and says in a sentence why it does not."""

import io
import os
import subprocess
import sys
import threading
import time
import tty
from pathlib import Path

import pytest

from seastar_gym.cli.main import main
from seastar_gym.identify.measurement import Measurement

ROLES = Path(__file__).with_name("roles.py")
SHORT = ["--path", "line", "--seconds", "2", "--no-window"]


def drive(tmp_path, *more):
    return main(["drive", "straight", *SHORT, "--out", str(tmp_path / "out"), *more])


@pytest.fixture
def tank():
    """A simulated plant in another process, and the name of its serial line."""
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, ROLES, "tank", str(ours)]
    with subprocess.Popen(command, pass_fds=[ours], env=environment, text=True, stdout=subprocess.PIPE) as process:
        assert process.stdout.readline() == "ready\n"
        yield process, f"serial:{os.ttyname(theirs)}"
        process.kill()
    for file in (ours, theirs):
        os.close(file)


def test_a_simulated_drive_is_planned_driven_and_reported(tmp_path, capsys):
    assert drive(tmp_path, "--yes", "--sight", "1") == 0
    said, out = capsys.readouterr().out, tmp_path / "out"
    assert "Plan: 0 of 1 waypoints, 0.4 s of heat in 4 decisions" in said and "The guard had nothing to stop." in said
    names = {"plan.png", "driven.png", "report.md", "tracking.csv", "commands.csv", "poses.csv"}
    assert {file.name for file in out.iterdir()} == names
    report = (out / "report.md").read_text()
    assert "| policy | straight |" in report and "| decisions | 4, every 0.5 s" in report
    measured = Measurement.from_csv(out / "tracking.csv", out / "commands.csv")
    assert measured.commands.tolist() == [[0, 1, 0, 0, -1], [0] * 5] * 2 and len(measured.nodes) == 6


@pytest.mark.parametrize("answer, is_heated", [("n\n", False), ("", False), ("yes\n", True)])
def test_it_asks_before_wires_are_heated(answer, is_heated, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(sys, "stdin", io.StringIO(answer))
    assert drive(tmp_path) == 0
    assert "Heat the wires? [y/N] " in (said := capsys.readouterr().out)
    assert ("No wire was heated." in said) != is_heated
    assert (tmp_path / "out" / "tracking.csv").exists() == is_heated and (tmp_path / "out" / "plan.png").exists()


def test_a_dry_run_heats_nothing(tmp_path, capsys):
    assert drive(tmp_path, "--dry", "--plant", "serial:/dev/null") == 0
    assert capsys.readouterr().out.endswith("No wire was heated.\n")


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="There are no pseudo-terminals here.")
def test_a_drive_over_a_serial_line(tank, tmp_path, capsys):
    """The second one finds what is left of the first one on the line, and its plant dies."""
    process, line = tank
    assert drive(tmp_path / "first", "--yes", "--plant", line) == 0
    assert "The guard had nothing to stop." in capsys.readouterr().out
    commands = tmp_path / "second" / "out" / "commands.csv"

    def kill():
        while not commands.exists() or len(commands.read_text().splitlines()) < 3:
            time.sleep(0.05)
        process.kill()

    killer = threading.Thread(target=kill, daemon=True)
    killer.start()
    assert drive(tmp_path / "second", "--yes", "--plant", line, "--seconds", "20") == 1
    killer.join(10.0)
    assert "No new picture for 0.12 s: all wires are stopped." in capsys.readouterr().out


@pytest.mark.parametrize(
    "arguments, words",
    [(["straight", "--plant", "usb"], "A plant is sim, or serial:/dev/"), (["learned", "--dry"], "policy sees 196"),
     (["straight", "--yes", "--plant", "serial:/dev/none"], "/dev/none cannot be opened: no such file or directory."),
     (["straight", "--yes", "--plant", "serial:/dev/null"], "/dev/null is no serial line."),
     (["straight", "--sight", "nodes"], "A tracker sees no nodes"), (["straight", "--seconds", "0"], "--seconds must"),
     (["nobody"], "Unknown scripted agent"), (["straight", "--scene", "none.py"], "none.py is no file.")],
)  # fmt: skip
def test_what_cannot_be_driven_is_said_in_a_sentence(arguments, words, tmp_path, capsys):
    assert main(["drive", *SHORT, "--out", str(tmp_path), *arguments]) != 0
    said = capsys.readouterr().err
    assert words in said and said.count("\n") == 1 and said.endswith(".\n")
