"""A five-limb soft robot that learns to swim: planar discrete elastic rods behind a Gymnasium environment.

Importing this package registers `SeastarSwim-v0`, the same with continuous commands, the timed environments that decide
several times a second, and the tasks of `seastar_gym.envs.tasks`. Its names are imported when somebody asks for them.
"""

from typing import TYPE_CHECKING

from seastar_gym.envs import IDS as IDS
from seastar_gym.envs import TASKS as TASKS
from seastar_gym.lazy import lazily

if TYPE_CHECKING:
    from seastar_gym.accuracy.certificate import Certificate as Certificate
    from seastar_gym.accuracy.chapters import scene_for as scene_for
    from seastar_gym.accuracy.measure import certify as certify
    from seastar_gym.envs.options import HeadingTargets as HeadingTargets
    from seastar_gym.envs.options import RewardWeights as RewardWeights
    from seastar_gym.envs.randomization import DomainRandomization as DomainRandomization
    from seastar_gym.envs.randomization import LogUniform as LogUniform
    from seastar_gym.envs.randomization import Normal as Normal
    from seastar_gym.envs.randomization import Uniform as Uniform
    from seastar_gym.envs.sight import Sight as Sight
    from seastar_gym.envs.symmetry import SymmetryReduction as SymmetryReduction
    from seastar_gym.envs.symmetry import VectorSymmetryReduction as VectorSymmetryReduction
    from seastar_gym.envs.tasks.fail_blind import FailBlind as FailBlind
    from seastar_gym.envs.tasks.miswired import Miswired as Miswired
    from seastar_gym.envs.tasks.obst_trap import ObstTrap as ObstTrap
    from seastar_gym.envs.tasks.prey import Prey as Prey
    from seastar_gym.envs.tasks.prizes import Prizes as Prizes
    from seastar_gym.envs.tasks.sim_to_real import SimToReal as SimToReal
    from seastar_gym.envs.tasks.station import Station as Station
    from seastar_gym.scene import AlongLimb as AlongLimb
    from seastar_gym.scene import Attachment as Attachment
    from seastar_gym.scene import Body as Body
    from seastar_gym.scene import Contact as Contact
    from seastar_gym.scene import Disc as Disc
    from seastar_gym.scene import GridCurrent as GridCurrent
    from seastar_gym.scene import Limb as Limb
    from seastar_gym.scene import Limited as Limited
    from seastar_gym.scene import MeasuredCurve as MeasuredCurve
    from seastar_gym.scene import Numerics as Numerics
    from seastar_gym.scene import Scene as Scene
    from seastar_gym.scene import Seastar as Seastar
    from seastar_gym.scene import Section as Section
    from seastar_gym.scene import ShearCurrent as ShearCurrent
    from seastar_gym.scene import SmaLimb as SmaLimb
    from seastar_gym.scene import SmaPulse as SmaPulse
    from seastar_gym.scene import SmaWires as SmaWires
    from seastar_gym.scene import Stiffening as Stiffening
    from seastar_gym.scene import Strip as Strip
    from seastar_gym.scene import ThermalSma as ThermalSma
    from seastar_gym.scene import Tube as Tube
    from seastar_gym.scene import UniformCurrent as UniformCurrent
    from seastar_gym.scene import Vortex as Vortex
    from seastar_gym.scene import Water as Water
    from seastar_gym.scene import relaxation_time as relaxation_time
    from seastar_gym.scene.serial import register_part as register_part
    from seastar_gym.scene.terms import register_term as register_term
    from seastar_gym.schemes import register_scheme as register_scheme
    from seastar_gym.simulator import Simulator as Simulator
    from seastar_gym.simulator import SolverStatus as SolverStatus
    from seastar_gym.simulator import State as State
    from seastar_gym.simulator import StrokeReport as StrokeReport
    from seastar_gym.version import __version__ as __version__
else:
    __all__, __getattr__, __dir__ = lazily(__name__)
