"""Held-out episodes of a task, swum by an agent that may be told more than robots see."""

from collections.abc import Callable
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from seastar_gym.controllers.contract import Policy
from seastar_gym.evaluation.rollout import Batch, Episodes, Info, rollout
from seastar_gym.evaluation.tasks import RECORDED, make_batch
from seastar_gym.scene.numerics import Fidelity

Wrap = Callable[[Batch], Batch]
"""What a learner puts around a batch."""


@runtime_checkable
class Agent(Protocol):
    """Whoever chooses the actions of a batch."""

    def act(self, observations: NDArray[np.float32], info: Info) -> NDArray[np.int64]:
        """Actions of all robots. info: That of the batch, for those who may know it."""


class Told:
    """Policy of an agent, which is told the info of every decision."""

    def __init__(self, agent: Agent):
        self._agent, self._info = agent, Info()

    def look(self, info: Info) -> None:
        """Tell the agent at its next decision what is known now."""
        self._info = info

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = False
    ) -> tuple[NDArray[np.int64], None]:
        """Actions of all robots."""
        return self._agent.act(observation, self._info), None


def swim(
    id: str,
    make_agent: Callable[[Batch], Agent | Policy],
    n_episodes: int,
    fidelity: Fidelity,
    wrap: Wrap = lambda batch: batch,
) -> Episodes:
    """The first episodes of the split "test", each to its end."""
    batch = wrap(make_batch(id, n_episodes, split="test", fidelity=fidelity))
    return swim_to_the_end(batch, make_agent(batch), seeds=0, options={"instance": np.arange(n_episodes)})


def swim_to_the_end(batch: Batch, agent: Agent | Policy, **how: Any) -> Episodes:
    """Episodes of a batch, each to its end; closes the batch. how: Arguments of `rollout`."""
    inner: Any = batch.unwrapped
    found = rollout_of(batch, agent, record=RECORDED, **how)
    batch.close()
    return found._replace(limit=inner.max_episode_steps * inner.decision_period)


def rollout_of(
    batch: Batch, agent: Agent | Policy, on_step: Callable[[Info], bool | None] = lambda info: None, **how: Any
) -> Episodes:
    """`rollout` of an agent or a policy. how: Arguments of it."""
    if not isinstance(agent, Agent):
        return rollout(batch, agent, on_step=on_step, **how)
    told = Told(agent)

    def look(info: Info) -> bool | None:
        told.look(info)
        return on_step(info)

    return rollout(batch, told, on_step=look, **how)
