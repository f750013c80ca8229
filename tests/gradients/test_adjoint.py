"""Gradients of swims: against dual lanes, and against differences of swims."""

import runpy
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numba
import numpy as np
import pytest

import seastar_gym.gradients.adjoint as adjoint
from gradients.test_differentiate import COMMANDS, SMALL, TERMS, differences, swum
from seastar_gym import Numerics, Simulator, SmaWires, ThermalSma, Water
from seastar_gym.gradients import Motion, differentiate, gradient, record
from seastar_gym.gradients.adjoint import QUANTITIES
from seastar_gym.scene.per_robot import at, with_numbers

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="lanes of a tape have compiled code alone")

ALL_KINDS = ["commands", "robot.youngs_modulus", "fluid.drag_coefficient", "actuator.peak_angle", "robot.limb_length"]
OF_START = ["positions", "velocities"]


def slopes_of(swim, seed=0):
    """Random slopes in all quantities of a swim."""
    rng = np.random.default_rng(seed)
    return {name: rng.standard_normal(getattr(swim, name).shape) for name in QUANTITIES}


def number_of(slopes, quantities):
    """The number that has these slopes, or its derivative; quantities: A Motion."""
    return sum(np.tensordot(each, getattr(quantities, name), axes=each.ndim) for name, each in slopes.items())


def assert_is_that_of_dual_lanes(scene, names, commands=COMMANDS, tolerance=1e-10, **start):
    """The gradient of a number of all quantities is that of dual lanes, and the swim is theirs to the bit."""
    expected, recorded = differentiate(scene, commands, names, **start), record(scene, commands, **start)
    for mine, theirs in zip(recorded.swim, expected.swim, strict=True):
        np.testing.assert_array_equal(mine, theirs)
    slopes = slopes_of(recorded.swim)
    for name, found in recorded.gradient(slopes, names).items():
        right = number_of(slopes, expected.by[name])
        sizes = Motion(*map(np.abs, expected.by[name]))  # of the terms, whose sum may be small
        largest = number_of({quantity: np.abs(each) for quantity, each in slopes.items()}, sizes).max()
        share = tolerance if scene.contact is None else 1e-8  # conjugate gradients leave rounding
        np.testing.assert_allclose(found, right, rtol=0.0, atol=share * largest, err_msg=name)
    assert recorded.sentence == expected.sentence
    return recorded


def test_gradient_is_that_of_dual_lanes():
    assert_is_that_of_dual_lanes(SMALL, [*ALL_KINDS, *OF_START])


@pytest.mark.parametrize("scheme", ["implicit-euler", "sdirk2", "sdirk3", "implicit-midpoint"])
def test_every_scheme(scheme):
    assert_is_that_of_dual_lanes(replace(SMALL, numerics=Numerics(scheme, 5e-3, 1e-12)), ALL_KINDS)


@pytest.mark.parametrize(
    "numerics",
    [
        Numerics("implicit-midpoint", 0.02, 1e-12, path_tolerance=0.01),
        Numerics("implicit-euler", 0.05, 1e-12, 3),
        Numerics("implicit-midpoint", 0.05, 1e-12, 3),
    ],
)
def test_halved_steps_are_of_their_branch(numerics):
    recorded = assert_is_that_of_dual_lanes(replace(SMALL, fluid=Water(), numerics=numerics), ALL_KINDS)
    assert recorded.sentence.startswith("The derivatives are of the branch that was taken")


@pytest.mark.parametrize("actuator", [SmaWires(0.6, 0.05, 0.3, period=0.1), ThermalSma()])
def test_actuators_with_memory(actuator):
    numerics = replace(SMALL.numerics, newton_tolerance=1e-14)
    scene = replace(SMALL, actuator=actuator, numerics=numerics)
    assert_is_that_of_dual_lanes(scene, ALL_KINDS[:4], 0.5 + 0.3 * COMMANDS)


def test_gradient_is_a_difference_of_swims():
    def objective(swim):
        return float(swim.hub[-1] @ [0.6, 0.8]), {"hub": np.multiply.outer([0, 0, 0, 1], [0.6, 0.8])}

    found = gradient(SMALL, COMMANDS, objective, ALL_KINDS)
    assert found.value == found.swim.hub[-1] @ [0.6, 0.8]
    for name in ALL_KINDS[1:]:
        number = at(SMALL, name)
        path, *_ = differences(
            lambda change, name=name, number=number: swum(with_numbers(SMALL, {name: number + change}), COMMANDS),
            1e-4 * number,
        )
        np.testing.assert_allclose(found.by[name], path[-1, 0] @ [0.6, 0.8], rtol=1e-6)


def test_a_swim_in_two_parts_has_the_gradient_of_the_whole():
    simulator = Simulator(SMALL, 1, threads=1)
    simulator.stroke(COMMANDS[:1])
    whole, rest = record(SMALL, COMMANDS), record(SMALL, COMMANDS[1:], simulator.get_state())
    np.testing.assert_array_equal(rest.swim.positions, whole.swim.positions[1:])
    first, at_end = record(SMALL, COMMANDS[:1]), np.zeros((3, 2))
    at_end[-1] = 1.0
    between = rest.gradient({"hub": at_end}, OF_START)
    slopes = {name: np.stack([0.0 * between[name], between[name]]) for name in OF_START}
    found = first.gradient(slopes, ["commands"])["commands"]
    expected = whole.gradient({"hub": np.vstack([np.zeros((1, 2)), at_end])}, ["commands"])["commands"][:1]
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("actuator", [SMALL.actuator, SmaWires(0.6, 0.05, 0.3, period=0.1)])
def test_commands_of_a_policy_pass_slopes_on(actuator):
    """Of a closed loop: the gradient in the policy's offsets and in velocities at the start is that of differences."""
    scene, rng = replace(SMALL, actuator=actuator), np.random.default_rng(2)
    rest = np.array(scene.robot.nodes(0))
    gains = rng.standard_normal((2, 5, *rest.shape)) * np.reshape([20.0, 2.0], (2, 1, 1, 1))
    change = rng.standard_normal(rest.shape)

    def command(places, velocities, offset):
        return np.tanh(np.tensordot(gains[0], places - rest, 2) + np.tensordot(gains[1], velocities, 2) + offset)

    def swim(share, of_start):
        """Quantities of a swim, whose start or whose offsets are changed, and its commands."""
        simulator = Simulator(scene, 1, threads=1, effort=True)
        state = simulator.get_state()
        state.velocities[0] += share * change * of_start
        simulator.set_state(state)
        seen, work, commands = [(simulator.positions[0], simulator.velocities[0], simulator.heading()[0])], [], []
        for offset in COMMANDS:
            commands.append(command(*seen[-1][:2], offset + share * (1.0 - of_start) * offset))
            work.append(simulator.stroke(commands[-1][None]).work[0])
            seen.append((simulator.positions[0], simulator.velocities[0], simulator.heading()[0]))
        return *(np.array(each) for each in zip(*seen, strict=True)), np.array(work), np.array(commands)

    commands = swim(0.0, 0.0)[-1]
    recorded = record(scene, commands)
    slopes, rises = slopes_of(recorded.swim), 1.0 - commands**2

    def feedback(k, slope):
        return tuple(np.tensordot(slope * rises[k], gain, 1) for gain in gains)

    found = recorded.gradient(slopes, ["commands", "velocities"], feedback)
    for of_start, mine in (
        (0.0, (found["commands"] * rises * COMMANDS).sum()),
        (1.0, (found["velocities"] * change).sum()),
    ):
        by_differences = differences(lambda share, of_start=of_start: swim(share, of_start)[:-1], 2e-5)
        assert mine == pytest.approx(number_of(slopes, Motion(*by_differences)), rel=1e-6)
    assert (found["commands"] * rises * COMMANDS).sum() != pytest.approx(
        (recorded.gradient(slopes, ["commands"])["commands"] * rises * COMMANDS).sum(), rel=1e-2
    )


def test_a_tape_grows_where_a_step_needs_more(monkeypatch):
    slopes = slopes_of(record(SMALL, COMMANDS).swim)
    expected = record(SMALL, COMMANDS).gradient(slopes, ["robot.density"])
    monkeypatch.setattr(adjoint, "ENTRIES", 1000)
    assert record(SMALL, COMMANDS).gradient(slopes, ["robot.density"]) == expected


def test_a_swim_that_failed_has_no_gradient():
    state = Simulator(SMALL, 1, threads=1).get_state()
    state.positions[:] = 0.25  # all nodes in one point: no angle, no direction, no way on
    recorded = record(SMALL, COMMANDS, state)
    assert recorded.status.any()
    assert np.isnan(recorded.gradient({"heading": np.ones(4)}, ["commands"])["commands"]).all()
    assert recorded.sentence.startswith("The solver failed in interval 1")


@pytest.mark.parametrize(
    ("slopes", "reason"),
    [
        ({"hope": np.zeros(3)}, "slopes has 'hope', which is none of hub, positions"),
        ({"hub": np.zeros((3, 2))}, r"slopes in hub must have shape \(4, 2\), not \(3, 2\)"),
    ],
)
def test_refusals_are_sentences(slopes, reason):
    with pytest.raises(ValueError, match=rf"{reason}.*\.$"):
        record(SMALL, COMMANDS).gradient(slopes, ["commands"])


@pytest.mark.parametrize("answer", [lambda slope: (slope, slope), lambda slope: slope, lambda slope: None])
def test_feedback_of_another_shape_is_refused(answer):
    recorded = record(SMALL, COMMANDS)
    with pytest.raises(ValueError, match=r"feedback must return slopes in .*, of shape \(21, 2\) each\."):
        recorded.gradient({"hub": np.ones((4, 2))}, ["commands"], lambda k, slope: answer(slope))
    with pytest.raises(ValueError, match=r"feedback must be a function, not 3\."):
        recorded.gradient({"hub": np.ones((4, 2))}, ["commands"], 3)


def test_memory_of_a_record_is_what_it_has_kept():
    recorded = record(SMALL, COMMANDS)
    assert all(kept.base is None for kept in map(recorded.history, range(len(COMMANDS))))


def example(name):
    return runpy.run_path(str(Path(__file__).parents[2] / "examples" / name))


def assert_is_slope_of_the_hub(found):
    expected = differentiate(SMALL, COMMANDS, ["commands"]).by["commands"].hub[-1, 0]
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-10 * np.abs(expected).max())


def test_pytorch_swims_farther_along_the_gradient():
    torch = pytest.importorskip("torch")
    its = example("torch_gradients.py")
    distances = its["swim_far"](SMALL, steps=5)
    assert all(after > before for before, after in pairwise(distances))
    commands = torch.tensor(COMMANDS, requires_grad=True)
    its["Swim"].apply(commands, SMALL)[-1, 0].backward()
    assert_is_slope_of_the_hub(commands.grad.numpy())


def test_jax_swims_farther_along_the_gradient():
    jax = pytest.importorskip("jax")
    its = example("jax_gradients.py")
    distances = its["swim_far"](SMALL, steps=5)
    assert all(after > before for before, after in pairwise(distances))
    of_two = jax.vmap(jax.grad(lambda commands: its["hub_of"](SMALL)(commands)[-1, 0]))
    found = of_two(jax.numpy.stack([jax.numpy.zeros_like(COMMANDS), COMMANDS]))
    assert_is_slope_of_the_hub(found[1])


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name in ("vacuum", "held node") else pytest.mark.slow) for name in TERMS]
)
def test_every_term_has_the_gradient_of_dual_lanes(name):
    scene, numbers, commands = TERMS[name]
    assert_is_that_of_dual_lanes(scene, ["commands", *numbers], commands)
