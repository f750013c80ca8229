"""Controllers: scripted gaits, the greedy agent, the planner, and learned policies with their weights.

In come observations, out go actions; they need numpy and safetensors alone, so that a policy runs where nothing is
compiled. What an agent of one's own must have is in `contract.py`, networks are in `learned.py`, names in
`registry.py`.

    from seastar_gym.controllers import pretrained

    policy = pretrained("strokes")
    env = gym.make("SeastarSwim-v0", actions=policy.actions)
    observation, info = env.reset(seed=0)
    action, _ = policy.predict(observation, deterministic=True)
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
