"""Drives in which something goes wrong at a random time: wires are cold soon, never too hot, never both of a limb. The
clock is simulated; driver, guard, lines and server are those of real drives."""

import contextlib
import itertools
import socket
from types import SimpleNamespace

import numpy as np
import pytest

from faults import COLD_WITHIN, LIES, Tank, garbage, greedy
from seastar_gym.plant import guard as heat
from seastar_gym.plant.guard import Guard, Limits
from seastar_gym.plant.lines import LinePlant, Server, sealed
from seastar_gym.plant.plant import PlantError

STEP = 0.01


@pytest.fixture(autouse=True)
def no_wall_clock(monkeypatch):
    """All time that passes is that of the simulation."""
    monkeypatch.setattr(heat, "time", SimpleNamespace(monotonic=lambda: 0.0))


class Far(LinePlant):
    """What a driver has of the plant."""

    def __init__(self, drive):
        self.drive = drive
        super().__init__(drive.ends[1], clock=lambda: drive.tank.time + drive.shift)

    def wait(self, seconds):
        self.drive.go_on(seconds)

    def sight(self):
        if self.drive.fails is not None:
            raise self.drive.fails
        return super().sight()


class Drive:
    """A driver with a guard, and a plant at the other end of a line."""

    def __init__(self, rng):
        self.rng, self.tank, self.ends = rng, Tank(), socket.socketpair()
        self.server, self.shift, self.fails = Server(self.tank, self.ends[0]), 0.0, None
        self.plant = Far(self)
        self.guard = Guard(self.plant, Limits())

    def go_on(self, seconds):
        """Let time go by, in which the plant does what it is told."""
        until = self.tank.time + seconds
        while self.tank.time < until - 1e-9:
            self.tank.time = min(self.tank.time + STEP, until)
            if self.server is not None:
                try:
                    self.server.turn()
                except (OSError, MemoryError):
                    self.server = None

    def swim(self, seconds):
        """Hold the heat as the guard allows; returns whether it went well."""
        until = self.tank.time + seconds
        try:
            while self.tank.time < until:
                free = ~self.guard.resting()
                wanted = np.where(free & (self.rng.random((5, 2)) < 0.7), [1, -1], 0)
                limbs = np.where(wanted[:, 0] != 0, wanted[:, 0], wanted[:, 1])
                self.guard.heat(limbs.tolist(), self.rng.choice([0.12, 0.1, 0.05]))
                self.guard.wait_until(self.plant.now() + self.rng.choice([0.02, 0.06, 0.13]))
        except (PlantError, OSError, KeyboardInterrupt, MemoryError, OverflowError):
            return False
        return True

    def say(self, lines):
        """Something else says lines in the place of the driver; each with the time after it [ms]."""
        for line, milliseconds in lines:
            with contextlib.suppress(BlockingIOError):
                self.ends[1].send(line)
            self.go_on(milliseconds / 1000.0)

    def close(self):
        for end in self.ends:
            end.close()

    # What goes wrong; each returns the time at which the driver or the plant was lost.

    def driver_dies(self):
        return self.tank.time

    def driver_closes(self):
        self.ends[1].close()
        return self.tank.time

    def driver_fails(self):
        self.fails = [OSError(5, "gone"), KeyboardInterrupt(), MemoryError(), OverflowError()][self.rng.integers(4)]
        now = self.tank.time
        assert not self.swim(0.5) and self.guard.held_back
        return now

    def plant_fails(self):
        failures = OSError(5, "gone"), MemoryError(), PlantError("Gone."), ValueError("Gone.")
        self.tank.fails = failures[self.rng.integers(4)]
        now = self.tank.time
        assert not self.swim(0.5)
        return now

    def plant_restarts(self):
        now, self.server = self.tank.time, None
        self.tank.stop()  # no power
        self.swim(0.05)
        self.go_on(0.5)
        self.server = Server(self.tank, self.ends[0])
        self.go_on(0.05)
        with pytest.raises(PlantError, match="has restarted"):
            self.plant.sight()
        return now

    def sight_freezes(self):
        self.tank.seen_until = self.tank.time
        now = self.tank.time
        assert not self.swim(0.5)
        return now

    def clock_jumps(self):
        self.shift += self.rng.choice([3600.0, 1.0, -0.05, -3600.0])
        self.swim(0.2)
        return self.tank.time

    def plant_lies(self):
        lies = ["hello 1 5", "error It burns.", "sight nan 0 0 0", "sight 1 1_0 0 0", "sight 1 1e999 0 0", "fly",
                f"sight 1 0 0 {'9' * 400}", f"hello 1 {'9' * 5000}", "sight inf 0 0 0", "sight 1 0 0 0 1"]  # fmt: skip
        now = self.tank.time
        self.ends[0].send(sealed(lies[self.rng.integers(len(lies))]))
        assert not self.swim(0.5) and self.guard.held_back
        return now

    def driver_lies(self):
        """It is stopped at once."""
        self.say([(LIES[self.rng.integers(len(LIES))], 10)])
        return self.tank.time - COLD_WITHIN

    def driver_floods(self):
        self.say([(garbage(self.rng) * 80, 20)] * 10)
        return self.tank.time - COLD_WITHIN

    def driver_holds_the_heat(self):
        self.say([(sealed("hello 1"), 10), *greedy(self.rng)])
        return self.tank.time

    def driver_beats_for_ever(self):
        self.say([(sealed("beat") * 2000, 20)] * 3)
        return self.tank.time

    def clock_of_the_plant_jumps(self):
        """While somebody holds the heat."""
        for jump in self.rng.choice([3600.0, 1.0, -0.05, -3600.0], 3):
            self.say([(sealed("hello 1"), 10), *greedy(self.rng)[:12]])
            self.tank.shift += jump
        return self.tank.time


FAULTS = [name for name in vars(Drive) if name.startswith(("driver_", "plant_", "sight_", "clock_"))]


@pytest.mark.parametrize("seeds", [range(8), range(8, 39)], ids=["few", "500 with the few"])
def test_whatever_goes_wrong_wires_are_cold_soon_and_never_too_hot(seeds):
    broken = []
    for fault, seed in itertools.product(FAULTS, seeds):
        drive = Drive(np.random.default_rng(seed))
        drive.guard.begin()
        assert drive.swim(drive.rng.uniform(0.02, 0.6))
        ended = getattr(drive, fault)()
        drive.go_on(0.25)
        broken += [(fault, seed, what) for what in drive.tank.heated.broken(ended)]
        drive.close()
    assert not broken
