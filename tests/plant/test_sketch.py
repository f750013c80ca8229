"""The sketch for a microcontroller does what a driver asks over a pseudo-terminal, and no more, whatever goes wrong."""

import os
import shutil
import subprocess
import time
import tty
from io import FileIO
from pathlib import Path

import numpy as np
import pytest

from faults import COLD_WITHIN, LIES, Heated, garbage, greedy
from seastar_gym.plant.guard import LATENESS, Heat, Limits
from seastar_gym.plant.lines import LinePlant, sealed

CANNOT = not (shutil.which("g++") and hasattr(os, "openpty"))
pytestmark = pytest.mark.skipif(CANNOT, reason="There is no compiler, or no pseudo-terminal, here.")
HERE = Path(__file__).parent
SKETCH = HERE.parents[1] / "examples"


def compiled(folder, name):
    """The sketch as a program of this computer, and of a board in a file of this folder."""
    options = ["-Wall", "-Wextra", "-Werror", "-fsanitize=address,undefined", "-fno-sanitize-recover", f"-I{SKETCH}"]
    subprocess.run(["g++", *options, str(HERE / f"{name}.cpp"), "-o", str(folder / name)], check=True)
    return folder / name


@pytest.fixture(scope="module")
def board(tmp_path_factory):
    return compiled(tmp_path_factory.mktemp("board"), "board")


@pytest.fixture(scope="module")
def played(tmp_path_factory):
    """Function that plays events to the sketch; what was heated, and what it said and when [s]."""
    program = compiled(tmp_path_factory.mktemp("played"), "played")

    def play(events):
        script = "".join(f"{name} {value.hex() or '-' if name == 'say' else value}\n" for name, value in events)
        told = subprocess.run([program], input=script, stdout=subprocess.PIPE, text=True, check=True).stdout
        heated, said = Heated(), []
        for what, milliseconds, rest in (line.split(" ", 2) for line in told.splitlines()):
            seconds = int(milliseconds) / 1000.0
            if what == "said":
                said.append((seconds, rest))
                continue
            pin, level = map(int, rest.split())
            (heated.on if level else heated.off)(divmod(pin - 2, 2), seconds)
        return heated, said

    return play


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


# On a clock that is played


def held(rng, milliseconds):
    """Events of a driver with a guard that holds the heat, and whose lines are late."""
    limits, events, sent = Limits(), [("say", sealed("hello 1")), ("go", 20)], []
    heat, time = Heat(5, limits, LATENESS), 0
    while time < milliseconds:
        pulse = int(rng.choice([120, 100, 50]))
        free = ~heat.resting(pulse / 1000.0) & (rng.random((5, 2)) < 0.7)
        free[:, 1] &= ~free[:, 0]
        signs = "".join("0+-"[1 * one + 2 * other] for one, other in free)
        heat.heat(free, pulse / 1000.0)
        sent.append((time + rng.integers(0, round(1000 * LATENESS)), sealed(f"heat {pulse} {signs}")))
        for _ in range(int(rng.choice([2, 6, 13]))):
            time += 10
            heat.tick(time / 1000.0)
    beats = [(at, sealed("beat")) for at in range(0, milliseconds, 50)]
    arrivals, now = sorted(sent + beats), 0
    for at, line in arrivals:
        events += [("go", at - now), ("say", line)] if at > now else [("say", line)]
        now = max(at, now)
    return events


def duration(events):
    return sum(value for name, value in events if name in ("go", "off")) / 1000.0


def lying(rng):
    return [("say", LIES[rng.integers(len(LIES))]), ("go", 100)]


def flooding(rng):
    return [event for _ in range(10) for event in (("say", garbage(rng)), ("go", 40))]


def holding(rng):
    return [event for line, after in [(sealed("hello 1"), 1), *greedy(rng)] for event in (("say", line), ("go", after))]


def beating(rng):
    return [event for _ in range(5) for event in (("say", sealed("beat") * 50), ("go", 50))]


def restarting(rng):
    return [*holding(rng), ("off", 500), *holding(rng)]


def jumping(rng):
    return [*holding(rng), ("jump", int(rng.choice([3_600_000, 1000, 4_294_960_000]))), ("go", 1), *holding(rng)]


FAULTS = [lambda rng: [], lying, flooding, holding, beating, restarting, jumping]


def test_whatever_goes_wrong_wires_are_cold_soon_and_never_too_hot(played):
    """500 drives in a row, over the time at which the board's clock comes round."""
    rng, events, ends = np.random.default_rng(0), [], []
    for drive in range(500):
        events += [*held(rng, int(rng.integers(20, 400))), *FAULTS[drive % len(FAULTS)](rng)]
        ends.append(duration(events))
        events.append(("go", 600))
    heated, _ = played(events)
    assert heated.hottest() <= Limits().hottest and heated.together() == 0.0
    offs = np.array(sorted(end for each in heated.intervals.values() for _, end in each))
    begins = np.array([begin for each in heated.intervals.values() for begin, _ in each])
    assert len(begins) > 2000
    for end in ends:
        assert not ((offs > end + COLD_WITHIN) & (offs < end + 0.6)).any()


def test_the_sketch_takes_what_a_guard_asks_for(played):
    heated, said = played([*held(np.random.default_rng(0), 20_000), ("go", 300)])
    assert not [line for _, line in said if "error" in line]
    assert Limits().hottest - 12.0 < heated.hottest() <= Limits().hottest


@pytest.mark.parametrize("lie", LIES)
def test_no_lie_is_followed(lie, played):
    heated, said = played([("say", sealed("hello 1")), ("go", 5), ("say", sealed("heat 100 +0000")), ("go", 50),
                           ("say", lie), ("go", 200)])  # fmt: skip
    assert heated.intervals.keys() == {(0, 0)} and heated.last() < 0.06
    assert sum("error" in line for _, line in said) >= 1 or b"hello" in lie


@pytest.mark.parametrize("greeting", [[], [("say", sealed("hello 2"))], [("say", sealed("hello 1")), ("off", 500)]])
def test_nothing_is_heated_before_a_greeting_in_the_right_version(greeting, played):
    heated, said = played([*greeting, ("go", 5), ("say", sealed("heat 100 +0000")), ("go", 200)])
    assert not heated.intervals and said[-1][1].startswith("error ")


def test_a_pulse_begun_is_never_prolonged_and_floods_do_not_keep_it(played):
    greeting = [("say", sealed("hello 1")), ("go", 5)]
    heated, _ = played([*greeting, *[("say", sealed("heat 120 +0000")), ("go", 90)] * 20])
    assert max(end - begin for begin, end in heated.intervals[0, 0]) <= 0.121
    heated, _ = played([*greeting, ("say", sealed("heat 100 +0000")), ("go", 2), ("say", b"x" * 30_000), ("go", 400)])
    assert heated.last() < 0.12
