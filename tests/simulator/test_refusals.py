"""A simulator refuses bad arguments in one sentence, before anything moves."""

from functools import partial

import numpy as np
import pytest

from hubs import TEN
from refusals import assert_refused
from seastar_gym import Numerics, Scene, Seastar, Simulator, State
from strokes import assert_same

STRAIGHT = np.array([[0.0, 1.0, 0.0, 0.0, -1.0]] * 2)
SCENE = Scene(TEN, numerics=Numerics("implicit-midpoint", 0.01))
MAKING = [
    *(({"n_robots": value}, "n_robots", repr(value)) for value in (0, -1, 2.5, "2", None, True)),
    *(({"scene": value}, "Scene") for value in (None, Scene, TEN, "chapter")),
    *(({"threads": value}, "threads") for value in ("two", 1.5, -1, True)),
]


@pytest.mark.parametrize("refused", MAKING, ids=str)
def test_what_is_no_simulator_is_refused(refused):
    arguments, *words = refused
    with assert_refused(*words):
        Simulator(**{"scene": SCENE, "n_robots": 2} | arguments)


def begin_parts(simulator: Simulator, commands=STRAIGHT, parts=2) -> None:
    next(simulator.stroke_in_parts(commands, parts))


def set_part(field: str, shape: tuple[int, ...], simulator: Simulator) -> None:
    """Set a state of which a part has another shape."""
    simulator.set_state(simulator.get_state()._replace(**{field: np.zeros(shape)}))


def set_number(field: str, value: float, simulator: Simulator) -> None:
    """Set a state of which the last number of a part is another."""
    state = simulator.get_state()
    getattr(state, field).reshape(-1)[-1] = value
    simulator.set_state(state)


def commands_with(value: float) -> np.ndarray:
    commands = np.zeros((2, 5))
    commands[1, 2] = value
    return commands


SHAPES = (5,), (1, 5), (2, 4), (2, 6), (5, 2), (2, 5, 1), ()
OF_STATES = [
    ("positions", (2, 45, 2)), ("positions", (1, 46, 2)), ("velocities", (2, 46, 3)), ("velocities", (2, 92)),
    ("time", ()), ("time", (3,)),
]  # fmt: skip
NO_COMMANDS = "abc", [[1, 2], [3]], [["a"] * 5] * 2, np.full((2, 5), 1j)
NO_STATES = (np.zeros((2, 46, 2)),), 3, None
NO_MASKS = [1, 0], [True], [[True, False]], "both", np.ones(3, bool)
RAGGED = [[True], [True, False]]
ASKING = [
    *((partial(Simulator.stroke, commands=np.zeros(shape)), "(n_robots, n_limbs) = (2, 5)", str(shape))
      for shape in SHAPES),
    *((partial(call, commands=commands_with(value)), "[-1, 1]", "robot 1", "limb 3")
      for call in (Simulator.stroke, begin_parts) for value in (np.nan, np.inf, -np.inf, 1.0000001, -2.0)),
    *((partial(Simulator.stroke, commands=commands), "commands") for commands in NO_COMMANDS),
    *((partial(begin_parts, parts=parts), "parts") for parts in (0, -1, 2.5, None)),
    *((partial(set_number, field, value), f"State.{field}", "finite")
      for field in State._fields[:3] for value in (np.nan, np.inf)),
    *((partial(set_part, field, shape), f"State.{field}", str(shape)) for field, shape in OF_STATES),
    *((partial(Simulator.set_state, state=state), "State") for state in NO_STATES),
    *((partial(Simulator.reset, mask=mask), "mask", "(2,)") for mask in NO_MASKS),
    *((partial(Simulator.reset, heading=heading), "heading", "finite") for heading in (np.nan, [0.0, np.inf])),
    *((partial(Simulator.reset, heading=heading), "heading")
      for heading in ([0.0, 1.0, 2.0], "north", [[0.0], [1.0]])),
    (partial(Simulator.reset, mask=RAGGED), "mask", "rows of different lengths"),
    (partial(Simulator.set_scene, scene=SCENE, mask=RAGGED), "mask", "rows of different lengths"),
]  # fmt: skip
"""What two robots are asked for, and words of the refusal."""


@pytest.mark.parametrize("refused", ASKING, ids=lambda refused: " ".join(refused[1:]))
def test_what_means_nothing_is_refused_before_anything_moves(refused):
    call, *words = refused
    simulator, other = Simulator(SCENE, 2), Simulator(SCENE, 2)
    for each in (simulator, other):
        each.stroke(STRAIGHT)
    with assert_refused(*words):
        call(simulator)
    assert_same(simulator, other)


def test_a_turning_hub_refuses_the_command_that_closes_it():
    simulator = Simulator(Scene(Seastar(hub_hinge="turning", discretisation="chapter")), 2)
    with assert_refused("robot 1", "limbs 2 and 3", "opening"):
        simulator.stroke([[0.0] * 5, [0.0, 1.0, -1.0, 0.0, 0.0]])
    assert not simulator.stroke([[0.0] * 5, [0.0, -1.0, 1.0, 0.0, 0.0]]).status.any()
