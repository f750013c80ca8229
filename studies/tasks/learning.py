"""Learners of the tasks: PPO as the project trains it, with a memory of past observations, and recurrent."""

from dataclasses import replace
from typing import Any

import numpy as np
import torch
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.utils import LinearSchedule

from agents.hyperparameters import Hyperparameters
from agents.ppo import make_model
from seastar_gym.adapters.stable_baselines3 import BatchVecEnv
from seastar_gym.envs.symmetry import VectorMemory, VectorSymmetryReduction
from seastar_gym.envs.tasks.obst_trap import ObstTrap
from seastar_gym.scene.numerics import Fidelity
from studies.tasks.episodes import Episodes, Wrap, make_batch, swim

PAST = 8
"""Past observations that a learner with memory sees."""
OWN: dict[str, dict[str, Any]] = {
    "miswired": {"discount": 0.9},
    "prey": {"discount": 0.98, "rollout": 64, "gae_lambda": 0.95},
    "fast-prey": {"discount": 0.98, "rollout": 64, "gae_lambda": 0.95},
    "station": {"discount": 0.9},
    "fail-blind": {"discount": 0.9},
    "obst-trap": {"discount": 0.95},
    "prizes": {"discount": 0.98, "rollout": 64, "gae_lambda": 0.95},
    "fast-prizes": {"discount": 0.98, "rollout": 64, "gae_lambda": 0.95},
}
"""Hyperparameters that differ from the project's, by challenge: prey and prizes are met after many seconds."""
TOLD_THE_WAY = "PPO, told the way"
"""Learner whose reward measures the way to the goal around all discs; it swims the task as it is."""
WRAPS: dict[str, Wrap] = {
    "PPO": VectorSymmetryReduction,
    "PPO, memory": lambda batch: VectorMemory(batch, PAST),
    TOLD_THE_WAY: VectorSymmetryReduction,
    "RecurrentPPO": lambda batch: batch,
}
"""What learners put around a batch, by their names. A network with a state of its own cannot have its limbs renamed
from one decision to the next, so it learns without the symmetry."""


class Trained:
    """Agent that asks a learner."""

    def __init__(self, model: Any):
        self._model, self._state = model, None
        self._begins: NDArray[np.bool_] | None = None

    def act(self, observations: NDArray[np.float32], info: dict[str, Any]) -> NDArray[np.int64]:
        """Most probable actions of all robots."""
        begins = np.ones(len(observations), bool) if self._begins is None else self._begins
        actions, self._state = self._model.predict(observations, self._state, begins, deterministic=True)
        self._begins = np.zeros(len(observations), bool)
        return np.asarray(actions)


def hyperparameters(task: str, decision_period: float) -> Hyperparameters:
    """Those of the project, with the horizon of the task."""
    return replace(Hyperparameters(), decision_period=decision_period, **OWN[task])


def _model(learner: str, env: BatchVecEnv, chosen: Hyperparameters, seed: int) -> Any:
    if learner != "RecurrentPPO":
        return make_model(env, chosen, seed)
    from sb3_contrib import RecurrentPPO

    return RecurrentPPO(
        "MlpLstmPolicy",
        env,
        n_steps=32,
        batch_size=1024,
        n_epochs=chosen.epochs,
        learning_rate=LinearSchedule(chosen.learning_rate, 0.0, 1.0),
        gamma=chosen.discount_per_decision,
        gae_lambda=chosen.gae_lambda,
        clip_range=chosen.clip_range,
        policy_kwargs={"net_arch": list(chosen.hidden), "lstm_hidden_size": 64},
        seed=seed,
        device="cpu",
    )


def train(id: str, task: str, learner: str, seed: int, decisions: int, fidelity: Fidelity, threads: int | None) -> Any:
    """A learner after so many decisions of training, a `PPO` or `RecurrentPPO`."""
    torch.set_num_threads(1)
    own = {"task": ObstTrap(potential="geodesic")} if learner == TOLD_THE_WAY else {}
    batch = make_batch(
        id, Hyperparameters().num_envs, "train", fidelity, threads, autoreset_mode=AutoresetMode.SAME_STEP, **own
    )
    period = float(batch.unwrapped.decision_period)  # type: ignore[attr-defined]
    env = BatchVecEnv(WRAPS[learner](batch))
    model: PPO = _model(learner, env, hyperparameters(task, period), seed)
    model.learn(decisions)
    env.close()
    return model


def evaluate(id: str, learner: str, model: Any, n_episodes: int, fidelity: Fidelity, threads: int | None) -> Episodes:
    """Held-out episodes of a learner."""
    return swim(id, lambda batch: Trained(model), n_episodes, fidelity, threads, WRAPS[learner])
