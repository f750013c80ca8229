"""A five-limb soft robot that learns to swim: planar discrete elastic rods behind a Gymnasium environment.

Importing this package registers `SeastarSwim-v0`, and the timed environments that decide several times a second.
"""

from typing import Any

from gymnasium.envs.registration import register

from seastar_gym.certification.measure import certify
from seastar_gym.envs.randomization import DomainRandomization, LogUniform, Normal, Uniform
from seastar_gym.envs.reward import RewardWeights
from seastar_gym.envs.symmetry import SymmetryReduction, VectorSymmetryReduction
from seastar_gym.scene import Numerics, Scene, Seastar, SmaPulse, Water, relaxation_time
from seastar_gym.scene.actuators.limited import Limited
from seastar_gym.scene.actuators.measured import MeasuredCurve
from seastar_gym.scene.actuators.sma_limb import SmaLimb
from seastar_gym.scene.actuators.thermal import ThermalSma
from seastar_gym.scene.actuators.wires import SmaWires
from seastar_gym.scene.along import AlongLimb, Stiffening
from seastar_gym.scene.body import Attachment, Body
from seastar_gym.scene.certificate import Certificate
from seastar_gym.scene.contact import Contact
from seastar_gym.scene.currents import GridCurrent, ShearCurrent, UniformCurrent, Vortex
from seastar_gym.scene.limb import Limb
from seastar_gym.scene.serial import register_part
from seastar_gym.simulator import Simulator, SolverStatus, State, StrokeReport
from seastar_gym.version import __version__

__all__ = [
    "AlongLimb",
    "Attachment",
    "Body",
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
    "Stiffening",
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

_ENTRY_POINTS: dict[str, Any] = {
    "entry_point": "seastar_gym.envs.seastar_swim:SeastarSwimEnv",
    "vector_entry_point": "seastar_gym.envs.vector:SeastarSwimVectorEnv",
}
register(id="SeastarSwim-v0", max_episode_steps=400, **_ENTRY_POINTS)

TIMED = {"SeastarSwimTimed-v0": 0.5, "SeastarSwimTimedModerate-v0": 0.2, "SeastarSwimTimedHard-v0": 0.1}
"""Times between decisions [s] of the timed environments, easy, moderate and hard, by id."""
TIME_LIMIT = 200.0
"""Time limit of the timed environments [s]."""

for _id, _decision_period in TIMED.items():
    register(
        id=_id,
        max_episode_steps=round(TIME_LIMIT / _decision_period),
        kwargs={"decision_period": _decision_period, "actions": "pairs"},
        **_ENTRY_POINTS,
    )
