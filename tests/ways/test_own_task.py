"""From a task of one's own, the page's or another, to an id, its promises kept, a training and a row in a table."""

import json

import pytest

from ways.story import ROOT, block, command

PAGE = "docs/extending.md"
TRAIN = """
import gymnasium as gym
from gymnasium.vector import AutoresetMode
from stable_baselines3 import PPO

import away
from seastar_gym.adapters.stable_baselines3 import BatchVecEnv

batch = gym.make_vec(
    "SeastarAway-v0", num_envs=32, vectorization_mode="vector_entry_point", fidelity="fast",
    autoreset_mode=AutoresetMode.SAME_STEP,
)
model = PPO("MlpPolicy", BatchVecEnv(batch), n_steps=32, batch_size=256, gamma=0.8, seed={}, device="cpu")
model.learn({})
model.save("mine.zip")
"""


@pytest.mark.parametrize(
    "changes, seed",
    [({}, 0), ({"seconds=30.0": "seconds=20.0, decision_period=0.5", "price=0.0005)": "price=0.0002)"}, 4)],
    ids=["the page's", "another"],
)
def test_a_task_of_ones_own_is_an_id_that_is_promised_trained_on_and_compared(story, changes, seed):
    code = block(PAGE, "class Away")
    for words, others in changes.items():
        code = code.replace(words, others)
    story.has("away.py", code)

    # It keeps the promises of every environment.
    promises = command(PAGE, "pytest -p away").replace("tests/envs", f"{ROOT}/tests/envs")
    story.types(f"{promises} -n0 -q -p no:cacheprovider")
    assert "passed" in story.told and "failed" not in story.told

    # PPO learns it, and is compared with a gait and with chance.
    story.runs(TRAIN.format(seed, 65536 if changes else 8192))
    gait = "lagged" if changes else "straight"
    line = command(PAGE, "seastar evaluate --task away:").replace("--agents straight", f"--agents {gait} mine=mine.zip")
    story.types(line.replace("--seeds 20", "--seeds 5"))
    rows = json.loads((story.folder / "runs/away.json").read_text("utf-8"))
    far = {row["agent"]: sum(row["scores"]) / 5 for row in rows}
    assert far["mine"] > 1.2 * far["random"] and set(far) == {gait, "mine", "random"}, far
