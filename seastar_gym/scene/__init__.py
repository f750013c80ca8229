"""Description of what is simulated: robot, water, actuator, contact and numerics, joined in a `Scene`.

In come a user's numbers in SI units; out go frozen dataclasses that have been checked together, or one sentence that
says what cannot be. Annotations declare units and bounds of numbers, and which may differ from robot to robot
(`number.py`, `checks.py`); `serial.py` writes scenes to plain data. A scene is numbers and words, without compiled
code, so that it can be read, compared and kept where nothing is simulated.
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
