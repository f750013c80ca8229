"""All that a user can say: robot, fluid, actuator, contact, numerics, and the scene that joins them."""

from seastar_gym.scene.actuators.limited import Limited
from seastar_gym.scene.actuators.measured import MeasuredCurve
from seastar_gym.scene.actuators.pulse import SmaPulse
from seastar_gym.scene.actuators.thermal import ThermalSma
from seastar_gym.scene.contact import Contact
from seastar_gym.scene.currents import GridCurrent, ShearCurrent, UniformCurrent, Vortex
from seastar_gym.scene.fluid import Water
from seastar_gym.scene.limb import Limb
from seastar_gym.scene.numerics import Numerics
from seastar_gym.scene.robot import Seastar, relaxation_time
from seastar_gym.scene.scene import Scene

__all__ = [
    "Contact",
    "GridCurrent",
    "Limb",
    "Limited",
    "MeasuredCurve",
    "Numerics",
    "Scene",
    "Seastar",
    "ShearCurrent",
    "SmaPulse",
    "ThermalSma",
    "UniformCurrent",
    "Vortex",
    "Water",
    "relaxation_time",
]
