"""Gradients of swims: against dual lanes, and against differences of swims."""

import runpy
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numba
import numpy as np
import pytest

import seastar_gym.gradients.adjoint as adjoint
from gradients.test_differentiate import BRANCH, COMMANDS, HALVED, SMALL, SWIMS, TERMS, THERMAL, WIRES, differences
from refusals import assert_refused
from seastar_gym import Scene, Simulator, Water
from seastar_gym.gradients import Motion, differentiate, gradient, record
from seastar_gym.gradients.adjoint import QUANTITIES
from seastar_gym.gradients.tape import OF_COMMANDS, of_command
from simulator.test_conservation import rattled
from strokes import ternary

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="lanes of a tape have compiled code alone")

ALL_KINDS = ["commands", "robot.youngs_modulus", "fluid.drag_coefficient", "actuator.peak_angle", "robot.limb_length"]


def slopes_of(swim, seed=0):
    """Random slopes in all quantities of a swim."""
    rng = np.random.default_rng(seed)
    return {name: rng.standard_normal(getattr(swim, name).shape) for name in QUANTITIES}


def number_of(slopes, quantities):
    """The number that has these slopes, or its derivative; quantities: A Motion."""
    return sum(np.tensordot(each, getattr(quantities, name), axes=each.ndim) for name, each in slopes.items())


TIGHT = replace(SMALL, numerics=replace(SMALL.numerics, newton_tolerance=1e-14))
SCENES = {
    "positions and velocities": (SMALL, [*ALL_KINDS, "positions", "velocities"], COMMANDS),
    "commands at their ends": (SMALL, ["commands", "robot.density"], np.sign(COMMANDS)),
    **{name: (SWIMS[name][0], ALL_KINDS, COMMANDS) for name in
       ("implicit-euler", "sdirk2", "implicit-midpoint", "halved")},
    "halved midpoint": (
        replace(SMALL, fluid=Water(), numerics=replace(HALVED, scheme="implicit-midpoint")), ALL_KINDS, COMMANDS
    ),
    **{type(each).__name__: (replace(TIGHT, actuator=each), ALL_KINDS[:4], 0.5 + 0.3 * COMMANDS)
       for each in (WIRES, THERMAL)},
    **{name: (scene, ["commands", *numbers], commands) for name, (scene, numbers, commands) in TERMS.items()},
}  # fmt: skip


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.slow] * (name in TERMS and name not in ("vacuum", "held node")))
     for name in SCENES],
)  # fmt: skip
def test_gradient_is_that_of_dual_lanes(name):
    """Of a number of all quantities; and the swim is theirs to the bit."""
    scene, names, commands = SCENES[name]
    expected, recorded = differentiate(scene, commands, names), record(scene, commands)
    for mine, theirs in zip(recorded.swim, expected.swim, strict=True):
        np.testing.assert_array_equal(mine, theirs)
    slopes = slopes_of(recorded.swim)
    for by, found in recorded.gradient(slopes, names).items():
        right = number_of(slopes, expected.by[by])
        sizes = Motion(*map(np.abs, expected.by[by]))  # of the terms, whose sum may be small
        largest = number_of({quantity: np.abs(each) for quantity, each in slopes.items()}, sizes).max()
        share = 1e-10 if scene.contact is None else 1e-8  # conjugate gradients leave rounding
        np.testing.assert_allclose(found, right, rtol=0.0, atol=share * largest, err_msg=by)
    assert recorded.sentence == expected.sentence
    assert (BRANCH in recorded.sentence) == (name.startswith("halved")) or name in TERMS


@pytest.mark.parametrize("command", [-1.0, 0.0, 1.0])
def test_slopes_in_commands_are_those_of_any_quartic_and_look_no_farther_than_commands_go(command):
    places, weights = map(np.array, of_command(command))
    np.testing.assert_allclose([weights @ places**power for power in range(1, 5)], [1.0, 0.0, 0.0, 0.0], atol=1e-12)
    assert np.abs(command + OF_COMMANDS * places).max() <= 1.0


def test_an_objective_has_its_value_and_the_gradient_of_its_slopes():
    slopes = {"hub": np.multiply.outer([0, 0, 0, 1], [0.6, 0.8])}
    found = gradient(SMALL, COMMANDS, lambda swim: (float(swim.hub[-1] @ [0.6, 0.8]), slopes), ALL_KINDS)
    assert found.value == found.swim.hub[-1] @ [0.6, 0.8]
    expected = record(SMALL, COMMANDS).gradient(slopes, ALL_KINDS)
    for name in ALL_KINDS:
        np.testing.assert_array_equal(found.by[name], expected[name], err_msg=name)


def test_a_swim_in_two_parts_has_the_gradient_of_the_whole():
    simulator = Simulator(SMALL, 1, threads=1)
    simulator.stroke(COMMANDS[:1])
    whole, rest = record(SMALL, COMMANDS), record(SMALL, COMMANDS[1:], simulator.get_state())
    np.testing.assert_array_equal(rest.swim.positions, whole.swim.positions[1:])
    first, at_end = record(SMALL, COMMANDS[:1]), np.zeros((3, 2))
    at_end[-1] = 1.0
    between = rest.gradient({"hub": at_end}, ["positions", "velocities"])
    slopes = {name: np.stack([0.0 * each, each]) for name, each in between.items()}
    found = first.gradient(slopes, ["commands"])["commands"]
    expected = whole.gradient({"hub": np.vstack([np.zeros((1, 2)), at_end])}, ["commands"])["commands"][:1]
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("actuator", [SMALL.actuator, WIRES])
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


def test_a_record_keeps_its_own_memory_and_a_tape_grows_where_a_step_needs_more(monkeypatch):
    recorded = record(SMALL, COMMANDS)
    assert all(kept.base is None for kept in map(recorded.history, range(len(COMMANDS))))
    slopes = slopes_of(recorded.swim)
    expected = recorded.gradient(slopes, ["robot.density"])
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
    ("slopes", "feedback", "words"),
    [
        ({"hope": np.zeros(3)}, None, ("slopes has 'hope', which is none of hub, positions",)),
        ({"hub": np.zeros((3, 2))}, None, ("slopes in hub must have shape (4, 2), not (3, 2)",)),
        ({"hub": np.full((4, 2), np.nan)}, None, ("slopes in hub must be finite numbers",)),
        ({"hub": np.ones((4, 2))}, 3, ("feedback must be a function, not 3.",)),
        *(({"hub": np.ones((4, 2))}, each, ("feedback must return slopes in", "of shape (21, 2) each"))
          for each in (lambda k, slope: (slope, slope), lambda k, slope: slope, lambda k, slope: None)),
    ],
)  # fmt: skip
def test_refusals_are_sentences(slopes, feedback, words):
    with assert_refused(*words):
        record(SMALL, COMMANDS).gradient(slopes, ["commands"], feedback)


@pytest.mark.parametrize("told", [1.0, (np.zeros(2), {}), (1.0, 2.0)])
def test_an_objective_without_slopes_is_refused(told):
    with assert_refused("objective must return a number and its slopes by name"):
        gradient(SMALL, COMMANDS, lambda swim: told, ["commands"])


@pytest.mark.parametrize("library", ["torch", "jax"])
def test_other_libraries_swim_farther_along_the_gradient(library):
    module = pytest.importorskip(library)
    its = runpy.run_path(str(Path(__file__).parents[2] / "examples" / f"{library}_gradients.py"))
    distances = its["swim_far"](SMALL, steps=5)
    assert all(after > before for before, after in pairwise(distances))
    if library == "torch":
        commands = module.tensor(COMMANDS, requires_grad=True)
        its["Swim"].apply(commands, SMALL)[-1, 0].backward()
        found = commands.grad.numpy()
    else:
        of_two = module.vmap(module.grad(lambda commands: its["hub_of"](SMALL)(commands)[-1, 0]))
        found = of_two(module.numpy.stack([module.numpy.zeros_like(COMMANDS), COMMANDS]))[1]
    expected = differentiate(SMALL, COMMANDS, ["commands"]).by["commands"].hub[-1, 0]
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-10 * np.abs(expected).max())


def test_a_swim_in_which_a_robot_comes_to_rest_has_failed_where_slopes_are_asked_for():
    """Nothing leads back through what was lost: edges that collapse at random velocities, see rods/guard.py."""
    scene, commands = Scene.preset("reference"), ternary(1, 8, 1)[0][2:3]
    state = rattled(Simulator(scene, 8), 50.0, seed=2).get_state().of_robots([2])
    simulator = Simulator(scene)
    simulator.set_state(state)
    report, swum = simulator.stroke(commands), record(scene, commands, state)
    assert report.status[0] == 0 < report.energy_cuts[0] and swum.status[0] == 1
    slopes = swum.gradient({"positions": np.ones(swum.swim.positions.shape)}, ["commands"])
    assert np.isnan(slopes["commands"]).all() and "failed in interval 1" in swum.sentence
