"""Decisions: how often commands are given, and which actuators can take them so often."""

import numpy as np

from seastar_gym.scene import Scene
from seastar_gym.scene.actuators.actuator import ActuatorBase, complete
from seastar_gym.scene.checks import require_number
from seastar_gym.scene.numerics import MAX_STEPS
from seastar_gym.scene.per_robot import batch_size
from seastar_gym.simulator.drive import JUMP
from seastar_gym.simulator.schedule import SHORTEST


def checked_decision_period(seconds: float | None, scene: Scene) -> float:
    """Time between decisions [s], a stroke if None; ValueError if the scene's actuator cannot be commanded so often."""
    actuator, step = scene.actuator, scene.numerics.step
    if seconds is None:
        return float(actuator.period)
    require_number("decision_period", seconds, "s")
    if not SHORTEST * step <= seconds <= MAX_STEPS * step:
        raise ValueError(
            f"decision_period must be from {SHORTEST * step:.4g} to {MAX_STEPS * step:.4g} s, with steps of "
            f"{step:.4g} s, not {seconds:.4g} s."
        )
    if not _can_begin_anew(complete(actuator), float(seconds)):
        raise ValueError(
            f"decision_period must be at least {actuator.period:.4g} s, the period of this {type(actuator).__name__}: "
            f"limbs would jump at a new command after {seconds:.4g} s. Use an actuator with memory, such as SmaWires."
        )
    return float(seconds)


def unless_strokes(seconds: float | None, scene: Scene) -> float | None:
    """Time between decisions [s], None where they are strokes of the scene's actuator."""
    return None if seconds == scene.actuator.period else seconds


def _can_begin_anew(actuator: ActuatorBase, seconds: float) -> bool:
    """Whether new commands that come after a time [s] find limbs at rest, or turn them on from where they are."""
    if not actuator.has_memory:
        return seconds >= actuator.period * (1.0 - JUMP)
    n_robots = batch_size(actuator)
    shape = (1,) if n_robots is None else (n_robots, 1)
    state = np.broadcast_to(actuator.rest, (*shape, actuator.rest.shape[-1]))
    ends = np.array([0.0, *(corner for corner in actuator.corners if 0.0 < corner < seconds), seconds])
    turned, state = actuator.respond(ends, np.ones(shape), state)
    jump = np.abs(actuator.respond(np.zeros(1), np.ones(shape), state)[0][0] - turned[-1])
    return bool((jump <= JUMP * np.max(actuator.peak_angle)).all())
