"""From a scene of one's own to its certificate, the fastest setting below an error, and a training there."""

import math
import re

import pytest

from ways.story import command

SCENE = """
from seastar_gym import Scene, Seastar, Water

scene = Scene(Seastar({}, rod_radius={}), Water(drag_coefficient=1.2))
"""
SWIM = """

import gymnasium as gym

import seastar_gym
from seastar_gym import Certificate, Scene, scene_for
from seastar_gym.controllers.learned import load
from seastar_gym.scene.scene import load_scene

certificate, policy = Certificate.load("certificate.json"), load("runs/mine/policy.safetensors")
scene = scene_for({error}, certificate="certificate.json")
assert scene == load_scene("chosen.json")
env = gym.make("SeastarSwim-v0", scene=scene, certificate="certificate.json", actions=policy.actions)
observation, info = env.reset(seed={seed})
info = env.step(policy.predict(observation)[0])[4]
setting = certificate.of(scene)
assert (info["space_error"], info["time_error"]) == (setting.space_error, setting.time_error)
print("errors", info["path_error"], setting.promise(certificate.promised))
"""


@pytest.mark.parametrize("n_limbs, radius, error, seed", [(3, 2e-3, 0.01, 0), (4, 1.6e-3, 0.02, 2)])
def test_a_scene_is_certified_chosen_and_trained_at_with_its_errors_in_info(story, n_limbs, radius, error, seed):
    story.has("my_scene.py", SCENE.format(n_limbs, radius))
    certify = command("docs/accuracy.md", "seastar certify").replace("--error 0.01", f"--error {error}")
    story.types(f"{certify} --samples 2 --seed {seed}")
    train = command("docs/accuracy.md", "train.py --scene chosen.json")
    story.types(f"{train} --strokes 4096 --seed {seed} --no-video --out runs/mine")
    told = story.runs(SWIM.format(error=error, seed=seed))
    of_random_commands, of_all = map(float, re.search(r"errors (\S+) (\S+)", told).groups())
    assert math.isfinite(of_random_commands) and of_random_commands <= of_all <= error
