from . import (
    accuracy as accuracy,
)
from . import (
    adapters as adapters,
)
from . import (
    cli as cli,
)
from . import (
    controllers as controllers,
)
from . import (
    envs as envs,
)
from . import (
    evaluation as evaluation,
)
from . import (
    files as files,
)
from . import (
    gaits as gaits,
)
from . import (
    gradients as gradients,
)
from . import (
    identify as identify,
)
from . import (
    lanes as lanes,
)
from . import (
    model as model,
)
from . import (
    plant as plant,
)
from . import (
    rods as rods,
)
from . import (
    scene as scene,
)
from . import (
    simulator as simulator,
)
from . import (
    sweep as sweep,
)
from .accuracy.certificate import Certificate as Certificate
from .accuracy.chapters import scene_for as scene_for
from .accuracy.measure import certify as certify
from .envs import IDS as IDS
from .envs import TASKS as TASKS
from .envs.headings import HeadingTargets as HeadingTargets
from .envs.randomization import DomainRandomization as DomainRandomization
from .envs.randomization import LogUniform as LogUniform
from .envs.randomization import Normal as Normal
from .envs.randomization import Uniform as Uniform
from .envs.rewards import RewardWeights as RewardWeights
from .envs.sight import Sight as Sight
from .envs.symmetry import SymmetryReduction as SymmetryReduction
from .envs.symmetry import VectorSymmetryReduction as VectorSymmetryReduction
from .envs.tasks.hidden import FailBlind as FailBlind
from .envs.tasks.hidden import Miswired as Miswired
from .envs.tasks.hidden import SimToReal as SimToReal
from .envs.tasks.obst_trap import ObstTrap as ObstTrap
from .envs.tasks.prey import Prey as Prey
from .envs.tasks.prizes import Prizes as Prizes
from .envs.tasks.station import Station as Station
from .model import register_scheme as register_scheme
from .scene import AlongLimb as AlongLimb
from .scene import Attachment as Attachment
from .scene import Body as Body
from .scene import Contact as Contact
from .scene import Disc as Disc
from .scene import GridCurrent as GridCurrent
from .scene import Limb as Limb
from .scene import Limited as Limited
from .scene import MeasuredCurve as MeasuredCurve
from .scene import Numerics as Numerics
from .scene import Scene as Scene
from .scene import Seastar as Seastar
from .scene import Section as Section
from .scene import ShearCurrent as ShearCurrent
from .scene import SmaLimb as SmaLimb
from .scene import SmaPulse as SmaPulse
from .scene import SmaWires as SmaWires
from .scene import Stiffening as Stiffening
from .scene import Strip as Strip
from .scene import ThermalSma as ThermalSma
from .scene import Tube as Tube
from .scene import UniformCurrent as UniformCurrent
from .scene import Vortex as Vortex
from .scene import Water as Water
from .scene import relaxation_time as relaxation_time
from .scene.serial import register_part as register_part
from .scene.serial import register_term as register_term
from .simulator import Simulator as Simulator
from .simulator import SolverStatus as SolverStatus
from .simulator import State as State
from .simulator import StrokeReport as StrokeReport
from .version import __version__ as __version__
