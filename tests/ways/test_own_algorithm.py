"""From an algorithm of one's own, in a file, a zip or a loop, to a row in a table beside those of the package."""

import json
import re

import pytest

from ways.story import ROOT, block, command


def rows(told):
    """Waypoints reached by every agent of a table, by name."""
    return dict(re.findall(r"^(\S+) .*? (\d) of 5 ", told, re.MULTILINE))


def test_a_class_with_predict_swims_beside_the_policy_and_the_script(story):
    page = "docs/controllers.md"
    story.has("nearest.py", block(page, "class Nearest") + block(page, "def make(env)"))
    story.types(command(page, "seastar evaluate --agents nearest:make") + " planner --fidelity fast")
    assert rows(story.told) == dict.fromkeys(["nearest:make", "learned", "pentagon", "planner"], "5")
    table = command(page, "seastar evaluate --task all --agents nearest:make").replace(" all ", " SeastarSwim-v0 ")
    story.types(f"{table} pentagon planner --fidelity fast --seeds 2 --decisions 20")
    assert re.findall(r"^(\S+) +SeastarSwim-v0 ", story.told, re.MULTILINE) == [
        "nearest:make", "learned", "pentagon", "planner"]  # fmt: skip


LEARN = """
symmetric = BatchVecEnv(VectorSymmetryReduction(batch))
for seed in range(3):
    model = PPO("MlpPolicy", symmetric, n_steps=32, batch_size=256, gamma=0.8, seed=seed, device="cpu")
    model.learn(512)
    model.save(f"{seed}.zip")
"""


def test_zips_of_several_seeds_are_one_row(story):
    story.runs(block("docs/training.md", "BatchVecEnv", "gym.make_vec").partition("model = ")[0] + LEARN)
    table = command("docs/controllers.md", "mine=A.zip,B.zip,C.zip").replace("A.zip,B.zip,C.zip", "0.zip,1.zip,2.zip")
    story.types(f"{table.replace('SeastarPrey', 'SeastarSwim')} --seeds 3 --decisions 30")
    mine, learned = json.loads((story.folder / "runs/prey.json").read_text("utf-8"))
    assert (mine["agent"], learned["agent"], len(mine["returns"])) == ("mine", "learned", 3), story.told


OWN_PERIOD = """
import gymnasium as gym
from stable_baselines3 import PPO

from seastar_gym import Sight

env = gym.make("SeastarSwim-v0", fidelity="fast", decision_period=0.2, sight=Sight())
PPO("MlpPolicy", env, n_steps=8, batch_size=8, device="cpu").learn(8).save("mine.zip")
"""


def test_a_zip_swims_and_drives_at_the_period_that_it_learned_with(story):
    story.runs(OWN_PERIOD)
    story.types("seastar swim --agent mine.zip --sight pose --seconds 0.4 --film swim.gif")
    story.types("seastar drive mine.zip --yes --no-window --unpaced --seconds 2")
    assert "in 10 decisions" in story.told


@pytest.mark.parametrize("seed", [0, 5])
def test_a_loop_in_one_file_ends_with_a_policy_that_arrives(story, seed):
    story.has("loop.py", (ROOT / "examples/single_file_ppo.py").read_text("utf-8"))
    story.types(f"python loop.py --out policy.safetensors --strokes 32768 --seed {seed}")
    story.types("seastar evaluate --agents policy.safetensors pentagon --fidelity fast")
    assert rows(story.told)["policy"] == "5"
