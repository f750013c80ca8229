"""What no scene can have is refused in one sentence: what numbers are to each other, and what is no number."""

import math
from functools import partial

import numpy as np
import pytest

from own_actuators import Triangle
from refusals import assert_refused
from seastar_gym import (
    Attachment,
    Body,
    Contact,
    Disc,
    Limb,
    Limited,
    MeasuredCurve,
    Numerics,
    Scene,
    Seastar,
    Section,
    Simulator,
    SmaLimb,
    SmaPulse,
    SmaWires,
    Strip,
    ThermalSma,
    Tube,
    Water,
)
from seastar_gym.model import make_rods
from unlike import robot_and_star

TRIANGLE = ((0.03, -0.01), (-0.01, 0.02), (-0.02, -0.02))
DISC, STRIP = Body(radius=0.02), Strip(2e-3, 8e-3)
CHAPTERS = partial(Seastar, discretisation="chapter")
PAIR, THREE = np.array([0.1, 0.2]), np.ones(3)


def limbs(*some, n=5, **same):
    """These limbs, and others like each other."""
    return (*some, *(Limb(**same),) * (n - len(some)))


def pointing(*angles):
    return tuple(Limb(direction=angle) for angle in angles)


def at_hub(*directions):
    """Limbs attached at the hub itself, which have to be in order as those without a body."""
    return Seastar(3, 5, body=Body(attachments=tuple(Attachment(0.0, 0.0, angle) for angle in directions)))


def coefficients(**robot):
    """Those of a robot that have to be finite and positive."""
    return make_rods(Scene(Seastar(**robot)))


def wrong(**changes):
    """A scene of an actuator that contradicts itself."""
    return Scene(actuator=type("Wrong", (Triangle,), changes)())


def changed(**parts):
    """A simulator is given a scene of other terms."""
    return Simulator(Scene(), 2).set_scene(Scene(**parts))


BEYOND_FLOATS = (
    Body(radius=1e100), Body(radius=0.02, mass=1e308, centre_of_mass=(10.0, 0.0)), Body.rectangle(1e-3, 1e100),
    Body(radius=0.02, centre_of_mass=(1e154, 1e154)), Body(mass=1e-3, inertia=1e-320),
    Body(attachments=(Attachment(1e200, 0.0, 0.0), Attachment(-1e200, 0.0, math.pi))),
)  # fmt: skip
"""By their size, mass, a side, their centre, inertia and arms."""
BODIES = [
    (lambda: Body(radius=0.01, outline=TRIANGLE), "radius", "outline"),
    (lambda: Body(outline=TRIANGLE[::-1]), "outline", "anti-clockwise"),
    (lambda: Body(outline=tuple((x + 1.0, y) for x, y in TRIANGLE)), "outline", "hub (0, 0)"),
    (lambda: Body(outline=TRIANGLE[:2]), "outline", "points"),
    (lambda: Body(mass=0.1), "inertia"),
    *((lambda body=body: Scene(Seastar(2, 5, body=body)), "inertia", "double precision", "body")
      for body in BEYOND_FLOATS),
    *((lambda angles=angles: at_hub(*angles), "at the hub", "anti-clockwise")
      for angles in ((0.0, -1.0, -3.0), (0.0, 3.0, 1.0), (0.0, 1.0, 1.0))),
    *((lambda body=body: Scene(Seastar(1, 5, body=body)), "One limb") for body in (None, Body())),
    (lambda: CHAPTERS(body=DISC), "chapter", "body"),
    (lambda: CHAPTERS(limbs=limbs(joint_stiffness=1.0)), "chapter", "joint_stiffness"),
    (lambda: Seastar(body=Body(attachments=(Attachment(0.02, 0.0, 0.0),) * 4)), "attachments", "5"),
    (lambda: Seastar(2, body=Body(attachments=(Attachment(0.02, 0.0, 0.0),) * 2), limbs=pointing(0, 1)),
     "Directions", "both"),
]  # fmt: skip
LIMBS = [
    (lambda: Seastar(limbs=[Limb()] * 5), "tuple of Limb"),
    (lambda: Seastar(limbs=limbs(n=4)), "one Limb for each"),
    (lambda: Seastar(limbs=limbs(Limb(direction=0.0))), "Either every limb"),
    (lambda: Seastar(limbs=pointing(0.0, 2.0, 1.0, 3.0, 4.0)), "increase"),
    (lambda: Seastar(limbs=pointing(0.5, 1.0, 2.0, 3.0, 4.0)), "begin at 0"),
    (lambda: Seastar(limbs=limbs(natural_curvature=400.0)), "too much for 12 nodes"),
    (lambda: Seastar(limb_length=np.array([0.1, 9.0]), limbs=limbs(natural_curvature=5.0)), "below pi"),
    (lambda: CHAPTERS(1, hub_hinge="turning"), "One limb"),
    (lambda: Limb(direction=PAIR), "direction", "for all robots"),
    (lambda: Limb(radius=1e-3, section=STRIP), "either a radius or a section"),
    (lambda: Strip(1e-3, (1e-3, 0.0)), "A strip's height must be positive all along it"),
    (lambda: Disc(()), "A disc's radius must be positive all along it"),
    (lambda: Tube(1e-3, 1e-3), "inner radius must be smaller"),
    (lambda: Tube((2e-3, 1e-3), 1.5e-3), "inner radius must be smaller"),
    (lambda: Tube(np.array([2e-3, 1e-3]), np.array([1e-3, 1.5e-3])), "inner radius must be smaller"),
    (lambda: Section(1e-5, None, 1e-3), "either a second_moment"),
    (lambda: Section(1e-5, 1e-11, 1e-3, bending_stiffness=1e-6), "either a second_moment"),
    (lambda: Scene(Seastar(limbs=limbs(section=Strip(1e-200, 1e-200)))), "overflow or vanish"),
    (lambda: Scene(Seastar(5, 7, limbs=limbs(section=Strip(1e150, 1e-3)), body=DISC), contact=Contact()),
     "overflow or vanish"),
    (lambda: Scene(Seastar(12, limbs=tuple(Limb(2.0 * math.pi * j / 12, radius=(1e-3, 1e-90)) for j in range(12)),
                           density=1100.0)),
     "limbs 0.1 m long", "radii of 1e-90 to 0.001 m", "moduli of 1e+06 Pa", "1100 kg/m^3"),
    *((partial(coefficients, **{name: value}), "") for name, value in
      {"rod_radius": 1e-90, "limb_length": 1e300, "youngs_modulus": 1e308, "density": 1e-320}.items()),
    (lambda: Scene(Seastar(youngs_modulus=np.array([1e6, 1e308]))), "overflow"),
]  # fmt: skip
NO_WIRES = (
    {"water_temperature": 22.0}, {"austenite_start": 80.0}, {"martensite_start": 80.0}, {"martensite_finish": 24.0},
    {"austenite_start": 70.5}, {"time_constant": 0.9e-3}, {"largest_temperature": 20.0},
)  # fmt: skip
ACTUATORS = [
    (lambda: MeasuredCurve((0.0, 0.5), (0.0, 0.1, 0.0)), "as many angles"),
    (lambda: MeasuredCurve((0.0,), (0.0,)), "two or more"),
    (lambda: MeasuredCurve((0.1, 0.5, 1.0), (0.0, 0.1, 0.0)), "begin at 0"),
    (lambda: MeasuredCurve((0.0, 0.5, 0.5), (0.0, 0.1, 0.0)), "increase"),
    (lambda: MeasuredCurve((0.0, 0.5, 1.0), (0.1, 0.1, 0.1)), "jump"),
    (lambda: MeasuredCurve((0.0, 0.5, 1.0), (0.0, 0.1, 0.1)), "jump"),
    (lambda: MeasuredCurve((0.0, 0.5, np.nan), (0.0, 0.1, 0.0)), "finite"),
    (lambda: wrong(corners=(0.0, 0.2, 0.5)), "from 0 to its period"),
    (lambda: wrong(corners=(0.0, 0.7, 0.6)), "increasing"),
    (lambda: wrong(peak_angle=0.2), "largest angle"),
    (lambda: wrong(delta_psi=lambda self, t: 0.1 + 0.0 * t), "jump"),
    (lambda: wrong(delta_psi=lambda self, t: 0.1), "per time"),
    (lambda: Limited(Limited(SmaPulse(), largest_rate=0.5)), "without memory"),
    (lambda: Limited(SmaPulse(np.ones(2)), np.ones(3)), "equally many"),
    (lambda: SmaPulse(heating_time=PAIR), "heating_time", "positive"),
    (lambda: SmaWires(period=None, heating_time=1e308, cooling_time=1e308), "period"),
    *((partial(ThermalSma, **change), "") for change in NO_WIRES),
    (lambda: ThermalSma(water_temperature=np.array([20.0, 30.0])), "T_water"),
    (lambda: SmaLimb(heating_time=1e3), "heating_time"),
    (lambda: SmaLimb(time_constant=1e9), "heating_time"),
    (lambda: SmaLimb.preset(15), "0, 10, 20, 30, 40, 50 % of liquid metal"),  # it was not measured
    (lambda: Scene(actuator=SmaPulse(np.array([0.1, 3.2]))), "below pi", "3.2 rad"),
    (lambda: Scene(Seastar(1), actuator=SmaPulse(0.1)), "One limb has no hub hinge"),
    (lambda: Scene(CHAPTERS(2), actuator=SmaPulse(0.0)), "turning"),
    (lambda: Scene(CHAPTERS(2, hub_hinge="turning"), actuator=SmaPulse(1.6)), "above zero"),
    (lambda: Scene(CHAPTERS(hub_hinge="turning"), actuator=SmaPulse(0.64)), "turning", "above zero"),
    (lambda: Scene(CHAPTERS(hub_hinge="turning"), actuator=Limited(SmaPulse(), largest_rate=1.0)), "above zero"),
    (lambda: Scene(robot_and_star("a gap wider than pi")[0], actuator=SmaPulse(0.5)), "so spread"),  # by 4.08 rad
]
SCENES = [
    (lambda: Numerics(newton_tolerance=0.1), "newton_tolerance", "0.01"),
    *((partial(Numerics, scheme, damping=0.002), "damping", "implicit-midpoint", scheme)
      for scheme in ("implicit-euler", "sdirk2")),
    (lambda: Simulator(Scene(numerics=Numerics(step=1e-15))), "step"),
    (lambda: Water(1000.0, np.array([1.0, 0.5]), 0.6), "tangential", "exceed"),
    *((partial(Scene, limb_strengths=strengths), "limb_strengths")
      for strengths in ((1.0,) * 4, (1.0, 1.0, 1.0, 1.0, 1.1), (-0.1, 1.0, 1.0, 1.0, 1.0))),
    *((partial(Scene, **{name: ((node, 1.0, 0.0) if name == "loads" else node,)}), "node", "0 to 55", repr(node))
      for name in ("held_nodes", "loads") for node in (-1, 56, 1.5, "0", True, None)),
    *((partial(Scene, loads=(load,)), "load", "F_x, F_y")
      for load in ((1, 2.0), (1, math.nan, 0.0), (1, 0.0, math.inf), (1, 1.0, 2.0, 3.0))),
    *((partial(Scene, loads=((1, force, 0.0),)), "") for force in ("a", None)),
    (lambda: Scene(Seastar(density=np.ones(2)), Water(density=THREE)), "equally many", "robot.density"),
    *((partial(Simulator(Scene(), 2).set_limb_strengths, shares), "limb_strengths")
      for shares in (np.ones(4), np.full((2, 5), 1.5), np.full(5, np.nan), np.ones((3, 5)))),
    (lambda: Simulator(Scene(Seastar(density=THREE)), 2), "3 robots", "2"),
    (lambda: changed(robot=Seastar(density=THREE)), "3 robots", "2"),
    *((partial(changed, **part), "same terms") for part in (
        {"actuator": SmaPulse(cooling_time=2.0)}, {"robot": Seastar(n_limbs=4)}, {"fluid": None},
        {"fluid": Water(1.0, 1.0, 0.1)})),
    (lambda: Simulator(Scene(Seastar(limbs=limbs(radius=(2e-3, 1e-3)))), 2).set_scene(
        Scene(Seastar(limbs=limbs(radius=(2e-3, 1.5e-3))))), "same terms"),
]  # fmt: skip


def test_what_no_scene_can_have_is_refused(subtests):
    for make, *words in (*BODIES, *LIMBS, *ACTUATORS, *SCENES):
        with subtests.test(words=words), assert_refused(*words):
            make()


LIMITS = [("chapter", n, 0.5 * (math.pi - 2.0 * math.pi / n), f"{n} limbs") for n in range(3, 13)]
LIMITS += [("continuum", n, math.pi, "below pi") for n in range(2, 13)]


@pytest.mark.parametrize("discretisation, n_limbs, limit, words", LIMITS)
def test_peak_angles_that_let_a_hinge_reach_pi_are_refused(discretisation, n_limbs, limit, words):
    """Neighbours turned apart by a peak angle each: 2 pi/n_limbs + 2 peak < pi. A rigid hub has no such hinges."""
    robot = Seastar(n_limbs=n_limbs, discretisation=discretisation)
    for peak in (limit, limit + 1e-9, 10.0):
        with assert_refused(words, f"{limit if discretisation == 'chapter' else peak:.4g}"):
            Scene(robot=robot, actuator=SmaPulse(peak_angle=peak))
    Scene(robot=robot, actuator=SmaPulse(peak_angle=0.999 * limit))
