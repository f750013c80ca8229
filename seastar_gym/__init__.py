"""A five-limb soft robot that learns to swim: planar discrete elastic rods behind a Gymnasium environment.

Importing this package registers `SeastarSwim-v0`.
"""

from gymnasium.envs.registration import register

from seastar_gym.certify.measure import certify
from seastar_gym.envs.randomization import DomainRandomization, LogUniform, Normal, Uniform
from seastar_gym.envs.reward import RewardWeights
from seastar_gym.envs.symmetry import SymmetryReduction, VectorSymmetryReduction
from seastar_gym.scene import Numerics, Scene, Seastar, SmaPulse, Water, relaxation_time
from seastar_gym.scene.actuators.limited import Limited
from seastar_gym.scene.actuators.measured import MeasuredCurve
from seastar_gym.scene.actuators.sma_limb import SmaLimb
from seastar_gym.scene.actuators.thermal import ThermalSma
from seastar_gym.scene.actuators.wires import SmaWires
from seastar_gym.scene.certificate import Certificate
from seastar_gym.scene.contact import Contact
from seastar_gym.scene.currents import GridCurrent, ShearCurrent, UniformCurrent, Vortex
from seastar_gym.scene.limb import Limb
from seastar_gym.scene.serial import register_part
from seastar_gym.simulator import Simulator, SolverStatus, State, StrokeReport
from seastar_gym.version import __version__

__all__ = [
    "Certificate",
    "Contact",
    "DomainRandomization",
    "GridCurrent",
    "Limb",
    "Limited",
    "LogUniform",
    "MeasuredCurve",
    "Normal",
    "Numerics",
    "RewardWeights",
    "Scene",
    "Seastar",
    "ShearCurrent",
    "Simulator",
    "SmaLimb",
    "SmaPulse",
    "SmaWires",
    "SolverStatus",
    "State",
    "StrokeReport",
    "SymmetryReduction",
    "ThermalSma",
    "Uniform",
    "UniformCurrent",
    "VectorSymmetryReduction",
    "Vortex",
    "Water",
    "__version__",
    "certify",
    "register_part",
    "relaxation_time",
]

register(
    id="SeastarSwim-v0",
    entry_point="seastar_gym.envs.seastar_swim:SeastarSwimEnv",
    vector_entry_point="seastar_gym.envs.vector:SeastarSwimVectorEnv",
    max_episode_steps=400,
)
