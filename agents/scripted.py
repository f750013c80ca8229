"""Scripted gaits: the straight gait, the pairs of Fig. 13.8, the pentagon gait (13.15), and random actions.

A gait looks at no observation. The number of strokes that it has swum is the recurrent state of Stable-Baselines3's
`predict`, so one gait may drive any number of robots:

    gait, state = scripted("pentagon"), None
    action, state = gait.predict(observation, state)
"""

import re
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.envs.commands import LIMB_COMMANDS, Actions, choices, command_table
from seastar_gym.gaits import pair_gait, pentagon_gait, straight_gait

Floats = NDArray[np.float64]
PolicyState = tuple[NDArray[np.int64], ...] | None

_PAIR = re.compile(r"\{?(\d+)([+-]),(\d+)([+-])\}?")


def to_actions(commands: ArrayLike, actions: Actions, n_limbs: int) -> NDArray[np.int64]:
    """Actions that mean commands of shape (..., n_limbs): the same shape for "limbs", otherwise (...)."""
    commands = np.asarray(commands, dtype=np.float64)
    if actions == "limbs":
        means = commands[..., None] == LIMB_COMMANDS
    else:
        means = (commands[..., None, :] == command_table(actions, n_limbs)).all(axis=-1)
    if not means.any(axis=-1).all():
        raise ValueError(f'Some of these commands have no action with actions="{actions}".')
    return np.argmax(means, axis=-1)


class OpenLoopPolicy:
    """Policy that repeats a gait; its state counts the strokes.

    commands: Commands of the gait, shape (n_strokes, n_limbs), values -1, 0, 1.
    actions: Action mode of the environment.
    """

    def __init__(self, commands: ArrayLike, actions: Actions = "limbs"):
        commands = np.asarray(commands, dtype=np.float64)
        if commands.ndim != 2 or commands.size == 0:
            raise ValueError(f"A gait needs commands of shape (n_strokes, n_limbs), not {commands.shape}.")
        self.actions: Actions = actions
        self._gait = to_actions(commands, actions, commands.shape[1])

    def predict(
        self,
        observation: NDArray[np.float32],
        state: PolicyState = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = False,
    ) -> tuple[NDArray[np.int64], PolicyState]:
        """Action of the next stroke, and the state for the call after it.

        observation: Observation of one robot, shape (size,), or of a batch, shape (n, size); only its shape matters.
        state: State that the last call returned, the strokes swum, shape (n,), in a tuple; None before the first call.
        episode_start: Whether an episode begins with this stroke, so that the gait starts again, shape (n,).
        """
        alone = np.ndim(observation) == 1
        swum = np.zeros(1 if alone else len(observation), dtype=np.int64) if state is None else state[0]
        if episode_start is not None:
            swum = np.where(episode_start, 0, swum)
        action = self._gait[swum % len(self._gait)]
        return action[0] if alone else action, (swum + 1,)


class RandomPolicy:
    """Policy of uniformly random actions, the baseline that any gait has to beat."""

    def __init__(self, rng: np.random.Generator, actions: Actions = "limbs", n_limbs: int = 5):
        self.actions: Actions = actions
        self._rng = rng
        _, self._n_choices = choices(actions, n_limbs)
        self._shape = (n_limbs,) if actions == "limbs" else ()

    def predict(
        self,
        observation: NDArray[np.float32],
        state: PolicyState = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = False,
    ) -> tuple[NDArray[np.int64], PolicyState]:
        """Action of one robot for an observation of shape (size,), or of n robots for shape (n, size)."""
        batch = np.shape(observation)[:-1]
        return np.asarray(self._rng.integers(self._n_choices, size=batch + self._shape)), None


def _pentagon(n_limbs: int) -> Floats:
    if n_limbs != 5:
        raise ValueError(f"The pentagon gait (13.15) is for five limbs, not {n_limbs}.")
    return pentagon_gait()


def _rest(n_limbs: int) -> Floats:
    return np.zeros((1, n_limbs))


GAITS: dict[str, Callable[[int], Floats]] = {"pentagon": _pentagon, "straight": straight_gait, "rest": _rest}
"""Functions that make the commands of a gait, shape (n_strokes, n_limbs), for a number of limbs, by name."""


def scripted(
    name: str, actions: Actions = "limbs", n_limbs: int = 5, rng: np.random.Generator | None = None
) -> OpenLoopPolicy | RandomPolicy:
    """Policy with the name of a gait in `GAITS`, "random", or a pair such as "4+,1-".

    actions: Action mode of the environment. rng: Generator of the random policy; by default one with seed 0.
    """
    if name == "random":
        return RandomPolicy(np.random.default_rng(0) if rng is None else rng, actions, n_limbs)
    return OpenLoopPolicy(_gait(name, n_limbs), actions)


def _gait(name: str, n_limbs: int) -> Floats:
    pair = _PAIR.fullmatch(name.replace(" ", ""))
    if pair is not None and pair[2] != pair[4]:
        limbs = {pair[2]: int(pair[1]), pair[4]: int(pair[3])}
        return pair_gait(limbs["+"], limbs["-"], n_limbs)
    if name in GAITS:
        return GAITS[name](n_limbs)
    names = ", ".join((*GAITS, "random"))
    raise ValueError(f'Unknown scripted agent {name!r}: choose one of {names}, or a pair of a + and a - limb: "4+,1-".')
