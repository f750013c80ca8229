"""Policies that learned behind a symmetry reduction, in environments without one."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import gymnasium as gym

from seastar_gym.controllers.contract import Policy, actions_in, is_batched, require_policy, sees_reduced
from seastar_gym.controllers.learned import reason_of
from seastar_gym.envs.symmetry import box_of, symmetry_in
from seastar_gym.scene.checks import require_kind


class ReducedPolicy:
    """Policy that another one, which learned behind `SymmetryReduction`, answers for, in an environment without it.

    Observations are reduced, and actions turned back; states of recurrent policies are passed on. Its other attributes
    are those of that policy.

    policy: Anything with `predict`. env: Environment or batch whose robot, observations and symmetry the policy knows;
    its action mode counts where the policy says none. ValueError, with one sentence, where its scene is not symmetric.
    """

    symmetric = True

    def __init__(self, policy: Policy, env: Any):
        require_policy(policy)
        require_kind("env", env, gym.Env | gym.vector.VectorEnv, "an environment or a batch")
        try:
            symmetry = symmetry_in(env)
        except ValueError as why:
            raise ValueError(f"The policy learned behind a symmetry reduction, but {reason_of(why)}.") from why
        self.actions = actions_in(policy, symmetry.actions, symmetry.layout.n_limbs)
        self._policy, self._symmetry = policy, replace(symmetry, actions=self.actions)
        self.batched = is_batched(policy)
        sees: Any = getattr(policy, "observation_space", None)
        if sees is not None:
            self.observation_space = box_of(sees)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self._policy, name)

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = False,
        action_masks: Any = None,
    ) -> tuple[Any, Any]:
        """Action for an observation, or actions of n robots, and the state for the next call.

        action_masks: Actions that the wires can follow, shape (k,) or (n, k), for policies that take them.
        """
        reduced, elements = self._symmetry.reduce(observation)
        masks = {} if action_masks is None else {"action_masks": self._symmetry.carry_masks(action_masks, elements)}
        actions, state = self._policy.predict(reduced, state, episode_start, deterministic, **masks)
        return self._symmetry.restore(actions, elements), state


def as_it_learned(policy: Policy, make_env: Callable[[], Any]) -> Policy:
    """A policy, behind a symmetry reduction for an environment if its observation space says that it learned so."""
    return ReducedPolicy(policy, make_env()) if sees_reduced(policy) else policy
