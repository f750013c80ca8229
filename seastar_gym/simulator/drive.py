"""The actuators of a batch of robots: from commands to the rotation of every limb during a stroke."""

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene.actuators.actuator import Actuator, StatefulActuator

Floats = NDArray[np.float64]


class Drive:
    """One actuator per limb of `n_robots` robots.

    times: Ends of a stroke's time steps [s].

    strengths: Share of its rotation that every limb still makes, shape (n_robots, n_limbs).
    curve: Rotation by command 1 at `times`, shape (n_times,), or (n_times, n_robots, 1) where numbers differ from robot
        to robot [rad]; None for actuators that remember something.
    state: What the actuators remember now, shape (n_robots, n_limbs, n_state); n_state is 0 for most.
    at_rest: The same of actuators that were left alone.
    """

    def __init__(self, actuator: Actuator, n_robots: int, n_limbs: int, times: Floats):
        self._times = times
        self._commands = np.zeros((n_robots, n_limbs))
        self.strengths = np.ones((n_robots, n_limbs))
        self.set_actuator(actuator)
        self.state = self.at_rest.copy()
        self._before = self._after = self.state  # as the stroke that is under way begins and ends

    def set_actuator(self, actuator: Actuator) -> None:
        """Go on with an actuator that differs in numbers of `PER_ROBOT` alone."""
        self._stateful = actuator if isinstance(actuator, StatefulActuator) else None
        self.curve = None if self._stateful else np.asarray(actuator.delta_psi(self._times))
        if self.curve is not None and self.curve.ndim > 1:
            self.curve = self.curve[:, :, None]
        rest = self._stateful.rest if self._stateful else np.zeros(0)
        self.at_rest = np.broadcast_to(rest, (*self.strengths.shape, rest.shape[-1]))

    def begin_stroke(self, commands: Floats) -> tuple[Floats, Floats | None]:
        """(peaks, shape) of a stroke with these commands: limbs turn by their peak times the shape.

        peaks: Shape (n_robots, n_limbs). shape: Shape (n_times, n_robots, n_limbs) [rad], or None for `curve`.
        """
        if self._stateful is None:
            return commands * self.strengths, None
        self._commands, self._before = commands, self.state
        turned, self._after = self._stateful.respond(self._times, commands, self.state)
        return self.strengths, turned

    def advance(self, end: int) -> None:
        """Bring the state to the time step `end` of the stroke that is under way."""
        if end == len(self._times) - 1:
            self.state = self._after
        elif self._stateful is not None:
            self.state = self._stateful.respond(self._times[: end + 1], self._commands, self._before)[1]

    def observe(self) -> Floats:
        """The state as numbers of order one, shape (n_robots, k), limb after limb; k is 0 for most actuators."""
        seen = self.state if self._stateful is None else self._stateful.observe(self.state)
        return seen.reshape(len(seen), -1)

    def rotations(self) -> Floats:
        """Of limbs between two strokes [rad], shape (n_robots, n_limbs)."""
        if self._stateful is None:
            return np.zeros_like(self.strengths)
        return self.strengths * self._stateful.respond(np.zeros(1), np.zeros_like(self.strengths), self.state)[0][0]

    def put(self, chosen: NDArray[np.bool_] | slice, state: Floats) -> None:
        """Put the actuators of the chosen robots into states, between two strokes."""
        self.state = np.array(self.state)
        self.state[chosen] = state
