"""Trainings of the study: what differs between them, and how each is run."""

import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.noise import NormalActionNoise

from agents import learner_file
from agents.hyperparameters import Hyperparameters
from agents.ppo import make_model, make_training_env
from seastar_gym.adapters.stable_baselines3 import BatchVecEnv
from seastar_gym.controllers import checkpoint, third_party
from seastar_gym.controllers.contract import Policy
from seastar_gym.envs.reward import RewardWeights
from seastar_gym.envs.symmetry import Symmetry
from seastar_gym.scene.numerics import Fidelity
from studies.learning.timed.shares import ChosenCommands, shares_of_pairs

COMMON = Hyperparameters(discount=0.9, rollout=32, num_envs=64, gae_lambda=0.95)
"""Hyperparameters of the trainings, but for what differs."""
COASTING: dict[str, Any] = {"coasting": True, "discount": 0.3, "num_envs": 128, "rollout": 16}
"""Progress by where the hub would come to rest, the shorter horizon that it allows, and shorter rollouts to fit."""
STROKES: dict[str, Any] = {"discount": 0.8, "rollout": 16, "num_envs": 128, "gae_lambda": 0.9}
"""Hyperparameters of `train.py` for strokes."""
SHARES = (1.0, 0.6)
"""Shares of a pulse among which "shares" chooses."""
SAC_SETTINGS: dict[str, Any] = {
    "buffer_size": 150_000, "batch_size": 512, "learning_rate": 1e-3, "learning_starts": 5_000, "train_freq": 1,
    "gradient_steps": 6,
}  # fmt: skip
"""Settings of SAC and TD3. An update follows every decision of the batch, with so many gradient steps."""
EXPLORATION = 0.3
"""Standard deviation of the noise of TD3's actions, of a whole pulse or the peak angle [1]."""


class ReducedPolicy:
    """Policy for the plain environment, from the model that a learner behind the symmetry reduction has learned.

    symmetry: Of the robot, with the environment's actions.
    table: Commands that the model's actions are the numbers of. None means that they are the environment's.
    """

    def __init__(self, model: Policy, symmetry: Symmetry, table: NDArray[np.float64] | None = None):
        self.model, self.symmetry, self.table, self.actions = model, symmetry, table, symmetry.actions

    def predict(
        self, observation: NDArray[Any], state: Any = None, episode_start: Any = None, deterministic: bool = False
    ) -> tuple[NDArray[Any], None]:
        """Actions for observations of shape (size,) or (n, size), and None: the policy has no state."""
        reduced, elements = self.symmetry.reduce(observation)
        chosen, _ = self.model.predict(reduced.astype(np.float32), None, None, deterministic)
        return self.symmetry.restore(chosen if self.table is None else self.table[chosen], elements), None


@dataclass(frozen=True)
class Training:
    """A training of the study.

    changes: Hyperparameters that differ from `COMMON`, as pairs of name and value.
    decisions: Its length, all robots together.
    learner: "pairs" is PPO over pairs of limbs, "shares" PPO over pairs that are heated for one of `SHARES`,
        "gaussian" PPO on pulse widths, "sac" SAC and "td3" TD3 on pulse widths; of strokes, on shares of the peak.
    start: Name of the training whose network, of the same seed, this one begins with.
    """

    changes: tuple[tuple[str, Any], ...]
    decisions: int = 300_000
    learner: Literal["pairs", "shares", "gaussian", "sac", "td3"] = "pairs"
    start: str | None = None

    @property
    def hyperparameters(self) -> Hyperparameters:
        """Hyperparameters of this training."""
        return replace(COMMON, **dict(self.changes))


def _every(
    period: float, decisions: int = 300_000, learner: Any = "pairs", start: str | None = None, **changes: Any
) -> Training:
    return Training((("decision_period", period), *changes.items()), decisions, learner, start)


def _priced(effort: float, discount: float = 0.8, aim: float = RewardWeights().aim) -> dict[str, Any]:
    return {**COASTING, "discount": discount, "reward": RewardWeights(effort=effort, aim=aim)}


TRAININGS: dict[str, Training] = {
    "1 s": _every(1.0, 98_304, **STROKES),
    "1 s, Gaussian": _every(1.0, 98_304, learner="gaussian", **STROKES),
    "1 s, SAC": _every(1.0, 98_304, learner="sac", **STROKES),
    "1 s, TD3": _every(1.0, 98_304, learner="td3", **STROKES),
    "0.5 s": _every(0.5, 150_000),
    "0.5 s, coasting": _every(0.5, 150_000, **COASTING),
    "0.5 s, price 0.05": _every(0.5, 150_000, "shares", **_priced(0.05)),
    "0.5 s, price 0.15": _every(0.5, 150_000, "shares", **_priced(0.15)),
    "0.5 s, price 0.15, nearer": _every(0.5, 300_000, "shares", **_priced(0.15, aim=0.9)),
    "0.2 s": _every(0.2),
    "0.2 s, coasting": _every(0.2, **COASTING),
    "0.2 s, price 0.1": _every(0.2, learner="shares", **_priced(0.1, discount=0.3)),
    "0.2 s, Gaussian": _every(0.2, learner="gaussian", **COASTING),
    "0.2 s, SAC": _every(0.2, 150_000, learner="sac", **COASTING),
    "0.2 s, SAC, price 0.1": _every(0.2, 150_000, "sac", **_priced(0.1, discount=0.3)),
    "0.1 s": _every(0.1),
    "0.1 s, coasting": _every(0.1, **COASTING),
    "0.1 s, coasting, n-step": _every(0.1, **(COASTING | {"rollout": 64, "gae_lambda": 0.99, "num_envs": 32})),
    "0.1 s, coasting, large rollouts": _every(0.1, **(COASTING | {"rollout": 64})),
    "0.1 s, after 0.2 s": _every(0.1, 200_000, start="0.2 s, coasting", learning_rate=5e-4, **COASTING),
}
"""Trainings by name."""


class Learned(NamedTuple):
    """What a training has learned. seconds: Processor time of the training [s]; None where it was not run again."""

    policy: Policy
    seconds: float | None


def learn(name: str, seed: int, fidelity: Fidelity, folder: Path, decisions: int | None = None) -> Learned:
    """Run a training, on one thread, unless its network is in the folder already.

    folder: Of the networks, in files as `train.py` writes them (model.zip) for pairs of limbs. Those of others are
        Stable-Baselines3's, which are unpickled: use no folder that you do not trust.
    """
    training, file = TRAININGS[name], network_file(folder, name, seed)
    env = _make_env(training, fidelity)
    if file.exists():
        return Learned(_read(training, file, env), None)
    model = _make_model(training, env, seed)
    if training.start is not None:
        assert isinstance(model, PPO)
        learner_file.begin_with(model, network_file(folder, training.start, seed))
    began = time.process_time()
    model.learn(training.decisions if decisions is None else decisions)
    seconds = time.process_time() - began
    _write(training, file, model)
    return Learned(_read(training, file, env), seconds)


def _write(training: Training, file: Path, model: BaseAlgorithm) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    if training.learner == "pairs":
        assert isinstance(model, PPO)
        learner_file.save(model, file)
    else:
        model.save(file)


def _read(training: Training, file: Path, env: BatchVecEnv) -> Policy:
    if training.learner == "pairs":
        return checkpoint.load(file)
    symmetry = Symmetry.of(env.get_attr("scene")[0], "continuous")
    return ReducedPolicy(third_party.load_model(file), symmetry, getattr(env.env, "table", None))


def network_file(folder: Path, name: str, seed: int) -> Path:
    """File of the learner of a training."""
    return folder / f"{name.replace(', ', '_').replace(' ', '')}_seed{seed}.zip"


def _make_env(training: Training, fidelity: Fidelity) -> BatchVecEnv:
    if training.learner == "pairs":
        return make_training_env(training.hyperparameters, "random", True, fidelity, threads=1)
    env = make_training_env(training.hyperparameters, "random", True, fidelity, threads=1, actions="continuous")
    if training.learner != "shares":
        return env
    table = shares_of_pairs(env.get_attr("scene")[0].robot.n_limbs, SHARES)
    return BatchVecEnv(ChosenCommands(env.env, table))


def _make_model(training: Training, env: BatchVecEnv, seed: int) -> BaseAlgorithm:
    hyperparameters = training.hyperparameters
    if training.learner not in ("sac", "td3"):
        return make_model(env, hyperparameters, seed)
    settings = SAC_SETTINGS | {"gamma": hyperparameters.discount_per_decision, "seed": seed, "device": "cpu"}
    settings["policy_kwargs"] = {"net_arch": list(hyperparameters.hidden)}
    if training.learner == "sac":
        return SAC("MlpPolicy", env, **settings)
    n_limbs = env.action_space.shape[0]  # type: ignore[index]
    noise = NormalActionNoise(np.zeros(n_limbs), np.full(n_limbs, EXPLORATION))
    return TD3("MlpPolicy", env, action_noise=noise, **settings)
