"""`SeastarSwimHeading-v0` as a row of the study: held-out random paths with random headings, and who swims them."""

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from seastar_gym.controllers import learned
from seastar_gym.controllers.contract import Policy
from seastar_gym.controllers.planner import Budget, Planner
from seastar_gym.controllers.turning import TurnThenSwim
from seastar_gym.envs.headings import Headings
from seastar_gym.envs.symmetry import VectorSymmetryReduction
from seastar_gym.evaluation.many import HELD_OUT_SEED
from seastar_gym.gaits import turning_wave
from seastar_gym.scene.numerics import Fidelity
from studies.learning import heading
from studies.tasks.episodes import Agent, Episodes, Info, make_batch, swim_to_the_end
from studies.tasks.learning import Trained

ID = "SeastarSwimHeading-v0"
RULE = "turn, then swim"
AGENTS = ("rest", "planner", RULE, "PPO")
"""Who swims it."""
LIMIT = 300.0
"""Time limit [s]."""
HEADINGS = Headings("random")
PERIOD, PERIOD_OF_RULE = 0.5, 0.2
"""Times between decisions [s]: that of the environment, and that of the rule, whose turning wave needs it."""
AHEAD = Budget(depth=1, beam=1, coasting=0.5)
"""The planner of the study looks one decision ahead."""


class Still:
    """Agent that heats nothing."""

    def act(self, observations: NDArray[np.float32], info: Info) -> NDArray[np.int64]:
        """Number of the command that heats no limb."""
        return np.zeros(len(observations), np.int64)


class OneByOne:
    """Agent of a policy that drives a single robot, for all robots of a batch."""

    def __init__(self, policy: Policy, n: int):
        self._policy, self._states = policy, [None] * n

    def act(self, observations: NDArray[np.float32], info: Info) -> NDArray[np.int64]:
        """Actions of all robots."""
        chosen = [self._policy.predict(*seen) for seen in zip(observations, self._states, strict=True)]
        self._states = [state for _, state in chosen]
        return np.array([action for action, _ in chosen])


def _still(batch: Any) -> Agent:
    return Still()


def _planner(batch: Any) -> Agent:
    return Trained(Planner(batch.scene, budget=AHEAD, threads=1, decision_period=PERIOD, headings=HEADINGS))


def _turn_then_swim(batch: Any) -> Agent:
    swims, wave = learned.load(learned.in_the_box(PERIOD_OF_RULE)), turning_wave(PERIOD_OF_RULE)
    return OneByOne(TurnThenSwim(wave, swims, swims.actions, batch.scene, HEADINGS, PERIOD_OF_RULE), batch.num_envs)


RULES: dict[str, Callable[[Any], Agent]] = {"rest": _still, "planner": _planner, RULE: _turn_then_swim}


def swum(agent: str, seed: int, decisions: int, n: int, fidelity: Fidelity, threads: int | None) -> Episodes:
    """Held-out episodes of an agent; PPO learns before, with a seed and for so many decisions, on other paths."""
    is_rule = agent == RULE
    period, mode = (PERIOD_OF_RULE, "joint") if is_rule else (PERIOD, "pairs")
    batch: Any = make_batch(
        ID, n, None, fidelity, threads, path="random", headings=HEADINGS, decision_period=period, actions=mode,
        max_episode_steps=round(LIMIT / period),
    )  # fmt: skip
    if agent == "PPO":
        torch.set_num_threads(1)
        swimmer: Agent = Trained(heading.train(heading.Options(decisions=decisions, seed=seed)))
        batch = VectorSymmetryReduction(batch)
    else:
        swimmer = RULES[agent](batch.unwrapped)
    return swim_to_the_end(batch, swimmer, *batch.reset(seed=list(range(HELD_OUT_SEED, HELD_OUT_SEED + n))))
