"""What is no sweep, no axis, no gait and no controller is refused in one sentence."""

from functools import partial

import numpy as np

from refusals import assert_refused
from seastar_gym.scene import Scene, Seastar, SmaPulse
from seastar_gym.sweep.command import axis_of
from seastar_gym.sweep.designs import Choices, Range, Route, Sweep, gait_of

FAST = Scene.preset("fast")
LENGTH = Range("robot.limb_length", 0.05, 0.15)
GAITS = "1*", "0+", "6+", "+", "1+2-", "a+", "1+,", "\u00b2+"
WATER_OR_NOT = Choices("fluid", (FAST.fluid, None), ("water", "vacuum"))


def sweep(*axes, **options):
    return partial(Sweep, FAST, axes, **options)


def chosen(name, *values):
    return sweep(Choices(name, values))


def of_controllers(*controllers, axes=(), **options):
    return sweep(Choices("controller", controllers), *axes, **{"route": Route([[0.04, 0.0]]), **options})


REFUSED = [
    (sweep(LENGTH, LENGTH), "once"),
    (sweep(LENGTH), "samples", "from 1 to"),
    (sweep(LENGTH, samples=10**8), "samples"),
    (chosen("robot.n_limbs", 0, 3), "n_limbs", "not 0"),
    (chosen("robot.colour", 1, 2), "robot.colour", "nothing that a sweep can vary"),
    (chosen("robot.limbs.0.length", 1, 2), "robot.limbs.0.length"),
    (sweep(Range("numerics.step", 1e-3, 2e-3), samples=5), "numerics.step", "within a batch"),
    (sweep(Choices("actuator.heating_time", (0.1, 0.2)), samples=5), "needs a range"),
    (chosen("robot.limb_length", -1.0, -2.0), "limb_length"),
    (chosen("gait", "straight", "6+"), "gait", "6+"),
    (chosen("actuator", SmaPulse(), "pulse"), "actuator", "pulse"),
    (chosen("fidelity", "fast", "quick"), "fidelity", "quick"),
    (sweep(gait="lagged"), "lagged", "SmaWires"),
    (sweep(gait="1+,2-,1-"), "names limb 1 twice"),
    (sweep(gait=np.zeros((2, 4))), "rows of commands of 5 limbs"),
    (sweep(WATER_OR_NOT, Range("fluid.density", 900.0, 1100.0), samples=2), "vacuum", "fluid.density"),
    (lambda: Sweep(Scene(Seastar(limb_length=np.array([0.1, 0.2]))), ()), "one robot"),
    *((partial(gait_of, text, FAST), f"limbs of 5 such as 1+,2-, not {text!r}") for text in GAITS),
    # Axes
    (lambda: Range("x", 2.0, 1.0), "larger"),
    (lambda: Range("x", 0.0, 1.0, is_log=True), "positive"),
    (lambda: Choices("x", (1, 2), ("a",)), "labels"),
    (lambda: Choices("x", (SmaPulse(0.1), SmaPulse(0.2))), "labels that differ"),
    *((partial(axis_of, f"x=1:2:{count}"), "a count from 2 to 1000000") for count in ("1", "1000001", "2.0", "0.3")),
    *((partial(axis_of, text), "is written") for text in ("=1", "x=", "x", "x=1:a", "x=1:2:3:4", "x=:log")),
    (partial(axis_of, "actuator=Muscle"), "Muscle"),
    # Controllers
    (of_controllers("nobody"), "nobody", "choose one of"),
    (of_controllers("nowhere:make"), "nowhere:make", "nowhere"),
    (of_controllers("learned", axes=(Choices("robot.n_limbs", (4,)),)), "robot of 5 limbs"),
    (of_controllers("learned", axes=(Choices("gait", ("straight",)),)), "gait or a controller"),
    (of_controllers("learned", route=Route(decision_period=0.5)), "SmaWires"),
    (of_controllers("prey"), "trained for the task prey"),
    (of_controllers("timed-0.2s"), "decides every 0.2 s", "--decision-period"),
]  # fmt: skip


def test_what_no_sweep_can_be_is_refused(tmp_path, monkeypatch, subtests):
    monkeypatch.chdir(tmp_path)
    for make, *words in REFUSED:
        with subtests.test(words=words), assert_refused(*words):
            make()
        assert not list(tmp_path.iterdir())
