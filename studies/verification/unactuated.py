"""Setup of robots that are not actuated: pauses, and clamped limbs."""

import numpy as np

from seastar_gym.scene import Seastar, SmaPulse
from seastar_gym.simulator import Simulator, SolverStatus


def pause(duration: float) -> SmaPulse:
    """Actuator that stays at rest, so that a stroke simulates a duration [s] without actuation."""
    return SmaPulse(0.0, heating_time=0.5 * duration, cooling_time=0.5 * duration)


def let_pass(simulator: Simulator) -> None:
    """Simulate one stroke without commands; RuntimeError if a robot fails."""
    report = simulator.stroke(np.zeros((simulator.n_robots, simulator.scene.robot.n_limbs)))
    if report.status.any():
        raise RuntimeError(SolverStatus.NOT_CONVERGED.sentence)


HUB = (0,)
"""Held nodes that clamp limbs of IN_LINE at the hub."""
IN_LINE = {"continuum": Seastar(2, 10), "chapter": Seastar(2, 10, hub_hinge="turning", discretisation="chapter")}
"""Two limbs in a line, in either discretisation. What mirrors itself in them does not turn them about the hub, so that
each is clamped there."""
