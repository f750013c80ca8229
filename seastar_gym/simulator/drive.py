"""`Drive`: the actuators of a batch of robots, from commands to rotations of limbs."""

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene.actuators.actuator import Actuator, StatefulActuator

Floats = NDArray[np.float64]


class Drive:
    """Actuators of a batch of robots, one for each limb.

    times: Ends of a stroke's time steps [s].
    strengths: Factor by which every limb's rotation is reduced, shape (n_robots, n_limbs).
    curve: Rotation by command 1 at `times` [rad], shape (n_times,), or (n_times, n_robots, 1) where numbers differ from
        robot to robot. None for actuators with memory.
    state: Present state of the actuators, shape (n_robots, n_limbs, n_state); n_state is 0 without memory.
    at_rest: State of the actuators at rest, of the shape of `state`.
    """

    def __init__(self, actuator: Actuator, n_robots: int, n_limbs: int, times: Floats):
        self._times = times
        self._commands = np.zeros((n_robots, n_limbs))
        self.strengths = np.ones((n_robots, n_limbs))
        self.set_actuator(actuator)
        self.state = self.at_rest.copy()
        self._before = self._after = self.state  # at the beginning and the end of the present stroke

    def set_actuator(self, actuator: Actuator) -> None:
        """Continue with an actuator that differs only in numbers that may differ from robot to robot."""
        self._stateful = actuator if isinstance(actuator, StatefulActuator) else None
        self.curve = None if self._stateful else np.asarray(actuator.delta_psi(self._times))
        if self.curve is not None and self.curve.ndim > 1:
            self.curve = self.curve[:, :, None]
        rest = self._stateful.rest if self._stateful else np.zeros(0)
        self.at_rest = np.broadcast_to(rest, (*self.strengths.shape, rest.shape[-1]))

    def begin_stroke(self, commands: Floats) -> tuple[Floats, Floats | None]:
        """Begin a stroke with these commands. Limbs rotate by the returned peaks times the returned shape.

        Returns peaks of shape (n_robots, n_limbs) and rotations [rad] of shape (n_times, n_robots, n_limbs), or None
        where the rotations are `curve`.
        """
        if self._stateful is None:
            return commands * self.strengths, None
        self._commands, self._before = commands, self.state
        turned, self._after = self._stateful.respond(self._times, commands, self.state)
        return self.strengths, turned

    def advance(self, end: int) -> None:
        """Bring the state to the time step `end` of the present stroke."""
        if end == len(self._times) - 1:
            self.state = self._after
        elif self._stateful is not None:
            self.state = self._stateful.respond(self._times[: end + 1], self._commands, self._before)[1]

    def observe(self) -> Floats:
        """State as numbers of order one, shape (n_robots, k), limb after limb; k = 0 without memory."""
        seen = self.state if self._stateful is None else self._stateful.observe(self.state)
        return seen.reshape(len(seen), -1)

    def rotations(self) -> Floats:
        """Rotations of limbs between two strokes [rad], shape (n_robots, n_limbs)."""
        if self._stateful is None:
            return np.zeros_like(self.strengths)
        return self.strengths * self._stateful.respond(np.zeros(1), np.zeros_like(self.strengths), self.state)[0][0]

    def put(self, chosen: NDArray[np.bool_] | slice, state: Floats) -> None:
        """Put the actuators of the chosen robots into states, between two strokes."""
        self.state = np.array(self.state)
        self.state[chosen] = state
