"""A five-limb soft robot that learns to swim: planar discrete elastic rods behind a Gymnasium environment."""

from seastar_gym.scene import Numerics, Scene, Seastar, SmaPulse, Water
from seastar_gym.simulator import Simulator, SolverStatus, State, StrokeReport

__version__ = "0.1.0"

__all__ = [
    "Numerics",
    "Scene",
    "Seastar",
    "Simulator",
    "SmaPulse",
    "SolverStatus",
    "State",
    "StrokeReport",
    "Water",
    "__version__",
]
