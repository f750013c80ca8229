"""Actuators that a user might write, which say no more than they have to."""

import numpy as np


class Triangle:
    """A curve."""

    peak_angle, period, corners = 0.3, 0.6, (0.0, 0.2, 0.6)

    def delta_psi(self, t):
        return np.interp(t, self.corners, (0.0, 0.3, 0.0))


class Remembering(Triangle):
    """The same with a memory that does nothing, and does not say what a mirror makes of it."""

    rest = np.zeros(1)

    def respond(self, t, commands, state):
        return np.multiply.outer(self.delta_psi(t), commands), state

    def observe(self, state):
        return state
