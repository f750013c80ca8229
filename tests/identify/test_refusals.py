"""What cannot be measured, simulated or fitted is refused in one sentence."""

from dataclasses import replace

import numpy as np
import pytest

from refusals import assert_refused
from seastar_gym import Body, Limb, MeasuredCurve, Numerics, Scene, Seastar, Water
from seastar_gym.identify import Measurement, get_parameter, identify, synthetic, trajectory, with_parameters
from seastar_gym.identify.measurement import ARM, ORIENTATION
from seastar_gym.identify.search import Residuals

SCENE = Scene(Seastar(nodes_per_limb=4), numerics=Numerics("implicit-midpoint", 0.02, newton_tolerance=1e-6))
TRUTH = {"actuator.peak_angle": 0.5, "fluid.drag_coefficient": 1.2}
COMMANDS = np.array([[0.0, 1.0, 0.0, 0.0, -1.0]] * 3)
ONE = Measurement(np.zeros(1), np.full((1, 1, 2), 1000.0), (0,), np.zeros((1, 5)))
TWO = replace(ONE, positions=np.zeros((1, 1, 2)), nodes=(15,))


@pytest.fixture(scope="module")
def measured():
    """Pictures at 30 Hz, with 1 mm of noise."""
    return synthetic(SCENE, TRUTH, n_strokes=3, rate=30.0)


def fitted(names=tuple(TRUTH), scene=SCENE, **changes):
    """Fit of a measurement of which something was changed."""
    return lambda measured: identify(scene, list(names), replace(measured, **changes))


def late(delay):
    return lambda _: identify(SCENE, list(TRUTH), synthetic(SCENE, TRUTH, 3, 30.0, delay=delay), largest_delay=0.2)


def swum(**arguments):
    whole = {"time": [0.0, 0.0, 1.0], "nodes": (15,), "commands": np.zeros((1, 5)), "scene": SCENE}
    return lambda measured: trajectory(**whole | arguments)


def seen(**changes):
    return lambda measured: replace(ONE, **changes)


def called(function, *given, **more):
    return lambda measured: function(*given, **more)


BENT = Scene(Seastar(body=Body(radius=0.02), limbs=(Limb(),) * 5),
             actuator=MeasuredCurve((0.0, 0.1, 1.0), (0.0, 0.5, 0.0)))  # fmt: skip
NO_NUMBER = ("robot.n_limbs", "robot.nodes_per_limb", "fluid.colour", "drag", "actuator.angles.3",
             "actuator.peak_angle", "fluid", "numerics.step", "robot.hub_hinge", "contact.modulus")  # fmt: skip
BOTH_DRAGS = ["fluid.drag_coefficient", "fluid.tangential_drag_coefficient"]
MEASUREMENTS = [
    (seen(nodes=(-2,)), "nodes must be a tuple of whole numbers"),
    (seen(time=np.zeros(2)), "do not fit the positions"),
    (seen(positions=np.full((1, 1, 2), np.nan)), "do not fit the positions"),
    (seen(positions=np.full((1, 1, 2), 1001.0)), "within 1000 m"),
    (seen(commands=np.zeros((0, 5))), "one row per stroke"),
    (seen(time=np.array([1e308])), "Times must be within 1e+10 s"),
    (seen(command_times=np.array([-1e308])), "command_times must be within 1e+10 s"),
    *((seen(time=np.array([time])), "Times must be finite, not negative, and in order") for time in (np.inf, -1e-9)),
    *((swum(time=time), "time must be a row of times") for time in ([0.1, 0.0], [-0.1, 0.0])),
    (swum(commands=np.zeros((0, 5))), "commands must have shape (n_strokes, 5)"),
    *((swum(nodes=(node,)), "A node must be a whole number from 0 to 15") for node in (-1, 16, ORIENTATION)),
    (swum(time=[0.0, 1.0 + 1e-8]), "beyond the last stroke, which ends at 1 s"),
    (called(synthetic, SCENE, {}, n_strokes=1, rate=2e7), "1 strokes at 2e+07 Hz are more than 10,000,000 times."),
    (called(synthetic, Scene(fluid=None), {"fluid.drag_coefficient": 1.3}),
     "'fluid.drag_coefficient' is no positive number of this scene"),
]  # fmt: skip
FITS = [
    (called(Residuals, SCENE, ("fluid.density", "robot.density"), TWO), "2 coordinates are too few for 2 parameters."),
    *((called(Residuals, SCENE, ("fluid.density",), wrong), "those of a robot of 5 limbs and 16 nodes")
      for wrong in (replace(TWO, nodes=(16,)), replace(TWO, commands=np.zeros((1, 4))))),
    (fitted(commands=np.zeros((3, 4))), "Commands and nodes"),
    (fitted((*TRUTH, *TRUTH)), "named twice"),
    (lambda measured: fitted(time=measured.time + 1.0)(measured), "beyond the last stroke"),
    # Drag along limbs must not exceed that across them, of which the Jacobian tries a smaller one.
    (fitted(BOTH_DRAGS, replace(SCENE, fluid=Water(1000.0, 1.0, 1.0))),
     "A first guess needs room for small changes: tangential_drag_coefficient must not exceed"),
    *((late(delay), "at the end of what was tried: allow a larger one") for delay in (0.4, -0.4)),
    (fitted(command_times=np.array([0.0, 0.5, 2.0])), "With these commands limbs would jump"),
    (called(identify, SCENE, list(TRUTH),
            Measurement(np.arange(3.0), np.zeros((3, 1, 2)) + [ARM, 0.0], (ORIENTATION,), COMMANDS)),
     "An orientation is that of a body"),
    *((called(get_parameter, BENT, name), "no positive number of this scene") for name in NO_NUMBER),
    (called(get_parameter, BENT, "robot.body.drag_coefficient"), "which leaves it out (None): give it a first guess"),
    (called(get_parameter, BENT, "robot.limbs.0.natural_curvature"), "where it is 0: the logarithm is fitted"),
    (called(get_parameter, BENT, "actuator.angles"), "but 3 of them: name one, such as actuator.angles.1"),
    *((called(with_parameters, SCENE, [name], [1.0]), f"'{name}' is no number of this scene")
      for name in ("fluid.nothing", "gravity")),
    *((called(with_parameters, SCENE, ["fluid.density", "robot.density"], values), "values")
      for values in ([1.0], [1.0, np.nan])),
]  # fmt: skip


def test_what_cannot_be_measured_simulated_or_fitted_is_refused(measured, subtests):
    for call, words in (*MEASUREMENTS, *FITS):
        with subtests.test(words), assert_refused(words):
            call(measured)


HEADER, ROW, COMMAND = "time,x0,y0\n", "0,0,0\n", "0,1,0,0,-1\n"
FILES = [
    *((text, COMMAND, "path.csv: the first line must be time,x0,y0") for text in (
        "", "time\n0\n", HEADER, "time,x0\n0,0\n", "t,x0,y0\n0,0,0\n", "time,x0,y1\n0,0,0\n", "time,x²,y²\n0,0,0\n")),
    (HEADER + "0,0\n", COMMAND, "path.csv, line 2: the line must have 3 fields"),
    (HEADER + ROW + ",0,0\n", COMMAND, "path.csv, line 3: there is no time"),
    (HEADER + "1,0,0\n" + ROW, COMMAND, "path.csv, line 3: the clock goes back"),
    (HEADER + ROW + "NaN,0,0\n", COMMAND, "path.csv, line 3: there is no time"),
    (HEADER + "0,1e308,0\n", COMMAND, "path.csv: Positions must be within 1000 m"),
    (HEADER + ROW, "", "commands.csv has no line with one number per limb"),
    (HEADER + ROW, COMMAND + "1\n", "commands.csv, line 2: every line must have one number per limb"),
    *((HEADER + ROW, text, "commands.csv: after time there must be one column per limb")
      for text in ("time\n0\n", "time,a\n")),
    (HEADER + ROW, "time,a,b\n0,1\n", "commands.csv, line 2: the line must have 3 fields"),
    (HEADER + ROW, "time,limb1,limb3\n0,1,1\n", "after time come limbs 1 to 2, each once, not limb1, limb3"),
    (HEADER + ROW, "time,limb1,more\n0,1,1\n", "after time come limbs 1 to 2, each once, not limb1, more"),
    (HEADER + ROW, "Time (s),a\n0,1\n", "commands.csv: the first line must be time,limb1,limb2"),
    (HEADER + ROW, "0,100,0,0,-100\n", "commands.csv: commands are shares of a pulse, from -1 to 1, and one is 100."),
    (HEADER + ROW, "time,a\n0,1\n0,1\n", "command_times must be 2 finite times that increase"),
]  # fmt: skip


def test_a_file_that_cannot_be_read_is_refused_by_its_name(tmp_path, subtests):
    for path, commands, words in FILES:
        (tmp_path / "path.csv").write_text(path, encoding="utf-8")
        (tmp_path / "commands.csv").write_text(commands)
        with subtests.test(path=path, commands=commands), assert_refused(words):
            Measurement.from_csv(tmp_path / "path.csv", tmp_path / "commands.csv")


@pytest.mark.parametrize("names", ["limb2,limb3,limb1", "limb 1,limb 2,limb 0"])
def test_commands_are_of_the_limbs_that_their_names_say(names, tmp_path):
    (tmp_path / "path.csv").write_text(HEADER + ROW + "1,nan,NA\n")
    (tmp_path / "commands.csv").write_text(f"time,{names}\n0,1,0,-1\n")
    found = Measurement.from_csv(tmp_path / "path.csv", tmp_path / "commands.csv")
    assert found.commands.tolist() == [[-1, 1, 0]] and np.isnan(found.positions[1]).all()
