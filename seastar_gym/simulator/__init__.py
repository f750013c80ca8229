"""A batch of robots of one scene, advanced by intervals of time. A stroke is the interval of one actuation period.

In come commands in [-1, 1] for every limb; out go states and a report of every interval. `simulator.py` offers what
users call, `drive.py` turns commands into rotations of limbs, for `SmaWires` by the kernel of `wires.py`, `batch.py`
holds the robots' numbers and calls the kernels of `rods`, `state.py` and `lock.py` keep intervals whole, and
`watches.py` tells errors and energies that grow.
A batch is the rule and one robot its smallest case, since eight cost as much as one.
"""

from seastar_gym.simulator.report import SolverStatus, StrokeReport
from seastar_gym.simulator.simulator import Simulator
from seastar_gym.simulator.state import State

__all__ = ["Simulator", "SolverStatus", "State", "StrokeReport"]
