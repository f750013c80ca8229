"""Controllers: scripted gaits, the greedy agent, the planner, and learned policies with their weights.

They need numpy and safetensors. What an agent of one's own must have is in `contract.py`; names are in `registry.py`.

    from seastar_gym.controllers import pretrained

    policy = pretrained("strokes")
    env = gym.make("SeastarSwim-v0", actions=policy.actions)
    observation, info = env.reset(seed=0)
    action, _ = policy.predict(observation, deterministic=True)
"""

from typing import TYPE_CHECKING

from seastar_gym.lazy import lazily

if TYPE_CHECKING:
    from seastar_gym.controllers.contract import Policy as Policy
    from seastar_gym.controllers.greedy import GreedyPolicy as GreedyPolicy
    from seastar_gym.controllers.learned import LearnedPolicy as LearnedPolicy
    from seastar_gym.controllers.learned import load as load
    from seastar_gym.controllers.learned import pretrained as pretrained
    from seastar_gym.controllers.open_loop import scripted as scripted
    from seastar_gym.controllers.planner import Planner as Planner
    from seastar_gym.controllers.registry import load_agent as load_agent
    from seastar_gym.controllers.registry import load_agents as load_agents
else:
    __all__, __getattr__, __dir__ = lazily(__name__)
