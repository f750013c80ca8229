"""What every controller has, `predict`, what that is given, and whether it can drive the robot of an environment."""

import math
from typing import TYPE_CHECKING, Any, Protocol, get_args

import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.commands import MOST_LIMBS, Actions, action_space
from seastar_gym.envs.layout import Layout
from seastar_gym.envs.sight import Sight, told
from seastar_gym.envs.symmetry import ReducedBox
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import as_array, shown

if TYPE_CHECKING:
    from seastar_gym.envs.robots import Task


LARGEST_SEEN = 1e30
"""Largest number of an observation by which a policy decides: sums of larger ones may have no float."""


class Policy(Protocol):
    """Anything with Stable-Baselines3's `predict`; see `actions_of` for the action mode that it is made for."""

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = False
    ) -> tuple[Any, Any]:
        """Action for an observation, and the recurrent state for the next call."""


def require_policy(policy: object) -> None:
    """ValueError for what has no `predict`."""
    if not callable(getattr(policy, "predict", None)) or isinstance(policy, type):
        raise ValueError(f"A policy must have predict(observation, ...), which {shown(policy)} has not.")


def answer_of(answer: object) -> tuple[Any, Any]:
    """Action and state that a call of `predict` returned; ValueError where it is no pair."""
    if not isinstance(answer, tuple) or len(answer) != 2:
        raise ValueError(f"predict must return an action and the state for its next call, not {shown(answer)}.")
    return answer


def is_batched(policy: Any) -> bool:
    """Whether a policy answers for many robots at once."""
    third_party = {each.__module__.partition(".")[0] for each in type(policy).__mro__}
    return bool(getattr(policy, "batched", not third_party.isdisjoint({"stable_baselines3", "sb3_contrib"})))


def sees_reduced(policy: Any) -> bool:
    """Whether a policy is to be given reduced observations, as its observation space says."""
    return isinstance(getattr(policy, "observation_space", None), ReducedBox)


def memory_of(state: object, shape: tuple[int, ...], kinds: str, what: str) -> NDArray[Any] | None:
    """The array in a state, None before the first decision; ValueError for what the last call cannot have given.

    shape, kinds: Of the array, and kinds of its numbers as numpy has them. what: What it holds, for the sentence.
    """
    memory = state[0] if isinstance(state, tuple) and len(state) == 1 else None
    fits = isinstance(memory, np.ndarray) and memory.dtype.kind in kinds and memory.shape == shape
    if state is not None and not fits:
        raise ValueError(f"state must be None or what the last call gave, {what} of shape {shape}.")
    return memory


def actions_of(policy: Policy, n_limbs: int) -> Actions:
    """The action mode that a policy is for: its attribute `actions`, or the mode that has its `action_space`, as models
    of Stable-Baselines3 say it; "limbs" if it says neither."""
    space: Any = getattr(policy, "action_space", None)
    if space is None or hasattr(policy, "actions"):
        return getattr(policy, "actions", "limbs")
    for mode in get_args(Actions):
        if (mode != "joint" or n_limbs <= MOST_LIMBS) and action_space(mode, n_limbs) == space:
            return mode
    raise ValueError(f"The policy acts in {space}, which is no action mode of a robot of {n_limbs} limbs.")


def actions_in(policy: Policy, own: Actions, n_limbs: int) -> Actions:
    """The action mode that a policy is for, see `actions_of`; an environment's own one if the policy says none."""
    says = hasattr(policy, "actions") or getattr(policy, "action_space", None) is not None
    return actions_of(policy, n_limbs) if says else own


def require_fit(
    policy: Policy,
    scene: Scene,
    actions: Actions,
    decision_period: float | None = None,
    n_seen: int | None = None,
    task: "Task | None" = None,
    sight: Sight | None = None,
) -> None:
    """ValueError, with one sentence, where a policy cannot drive the robot of an environment, as far as it tells.

    decision_period: Time between decisions of the environment [s]. None means a stroke.
    n_seen: Length of the environment's observations. None means those of waypoints.
    task: Of the environment. None means waypoints. sight: Through which the robot is seen, None for full sight.
    """
    n_seen = Layout.of(scene).size if n_seen is None else n_seen
    limbs = getattr(policy, "n_limbs", None)
    if limbs is not None and limbs != scene.robot.n_limbs:
        raise ValueError(f"The policy is for a robot of {limbs} limbs, the environment's has {scene.robot.n_limbs}.")
    sees: Any = getattr(policy, "observation_space", None)
    ours = getattr(policy, "decision_period", getattr(sees, "decision_period", None))
    theirs = scene.actuator.period if decision_period is None else decision_period
    if ours is not None and not math.isclose(ours, theirs):  # robots have other wires then, and show other numbers
        raise ValueError(
            f"The policy decides every {ours:g} s, the environment every {theirs:g} s: make them equal, by "
            "decision_period or --decision-period, or take the id that it learned for."
        )
    if hasattr(policy, "require_fit"):
        policy.require_fit(scene, actions, n_seen, task, sight)
    if sees is not None and sees.shape != (n_seen,):
        shown_by = "" if sight is None else f", by {told(sight)}"
        raise ValueError(
            f"The policy sees observations of shape {sees.shape}, the environment's have {(n_seen,)}{shown_by}."
        )
    if sees_reduced(policy):
        raise ValueError(
            "The policy learned behind a symmetry reduction: take ReducedPolicy(policy, env), or load its file by name."
        )
    acts = getattr(policy, "action_space", None)
    if acts is not None and acts != action_space(actions, scene.robot.n_limbs):
        raise ValueError(f'The policy acts in {acts}, which is not that of an environment with actions="{actions}".')


def as_floating(name: str, value: object) -> NDArray[np.floating[Any]]:
    """Value as an array of floats of its own precision, of whatever shape."""
    array = as_array(name, value)
    if array.dtype.kind not in "iuf":
        raise ValueError(f"{name} must be numbers, not {array.dtype} values.")
    return array


def observed(observation: object, smallest: int) -> NDArray[np.floating[Any]]:
    """Observations of one robot, shape (size,), or several, shape (n, size). smallest: Least numbers of each."""
    array = as_floating("observation", observation)
    if array.ndim not in (1, 2) or array.shape[-1] < smallest:
        raise ValueError(
            f"An observation must have shape (size,) or (n, size), with {smallest} numbers or more, not {array.shape}."
        )
    return array


def can_be_decided_by(observations: NDArray[Any]) -> NDArray[np.bool_]:
    """Which observations, shape (..., size), are of finite numbers that a network can add up.

    By any other a robot rests: action 0 of every discrete mode moves no limb.
    """
    return np.asarray((np.abs(observations) <= LARGEST_SEEN).all(axis=-1))


def starts(episode_start: object, n: int) -> NDArray[np.bool_]:
    """Which of n robots begin an episode; none if it is not said."""
    if episode_start is None:
        return np.zeros(n, bool)
    flags = as_array("episode_start", episode_start)
    if flags.dtype.kind not in "biu" or flags.shape not in ((), (1,), (n,)):
        raise ValueError(f"episode_start must be flags of shape ({n},), not {shown(episode_start)}.")
    return np.broadcast_to(flags.astype(bool), (n,))
