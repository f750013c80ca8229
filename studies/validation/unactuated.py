"""Setup of robots that are not actuated: pauses, and a clamped limb."""

import numpy as np

from seastar_gym.scene import Seastar, SmaPulse
from seastar_gym.simulator import Simulator, SolverStatus

MM = 1e3
"""Millimetres per metre."""


def pause(duration: float) -> SmaPulse:
    """Actuator that stays at rest, so that a stroke simulates a duration [s] without actuation."""
    return SmaPulse(0.0, heating_time=0.5 * duration, cooling_time=0.5 * duration)


def let_pass(simulator: Simulator) -> None:
    """Simulate one stroke without commands; RuntimeError if a robot fails."""
    report = simulator.stroke(np.zeros((simulator.n_robots, simulator.scene.robot.n_limbs)))
    if report.status.any():
        raise RuntimeError(SolverStatus.NOT_CONVERGED.sentence)


CLAMP = (0, 1)
"""Held nodes that clamp limb 1: the hub and its root node. The root hinge measures the angle between the held edge and
the next one and bends from the middle of the one to the middle of the other, so the limb is clamped at l/2."""


def free_length(robot: Seastar) -> float:
    """Free length L - l/2 [m] of a limb that is clamped by CLAMP."""
    return robot.limb_length - 0.5 * robot.edge_length
