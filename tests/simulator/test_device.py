"""A device with a thread for each robot swims to the bits of the processor: the twin "scalar" always, "cuda" with a GPU.

The code of a device is that of one mesh, so there are few scenes here; `python -m studies.gpu` has all others.
"""

import pickle
import re
import shutil
import subprocess
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest

from hubs import TEN
from seastar_gym import Contact, Limited, Numerics, Scene, Seastar, Simulator, SmaPulse, Water
from seastar_gym.simd import cuda
from seastar_gym.simulator.report import MEASURED_IF_ASKED
from strokes import assert_same_bits, finished
from studies.gpu import scenes as scenes_of_study

SMALL = Scene(Seastar(nodes_per_limb=4), numerics=Numerics.preset("fast"))
N_ROBOTS = 35
"""Robots of a batch: more than one group of a device, and of a processor, and none of them full."""


def has_gpu() -> bool:
    try:
        cuda.arrays()
    except RuntimeError:
        return False
    return True


needs_gpu = pytest.mark.skipif(not has_gpu(), reason="there is no GPU")


@pytest.fixture(params=["scalar", pytest.param("cuda", marks=needs_gpu)])
def device(request):
    return request.param


def commands_of(scene: Scene, n_robots: int, n_strokes: int, seed: int = 0) -> np.ndarray:
    """Random commands, the first of which is repeated by every other robot."""
    commands = np.random.default_rng(seed).uniform(-1.0, 1.0, (n_strokes, n_robots, scene.robot.n_limbs))
    commands[:, ::2] = commands[0, ::2]
    return commands


def pair(scene: Scene, device: str, n_robots: int = N_ROBOTS, **options) -> tuple[Simulator, Simulator]:
    return Simulator(scene, n_robots, **options), Simulator(scene, n_robots, device=device, **options)


def assert_same(first: Simulator, second: Simulator) -> None:
    for ours, theirs in zip(first.get_state(), second.get_state(), strict=True):
        np.testing.assert_array_equal(ours, theirs)
    np.testing.assert_array_equal(first.elastic_energy(), second.elastic_energy())
    np.testing.assert_array_equal(first.hub_position(), second.hub_position())
