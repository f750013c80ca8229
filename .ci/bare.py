"""The installed package with its base dependencies and nothing else: does it import, register, step?

`.ci/run` starts this as `python -I`, so that the checkout is out of sight and only the wheel can answer.
"""

import subprocess
import sys
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

import gymnasium as gym
import numpy as np

from seastar_gym.controllers.learned import load
from seastar_gym.evaluation.swim import swim

for absent in ("agents", "studies", "train", "torch", "stable_baselines3", "matplotlib", "pygame"):
    assert find_spec(absent) is None, f"a bare environment holds {absent}"

command = Path(sys.executable).parent / "seastar"
told = subprocess.run([command, "--help"], capture_output=True, text=True, check=True).stdout
commands = "swim", "play", "evaluate", "train", "export", "certify", "track2csv", "identify"
assert all(name in told for name in commands)
for arguments, missing in (
    ("swim --film swim.mp4", "[render]"),
    ("train", "checkout"),
    ("certify", "[studies]"),
):
    done = subprocess.run([command, *arguments.split()], capture_output=True, text=True, cwd=command.parent)
    assert done.returncode == 2, (arguments, done)
    assert missing in done.stderr, done.stderr
    assert done.stderr.count("\n") == 1, done.stderr

env = gym.make("seastar_gym:SeastarSwim-v0")
observation, _ = env.reset(seed=0)
assert observation in env.observation_space
env.action_space.seed(0)
alone = [env.step(env.action_space.sample()) for _ in range(3)]
assert all(np.isfinite(observation).all() and np.isfinite(reward) for observation, reward, *_ in alone)

batch = gym.make_vec("SeastarSwim-v0", num_envs=9, vectorization_mode="vector_entry_point")
batch.reset(seed=0)
batch.action_space.seed(0)
observations, rewards, *_ = batch.step(batch.action_space.sample())
assert observations.shape == (9, *observation.shape)
assert np.isfinite(observations).all()
assert np.isfinite(rewards).all()

policy = load()
lane = gym.make("SeastarSwim-v0", actions=policy.actions, scene=policy.scene, path=[[0.05, 0.0]]).unwrapped
assert swim("learned", policy, lane, max_strokes=40, seed=0).finished

print(*(f"{name} {version(name)}" for name in ("gymnasium", "numba", "numpy", "safetensors", "scipy")), sep=", ")
