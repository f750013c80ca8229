"""A batch of robots of one scene, advanced by intervals of time. A stroke is the interval of one actuation period.

`simulator.py` offers what users call, `batch.py` holds the robots' numbers and calls the kernels, `drive.py` turns
commands into rotations of limbs, `clock.py` counts time, `lock.py` keeps intervals whole, `workers.py` shares a batch
out over threads and `error_bars.py` estimates the hub's error by a twin.
"""

from seastar_gym.simulator.report import SolverStatus, StrokeReport
from seastar_gym.simulator.simulator import Simulator
from seastar_gym.simulator.state import State

__all__ = ["Simulator", "SolverStatus", "State", "StrokeReport"]
