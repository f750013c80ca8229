"""A five-limb soft robot that learns to swim: planar discrete elastic rods behind a Gymnasium environment.

Importing this package registers `SeastarSwim-v0`, the same with continuous commands, the timed environments that decide
several times a second, and the tasks of `seastar_gym.envs.tasks`. Its names are imported when somebody asks for them.
"""

from typing import TYPE_CHECKING

from seastar_gym.envs import TASKS as TASKS
from seastar_gym.envs import TIME_LIMIT as TIME_LIMIT
from seastar_gym.envs import TIMED as TIMED
from seastar_gym.lazy import lazily
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

if TYPE_CHECKING:
    from seastar_gym.accuracy.certificate import Certificate
    from seastar_gym.accuracy.measure import certify
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
    from seastar_gym.scene import (
        AlongLimb,
        Attachment,
        Body,
        Contact,
        GridCurrent,
        Limb,
        Limited,
        MeasuredCurve,
        Numerics,
        Scene,
        Seastar,
        ShearCurrent,
        SmaLimb,
        SmaPulse,
        SmaWires,
        Stiffening,
        ThermalSma,
        UniformCurrent,
        Vortex,
        Water,
        relaxation_time,
    )
    from seastar_gym.scene.serial import register_part
    from seastar_gym.simulator import Simulator, SolverStatus, State, StrokeReport
else:
    __getattr__, __dir__ = lazily(
        __name__,
        {
            **dict.fromkeys(__all__, "scene"),  # but for these
            "Certificate": "accuracy.certificate",
            "DomainRandomization": "envs.randomization",
            "FailBlind": "envs.tasks.fail_blind",
            "Headings": "envs.headings",
            "LogUniform": "envs.randomization",
            "Miswired": "envs.tasks.miswired",
            "Normal": "envs.randomization",
            "ObstTrap": "envs.tasks.obst_trap",
            "Prey": "envs.tasks.prey",
            "Prizes": "envs.tasks.prizes",
            "RewardWeights": "envs.reward",
            "Simulator": "simulator",
            "SolverStatus": "simulator",
            "State": "simulator",
            "Station": "envs.tasks.station",
            "StrokeReport": "simulator",
            "SymmetryReduction": "envs.symmetry",
            "Uniform": "envs.randomization",
            "VectorSymmetryReduction": "envs.symmetry",
            "certify": "accuracy.measure",
            "register_part": "scene.serial",
        },
    )
