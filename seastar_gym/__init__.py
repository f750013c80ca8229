"""A five-limb soft robot that learns to swim: planar discrete elastic rods behind a Gymnasium environment.

Importing this package registers `SeastarSwim-v0`, the same with continuous commands, the timed environments that decide
several times a second, and the tasks of `seastar_gym.envs.tasks`.
"""

from typing import Any

from gymnasium.envs.registration import register

from seastar_gym.accuracy.certificate import Certificate
from seastar_gym.accuracy.measure import certify
from seastar_gym.envs.commands import Actions
from seastar_gym.envs.headings import Headings
from seastar_gym.envs.randomization import DomainRandomization, LogUniform, Normal, Uniform
from seastar_gym.envs.reward import RewardWeights
from seastar_gym.envs.symmetry import SymmetryReduction, VectorSymmetryReduction
from seastar_gym.envs.tasks.fail_blind import FailBlind
from seastar_gym.envs.tasks.miswired import Miswired
from seastar_gym.envs.tasks.obst_trap import ObstTrap
from seastar_gym.envs.tasks.prey import Prey
from seastar_gym.envs.tasks.prizes import Prizes
from seastar_gym.envs.tasks.station import Station
from seastar_gym.scene import Numerics, Scene, Seastar, SmaPulse, Water, relaxation_time
from seastar_gym.scene.actuators.limited import Limited
from seastar_gym.scene.actuators.measured import MeasuredCurve
from seastar_gym.scene.actuators.sma_limb import SmaLimb
from seastar_gym.scene.actuators.thermal import ThermalSma
from seastar_gym.scene.actuators.wires import SmaWires
from seastar_gym.scene.along import AlongLimb, Stiffening
from seastar_gym.scene.body import Attachment, Body
from seastar_gym.scene.contact import Contact
from seastar_gym.scene.currents import GridCurrent, ShearCurrent, UniformCurrent, Vortex
from seastar_gym.scene.limb import Limb
from seastar_gym.scene.serial import register_part, to_dict
from seastar_gym.simulator import Simulator, SolverStatus, State, StrokeReport
from seastar_gym.version import __version__

__all__ = [
    "AlongLimb",
    "Attachment",
    "Body",
    "Certificate",
    "Contact",
    "DomainRandomization",
    "FailBlind",
    "GridCurrent",
    "Headings",
    "Limb",
    "Limited",
    "LogUniform",
    "MeasuredCurve",
    "Miswired",
    "Normal",
    "Numerics",
    "ObstTrap",
    "Prey",
    "Prizes",
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
    "Station",
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
register(
    id="SeastarSwimContinuous-v0", max_episode_steps=400, kwargs={"actions": "continuous"}, **_ENTRY_POINTS
)

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

register(
    id="SeastarSwimHeading-v0",
    max_episode_steps=600,
    kwargs={"decision_period": 0.5, "actions": "pairs", "headings": to_dict(Headings())},
    **_ENTRY_POINTS,
)

TASKS: dict[str, tuple[str, Actions, float, float, float]] = {
    "SeastarMiswired-v0": ("miswired", "joint", 1.0, 400.0, 150.0),
    "SeastarMiswiredTimed-v0": ("miswired", "joint", 0.5, 400.0, 145.0),
    "SeastarPrey-v0": ("prey", "pairs", 1.0, 200.0, 80.0),
    "SeastarPreyTimed-v0": ("fast-prey", "pairs", 0.5, 200.0, 130.0),
    "SeastarStation-v0": ("station", "joint", 1.0, 120.0, -20.0),
    "SeastarFailBlind-v0": ("fail-blind", "joint", 1.0, 500.0, 150.0),
    "SeastarObstTrap-v0": ("obst-trap", "pairs", 1.0, 300.0, 95.0),
    "SeastarObstTrapTimed-v0": ("obst-trap", "pairs", 0.5, 200.0, 94.0),
    "SeastarPrizes-v0": ("prizes", "pairs", 1.0, 201.0, 80.0),
    "SeastarPrizesTimed-v0": ("fast-prizes", "pairs", 0.5, 115.5, 76.0),
}
"""Name of the challenge, actions, time between decisions [s], time limit [s] and reward threshold of tasks, by id."""

for _id, (_task, _actions, _decision_period, _limit, _threshold) in TASKS.items():
    register(
        id=_id,
        entry_point="seastar_gym.envs.tasks.envs:SeastarTaskEnv",
        vector_entry_point="seastar_gym.envs.tasks.envs:SeastarTaskVectorEnv",
        max_episode_steps=round(_limit / _decision_period),
        reward_threshold=_threshold,
        kwargs={"task": _task, "actions": _actions, "decision_period": _decision_period},
    )
