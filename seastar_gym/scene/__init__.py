"""Description of what is simulated: robot, fluid, actuator, contact and numerics, joined in a `Scene`.

All parts are frozen dataclasses in SI units. Their annotations declare units and bounds of numbers (`number.py`),
`checks.py` refuses bad values, `per_robot.py` allows numbers that differ from robot to robot, and `serial.py` writes
scenes to plain data.
"""

from seastar_gym.scene.actuators.curves import Limited, MeasuredCurve, SmaPulse
from seastar_gym.scene.actuators.sma_limb import SmaLimb
from seastar_gym.scene.actuators.wires import SmaWires, ThermalSma
from seastar_gym.scene.body import Attachment, Body
from seastar_gym.scene.limb import AlongLimb, Limb, Stiffening
from seastar_gym.scene.numerics import Numerics
from seastar_gym.scene.robot import Seastar, relaxation_time
from seastar_gym.scene.scene import Contact, Scene
from seastar_gym.scene.section import Disc, Section, Strip, Tube
from seastar_gym.scene.water import GridCurrent, ShearCurrent, UniformCurrent, Vortex, Water

__all__ = [
    "AlongLimb",
    "Attachment",
    "Body",
    "Contact",
    "Disc",
    "GridCurrent",
    "Limb",
    "Limited",
    "MeasuredCurve",
    "Numerics",
    "Scene",
    "Seastar",
    "Section",
    "ShearCurrent",
    "SmaLimb",
    "SmaPulse",
    "SmaWires",
    "Stiffening",
    "Strip",
    "ThermalSma",
    "Tube",
    "UniformCurrent",
    "Vortex",
    "Water",
    "relaxation_time",
]
