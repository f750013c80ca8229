"""PPO on a task: the project's hyperparameters with the horizon of the task, with and without memory."""

from dataclasses import replace
from typing import Any, NamedTuple

import gymnasium as gym
import torch
from gymnasium.vector import AutoresetMode
from stable_baselines3 import PPO

from agents.distillation import PAST, distil
from agents.ppo import Hyperparameters, make_model, with_coasting
from seastar_gym import TASKS
from seastar_gym.adapters.stable_baselines3 import BatchVecEnv
from seastar_gym.controllers.learned import LearnedPolicy, bundled_file, load
from seastar_gym.envs.symmetry import VectorFrameStack, VectorSymmetryReduction
from seastar_gym.envs.tasks.obst_trap import ObstTrap
from seastar_gym.evaluation.rollout import make_batch
from seastar_gym.scene.numerics import Fidelity

Batch = gym.vector.VectorEnv[Any, Any, Any]

OWN: dict[str, dict[str, Any]] = {
    "miswired": {"discount": 0.9},
    "prey": {"discount": 0.98, "rollout": 64, "gae_lambda": 0.95},
    "fast-prey": {"discount": 0.98, "rollout": 64, "gae_lambda": 0.95},
    "station": {"discount": 0.9},
    "fail-blind": {"discount": 0.9},
    "obst-trap": {"discount": 0.95},
    "prizes": {"discount": 0.98, "rollout": 64, "gae_lambda": 0.95},
    "fast-prizes": {"discount": 0.98, "rollout": 64, "gae_lambda": 0.95},
    "sim-to-real": {"discount": 0.3, "gae_lambda": 0.95},
}
"""Hyperparameters that differ from the project's, by task: prey and prizes are met after many seconds."""


class Learner(NamedTuple):
    """How PPO sees a task."""

    past: int = 0
    """Past observations that it sees; 0 for a learner without memory."""
    symmetric: bool = True
    """Whether waypoints are turned and mirrored into one sector."""
    told_the_way: bool = False
    """Whether its reward measures the way around all discs of `ObstTrap`; it swims the task as it is."""
    coasting: bool = False
    """Whether its reward measures progress by where the hub would come to rest, see `agents.ppo`."""

    def wrap(self, batch: Batch) -> Batch:
        """The batch as the learner sees it."""
        if self.coasting:
            inner: Any = batch.unwrapped
            batch = with_coasting(batch, inner.task.reward)
        if self.past:
            return VectorFrameStack(batch, self.past)
        return VectorSymmetryReduction(batch) if self.symmetric else batch

    def arguments(self) -> dict[str, Any]:
        """Arguments of the environment that it is trained in."""
        return {"task": ObstTrap(potential="geodesic")} if self.told_the_way else {}


LEARNERS: dict[str, Learner] = {
    "PPO": Learner(),
    "PPO, memory": Learner(PAST),
    "PPO, memory, coasting": Learner(PAST, coasting=True),
    "PPO, told the way": Learner(told_the_way=True),
    "PPO, memory, told the way": Learner(PAST, told_the_way=True),
}
"""Learners by name."""


def hyperparameters(task: str, decision_period: float) -> Hyperparameters:
    """Those of the project, with the horizon of the task."""
    return replace(Hyperparameters(), decision_period=decision_period, **OWN[task])


def make_learning_env(id: str, learner: Learner, fidelity: Fidelity, threads: int | None) -> BatchVecEnv:
    """Environment of a training, on the split "train"."""
    return BatchVecEnv(learner.wrap(_training_batch(id, fidelity, threads, **learner.arguments())))


def _training_batch(id: str, fidelity: Fidelity, threads: int | None, **arguments: Any) -> Batch:
    return make_batch(
        id, Hyperparameters().num_envs, split="train", fidelity=fidelity, threads=threads,
        autoreset_mode=AutoresetMode.SAME_STEP, **arguments,
    )  # fmt: skip


def new_model(id: str, env: BatchVecEnv, seed: int) -> PPO:
    """PPO that has learned nothing yet."""
    batch: Any = env.env.unwrapped
    return make_model(env, hyperparameters(str(TASKS[id].task), float(batch.decision_period)), seed)


def train(id: str, learner: Learner, seed: int, decisions: int, fidelity: Fidelity, threads: int | None) -> PPO:
    """PPO after so many decisions of training."""
    torch.set_num_threads(1)
    env = make_learning_env(id, learner, fidelity, threads)
    model = new_model(id, env, seed)
    model.learn(decisions)
    env.close()
    return model


def imitate(id: str, seed: int, decisions: int, fidelity: Fidelity, threads: int | None) -> LearnedPolicy:
    """Policy with memory after so many decisions of learning from the bundled one of waypoints, which sees all."""
    torch.set_num_threads(1)
    batch = _training_batch(id, fidelity, threads)
    period = float(batch.unwrapped.decision_period)  # type: ignore[attr-defined]
    return distil(load(bundled_file(period)), VectorFrameStack(batch, PAST), decisions, seed)
