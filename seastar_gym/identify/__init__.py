"""Fits numbers of a scene to measured trajectories: `python -m seastar_gym.identify --help`."""

from seastar_gym.identify.identify import (
    Estimate,
    Measurement,
    get_parameter,
    identify,
    synthetic,
    trajectory,
    with_parameters,
)

__all__ = [
    "Estimate",
    "Measurement",
    "get_parameter",
    "identify",
    "synthetic",
    "trajectory",
    "with_parameters",
]
