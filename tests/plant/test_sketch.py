"""The reference sketch for a microcontroller does what a driver asks over a pseudo-terminal, and no more."""

import os
import shutil
import subprocess
import time
import tty
from io import FileIO
from pathlib import Path

import pytest

from seastar_gym.plant.lines import LinePlant, sealed
from seastar_gym.plant.plant import PlantError

pytestmark = pytest.mark.skipif(
    not (shutil.which("g++") and hasattr(os, "openpty")), reason="There is no compiler, or no pseudo-terminal, here."
)
HERE = Path(__file__).parent
SKETCH = HERE.parents[1] / "examples"


@pytest.fixture(scope="module")
def board(tmp_path_factory):
    """The sketch as a program of this computer."""
    program = tmp_path_factory.mktemp("board") / "board"
    command = ["g++", "-Wall", "-Wextra", "-Werror", f"-I{SKETCH}", str(HERE / "board.cpp"), "-o", str(program)]
    subprocess.run(command, check=True)
    return program


@pytest.fixture
def wires(board, tmp_path):
    """A driver of the board, the serial line, and what tells the changes of pins: milliseconds, pin, level."""
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    with (tmp_path / "pins").open("wb") as pins:
        process = subprocess.Popen([board, str(theirs), str(pins.fileno())], pass_fds=[theirs, pins.fileno()])

    def changes():
        return [tuple(map(int, line.split())) for line in (tmp_path / "pins").read_text().splitlines()]

    with FileIO(ours, "r+") as line:
        yield LinePlant(line), ours, changes
        process.kill()
        process.wait()
    os.close(theirs)


def beat(plant, seconds):
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        plant.sight()
        time.sleep(0.01)


def test_pulses_heat_their_wires_for_their_time(wires):
    plant, _, changes = wires
    assert plant.n_limbs == 5
    plant.heat([1, 0, -1, 0, 0], 0.08)
    beat(plant, 0.2)
    on, off = changes()[:2], changes()[2:]
    assert {(pin, level) for _, pin, level in on} == {(2, 1), (7, 1)} and {one[1:] for one in off} == {(2, 0), (7, 0)}
    assert 79 <= off[0][0] - on[0][0] <= 110
    plant.heat([0, 0, 0, 0, 1], 0.1)
    plant.stop()
    beat(plant, 0.05)
    (began, *_), (ended, *_) = changes()[4:]
    assert ended - began < 60


def test_a_driver_that_is_silent_has_cold_wires(wires):
    plant, _, changes = wires
    plant.heat([1, 1, 1, 1, 1], 0.12)
    plant.sight()
    time.sleep(0.3)
    times = [change[0] for change in changes()]
    assert len(times) == 10 and 95 <= max(times) - min(times) <= 119


@pytest.mark.parametrize(
    "bad", [b"heat 80 +0000\n", b"x" * 300 + b"\n", *map(sealed, ["heat 121 +0000", "heat 80 +000", "heat 80 +000x",
                                                                  "heat +0000", "fly", "heat  +0000"])]
)  # fmt: skip
def test_bad_lines_cool_the_wires_and_are_told(bad, wires):
    plant, line, changes = wires
    plant.heat([0, 1, 0, 0, 0], 0.12)
    os.write(line, bad)
    with pytest.raises(PlantError, match="The plant has stopped: "):
        beat(plant, 1.0)
    (on, *_), (off, *_) = changes()
    assert off - on < 60


def test_another_version_is_not_heated(wires):
    plant, line, changes = wires
    os.write(line, sealed("hello 2"))
    plant.heat([1, 0, 0, 0, 0], 0.05)
    with pytest.raises(PlantError, match="The plant has stopped: "):
        beat(plant, 1.0)
    assert not changes()
