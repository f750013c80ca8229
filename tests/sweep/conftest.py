"""Small sweeps. Without the extra `sweep`, there is nothing to test here, and no searches without `search`."""

from importlib.util import find_spec

import pytest

from seastar_gym.scene import Scene

collect_ignore_glob = [] if find_spec("pyarrow") else ["test_*.py"]
if not find_spec("optuna"):
    collect_ignore_glob.append("test_proposals.py")


@pytest.fixture
def sweep():
    """Four batches of four designs and one stroke."""
    from seastar_gym.sweep.designs import Choices, Range, Sweep

    axes = Range("robot.limb_length", 0.05, 0.15), Choices("robot.n_limbs", (3, 5))
    return Sweep(Scene.preset("fast"), axes, settling=0, measured=1, samples=8, robots=4)
