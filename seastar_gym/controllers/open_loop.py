"""Scripted gaits: the straight gait, the pairs of Fig. 13.8, the pentagon gait (13.15), gaits in time, random actions.

A gait looks at no observation. The number of decisions that it has made is the recurrent state of Stable-Baselines3's
`predict`, so one gait may drive any number of robots:

    gait, state = scripted("pentagon"), None
    action, state = gait.predict(observation, state)

Strokes begin once a second whatever the time between decisions. Lagged gaits, and the wave that turns the robot, need
shorter ones than a second, and wires.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from typing import Any, get_args

import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike, NDArray

from seastar_gym.controllers.contract import memory_of, observed, starts
from seastar_gym.envs.commands import LIMB_COMMANDS, Actions, action_space, command_table
from seastar_gym.gaits import (
    PERIOD,
    lagged_gait,
    lagged_pentagon,
    pair_gait,
    pentagon_gait,
    straight_gait,
    thrifty_gait,
    timed,
    turning_wave,
)
from seastar_gym.scene.checks import (
    as_finite,
    require_choice,
    require_few,
    require_kind,
    require_limbs,
    require_period,
    shown,
)

Floats = NDArray[np.float64]
PolicyState = tuple[NDArray[np.int64], ...] | None

_PAIR = re.compile(r"\{?(\d+)([+-]),(\d+)([+-])\}?")


MOST_COMMANDS = 100_000
"""Most decisions of a gait, which is repeated."""


def to_actions(commands: ArrayLike, actions: Actions, n_limbs: int) -> NDArray[Any]:
    """Actions that mean commands of shape (..., n_limbs): that shape for "limbs" and "continuous", otherwise (...)."""
    commands = np.asarray(commands, dtype=np.float64)
    if actions == "continuous":
        return commands.astype(np.float32)
    if actions == "limbs":
        means = commands[..., None] == LIMB_COMMANDS
    else:
        means = (commands[..., None, :] == command_table(actions, n_limbs)).all(axis=-1)
    if not means.any(axis=-1).all():
        raise ValueError(f'Some of these commands have no action with actions="{actions}".')
    return np.argmax(means, axis=-1)


class OpenLoopPolicy:
    """Policy that repeats a gait; its state counts the decisions.

    commands: Commands of the gait, shape (n_decisions, n_limbs), values -1, 0, 1, or between them for "continuous".
    actions: Action mode of the environment.
    decision_period: Time between decisions [s] that the gait is made for. None means any.
    """

    batched = True

    def __init__(self, commands: ArrayLike, actions: Actions = "limbs", decision_period: float | None = None):
        require_few("A gait", commands, MOST_COMMANDS)
        commands = as_finite("commands", commands, ())
        require_choice("actions", actions, get_args(Actions))
        require_period(decision_period)
        if commands.ndim != 2 or commands.size == 0:
            raise ValueError(f"A gait needs commands of shape (n_strokes, n_limbs), not {commands.shape}.")
        self.actions: Actions = actions
        self.n_limbs = commands.shape[1]
        self.decision_period = decision_period
        unlike, each = np.unique(commands, axis=0, return_inverse=True)
        self._gait = to_actions(unlike, actions, commands.shape[1])[each.reshape(-1)]

    def predict(
        self,
        observation: NDArray[np.float32],
        state: PolicyState = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = False,
    ) -> tuple[NDArray[Any], PolicyState]:
        """Action of the next decision, and the state for the call after it.

        observation: Observation of one robot, shape (size,), or of a batch, shape (n, size); only its shape matters.
        state: State that the last call returned, the decisions made, shape (n,), in a tuple; None before the first.
        episode_start: Whether an episode begins with this decision, so that the gait starts again, shape (n,).
        """
        observation = observed(observation, 0)
        alone = observation.ndim == 1
        n = 1 if alone else len(observation)
        made = memory_of(state, (n,), "iu", "decisions made")
        swum = np.where(starts(episode_start, n), 0, 0 if made is None else made)
        action = self._gait[swum % len(self._gait)]
        return action[0] if alone else action, (swum + 1,)


class RandomPolicy:
    """Policy of uniformly random actions, the baseline that any gait has to beat."""

    batched = True

    def __init__(self, rng: np.random.Generator, actions: Actions = "limbs", n_limbs: int = 5):
        require_kind("rng", rng, np.random.Generator, "a numpy Generator")
        require_limbs(n_limbs)
        self.actions: Actions = actions
        self.n_limbs = n_limbs
        self._rng = rng
        self._space = action_space(actions, n_limbs)

    def predict(
        self,
        observation: NDArray[np.float32],
        state: PolicyState = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = False,
    ) -> tuple[NDArray[Any], PolicyState]:
        """Action of one robot for an observation of shape (size,), or of n robots for shape (n, size)."""
        shape = (*observed(observation, 0).shape[:-1], *(self._space.shape or ()))
        if isinstance(self._space, spaces.Box):
            return self._rng.uniform(-1.0, 1.0, shape).astype(np.float32), None
        n_choices = self._space.n if isinstance(self._space, spaces.Discrete) else self._space.nvec[0]
        return np.asarray(self._rng.integers(n_choices, size=shape)), None


def _of_five(gait: Callable[[float], Floats]) -> Callable[[int, float], Floats]:
    def make(n_limbs: int, decision_period: float) -> Floats:
        if n_limbs != 5:
            raise ValueError(f"The pentagon gait (13.15), and others that turn, are for five limbs, not {n_limbs}.")
        return gait(decision_period)

    return make


GAITS: dict[str, Callable[[int, float], Floats]] = {
    "pentagon": _of_five(partial(timed, pentagon_gait())),
    "straight": lambda n_limbs, decision_period: timed(straight_gait(n_limbs), decision_period),
    "rest": lambda n_limbs, decision_period: np.zeros((1, n_limbs)),
    "lagged": lambda n_limbs, decision_period: lagged_gait(decision_period, n_limbs),
    "thrifty": lambda n_limbs, decision_period: thrifty_gait(decision_period, n_limbs),
    "wave": _of_five(turning_wave),
    "lagged-pentagon": _of_five(lagged_pentagon),
}
"""Functions that make the commands of a gait, shape (n_decisions, n_limbs), for a number of limbs and a decision period
[s], by name."""


def scripted(
    name: str,
    actions: Actions | None = None,
    n_limbs: int = 5,
    rng: np.random.Generator | None = None,
    decision_period: float | None = None,
) -> OpenLoopPolicy | RandomPolicy:
    """Policy with the name of a gait in `GAITS`, "random", or a pair such as "4+,1-".

    actions: Action mode of the environment. None means "limbs", or "continuous" for gaits of partial pulses.
    rng: Generator of the random policy; by default one with seed 0. decision_period: Of the environment [s]. None
    means strokes, of any length.
    """
    require_kind("name", name, str, "the name of a gait")
    require_limbs(n_limbs)
    require_period(decision_period)
    require_kind("rng", rng, np.random.Generator | None, "a numpy Generator, or None")
    if actions is not None:
        require_choice("actions", actions, get_args(Actions))
    if name == "random":
        return RandomPolicy(np.random.default_rng(0) if rng is None else rng, actions or "limbs", n_limbs)
    commands = _gait(name, n_limbs, PERIOD if decision_period is None else decision_period)
    is_whole = bool(np.isin(commands, LIMB_COMMANDS).all())
    return OpenLoopPolicy(commands, actions or ("limbs" if is_whole else "continuous"), decision_period)


def _gait(name: str, n_limbs: int, decision_period: float) -> Floats:
    pair = _PAIR.fullmatch(name.replace(" ", ""))
    if pair is not None and pair[2] != pair[4]:
        limbs = {pair[2]: int(pair[1]), pair[4]: int(pair[3])}
        return timed(pair_gait(limbs["+"], limbs["-"], n_limbs), decision_period)
    if name in GAITS:
        return GAITS[name](n_limbs, decision_period)
    names = ", ".join((*GAITS, "random"))
    raise ValueError(
        f'Unknown scripted agent {shown(name)}: choose one of {names}, or a pair of a + and a - limb: "4+,1-".'
    )
