"""A simulator refuses bad arguments in one sentence, before anything moves."""

import numpy as np
import pytest

from hubs import TEN
from refusals import assert_refused
from seastar_gym import Numerics, Scene, Seastar, Simulator, State
from seastar_gym.simd.lanes import N_LANES

STRAIGHT = np.array([[0.0, 1.0, 0.0, 0.0, -1.0]])
SCENE = Scene(TEN, numerics=Numerics("implicit-midpoint", 0.01))


@pytest.mark.parametrize("value", [0, -1, 2.5, "2", None, True], ids=repr)
def test_a_batch_has_one_robot_or_more(value):
    with assert_refused("n_robots", repr(value)):
        Simulator(Scene(TEN), value)


@pytest.mark.parametrize("scene", [None, Scene, TEN, "chapter"])
def test_a_simulator_needs_a_scene(scene):
    with assert_refused("Scene"):
        Simulator(scene)


@pytest.mark.parametrize("value", ["two", 1.5, -1, True], ids=repr)
def test_threads_are_a_whole_number(value):
    with assert_refused("threads"):
        Simulator(Scene(TEN), 3 * N_LANES, threads=value)


@pytest.mark.parametrize("shape", [(5,), (1, 5), (2, 4), (2, 6), (5, 2), (2, 5, 1), ()])
def test_commands_of_another_shape_are_refused(shape):
    with assert_refused("(n_robots, n_limbs) = (2, 5)", str(shape)):
        Simulator(Scene(TEN), 2).stroke(np.zeros(shape))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1.0000001, -2.0])
def test_commands_beyond_one_or_not_numbers_are_refused_before_anything_moves(value):
    simulator = Simulator(SCENE, 2)
    simulator.stroke(np.tile(STRAIGHT, (2, 1)))
    before, commands = simulator.get_state(), np.zeros((2, 5))
    commands[1, 2] = value
    with assert_refused("[-1, 1]", "robot 1", "limb 3"):
        simulator.stroke(commands)
    with assert_refused("[-1, 1]"):
        next(simulator.stroke_in_parts(commands, 2))
    for now, then in zip(simulator.get_state(), before, strict=True):
        np.testing.assert_array_equal(now, then)


@pytest.mark.parametrize("commands", ["abc", [[1, 2], [3]], [["a"] * 5] * 2, np.full((2, 5), 1j)], ids=str)
def test_commands_that_are_no_numbers_at_all_are_refused_with_a_sentence(commands):
    with assert_refused("commands"):
        Simulator(Scene(TEN), 2).stroke(commands)


def test_a_turning_hub_refuses_the_command_that_closes_it():
    simulator = Simulator(Scene(Seastar(hub_hinge="turning", discretisation="chapter")), 2)
    with assert_refused("robot 1", "limbs 2 and 3", "opening"):
        simulator.stroke([[0.0] * 5, [0.0, 1.0, -1.0, 0.0, 0.0]])
    assert not simulator.stroke([[0.0] * 5, [0.0, -1.0, 1.0, 0.0, 0.0]]).status.any()


@pytest.mark.parametrize("field", range(3))
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_states_that_are_not_finite_are_refused_and_change_nothing(field, value):
    simulator = Simulator(SCENE, 2)
    simulator.stroke(np.tile(STRAIGHT, (2, 1)))
    before, state = simulator.get_state(), simulator.get_state()
    state[field].reshape(-1)[-1] = value
    with assert_refused(f"State.{State._fields[field]}", "finite"):
        simulator.set_state(state)
    for now, then in zip(simulator.get_state(), before, strict=True):
        np.testing.assert_array_equal(now, then)


@pytest.mark.parametrize(
    "field, shape", [(0, (2, 45, 2)), (0, (1, 46, 2)), (1, (2, 46, 3)), (1, (2, 92)), (2, ()), (2, (3,))]
)
def test_states_of_another_shape_are_refused(field, shape):
    simulator = Simulator(Scene(TEN), 2)
    state = list(simulator.get_state())
    state[field] = np.zeros(shape)
    with assert_refused(f"State.{State._fields[field]}", str(shape)):
        simulator.set_state(state)


@pytest.mark.parametrize("state", [(np.zeros((1, 46, 2)),), 3, None], ids=["one field", "number", "None"])
def test_what_is_no_state_is_refused_with_a_sentence(state):
    with assert_refused("State"):
        Simulator(Scene(TEN)).set_state(state)


@pytest.mark.parametrize("mask", [[1, 0], [True], [[True, False]], "both", np.ones(3, bool)], ids=str)
def test_masks_of_another_shape_or_kind_are_refused(mask):
    with assert_refused("mask", "(2,)"):
        Simulator(Scene(TEN), 2).reset(mask)


@pytest.mark.parametrize("heading", [np.nan, [0.0, np.inf]], ids=str)
def test_headings_that_are_not_finite_are_refused(heading):
    with assert_refused("heading", "finite"):
        Simulator(Scene(TEN), 2).reset(heading=heading)


@pytest.mark.parametrize("heading", [[0.0, 1.0, 2.0], "north", [[0.0], [1.0]]], ids=str)
def test_headings_of_another_shape_are_refused_with_a_sentence(heading):
    with assert_refused("heading"):
        Simulator(Scene(TEN), 2).reset(heading=heading)


@pytest.mark.parametrize("parts", [0, -1, 2.5, None], ids=repr)
def test_a_stroke_has_one_part_or_more(parts):
    with assert_refused("parts"):
        next(Simulator(Scene(TEN)).stroke_in_parts(STRAIGHT, parts))


@pytest.mark.parametrize("name, arguments", [("reset", ()), ("set_scene", (SCENE,))])
def test_a_mask_of_rows_of_different_lengths_is_refused(name, arguments):
    with assert_refused("mask", "rows of different lengths"):
        getattr(Simulator(SCENE, 2), name)(*arguments, mask=[[True], [True, False]])
