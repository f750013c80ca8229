"""`SeastarSwimHeading-v0` as a row of the study: held-out random paths with random headings, and who swims them."""

from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import torch
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3 import PPO

from agents.hyperparameters import Hyperparameters
from agents.ppo import make_model
from seastar_gym.adapters.stable_baselines3 import BatchVecEnv
from seastar_gym.controllers import learned
from seastar_gym.controllers.contract import Policy
from seastar_gym.controllers.planner import Budget, Planner
from seastar_gym.controllers.scripted import scripted
from seastar_gym.controllers.turning import TurnThenSwim
from seastar_gym.envs.headings import HeadingTargets
from seastar_gym.envs.symmetry import VectorSymmetryReduction
from seastar_gym.evaluation.many import HELD_OUT_SEED
from seastar_gym.evaluation.rollout import Episodes
from seastar_gym.evaluation.tasks import make_batch
from seastar_gym.gaits import turning_wave
from seastar_gym.scene.numerics import Fidelity
from studies.tasks.episodes import swim_to_the_end

ID = "SeastarSwimHeading-v0"
RULE = "turn, then swim"
AGENTS = ("rest", "planner", RULE, "PPO")
"""Who swims it."""
LIMIT = 300.0
"""Time limit [s]."""
HEADINGS = HeadingTargets("random")
PERIOD, PERIOD_OF_RULE = 0.5, 0.2
"""Times between decisions [s]: that of the environment, and that of the rule, whose turning wave needs it."""
AHEAD = Budget(depth=1, beam=1, coasting=0.5)
"""The planner of the study looks one decision ahead."""


class OneByOne:
    """Policy for all robots of a batch, of one that drives a single robot."""

    def __init__(self, policy: Policy):
        self._policy = policy

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = False
    ) -> tuple[NDArray[np.int64], list[Any]]:
        """Actions of all robots, and the states of the policy."""
        states = [None] * len(observation) if state is None else state
        actions, states = zip(*map(self._policy.predict, observation, states), strict=True)
        return np.array(actions), list(states)


def _turn_then_swim(batch: Any) -> Policy:
    swims, wave = learned.load(learned.bundled_file(PERIOD_OF_RULE)), turning_wave(PERIOD_OF_RULE)
    return OneByOne(TurnThenSwim(wave, swims, swims.actions, batch.scene, HEADINGS, PERIOD_OF_RULE))


RULES: dict[str, Callable[[Any], Policy]] = {
    "rest": lambda batch: scripted("rest", "pairs"),
    "planner": lambda batch: Planner(batch.scene, budget=AHEAD, threads=1, decision_period=PERIOD, headings=HEADINGS),
    RULE: _turn_then_swim,
}


def trained(decisions: int, seed: int) -> PPO:
    """Learner on random paths with random headings, by pairs of limbs at "fast"; it sees reduced observations."""
    hyperparameters = Hyperparameters(decision_period=PERIOD)
    env: Any = gym.make_vec(
        ID, hyperparameters.num_envs, "vector_entry_point", path="random", fidelity="fast", headings=HEADINGS,
        autoreset_mode=AutoresetMode.SAME_STEP, max_episode_steps=800,
    )  # fmt: skip
    model = make_model(BatchVecEnv(VectorSymmetryReduction(env)), hyperparameters, seed)
    model.learn(decisions)
    return model


def swum(agent: str, seed: int, decisions: int, n: int, fidelity: Fidelity) -> Episodes:
    """Held-out episodes of an agent; PPO learns before, with a seed and for so many decisions, on other paths."""
    is_rule = agent == RULE
    period, mode = (PERIOD_OF_RULE, "joint") if is_rule else (PERIOD, "pairs")
    batch: Any = make_batch(
        ID, n, fidelity=fidelity, path="random", headings=HEADINGS, decision_period=period, actions=mode,
        max_episode_steps=round(LIMIT / period),
    )  # fmt: skip
    if agent == "PPO":
        torch.set_num_threads(1)
        swimmer: Policy = trained(decisions, seed)
        batch = VectorSymmetryReduction(batch)
    else:
        swimmer = RULES[agent](batch.unwrapped)
    return swim_to_the_end(batch, swimmer, seeds=list(range(HELD_OUT_SEED, HELD_OUT_SEED + n)))
