"""Every actuator, and every part that a scene may have, for tests that have to hold for all of them."""

import math
from dataclasses import replace

import numpy as np

from own_terms import Trap
from seastar_gym import (
    AlongLimb,
    Attachment,
    Body,
    Contact,
    Disc,
    GridCurrent,
    Limb,
    Limited,
    MeasuredCurve,
    Numerics,
    Seastar,
    Section,
    ShearCurrent,
    SmaLimb,
    SmaPulse,
    SmaWires,
    Stiffening,
    Strip,
    ThermalSma,
    Tube,
    UniformCurrent,
    Vortex,
    Water,
)

EACH = np.array([1.0, 0.1 + 0.2, math.nextafter(1.0, 2.0)])
"""Numbers of three robots, none of which survives rounding."""
CURVE = MeasuredCurve((0.0, 0.1, 1 / 3, 1.0), (0.0, math.pi / 5, 0.2, 0.0))
WAVES = GridCurrent.from_function(lambda x, y: (1e-3 * np.sin(7 * x), 1e-3 * np.cos(3 * y)), (-0.3, 0.3), (0, 1), 0.1)

ACTUATORS = {
    "pulse": SmaPulse(0.3 + 1e-16, 1 / 7, 6 / 7),
    "pulse of each robot": SmaPulse(0.5 * EACH),
    "curve": CURVE,
    "curve of each robot": replace(CURVE, scale=EACH),
    "limited pulse": Limited(SmaPulse(), 0.5, 2.0),
    "limited curve": Limited(CURVE, None, 3.0),
    "limits of each robot": Limited(SmaPulse(0.4), 0.3 * EACH, None),
    "thermal": ThermalSma(austenite_finish=70.1),
    "thermal with a limit": ThermalSma(largest_temperature=60.0 + 1 / 3, heating_power=1 / 3),
    "wires": SmaWires(0.3 + 1e-16, 1 / 7, 6 / 7, period=1 / 3),
    "refractory wires of each robot": SmaWires(0.5 * EACH, refractory=True),
    "measured limb": SmaLimb.preset(20, period=1 / 3),
    "measured limbs of each robot": SmaLimb(0.5 * EACH, rise=9.0 * EACH, time_constant=0.7 * EACH),
    "thermal of each robot": ThermalSma(water_temperature=20.0 + EACH),
    "limits of thermal of each robot": ThermalSma(steady_rise=220.0 * EACH, largest_temperature=30.0 + 20.0 * EACH),
}
PARTS = {
    "nothing": {},
    "vacuum": {"fluid": None},
    "currents": {"fluid": Water(current=UniformCurrent(1e-3, -1 / 3e3))},
    "currents of each robot": {"fluid": Water(current=UniformCurrent(1e-3 * EACH, 0.0))},
    "shear": {"fluid": Water(1000.0, 1.1, 0.1, ShearCurrent(0.01, 1 / 3), 1.0)},
    "vortex": {"fluid": Water(current=Vortex(1e-3, 0.1, -0.2, 0.07))},
    "grid": {"fluid": Water(current=WAVES)},
    "contact": {"contact": Contact(1e5 / 3, 0.2)},
    "contact of each robot": {"contact": Contact(1e5 * EACH)},
    "layers of each robot": {"contact": Contact(layer=5e-3 * EACH)},
    "loads": {"loads": ((9, 0.0, 1e-3 / 3), (18, -1e-4, 0.0))},
    "held nodes": {"held_nodes": (3, 0)},
    "hub hinges": {"robot": Seastar(nodes_per_limb=8, discretisation="chapter")},
    "gravity": {"gravity": (1 / 3, -9.81)},
    "own terms": {"terms": (Trap(1 / 3, 0.1 * EACH), Trap(x=0.1))},
    "strengths": {"limb_strengths": (1.0, 0.0, 1 / 3, 1.0, 0.5)},
    "limbs": {"robot": Seastar(limbs=(Limb(radius=(2e-3, 1e-3 / 3)), *(Limb(length=0.1 / 3),) * 4))},
    "discs": {"robot": Seastar(limbs=(Limb(section=Disc((2e-3, 1e-3 / 3))),) * 5)},
    "strips": {"robot": Seastar(limbs=(Limb(section=Strip((2e-3, 1e-3 / 3), 8e-3 * EACH)),) * 5)},
    "tubes": {"robot": Seastar(limbs=(Limb(section=Tube(2e-3 * EACH, 1e-3 / 3)),) * 5)},
    "sections": {"robot": Seastar(limbs=(Limb(section=Section(1e-5, None, 4e-3, bending_stiffness=1e-5 / 3)),) * 5)},
    "limbs of each robot": {"robot": Seastar(limbs=(Limb(radius=1e-3 * EACH, natural_curvature=EACH),) * 5)},
    "directions": {"robot": Seastar(limbs=tuple(Limb(1.25 * k, youngs_modulus=(1e6, 2e6)) for k in range(5)))},
    "bent along": {"robot": Seastar(along=AlongLimb(1 / 3, (1.0, 0.1 + 0.2)), stiffening=Stiffening(2.68, 1 / 3))},
    "bent along, each": {"robot": Seastar(along=AlongLimb(0.1 * EACH), stiffening=Stiffening(1.5 * EACH))},
    "robots": {"robot": Seastar(n_limbs=4, nodes_per_limb=6, density=1000.0 * EACH, relaxation_time=1e-3)},
    "body": {"robot": Seastar(body=Body(radius=0.02, mass=0.01 * EACH, centre_of_mass=(1e-3, 1 / 3e3)))},
    "attachments": {"robot": Seastar(2, body=Body.rectangle(0.06, 0.02, attachments=(Attachment(0, 0.01, 0.3),) * 2))},
    "joints": {"robot": Seastar(limbs=(Limb(joint_stiffness=1e-4 * EACH),) * 5)},
    "numerics": {"numerics": Numerics("implicit-midpoint", 5e-3 / 3, 1e-7 / 3, 30, 0.015)},
}  # fmt: skip
