"""The native batch as the environment of RLlib's env runners.

    from ray.rllib.algorithms.ppo import PPOConfig
    from ray.tune.registry import register_env

    register_env("seastar", native_batch)
    config = PPOConfig().environment("seastar", env_config={"fidelity": "fast", "actions": "pairs"}).env_runners(
        num_envs_per_env_runner=64, gym_env_vectorize_mode="vector_entry_point"
    )

Neither Ray nor RLlib is imported here: nodes need this module, and whoever registers it has Ray.
"""

import inspect
from collections.abc import Mapping
from typing import Any

import gymnasium as gym

from seastar_gym.envs.symmetry import VectorSymmetryReduction
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.scene.checks import require_flag, shown

Batch = gym.vector.VectorEnv[Any, Any, Any]


def native_batch(context: Mapping[str, Any]) -> Batch:
    """Batch of an env runner, in the autoreset mode NEXT_STEP that RLlib expects.

    context: RLlib's `env_config` with its "num_envs": arguments of `SeastarSwimVectorEnv`, and "symmetry", whether
    observations are reduced to one sector (false by default). An env runner has one processor, and so one thread,
    unless "threads" says otherwise.
    """
    if not isinstance(context, Mapping) or not all(isinstance(name, str) for name in context):
        raise ValueError(f"context must be arguments of SeastarSwimVectorEnv by name, not {shown(context)}.")
    arguments = {"threads": 1, **context}
    symmetry = arguments.pop("symmetry", False)
    require_flag("symmetry", symmetry)
    unknown = arguments.keys() - inspect.signature(SeastarSwimVectorEnv).parameters.keys()
    if unknown:
        raise ValueError(f"SeastarSwimVectorEnv has no argument {shown(sorted(unknown)[0])}.")
    batch: Batch = SeastarSwimVectorEnv(**arguments)
    return OfRunner(VectorSymmetryReduction(batch) if symmetry else batch)


class OfRunner(gym.vector.VectorWrapper):
    """Batch whose seeds differ from those of other env runners, and which has no info.

    RLlib gives env runner k the seed `seed + k`, with which robot i would have the seed `seed + k + i`: nearly all of
    them those of another runner's robots. And it would take info apart robot by robot at every step.
    """

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin episodes; robot i has the seed `seed * num_envs + i`."""
        own: Any = seed * self.num_envs if isinstance(seed, int) else seed
        observations, _ = self.env.reset(seed=own, options=options)
        return observations, {}

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """One decision of every robot."""
        return *self.env.step(actions)[:4], {}
