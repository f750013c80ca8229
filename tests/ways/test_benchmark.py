"""A row of the benchmark: trained, stopped, gone on with, evaluated, and merged with another's."""

import json

import pytest

from ways.story import command

CELL = "--methods PPO --tracks symmetric --ids SeastarStation-v0 --decisions 2048 --workers 1"


def test_a_row_is_trained_after_a_stop_evaluated_and_merged(story):
    train = f"python -m agents.tasks --benchmark {CELL}"
    files = [story.folder / f"runs/benchmark/2048/ppo-symmetric/SeastarStation-v0-{seed}.json" for seed in (0, 1)]
    story.types(f"{train} --seeds 0 1", ends=130, stop=files[0].is_file)
    assert files[0].is_file() and not files[1].is_file()
    first = files[0].read_bytes()
    story.types(f"{train} --seeds 0 1")
    assert "Cells to train: 1" in story.told and files[0].read_bytes() == first and files[1].is_file()
    evaluate = command("docs/benchmark.md", "seastar evaluate --benchmark", "--agents").partition("--agents")[0]
    zips = ",".join(str(file.with_suffix(".zip").relative_to(story.folder)) for file in files)
    story.types(f"{evaluate} --agents mine={zips} --decisions 2048 --out runs/mine")
    assert "2,048 decisions" in story.told
    mine = json.loads((story.folder / "runs/mine/benchmark.json").read_text())["cells"]
    trained = [json.loads(file.read_text())["cells"][0] for file in files]
    assert {one["track"] for one in mine} == {"symmetric"}
    assert [one["measure"] for one in mine] == [one["measure"] for one in trained]
    story.types(f"seastar evaluate --merge runs/mine/benchmark.json {files[0].relative_to(story.folder)}")
    assert "mine" in story.told and "PPO" in story.told and "(2)" in story.told


LOOP = """
import numpy as np
import torch
from torch import nn
from torch.distributions import Categorical

from seastar_gym.evaluation.benchmark import make


def actor(env):
    size, n_actions = env.observation_space.shape[-1], 243
    return nn.Sequential(nn.Linear(size, 32), nn.Tanh(), nn.Linear(32, n_actions))


def action(policy, observation):
    return int(policy(torch.from_numpy(np.asarray(observation, np.float32))).argmax())


def train(seed, envs):
    torch.manual_seed(seed)
    policy, (seen, _) = actor(envs), envs.reset(seed=seed)
    adam = torch.optim.Adam(policy.parameters(), lr=1e-3)
    for _ in range(4):
        choices = Categorical(logits=policy(torch.from_numpy(seen)))
        chosen = choices.sample()
        seen, rewards, *_ = envs.step(chosen.numpy())
        loss = -(choices.log_prob(chosen) * torch.from_numpy(rewards - rewards.mean())).mean()
        adam.zero_grad()
        loss.backward()
        adam.step()
    return policy
"""
TORCHRL = """
import torch
from tensordict import TensorDict
from tensordict.nn import TensorDictModule
from torch.distributions import Categorical
from torchrl.collectors import Collector
from torchrl.envs import GymWrapper
from torchrl.envs.utils import ExplorationType, set_exploration_type
from torchrl.modules import MLP, ProbabilisticActor

from seastar_gym.evaluation.benchmark import make


def actor(env):
    network = MLP(in_features=env.observation_space.shape[-1], out_features=243, num_cells=[32])
    module = TensorDictModule(network, in_keys=["observation"], out_keys=["logits"])
    return ProbabilisticActor(module, in_keys=["logits"], distribution_class=Categorical)


def action(policy, observation):
    with set_exploration_type(ExplorationType.DETERMINISTIC):
        return int(policy(TensorDict({"observation": torch.as_tensor(observation)}))["action"])


def train(seed, envs):
    torch.manual_seed(seed)
    policy = actor(envs)
    env = GymWrapper(envs, categorical_action_encoding=True)
    for rollout in Collector(env, policy, frames_per_batch=32, total_frames=32, auto_register_policy_transforms=False):
        assert rollout["next", "reward"].shape[:2] == (8, 4)
    return policy
"""
ROW = """

class Mine:
    def __init__(self, env, file):
        self.policy = actor(env)
        self.policy.load_state_dict(torch.load(file))

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        with torch.no_grad():
            return action(self.policy, observation), state


def seed0(env):
    return Mine(env, "0.pt")


def seed1(env):
    return Mine(env, "1.pt")


if __name__ == "__main__":
    for seed in (0, 1):
        policy = train(seed, make("SeastarStation-v0", 8, autoreset_mode="AUTORESET"))
        torch.save(policy.state_dict(), f"{seed}.pt")
"""


@pytest.mark.parametrize("learner", ["one file, like CleanRL", "torchrl"])
def test_a_learner_of_another_library_has_a_row_by_the_same_command(story, learner):
    loop, autoreset = LOOP, "SameStep"
    if learner == "torchrl":
        pytest.importorskip("torchrl")
        loop, autoreset = TORCHRL, "Disabled"
    story.has("mine.py", loop + ROW.replace("AUTORESET", autoreset))
    story.types("python mine.py")
    evaluate = command("docs/benchmark.md", "seastar evaluate --benchmark", "--agents").partition("--agents")[0]
    story.types(f"{evaluate} --agents mine=mine:seed0,mine:seed1 --decisions 32 --out runs/mine")
    cells = json.loads((story.folder / "runs/mine/benchmark.json").read_text())["cells"]
    assert [(cell["agent"], cell["id"], cell["seed"]) for cell in cells] == [
        ("mine", "SeastarStation-v0", 0), ("mine", "SeastarStation-v0", 1)]  # fmt: skip
    assert cells[0]["measure"] != cells[1]["measure"] and "(2)" in story.told
