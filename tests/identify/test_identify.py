"""Parameters are found in data that a known robot made, and what the data cannot tell is said."""

import json
import math
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from drawn import drawn
from later import Later
from seastar_gym import (
    AlongLimb,
    Attachment,
    Body,
    Contact,
    DomainRandomization,
    Limb,
    Limited,
    MeasuredCurve,
    Numerics,
    Scene,
    Seastar,
    SmaLimb,
    SmaPulse,
    Stiffening,
    Strip,
    Uniform,
    Water,
)
from seastar_gym.identify import Measurement, get_parameter, identify, synthetic, trajectory, with_parameters
from seastar_gym.identify import command as its_command
from seastar_gym.identify.command import main
from seastar_gym.identify.measurement import uncertainty_of
from seastar_gym.identify.trajectories import trajectories
from seastar_gym.scene.number import numbers_of
from seastar_gym.scene.scene import load_scene

stats = Later("scipy.stats")

SCENE = Scene(numerics=Numerics("implicit-midpoint", 0.01))
TRUTH = {"fluid.drag_coefficient": 1.3, "robot.youngs_modulus": 1.4e6, "actuator.peak_angle": 0.55}


@pytest.fixture(scope="module")
def measurement():
    return synthetic(SCENE, TRUTH, n_strokes=3)


def test_three_parameters_are_recovered_within_their_intervals_from_data_with_1_mm_of_noise(measurement):
    estimate = identify(SCENE, list(TRUTH), measurement)
    truth = np.array(list(TRUTH.values()))
    assert ((estimate.lower < truth) & (truth < estimate.upper)).all()
    assert (estimate.upper / estimate.lower < 1.2).all() and not estimate.untold
    assert estimate.root_mean_square == pytest.approx(1e-3, rel=0.05)
    assert get_parameter(estimate.scene, "fluid.drag_coefficient") == estimate.values[0]
    np.testing.assert_allclose(np.diag(estimate.correlation), 1.0)
    assert all(name in estimate.report() for name in TRUTH)


def test_the_picture_of_a_fit_has_residuals_in_millimetres(golden, monkeypatch):
    positions = np.arange(12.0).reshape(3, 2, 2) / 7e3
    made = SimpleNamespace(residuals=positions[::-1] / 3.0, root_mean_square=1.234e-3)
    seen = Measurement(np.arange(3.0), positions, (0, 11), np.zeros((3, 5)))
    golden("fit_picture.txt", drawn(monkeypatch, its_command, partial(its_command.draw, made, seen)))


BODY = Body.rectangle(0.06, 0.03, mass=0.03, drag_turning=1.0, attachments=tuple(
    Attachment(x, y, math.atan2(y, x)) for x, y in ((0.03, 0.015), (-0.03, 0.015), (-0.03, -0.015))))  # fmt: skip
STRIPS = Seastar(nodes_per_limb=4, limbs=(Limb(section=Strip(2.5e-3, 4e-3)),) * 5)
CURVE = MeasuredCurve((0.0, 0.1, 0.4, 1.0), (0.0, 0.5, 0.3, 0.0))
RECOVERED = {
    # Its mass, how hard it turns, and the place of a limb, which is no number of each robot.
    "body": (Scene(Seastar(3, 5, body=BODY), numerics=SCENE.numerics),
             {"robot.body.mass": 0.05, "robot.body.drag_turning": 1.5, "robot.body.attachments.0.x": 0.027}, 3, 2e-4),
    # Bending goes with its cube and drag with the width across, so the two are told apart.
    "strips": (Scene(STRIPS, numerics=Numerics("implicit-midpoint", 0.02)),
               {"robot.limbs.2.section.width": 3e-3, "robot.limbs.2.section.height": 5e-3}, 2, 1e-4),
    "curve": (replace(SCENE, actuator=CURVE), {"actuator.angles.1": 0.55, "fluid.drag_coefficient": 1.2}, 2, 0.0),
}  # fmt: skip


@pytest.mark.parametrize("name", [*list(RECOVERED)[1:], pytest.param("body", marks=pytest.mark.slow)])
def test_numbers_of_any_part_are_recovered(name):
    scene, truth, n_strokes, noise = RECOVERED[name]
    estimate = identify(scene, list(truth), synthetic(scene, truth, n_strokes=n_strokes, noise=noise))
    np.testing.assert_allclose(estimate.values, list(truth.values()), rtol=0.05 if noise else 1e-4)
    if noise:
        assert ((estimate.lower < list(truth.values())) & (estimate.upper > list(truth.values()))).all()
        assert not estimate.untold and estimate.root_mean_square == pytest.approx(noise, rel=0.1)
    assert [get_parameter(estimate.scene, each) for each in truth] == estimate.values.tolist()


def test_parameters_that_act_as_a_product_cannot_be_told_apart(measurement):
    names = ["fluid.drag_coefficient", "fluid.density", "actuator.peak_angle"]
    estimate = identify(SCENE, names, measurement)
    assert estimate.untold == (("fluid.drag_coefficient", "fluid.density"),)
    assert "Cannot tell fluid.drag_coefficient and fluid.density apart" in estimate.report()


def test_coordinates_that_were_not_seen_do_not_count(measurement):
    positions = measurement.positions.copy()
    positions[::2, 1:] = np.nan
    partly = Measurement(measurement.time, positions, measurement.nodes, measurement.commands)
    few, all_of_them = (identify(SCENE, ["actuator.peak_angle"], data) for data in (partly, measurement))
    assert few.upper[0] - few.lower[0] > 1.05 * (all_of_them.upper[0] - all_of_them.lower[0])
    assert few.values[0] == pytest.approx(all_of_them.values[0], rel=0.02)


def test_the_command_line_fits_a_scene_of_ones_own_and_writes_it(tmp_path, monkeypatch):
    robot = Seastar(nodes_per_limb=4, n_limbs=3)
    scene = Scene(robot, numerics=Numerics("implicit-midpoint", 0.02, newton_tolerance=1e-6))
    synthetic(scene, {"actuator.peak_angle": 0.5}, n_strokes=1).to_csv(tmp_path / "path.csv", tmp_path / "commands.csv")
    (tmp_path / "mine.json").write_text(json.dumps(scene.to_dict()))
    monkeypatch.chdir(tmp_path)
    command = ["path.csv", "commands.csv", "--scene", "mine.json", "--out", "fitted.json"]
    command += ["--fit", "actuator.peak_angle", "--intervals", "intervals.json", "--picture", "fit.png"]
    assert main(command) == 0
    assert (tmp_path / "fit.png").read_bytes()[16:24] == bytes([0, 0, 4, 176, 0, 0, 1, 248])  # 1200 x 504 pixels
    fitted = load_scene(tmp_path / "fitted.json")
    assert fitted.actuator.peak_angle == pytest.approx(0.5, rel=0.02)
    assert replace(fitted, actuator=scene.actuator) == scene
    low, high = json.loads((tmp_path / "intervals.json").read_text())["actuator.peak_angle"]
    assert low < fitted.actuator.peak_angle < high < 1.1 * low


def test_every_number_of_a_body_on_limbs_that_bend_can_be_fitted_and_drawn():
    """But for those that are the same for all robots of a batch, which can only be fitted."""
    body = Body(radius=0.02, mass=0.02, inertia=4e-6, drag_coefficient=1.0)
    robot = Seastar(nodes_per_limb=5, along=AlongLimb(0.9), stiffening=Stiffening(), body=body)
    scene = Scene(robot, Water(1000.0, 1.0, 0.5, None, 1.0), SmaLimb())
    for name, value in numbers_of(scene).items():
        if value is None:
            continue
        assert get_parameter(with_parameters(scene, [name], [0.99 * value]), name) == 0.99 * value
        assert DomainRandomization({name: Uniform(0.99 * value, value)}).first_values(scene, 2)[name][0] == value
    for name in ("robot.body.radius", "robot.stiffening.middle", "actuator.heating_time", "actuator.delay"):
        value = get_parameter(scene, name)
        assert get_parameter(with_parameters(scene, [name], [0.99 * value]), name) == 0.99 * value
    limited = Scene(actuator=Limited(SmaPulse(), largest_rate=2.0), contact=Contact(modulus=1e5))
    names = ["actuator.largest_rate", "actuator.actuator.peak_angle", "contact.modulus"]
    assert [get_parameter(with_parameters(limited, names, [3.0, 0.5, 2e5]), name) for name in names] == [3.0, 0.5, 2e5]


def test_scenes_side_by_side_move_as_each_would_alone(measurement):
    """Whatever may differ from robot to robot makes one batch; another duration, which may not, makes another."""
    scenes = [
        with_parameters(SCENE, [name], [value])
        for name, value in (("robot.limb_length", 0.09), ("actuator.cooling_time", 1.1), ("actuator.peak_angle", 0.4))
    ]
    for scene, found in zip(scenes, trajectories(scenes, measurement), strict=True):
        alone = trajectory(measurement.time, measurement.nodes, measurement.commands, scene)
        np.testing.assert_array_equal(found, alone)


# Intervals of a fit hold what they promise where residuals depend on each other, and where they do not.


def line(n_pictures: int) -> tuple[np.ndarray, np.ndarray]:
    """Times of pictures of two coordinates, and the derivative of a straight line and an oscillation."""
    times = np.repeat(np.arange(n_pictures) * 0.05, 2)
    return times, np.stack([np.ones_like(times), times, np.sin(3.0 * times)], axis=1)


def coverage(memory: float, n_pictures: int = 400) -> np.ndarray:
    """Share of 200 fits whose 95 % interval has the truth, shape (p,). memory: Of errors, from picture to picture."""
    times, jacobian = line(n_pictures)
    rng, held = np.random.default_rng(0), []
    fit = np.linalg.pinv(jacobian)
    for _ in range(200):
        errors = np.empty((n_pictures, 2))
        errors[0] = rng.normal(size=2)
        for picture in range(1, n_pictures):
            errors[picture] = memory * errors[picture - 1] + np.sqrt(1.0 - memory**2) * rng.normal(size=2)
        wrong = fit @ errors.ravel()
        covariance = uncertainty_of(jacobian, errors.ravel() - jacobian @ wrong, times).covariance
        held.append(np.abs(wrong) < stats.norm.ppf(0.975) * np.sqrt(np.diag(covariance)))
    return np.mean(held, axis=0)


def test_intervals_hold_where_errors_depend_on_those_before_and_where_they_do_not():
    """Errors are remembered for 0.2 s of 20. Intervals of independent errors hold the truth in six of ten fits."""
    assert coverage(0.0).min() > 0.93
    assert coverage(0.8).min() > 0.85


def test_the_command_takes_a_scene_with_its_own_steps_or_those_it_is_given(tmp_path, monkeypatch):
    steps = []

    def fitted(scene, names, measurement, largest_delay):
        steps.append(scene.numerics.step)
        raise ValueError("enough")

    monkeypatch.setattr(its_command, "identify", fitted)
    monkeypatch.setattr(its_command.Measurement, "from_csv", lambda *files: None)
    (tmp_path / "mine.json").write_text(json.dumps(SCENE.to_dict()))
    own = ["a.csv", "b.csv", "--scene", str(tmp_path / "mine.json")]
    for line in (own[:2], own, [*own, "--step", "0.02"]):
        assert main(line) == 2
    assert steps == [0.005, 0.01, 0.02]
