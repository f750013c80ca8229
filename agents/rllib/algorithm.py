"""PPO of RLlib, set up as train.py's is."""

from collections.abc import Mapping
from math import sqrt
from typing import Any

import numpy as np
from ray.rllib.algorithms.ppo import PPO, PPOConfig
from ray.rllib.core import COMPONENT_LEARNER, COMPONENT_RL_MODULE, DEFAULT_MODULE_ID
from ray.rllib.core.rl_module.default_model_config import DefaultModelConfig
from ray.tune.registry import register_env

from agents.rllib.options import Options
from seastar_gym.adapters.rllib import native_batch
from seastar_gym.controllers.description import Description
from seastar_gym.controllers.learned import LearnedPolicy, Weights
from seastar_gym.envs.options import make_scene
from seastar_gym.envs.paths import WAYPOINT_RADIUS

NAME = "seastar"
PATIENCE = 600.0
"""Time that env runners have for a rollout [s]: a first one may compile."""


def make_algorithm(options: Options) -> PPO:
    """New learner with its env runners, on the Ray cluster that is connected."""
    register_env(NAME, native_batch)
    return PPO(config=configuration(options))


def configuration(options: Options) -> PPOConfig:
    """Settings: the loss, the network and the schedule of Stable-Baselines3's PPO, in RLlib's words.

    A lost env runner is started again, on another node if its own is gone, while the others go on.
    """
    ppo = options.ppo
    return (
        PPOConfig()
        .environment(NAME, env_config=env_config(options))
        .env_runners(
            num_env_runners=options.env_runners,
            num_envs_per_env_runner=ppo.num_envs // options.env_runners,
            gym_env_vectorize_mode="vector_entry_point",
            rollout_fragment_length=ppo.rollout,
            sample_timeout_s=PATIENCE,
        )
        .learners(num_learners=0)
        .rl_module(model_config=network(ppo.hidden))
        .training(
            train_batch_size_per_learner=ppo.num_envs * ppo.rollout,
            minibatch_size=ppo.batch_size,
            num_epochs=ppo.epochs,
            lr=[[0, ppo.learning_rate], [options.length, 0.0]],
            gamma=ppo.discount_per_decision,
            lambda_=ppo.gae_lambda,
            clip_param=ppo.clip_range,
            entropy_coeff=ppo.entropy,
            use_kl_loss=False,
            vf_loss_coeff=0.5,
            vf_clip_param=float("inf"),
            grad_clip=0.5,
            grad_clip_by="global_norm",
        )
        .fault_tolerance(restart_failed_env_runners=True, delay_between_env_runner_restarts_s=1.0)
        .debugging(seed=options.seed, log_level="ERROR")
    )


def network(hidden: tuple[int, ...]) -> DefaultModelConfig:
    """Policy and value network of their own, with tanh and Stable-Baselines3's first weights of hidden layers."""
    return DefaultModelConfig(
        fcnet_hiddens=list(hidden),
        fcnet_activation="tanh",
        fcnet_kernel_initializer="orthogonal_",
        fcnet_kernel_initializer_kwargs={"gain": sqrt(2.0)},
        fcnet_bias_initializer="zeros_",
        vf_share_layers=False,
    )


def env_config(options: Options) -> dict[str, Any]:
    """Arguments of the native batch."""
    ppo = options.ppo
    return {
        "symmetry": ppo.symmetry,
        "path": options.path,
        "random_heading": options.random_heading,
        "fidelity": options.fidelity,
        "waypoint_radius": WAYPOINT_RADIUS,
        **ppo.options,
    }


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
