"""Turn, then swim: a controller for asked headings, made of a gait that turns and a policy that swims.

While the heading is not the asked one to a part of the tolerance, the robot turns by the gait, about on
the spot; then the policy, which knows nothing of headings, swims to the waypoint. Straight swims hardly turn.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.controllers.contract import Policy, can_be_decided_by
from seastar_gym.controllers.scripted import to_actions
from seastar_gym.envs.commands import Actions, to_commands
from seastar_gym.envs.headings import HeadingTargets
from seastar_gym.envs.layout import HEADINGS, Layout
from seastar_gym.envs.symmetry import transform_commands
from seastar_gym.scene import Scene

Floats = NDArray[np.float64]

BEGIN, END = 0.9, 0.4
"""Shares of the tolerance: turning begins above the first, and ends below the second."""


@dataclass(frozen=True)
class TurnThenSwim:
    """Agent that turns to the asked heading, and swims once it has it.

    clockwise: Gait that turns clockwise, as commands of decisions, shape (n_decisions, n_limbs); its mirror image turns
    back. swimmer: Policy that swims, without headings, with the same decisions. swims_in: Its action mode.
    scene, headings: Those of the environment. decision_period: Of the environment [s].
    """

    clockwise: Floats
    swimmer: Policy
    swims_in: Actions
    scene: Scene
    headings: HeadingTargets
    decision_period: float | None
    actions: Actions = "joint"

    def predict(
        self,
        observation: NDArray[np.float32],
        state: tuple[bool, int] | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = False,
    ) -> tuple[NDArray[Any], tuple[bool, int]]:
        """Action of one robot for an observation of shape (size,), and whether it turns, with the gait's decisions."""
        turns, k = (False, 0) if state is None else state
        if not can_be_decided_by(observation):
            return self._action(np.zeros(self.scene.robot.n_limbs)), (turns, k)
        at = Layout.of(self.scene, entries=HEADINGS)
        c, s = observation[at.headings][:2].astype(np.float64).tolist()
        left = math.atan2(s, c)
        turns = bool(abs(left) > (END if turns else BEGIN) * self.headings.tolerance)
        if turns:
            command = self._turn(left)[k % len(self.clockwise)]
            return self._action(command), (True, k + 1)
        chosen, _ = self.swimmer.predict(np.delete(observation, at.headings), deterministic=True)
        command = to_commands(self.swims_in, self.scene.robot.n_limbs, [chosen], 1)[0]
        return self._action(command), (False, 0)

    def _turn(self, left: float) -> Floats:
        """The gait that turns to the side where the asked heading lies."""
        mirror = 2 * self.scene.robot.n_limbs - 1
        return self.clockwise if left < 0.0 else np.asarray(transform_commands(self.clockwise, mirror), np.float64)

    def _action(self, command: Floats) -> NDArray[Any]:
        return np.asarray(to_actions(command[None], self.actions, self.scene.robot.n_limbs)[0])
