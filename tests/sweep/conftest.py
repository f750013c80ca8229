"""Small sweeps. Without the extra `sweep`, there is nothing to test here."""

import subprocess
from importlib.util import find_spec

import pytest

from seastar_gym.scene import Scene

collect_ignore_glob = [] if all(map(find_spec, ("optuna", "pyarrow"))) else ["test_*.py"]


@pytest.fixture
def sweep():
    """Four cells of four designs and one stroke."""
    from seastar_gym.sweep.axes import Choices, Range
    from seastar_gym.sweep.designs import Sweep

    axes = Range("robot.limb_length", 0.05, 0.15), Choices("robot.n_limbs", (3, 5))
    return Sweep(Scene.preset("fast"), axes, settling=0, measured=1, samples=8, robots=4)


@pytest.fixture
def small_disk(tmp_path):
    """Function that mounts a small disk; it returns its place, and a function that makes it larger."""
    mounted = []

    def mount(size):
        place = tmp_path / f"disk_{len(mounted)}"
        place.mkdir()
        command = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(place)]
        if subprocess.run(command, capture_output=True, check=False).returncode:
            pytest.skip("mounting a disk needs root")
        mounted.append(place)
        return place, lambda: subprocess.run(["mount", "-o", "remount,size=10m", str(place)], check=True)

    yield mount
    for place in mounted:
        subprocess.run(["umount", str(place)], check=True)
