"""Controllers: scripted gaits, the greedy agent, the planner, and learned policies with their weights.

They need numpy and safetensors. What an agent of one's own must have is in `contract.py`; names are in `roster.py`.

    from seastar_gym.controllers import load

    policy = load()  # the one in the box
    env = gym.make("SeastarSwim-v0", actions=policy.actions)
    observation, info = env.reset(seed=0)
    action, _ = policy.predict(observation, deterministic=True)
"""

from typing import TYPE_CHECKING

from seastar_gym.controllers.learned import LearnedPolicy, in_the_box, load
from seastar_gym.lazy import lazily

__all__ = [
    "GreedyPolicy",
    "LearnedPolicy",
    "Planner",
    "Policy",
    "in_the_box",
    "load",
    "load_agent",
    "load_agents",
    "scripted",
]

if TYPE_CHECKING:
    from seastar_gym.controllers.contract import Policy
    from seastar_gym.controllers.greedy import GreedyPolicy
    from seastar_gym.controllers.planner import Planner
    from seastar_gym.controllers.roster import load_agent, load_agents
    from seastar_gym.controllers.scripted import scripted
else:
    __getattr__, __dir__ = lazily(
        __name__,
        {
            "GreedyPolicy": "greedy",
            "Planner": "planner",
            "Policy": "contract",
            "load_agent": "roster",
            "load_agents": "roster",
            "scripted": "scripted",
        },
    )
