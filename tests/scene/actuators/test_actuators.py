"""Actuators other than the pulse, and weak limbs: what they do to a limb."""

import numpy as np
import pytest

from own_actuators import Remembering, Triangle
from refusals import assert_refused
from seastar_gym import Limited, MeasuredCurve, Numerics, Scene, Simulator, SmaPulse
from seastar_gym.scene.actuators.base import Actuator, complete

NUMERICS = Numerics("implicit-midpoint", 0.01)
SAMPLED_PULSE = MeasuredCurve((0.0, 0.1, 1.0), (0.0, np.pi / 5, 0.0))
COMMANDS = np.random.default_rng(0).integers(-1, 2, (4, 3, 5)).astype(float)


def swim(scene: Scene, commands=COMMANDS) -> Simulator:
    simulator = Simulator(scene, len(commands[0]))
    for command in commands:
        assert not simulator.stroke(command).status.any()
    return simulator


# --- measured curves -------------------------------------------------------------------------------------------------


def test_a_measured_curve_that_samples_the_pulse_reproduces_it_to_rounding():
    times = np.linspace(0.0, 1.0, 1001)
    np.testing.assert_allclose(SAMPLED_PULSE.delta_psi(times), SmaPulse().delta_psi(times), atol=1e-15)
    assert SAMPLED_PULSE.corners == SmaPulse().corners and SAMPLED_PULSE.peak_angle == SmaPulse().peak_angle
    curve, pulse = swim(Scene(actuator=SAMPLED_PULSE, numerics=NUMERICS)), swim(Scene(numerics=NUMERICS))
    np.testing.assert_allclose(curve.positions, pulse.positions, atol=1e-11)


def test_a_measured_curve_is_linear_between_its_samples_and_as_large_as_its_scale():
    curve = MeasuredCurve((0.0, 0.2, 0.6, 0.8), (0.0, 0.3, -0.5, 0.0), scale=1.5)
    np.testing.assert_allclose(curve.delta_psi([0.1, 0.2, 0.4, 0.7]), 1.5 * np.array([0.15, 0.3, -0.1, -0.25]))
    assert (curve.peak_angle, curve.period, curve.corners) == (0.75, 0.8, curve.times)
    each = MeasuredCurve(curve.times, curve.angles, scale=np.array([1.0, 2.0]))
    np.testing.assert_allclose(each.delta_psi([[0.2, 0.6]]), [[[0.3, 0.6], [-0.5, -1.0]]])


@pytest.mark.parametrize("head", ["", "phase,angle\n"])
def test_curves_are_read_from_csv(tmp_path, head):
    """Of angles, or of curvatures, which bend a limb by their change times its length."""
    file = tmp_path / "curve.csv"
    file.write_text(head + "0.0,0.0\n0.1,0.6\n\n1.0,0.0\n")
    assert MeasuredCurve.from_csv(file) == MeasuredCurve((0.0, 0.1, 1.0), (0.0, 0.6, 0.0))
    for last in ("", "1.0,121.0\n"):
        file.write_text(head + "0.0,120.0\n0.25,40.0\n0.5,80.0\n" + last)
        curve = MeasuredCurve.from_curvatures(file, period=2.0, limb_length=0.03)
        assert curve.times == (0.0, 0.5, 1.0, 2.0)
        np.testing.assert_allclose(curve.angles, (0.0, -2.4, -1.2, 0.0), rtol=1e-14)


BENCH = np.linspace(0.0, 1.0, 1001)
SQUARE = 0.6 * np.sin(np.pi * BENCH) ** 2


def bench(head, times, angles, separator=",", decimal="."):
    pairs = zip(times.tolist(), angles.tolist(), strict=True)
    rows = (f"{t!r}{separator}{a!r}".replace(".", decimal) for t, a in pairs)
    return "\n".join([head, *rows]) + "\n"


@pytest.mark.parametrize(
    ("text", "options"),
    [
        (bench("time,angle", BENCH, SQUARE), {}),  # which ends at 9e-33
        (bench("time (ms),angle (deg)", 1e3 * BENCH, np.degrees(SQUARE)), {}),
        (bench("t [s];Winkel [°]", BENCH, np.degrees(SQUARE), ";", ","), {}),
        (bench("angle_deg,time_s", np.degrees(SQUARE), BENCH), {}),
        (bench("angle,time", SQUARE, BENCH), {}),
        (bench("time,angle", BENCH + 12.5, SQUARE), {}),
        (bench("time,angle", BENCH, SQUARE + 2e-4 * np.sign(BENCH - 0.5)), {}),
        (bench("time,angle", BENCH, SQUARE + 0.03 + 0.05 * BENCH), {"detrend": True}),
        (bench("time,angle", BENCH, SQUARE), {"thin": 0.005}),
    ],
)
def test_a_curve_from_a_bench_is_taken_in_its_own_units(tmp_path, text, options):
    (tmp_path / "curve.csv").write_text(text, encoding="utf-8-sig")
    curve = MeasuredCurve.from_csv(tmp_path / "curve.csv", **options)
    assert curve.period == pytest.approx(1.0) and curve.angles[0] == curve.angles[-1] == 0.0
    assert np.abs(curve.delta_psi(BENCH) - SQUARE).max() <= max(options.get("thin", 0.0), 3e-4)
    assert (len(curve.times) < 40) == ("thin" in options)


def of_curvatures(file):
    return MeasuredCurve.from_curvatures(file, 1.0, 0.03)


@pytest.mark.parametrize(
    "read, text, words",
    [
        *((MeasuredCurve.from_csv, text, "") for text in ("0,0\n1,0,0\n", "0,0\n0.5\n", "time,angle\n", "0,O\n", "")),
        (MeasuredCurve.from_csv, "0,0\n1,1\n", ": A measured curve must begin and end at 0"),
        (MeasuredCurve.from_csv, "time (h),angle (deg)\n0,0\n1,0\n", ": time (h) must be in s, ms"),
        (MeasuredCurve.from_csv, "a (s),b (ms)\n0,0\n1,0\n", ": one column must be a time and one an angle"),
        *((of_curvatures, text, "") for text in ("0.1,1\n0.5,2\n", "0,1\n0.5,2\n0.4,3\n", "0,1\n1.5,2\n", "0,1,2\n")),
    ],
)
def test_files_of_no_curve_are_refused_by_their_names(tmp_path, read, text, words):
    file = tmp_path / "curve.csv"
    with pytest.raises(FileNotFoundError, match=r"^There is no measured curve at .*curve\.csv: .*\.$"):
        MeasuredCurve.from_csv(file)
    file.write_text(text)
    with assert_refused(f"{file}{words}"):
        read(file)


# --- limits ----------------------------------------------------------------------------------------------------------


def test_a_limited_limb_turns_as_far_and_as_fast_as_it_may_to_either_side_from_wherever_it_is():
    actuator, t = Limited(SmaPulse(), largest_angle=0.4, largest_rate=2.0), np.linspace(0.0, 1.0, 101)
    commands, state = np.array([[1.0, -1.0, 0.3, -0.3]]), np.array([[[0.1], [-0.1], [-0.2], [0.2]]])
    turned, after = actuator.respond(t, commands, state)
    np.testing.assert_array_equal(turned[..., 1::2], -turned[..., ::2])
    np.testing.assert_array_equal(turned[0, 0], state[0, :, 0])
    np.testing.assert_array_equal(after[..., 0], turned[-1])
    np.testing.assert_allclose([turned.max(), turned.min()], [0.4, -0.4])
    steps = np.diff(turned, axis=0)
    np.testing.assert_allclose([steps.max(), steps.min()], [2.0 * 0.01, -2.0 * 0.01])
    np.testing.assert_allclose(actuator.observe(state)[0, :, 0], [0.25, -0.25, -0.5, 0.5])
    np.testing.assert_allclose(actuator.delta_psi(t[[0, 10, 30]]), [0.0, 0.2, 0.4])  # 0.1 s at 2 rad/s
    half, _ = actuator.respond(np.linspace(0.0, 1.0, 1001), np.full((), 0.5), np.zeros(1))
    meeting = (np.pi / 10 / 0.9) / (2.0 + np.pi / 10 / 0.9)  # [s], where 2 t meets half the falling pulse
    assert half.max() == pytest.approx(2.0 * meeting, rel=0.01)


# --- any actuator ----------------------------------------------------------------------------------------------------


def test_a_scene_takes_any_actuator_that_says_what_it_does():
    assert isinstance(Triangle(), Actuator) and not complete(Triangle()).has_memory
    found = swim(Scene(actuator=Triangle(), numerics=NUMERICS))
    expected = swim(Scene(actuator=MeasuredCurve(Triangle.corners, (0.0, 0.3, 0.0)), numerics=NUMERICS))
    assert found.positions.tobytes() == expected.positions.tobytes()


def test_what_an_actuator_of_ones_own_says_is_heeded():
    says = {"mirror": ((0, -1),), "heating_power": 2.0, "seconds_heated": lambda self, t, c, s: np.full(c.shape, t[-1])}
    simulator = Simulator(Scene(actuator=type("Saying", (Remembering,), says)(), numerics=NUMERICS), 2)
    assert complete(simulator.scene.actuator).mirror == ((0, -1),)
    np.testing.assert_allclose(simulator.stroke(np.ones((2, 5))).energy, 2.0 * 5 * 0.6)
