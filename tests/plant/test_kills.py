"""Whoever dies, wires are cold within 200 ms: driver, tracker and wires are processes, joined by a pseudo-terminal."""

import os
import subprocess
import sys
import time
import tty
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import NamedTuple

import pytest

from faults import COLD_WITHIN

pytestmark = pytest.mark.skipif(not hasattr(os, "openpty"), reason="There are no pseudo-terminals here.")

ROLES = Path(__file__).with_name("roles.py")


class Tank(NamedTuple):
    tracker: subprocess.Popen
    driver: subprocess.Popen
    hot: Path

    def hot_times(self) -> list[float]:
        """Times at which wires were heated [s]."""
        return [float(line) for line in self.hot.read_text().split("\n")[:-1]]


@contextmanager
def tank(folder):
    """Three processes, once the robot swims. Pipes stay open here, so that nobody is told that another has died."""
    with ExitStack() as stack:

        def started(role, *files, **options):
            numbers = [str(file) for file in files]
            own = [file for file in files if isinstance(file, int)]
            environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
            command = [sys.executable, ROLES, role, *numbers]
            process = subprocess.Popen(command, pass_fds=own, env=environment, text=True, **options)
            stack.callback(process.wait)
            stack.callback(process.kill)
            return process

        ours, theirs = os.openpty()
        tty.setraw(theirs)
        seen, told = os.pipe(), os.pipe()
        for file in (ours, theirs, *seen, *told):
            stack.callback(os.close, file)
        wires = started("heat", theirs, seen[1], folder / "hot", stdout=subprocess.PIPE)
        assert wires.stdout.readline() == "ready\n"
        tracker = started("track", seen[0], told[1])
        driver = started("drive", ours, told[0], stdout=subprocess.PIPE)
        stack.callback(wires.stdout.close), stack.callback(driver.stdout.close)
        assert driver.stdout.readline() == "swims\n" and driver.stdout.readline() == "swims\n"
        yield Tank(tracker, driver, folder / "hot")


@pytest.mark.parametrize("who", ["tracker", "driver"])
def test_wires_are_cold_within_200_ms_whoever_is_killed(who, tmp_path):
    with tank(tmp_path) as processes:
        getattr(processes, who).kill()
        ended = time.monotonic()
        time.sleep(1.0)
        times = processes.hot_times()
        assert ended - 0.1 < max(times) < ended + COLD_WITHIN
        assert min(times) < ended - 0.5
        if who == "tracker":
            assert "No new picture for 0.12 s" in processes.driver.stdout.read()
