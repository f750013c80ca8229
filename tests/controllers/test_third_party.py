"""Agents of a user's own module: found in the current folder, and asked for one robot at a time."""

import os
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

import seastar_gym
from seastar_gym.controllers.open_loop import scripted
from seastar_gym.controllers.registry import RobotByRobot, call_function
from seastar_gym.evaluation.swim import swim_many
from seastar_gym.scene import Scene

MINE = """
import numpy as np

class Mine:
    actions = "pairs"

    def __init__(self):
        self.decisions = 0

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        assert observation.ndim == 1
        self.decisions += 1
        return np.int64((self.decisions + 7 * (observation[0] > 0)) % 21), state

def make(env):
    return Mine()
"""
FAST = Scene.preset("fast")


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    Path("mine_of_one.py").write_text(MINE)
    yield tmp_path
    sys.modules.pop("mine_of_one", None)


def test_a_robot_in_company_swims_as_alone(here):
    policy = call_function("mine_of_one:make", None)
    first, second = (swim_many("mine", policy, "random", 3, FAST, max_strokes=6, threads=1) for _ in range(2))
    for one, again in zip(first, second, strict=True):
        np.testing.assert_array_equal(one.cross_track_errors, again.cross_track_errors)
    observation = np.random.default_rng(0).standard_normal((3, 40)).astype(np.float32)
    state = None
    for decision in range(1, 5):
        actions, state = policy.predict(observation, state, np.full(3, decision == 1))
        assert actions.tolist() == [(decision + 7 * (row[0] > 0)) % 21 for row in observation]


def test_what_cannot_be_copied_is_shared_and_what_is_batched_is_not_wrapped(here):
    Path("mine_of_one.py").write_text(MINE + "\nimport threading\nMine.__init__ = lambda self: vars(self).update(\n"
                                             "    decisions=0, lock=threading.Lock())\n")  # fmt: skip
    policy = call_function("mine_of_one:make", None)
    assert isinstance(policy, RobotByRobot) and policy.actions == "pairs" and policy.lock is not threading.Lock()
    actions, _ = policy.predict(np.ones((2, 40), np.float32), None, np.ones(2, bool))
    assert actions.tolist() == [8, 9]
    Path("mine_batched.py").write_text("def make(env):\n    from seastar_gym.gaits import pentagon_gait\n"
                                       "    from seastar_gym.controllers.open_loop import scripted\n"
                                       "    return scripted('pentagon')\n")  # fmt: skip
    assert type(call_function("mine_batched:make", None)) is type(scripted("pentagon"))


@pytest.mark.parametrize("words", [("evaluate", "--task", "SeastarSwim-v0", "--seeds", "2", "--decisions", "3"),
                                   ("evaluate", "--seconds", "3")])  # fmt: skip
def test_a_fresh_process_finds_it_in_the_current_folder(here, words):
    env = {**os.environ, "PYTHONPATH": str(Path(seastar_gym.__file__).parents[1])}
    line = [sys.executable, "-P", "-m", "seastar_gym.cli", *words, "--agents", "mine_of_one:make"]
    done = subprocess.run(line, env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "mine_of_one:make" in done.stdout
