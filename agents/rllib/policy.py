"""The policy that RLlib has learned, as plain numbers."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from ray.rllib.algorithms.ppo import PPO
from ray.rllib.core import COMPONENT_LEARNER, COMPONENT_RL_MODULE, DEFAULT_MODULE_ID

from agents.rllib.options import Options
from seastar_gym.controllers.description import Description
from seastar_gym.controllers.learned import LearnedPolicy, Weights
from seastar_gym.envs.options import make_scene

ACTOR = "encoder.actor_encoder.net.mlp."
"""Beginning of the names of the policy's hidden layers, as RLlib calls them."""
LAST = "pi.net.mlp.0"


def policy_of(algorithm: PPO, options: Options) -> LearnedPolicy:
    """Policy that a learner has learned so far."""
    state = algorithm.learner_group.get_state(components=f"{COMPONENT_LEARNER}/{COMPONENT_RL_MODULE}")
    ppo = options.ppo
    scene = make_scene(None, options.fidelity, ppo.decision_period)
    description = Description(ppo.actions, ppo.symmetry, scene, ppo.hidden, ppo.decision_period)
    return LearnedPolicy(description, actor(state[COMPONENT_LEARNER][COMPONENT_RL_MODULE][DEFAULT_MODULE_ID]))


def actor(network: Mapping[str, Any]) -> Weights:
    """Weights of the policy in RLlib's network, under the names of `LearnedPolicy`."""
    hidden = sorted({int(name.split(".")[4]) for name in network if name.startswith(ACTOR)})
    layers = [*(f"{ACTOR}{number}" for number in hidden), LAST]
    return {
        f"{layer}.{kind}": np.array(network[f"{name}.{kind}"], np.float32)
        for layer, name in enumerate(layers)
        for kind in ("weight", "bias")
    }
