"""Fits numbers of a scene to measured trajectories: `seastar identify --help`.

In come a scene, commands with times, and tracks of cameras (tracks/); out go the numbers that fit best with their
intervals, or what is wrong with them. Fits begin with the first strokes, because a limb that rings a cycle too fast
fits all of them nearly as well.
"""

from seastar_gym.identify.fit import Estimate, identify
from seastar_gym.identify.measurement import Measurement, get_parameter, with_parameters
from seastar_gym.identify.trajectories import synthetic, trajectory

__all__ = [
    "Estimate",
    "Measurement",
    "get_parameter",
    "identify",
    "synthetic",
    "trajectory",
    "with_parameters",
]
