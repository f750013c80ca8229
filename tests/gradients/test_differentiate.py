"""Derivatives of swims: against differences of swims, and against what symmetry and units say exactly."""

from dataclasses import replace

import numba
import numpy as np
import pytest

from refusals import assert_refused
from seastar_gym import (
    AlongLimb,
    Body,
    Contact,
    Numerics,
    Scene,
    Seastar,
    Simulator,
    SmaPulse,
    SmaWires,
    Stiffening,
    ThermalSma,
    Vortex,
    Water,
)
from seastar_gym.gradients import differentiate
from seastar_gym.scene.number import at, with_numbers

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="dual lanes have compiled code alone")

PULSE = SmaPulse(0.6, 0.05, 0.05)
EXACT = Numerics("implicit-midpoint", 5e-3, 1e-12, damping=0.003)
SMALL = Scene(Seastar(nodes_per_limb=5), actuator=PULSE, numerics=EXACT)
COMMANDS = np.random.default_rng(1).uniform(-0.9, 0.9, (3, 5))
SHARES, WEIGHTS = (-2.0, -1.0, 1.0, 2.0), (1.0 / 12.0, -8.0 / 12.0, 8.0 / 12.0, -1.0 / 12.0)
"""Places of differences of fourth order, and their weights."""
QUANTITIES = ("positions", "velocities", "heading", "work")


def swum(scene, commands, velocities=0.0):
    """Quantities of QUANTITIES of a swim."""
    simulator = Simulator(scene, 1, threads=1, effort=True)
    state = simulator.get_state()
    state.velocities[0] += velocities
    simulator.set_state(state)
    found, work = [], []
    for command in [None, *commands]:
        if command is not None:
            work.append(simulator.stroke(command[None]).work[0])
        found.append((simulator.positions[0], simulator.velocities[0], simulator.heading()[0]))
    return *(np.array(each) for each in zip(*found, strict=True)), np.array(work)


def differences(swim, step):
    """Derivative of the quantities of `swim(change)`."""
    beside = [swim(step * share) for share in SHARES]
    return [np.tensordot(WEIGHTS, np.array(each), axes=1) / step for each in zip(*beside, strict=True)]


def assert_same(found, expected, tolerance):
    for name, slope, difference in zip(QUANTITIES, found, expected, strict=True):
        scale = np.abs(difference).max()
        np.testing.assert_allclose(slope, difference, rtol=0.0, atol=tolerance * scale + 1e-13, err_msg=name)


def assert_is_derivative(scene, names, commands=COMMANDS, tolerance=1e-6, share=1e-4):
    """Derivatives in numbers, and in two commands, are differences; and the swim is that of `Simulator`."""
    found = differentiate(scene, commands, [*names, "commands"])
    for name, value, expected in zip(QUANTITIES, found.swim, swum(scene, commands), strict=True):
        np.testing.assert_allclose(value, expected, rtol=1e-14, atol=1e-16 if name == "heading" else 0.0)
    for name in names:
        number = at(scene, name)
        step = share * (abs(number) or 1.0)
        expected = differences(
            lambda change, name=name, number=number: swum(with_numbers(scene, {name: number + change}), commands), step
        )
        assert_same(found.by[name], expected, tolerance)
    for place in ((0, 1), (1, 3)):
        change = np.zeros_like(commands)
        change[place] = 1.0
        expected = differences(lambda size, change=change: swum(scene, commands + size * change), share)
        assert_same([each[..., *place] for each in found.by["commands"]], expected, tolerance)
    return found


# Each of these scenes with other terms is compiled for minutes

TOUCHING = np.array([[0.9, -0.9, 0.0, 0.8, -0.7], [-0.8, 0.9, 0.3, -0.9, 0.5], [0.9, -0.9, 0.7, 0.6, -0.9]])
FAR = SmaPulse(1.2, 0.1, 0.2)
"""Pulses with which limbs touch by the commands TOUCHING."""
FLUID = Water(950.0, 1.3, 0.1, Vortex(0.02, 0.1, -0.05, 0.06), 0.8)
EVERYTHING = Seastar(
    nodes_per_limb=5, density=1100.0, relaxation_time=4e-3, body=Body(radius=0.02), along=AlongLimb(0.7),
    stiffening=Stiffening(ratio=2.0),
)  # fmt: skip
YOUNG, DRAG, PEAK = "robot.youngs_modulus", "fluid.drag_coefficient", "actuator.peak_angle"
TERMS = {
    "vacuum": (replace(SMALL, fluid=None), ["robot.density"], COMMANDS),
    "contact": (replace(SMALL, contact=Contact(), actuator=FAR), [YOUNG, "robot.rod_radius"], TOUCHING),
    "hub hinges": (replace(SMALL, robot=Seastar(nodes_per_limb=5, discretisation="chapter")), [YOUNG], COMMANDS),
    "fluid, damping": (
        replace(SMALL, robot=Seastar(nodes_per_limb=5, relaxation_time=4e-3), fluid=FLUID),
        ["fluid.added_mass_coefficient", "fluid.tangential_drag_coefficient", "fluid.current.x",
         "robot.relaxation_time"], COMMANDS,
    ),
    "held node": (replace(SMALL, held_nodes=(0,)), [YOUNG, DRAG], COMMANDS),
    "along, body, contact, loads, gravity and more": (
        replace(SMALL, robot=EVERYTHING, fluid=FLUID, actuator=SmaPulse(2.9, 0.2, 0.3), contact=Contact(),
                loads=((3, 1e-4, 2e-5),), gravity=(0.3, -1.0)),
        ["robot.density", YOUNG, "fluid.added_mass_coefficient", PEAK],
        TOUCHING,
    ),
}  # fmt: skip
HALVED = Numerics("implicit-euler", 0.05, 1e-12, 3)
WIRES, THERMAL = SmaWires(0.6, 0.05, 0.3, period=0.1), ThermalSma()
AS_IT_IS = "The derivatives are of the swim as it is: no step was halved, no energy cut, and no limb touched."
ANY, BRANCH, TOUCHED = (
    "The derivatives are of",
    "The derivatives are of the branch that was taken",
    "some limbs touched",
)
SWIMS = {
    **{scheme: (replace(SMALL, numerics=Numerics(scheme, 5e-3, 1e-12)), [YOUNG, DRAG, PEAK], COMMANDS, AS_IT_IS)
       for scheme in ("implicit-euler", "sdirk2", "implicit-midpoint")},
    "halved": (replace(SMALL, fluid=Water(), numerics=HALVED), [YOUNG], COMMANDS, BRANCH, 1e-5, 1e-6),
    **{type(each).__name__: (replace(SMALL, actuator=each), [PEAK], 0.5 + 0.3 * COMMANDS, ANY)
       for each in (WIRES, THERMAL)},
    "lengths, which move the start": (SMALL, ["robot.limb_length", "robot.rod_radius"], COMMANDS, ANY),
    **{name: (*each, TOUCHED if each[0].contact else ANY, 1e-6, 1e-5 if each[0].contact else 1e-4)
       for name, each in TERMS.items()},
}  # fmt: skip


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.slow] * (name in TERMS)) for name in SWIMS])
def test_derivatives_are_those_of_differences(name):
    scene, numbers, commands, sentence, *accuracy = SWIMS[name]
    found = assert_is_derivative(scene, numbers, commands, *accuracy)
    assert sentence in found.sentence and (TOUCHED in found.sentence) == (scene.contact is not None)
    assert (found.halvings.sum() > 0) == (name == "halved") or name in TERMS


def test_velocities_at_the_start():
    found = differentiate(SMALL, COMMANDS, ["velocities"])
    blow = np.random.default_rng(0).standard_normal((SMALL.robot.n_nodes, 2))
    expected = differences(lambda size: swum(SMALL, COMMANDS, size * blow), 1e-5)
    assert_same([np.tensordot(each, blow, axes=2) for each in found.by["velocities"]], expected, 1e-6)


def test_symmetries_and_units_are_exact():
    """A robot that is moved swims as far aside: the sum of the derivatives in all positions is the whole robot's. E and
    both densities times one factor are the same robot in other units of mass. Strengths are factors of commands, by
    which alone a robot at rest moves.
    """
    names = [YOUNG, "robot.density", "fluid.density"]
    weak = replace(SMALL, limb_strengths=(1.0, 0.9, 0.8, 0.7, 0.6))
    found, of_weak = (
        differentiate(scene, COMMANDS, by).by
        for scene, by in ((SMALL, ["positions", *names]), (weak, ["limb_strengths.1", "commands"]))
    )
    moved = found["positions"].positions.sum(axis=-2)
    np.testing.assert_allclose(moved, np.broadcast_to(np.eye(2), moved.shape), atol=1e-9)
    np.testing.assert_allclose(found["positions"].heading.sum(axis=-2), 0.0, atol=1e-7)
    each = np.array([at(SMALL, name) * found[name].positions for name in names])
    assert np.abs(each.sum(axis=0)).max() < 1e-9 * np.abs(each).max()
    expected = of_weak["commands"].hub[..., 1] @ (COMMANDS[:, 1] / 0.9)
    np.testing.assert_allclose(of_weak["limb_strengths.1"].hub, expected, atol=1e-9 * np.abs(expected).max())
    at_rest = differentiate(SMALL, np.zeros((2, 5)), ["commands", YOUNG]).by
    assert SMALL.robot.youngs_modulus * np.abs(at_rest[YOUNG].positions).max() < 1e-12
    assert np.isfinite(at_rest["commands"].positions).all() and at_rest["commands"].positions.any()


def test_derivatives_go_on_from_a_state():
    simulator = Simulator(SMALL, 1, threads=1)
    simulator.stroke(COMMANDS[:1])
    whole = differentiate(SMALL, COMMANDS, ["commands"])
    rest = differentiate(SMALL, COMMANDS[1:], ["commands"], simulator.get_state())
    np.testing.assert_array_equal(rest.swim.positions, whole.swim.positions[1:])
    np.testing.assert_allclose(rest.by["commands"].hub, whole.by["commands"].hub[1:, :, 1:], rtol=0.0, atol=1e-12)


# Refusals


@pytest.mark.parametrize(
    ("scene", "by", "words"),
    [
        (SMALL, (), ("by must name one unknown or more, each once",)),
        (SMALL, ("commands", "commands"), ("each once",)),
        (SMALL, ("robot.colour",), ("no number of this scene",)),
        (SMALL, ("numerics.step",), ("no number of this scene",)),
        (SMALL, ("actuator.heating_time",), ("moves the ends of time steps",)),
        (SMALL, ("robot.nodes_per_limb",), ("cannot be changed both ways",)),
        (replace(SMALL, actuator=SmaPulse((0.3, 0.4))), ("commands",), ("scene of one robot",)),
    ],
)
def test_refusals_are_sentences(scene, by, words):
    with assert_refused(*words):
        differentiate(scene, COMMANDS, by)
