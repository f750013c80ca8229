"""What arguments cannot say of each other, and of a scene, is refused in one sentence, before anything moves."""

import math
from dataclasses import replace
from functools import partial

import numpy as np

from currents import swirl
from hubs import TEN
from refusals import assert_refused
from seastar_gym import (
    AlongLimb,
    Attachment,
    Body,
    Contact,
    GridCurrent,
    Limb,
    Numerics,
    Scene,
    Seastar,
    Simulator,
    SmaPulse,
    State,
    Stiffening,
)
from strokes import assert_same

SCENE = Scene(TEN, numerics=Numerics("implicit-midpoint", 0.01))
CROSSED = Seastar(limbs=tuple(Limb(natural_curvature=bend) for bend in (16.0, -16.0, 16.0, -16.0, 0.0)))


def on_body(body: Body, *places: tuple[float, float, float], length: float = 0.1, bend: float = 0.0) -> Scene:
    """Two limbs on a body, that are in contact with it and each other."""
    attached = replace(body, attachments=tuple(Attachment(*place) for place in places))
    robot = Seastar(2, 5, length, limbs=(Limb(natural_curvature=bend), Limb()), body=attached)
    return Scene(robot, contact=Contact())


TURNING = Scene(Seastar(hub_hinge="turning", discretisation="chapter"))
DISC, PLATE, THIN = Body(radius=0.02), Body.rectangle(0.06, 0.03), Body.rectangle(0.06, 1e-4)
MAKING = [
    *((partial(Simulator, replace(SCENE, **fixed), error_bars=True), "one mesh", "error_bars=False")
      for fixed in ({"held_nodes": (0, 1)}, {"loads": ((3, 0.0, 1e-3),)})),
    # Contact
    (partial(Scene, TEN, contact=Contact(opening_angle=1.3)), "touch at rest"),
    (partial(Scene, Seastar(n_limbs=1), actuator=SmaPulse(0.0), contact=Contact()), "half a turn"),
    (partial(Scene, CROSSED, contact=Contact()), "cross at rest"),
    (partial(Contact, modulus=1e5, layer=5e-3), "either a modulus [Pa] or a layer [m]"),
    *((lambda layer=layer: Scene(TEN, contact=Contact(layer=layer)), f"Contact.layer={layer:g} m", "overflows")
      for layer in (1e-90, 1e90)),
    (partial(on_body, DISC, (0.0, 0.0, 0.0), (-0.02, 0.0, math.pi)), "limb 1 touches the body"),
    (partial(on_body, DISC, (0.02, 0.0, 0.0), (0.02, 2e-3, 0.0)), "limbs 1 and 2 touch each other"),
    (partial(on_body, PLATE, (0.03, 0.015, 2.4), (-0.03, 0.015, 0.7), length=2.0), "limbs 1 and 2 touch each other"),
    (partial(on_body, THIN, (0.0, 5e-5, -1.6), (-0.03, 0.0, math.pi)), "limb 1 touches the body"),
    # The last 4 mm of an arc
    (partial(on_body, PLATE, (0.03, 0.015, 1.0), (-0.03, 0.0, math.pi), bend=45.0), "limb 1 touches the body"),
    # Fluids
    (partial(GridCurrent, (0.0, 0.0), 0.1, np.zeros((1, 2, 2))), "velocities", "(1, 2, 2)"),
    (partial(GridCurrent, (0.0, 0.0), 0.1, np.full((2, 2, 2), np.nan)), "velocities", "finite"),
    (partial(GridCurrent.from_function, swirl, (0.0, 0.0), (0.0, 1.0), 0.1), "x", "spacing apart"),
    (partial(GridCurrent.from_function, swirl, (0.0, 1e4), (0.0, 1e4), 0.1), "points", "larger spacing"),
    # The continuum, and limbs that bend along their length
    (partial(Seastar, hub_hinge="turning", discretisation="continuum"), 'only discretisation="chapter"'),
    (partial(Seastar, along=AlongLimb(), discretisation="chapter"), 'only discretisation="continuum"'),
    *((partial(AlongLimb, profile=profile), "bend it to one side") for profile in ((1.0, -1.0), (-1.0, 0.9))),
    (partial(Scene, Seastar(nodes_per_limb=3, along=AlongLimb()), actuator=SmaPulse(7.0)), "more nodes per limb"),
    (partial(Seastar, 2, limbs=(Limb(joint_stiffness=1e-4),) * 2, stiffening=Stiffening()), "joints"),
    (lambda: Simulator(TURNING, 2).stroke([[0.0] * 5, [0.0, 1.0, -1.0, 0.0, 0.0]]),
     "robot 1", "limbs 2 and 3", "opening"),
]  # fmt: skip
"""What is made, and words of the refusal."""


def test_what_cannot_be_made_is_refused(subtests):
    for make, *words in MAKING:
        with subtests.test(words=words), assert_refused(*words):
            make()


# What two robots are asked that have swum, and estimate their errors.

STRAIGHT = np.array([[0.0, 1.0, 0.0, 0.0, -1.0]] * 2)


def begin_parts(simulator: Simulator, commands=STRAIGHT, parts=2, duration=1.0) -> None:
    next(simulator.advance_in_parts(duration, commands, parts))


def set_part(simulator: Simulator, **parts) -> None:
    """Set a state with other parts."""
    simulator.set_state(simulator.get_state()._replace(**parts))


def set_last(simulator: Simulator, field: str, value: float) -> None:
    """Set a state of which the last number of a part is another."""
    state = simulator.get_state()
    getattr(state, field).reshape(-1)[-1] = value
    simulator.set_state(state)


def commands_with(value: float) -> np.ndarray:
    commands = np.zeros((2, 5))
    commands[1, 2] = value
    return commands


RAGGED = [[True], [True, False]]
OF_STATES = ("positions", (2, 45, 2)), ("positions", (1, 46, 2)), ("velocities", (2, 92)), ("time", ()), ("phase", (3,))
ASKING = [
    *((partial(Simulator.stroke, commands=np.zeros(shape)), "(n_robots, n_limbs) = (2, 5)", str(shape))
      for shape in ((5,), (1, 5), (2, 6), (2, 5, 1), ())),
    *((partial(call, commands=commands_with(value)), "[-1, 1]", "robot 1", "limb 3")
      for call in (Simulator.stroke, begin_parts) for value in (np.nan, np.inf, 1.0000001, -2.0)),
    *((partial(call, duration=duration), "duration", word) for call in (Simulator.advance, begin_parts)
      for word, durations in (("positive", (0.0, np.nan)), ("from 1e-08 to", (1e-12, 1e12))) for duration in durations),
    *((partial(set_last, field=field, value=value), f"State.{field}", "finite")
      for field in (*State._fields[:3], "commands") for value in (np.nan, np.inf)),
    *((partial(set_part, **{field: np.zeros(shape)}), f"State.{field}", str(shape)) for field, shape in OF_STATES),
    (partial(set_part, phase=np.array([0.3, 0.4])), "one time for all robots"),
    (partial(set_part, phase=np.array([0.3, -0.1])), "at least 0"),
    (partial(set_part, phase=np.full(2, 1.0)), "less than 1 s"),
    (partial(set_part, commands=np.full((2, 5), 1.5)), "State.commands must be numbers in [-1, 1]"),
    *((partial(Simulator.reset, mask=mask), "mask", "(2,)") for mask in ([1, 0], [True], "both", np.ones(3, bool))),
    *((call, "mask", "rows of different lengths") for call in
      (partial(Simulator.reset, mask=RAGGED), partial(Simulator.set_scene, scene=SCENE, mask=RAGGED))),
    (partial(Simulator.set_scene, scene=Scene(Seastar(4), numerics=SCENE.numerics)), "set_scene"),
    (partial(Simulator.set_scene, scene=Scene(Seastar(nodes_per_limb=10))), "set_scene"),
    (partial(Simulator.set_scene, scene=replace(SCENE, held_nodes=(0,))), "one mesh"),
]  # fmt: skip


def test_what_means_nothing_is_refused_before_anything_moves(subtests):
    for call, *words in ASKING:
        simulator, other = (Simulator(SCENE, 2, error_bars=True) for _ in range(2))
        for each in (simulator, other):
            each.stroke(STRAIGHT)
        with subtests.test(words=words):
            with assert_refused(*words):
                call(simulator)
            assert_same(simulator, other)
            for each in (simulator, other):  # the twin, too
                each.stroke(STRAIGHT)
            assert_same(simulator, other)
