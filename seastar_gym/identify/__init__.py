"""Fits numbers of a scene to measured trajectories: `seastar identify --help`."""

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
