from . import (
    symmetry as symmetry,
)
from . import (
    wrappers as wrappers,
)
from .symmetry import FrameStack as FrameStack
from .symmetry import Symmetry as Symmetry
from .symmetry import action_table as action_table
from .symmetry import compose as compose
from .symmetry import inverse as inverse
from .symmetry import limb_order as limb_order
from .symmetry import memory_mirror as memory_mirror
from .symmetry import symmetry_of as symmetry_of
from .symmetry import transform_commands as transform_commands
from .symmetry import turns as turns
from .wrappers import SymmetryReduction as SymmetryReduction
from .wrappers import VectorFrameStack as VectorFrameStack
from .wrappers import VectorSymmetryReduction as VectorSymmetryReduction
from .wrappers import observed_mirror as observed_mirror
from .wrappers import require_symmetry as require_symmetry
from .wrappers import symmetry_in as symmetry_in
