"""Results of the tasks, the bound, and which tasks are kept."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.tasks.envs import CHALLENGES
from seastar_gym.evaluation.measures import measure_of_challenge

MORE_IS_BETTER = tuple(name for name, each in CHALLENGES.items() if measure_of_challenge(each).better == "more")
ORDER = ("rest", "greedy", "planner", "adaptive", "prior", "informed", "turn, then swim", "PPO", "PPO, memory",
         "PPO, told the way", "PPO, memory, coasting", "RecurrentPPO", "bundled")  # fmt: skip
"""Agents from top to bottom."""
HEADROOM, LEFT = 0.2, 1.0 / 3.0
"""A task is kept where the bound is so much better than greedy, and PPO leaves so much of that."""


class Row(NamedTuple):
    """Results of a task."""

    id: str
    challenge: str
    agents: dict[str, list[NDArray[np.float64]]]
    """Measures of all episodes, one array for every seed."""

    @property
    def in_order(self) -> list[tuple[str, list[NDArray[np.float64]]]]:
        """Agents and their measures, from top to bottom."""
        return sorted(self.agents.items(), key=lambda one: ORDER.index(one[0]))

    def mean(self, agent: str, episodes: int | None = None) -> float:
        """Mean measure of an agent over seeds and the first episodes, all if None."""
        return float(np.mean([values[:episodes].mean() for values in self.agents[agent]]))

    def shared(self, agent: str) -> float:
        """Mean measure of an agent over the episodes that all agents of the row have swum, for comparisons."""
        return self.mean(agent, min(len(values) for seeds in self.agents.values() for values in seeds))

    @property
    def bound(self) -> str:
        """The agent with the best mean."""
        best = max if self.challenge in MORE_IS_BETTER else min
        return best(self.agents, key=self.shared)

    def is_ahead(self, agent: str, *others: str) -> bool:
        """Whether the mean of an agent is better than those of the others that have swum."""
        sign = 1.0 if self.challenge in MORE_IS_BETTER else -1.0
        return all(sign * self.shared(agent) > sign * self.shared(other) for other in set(others) & self.agents.keys())

    @property
    def headroom(self) -> float:
        """By how much of greedy's measure the bound is better; infinite where greedy catches nothing."""
        greedy, bound = self.shared("greedy"), self.shared(self.bound)
        return abs(bound - greedy) / greedy if greedy > 0.0 else np.inf

    @property
    def better(self) -> str:
        """The headroom in words."""
        return f"{100.0 * self.headroom:.0f} %" if self.headroom < 10.0 else "more than ten times"

    @property
    def left(self) -> float:
        """Share of the headroom that PPO leaves."""
        greedy, bound = self.shared("greedy"), self.shared(self.bound)
        return abs(bound - self.shared("PPO")) / abs(bound - greedy)

    @property
    def is_kept(self) -> bool:
        """Whether the task has headroom that PPO does not take."""
        return self.headroom >= HEADROOM and self.left >= LEFT


def rows_of(results: Mapping[str, Any], ids: Mapping[str, str]) -> list[Row]:
    """Results by task."""
    rows = {id: Row(id, challenge, {}) for id, challenge in ids.items()}
    for name, found in results["cells"].items():
        id, _, rest = name.partition(", ")
        agent, _, _ = rest.rpartition(", ")
        rows[id].agents.setdefault(agent, []).append(np.array(found["measure"]))
    return [row for row in rows.values() if row.agents]
