"""Tolerances and limits of a robot's solver, for the kernels in der/stepping/."""

import math

import numpy as np

from seastar_gym.der.stepping.scales import Limits
from seastar_gym.scene.numerics import ADAPTATION, MOST_ITERATIONS, MOST_ITERATIONS_PER_STEP
from seastar_gym.scene.per_robot import of_robot
from seastar_gym.scene.scene import Scene


def make_limits(scene: Scene, index: int = 0) -> Limits:
    """Tolerances and limits of the solver for robot `index` of a scene.

    The largest error of a step per second follows from the tolerance of the path, as was measured, see ADAPTATION.
    """
    numerics, length = scene.numerics, of_robot(scene.robot.limb_length, index)
    speed, tolerance = length / scene.actuator.period, numerics.path_tolerance
    error_rate = 0.0 if tolerance is None else speed * (tolerance / ADAPTATION[0]) ** ADAPTATION[1]
    n_steps = math.ceil(scene.actuator.period / numerics.step)
    return Limits(
        tolerance=np.array([numerics.newton_tolerance * length]),
        max_iterations=numerics.max_iterations,
        most_iterations=MOST_ITERATIONS + MOST_ITERATIONS_PER_STEP * n_steps,
        adaptive=tolerance is not None,
        error_rate=np.array([error_rate]),
    )
