"""A batch of robots of one scene, advanced stroke by stroke."""

from seastar_gym.simulator.report import SolverStatus, StrokeReport
from seastar_gym.simulator.simulator import Simulator, State

__all__ = ["Simulator", "SolverStatus", "State", "StrokeReport"]
