"""Learners of the tasks: PPO as the project trains it, with a memory of past observations, and recurrent."""

from typing import Any

import torch
from stable_baselines3.common.utils import LinearSchedule

from agents.tasks.learning import LEARNERS, Learner, hyperparameters, make_learning_env, new_model
from seastar_gym import TASKS
from seastar_gym.adapters.stable_baselines3 import BatchVecEnv
from seastar_gym.evaluation.rollout import Episodes
from seastar_gym.scene.numerics import Fidelity
from studies.tasks.episodes import swim

RECURRENT = "RecurrentPPO"
ALL_LEARNERS = {**LEARNERS, RECURRENT: Learner(symmetric=False)}
"""Learners by name. A network with a state of its own cannot have its limbs renamed from one decision to the next, so
it learns without the symmetry."""


def _recurrent(id: str, env: BatchVecEnv, seed: int) -> Any:
    from sb3_contrib import RecurrentPPO

    task, _, period, *_ = TASKS[id]
    chosen = hyperparameters(task, period)
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


def train(id: str, name: str, seed: int, decisions: int, fidelity: Fidelity) -> Any:
    """A learner after so many decisions of training, a `PPO` or `RecurrentPPO`."""
    torch.set_num_threads(1)
    env = make_learning_env(id, ALL_LEARNERS[name], fidelity, None)
    model = _recurrent(id, env, seed) if name == RECURRENT else new_model(id, env, seed)
    model.learn(decisions)
    env.close()
    return model


def evaluate(id: str, name: str, model: Any, n_episodes: int, fidelity: Fidelity) -> Episodes:
    """Held-out episodes of a learner."""
    return swim(id, lambda batch: model, n_episodes, fidelity, ALL_LEARNERS[name].wrap)
