"""A fit ends at the right minimum, or says that it does not; what cannot be a track of the robot is refused."""

import json
from dataclasses import replace

import numpy as np
import pytest

from refusals import assert_refused
from seastar_gym import Scene, Seastar, SmaPulse, Water
from seastar_gym.identify import command as its_command
from seastar_gym.identify import identify, synthetic, with_parameters
from seastar_gym.identify.fit import DOUBT, UNSURE
from seastar_gym.identify.search import noise_of
from slopes import rotated

NAMES = ("fluid.drag_coefficient", "robot.youngs_modulus", "actuator.peak_angle")
TRUE = 1.5, 0.55e6, 0.42
FIRST = 1.1, 0.4e6, 0.52
RINGING = Scene(
    Seastar(3, 7, limb_length=0.08, rod_radius=3e-3, youngs_modulus=FIRST[1], density=1100.0),
    Water(drag_coefficient=FIRST[0], tangential_drag_coefficient=0.1),
    SmaPulse(FIRST[2]),
)
"""Its limbs are stiff, and with a wrong modulus they ring in phase again."""


def track(scene=RINGING, n_strokes=6, noise=1e-3, seed=0, **truth):
    return synthetic(scene, dict(zip(NAMES, TRUE, strict=True)) | truth, n_strokes, noise=noise, seed=seed)


@pytest.mark.parametrize("seed, n_strokes, factor", [(0, 6, 1.0), (1, 10, 1.0), (2, 6, 2.5), (3, 6, 0.5)])
def test_limbs_that_ring_have_their_modulus_found_from_afar(seed, n_strokes, factor):
    scene = with_parameters(RINGING, [NAMES[1]], [FIRST[1] * factor])
    found = identify(scene, NAMES, track(n_strokes=n_strokes, seed=seed))
    assert found.values == pytest.approx(TRUE, rel=0.03) and not found.is_doubted and found.at_end == ()
    assert found.scene.numerics == scene.numerics  # though it was fitted with a smaller tolerance
    assert found.noise == pytest.approx(1e-3, rel=0.15)


@pytest.mark.parametrize("every", [2, 3])
def test_the_noise_of_a_track_with_empty_lines_is_that_of_the_lines_between(every):
    """As of a tracker that looks at every n-th picture."""
    seen = track()
    between = seen.positions[::every].copy()
    seen.positions[np.arange(len(seen.time)) % every > 0] = np.nan
    assert noise_of(seen.positions) == noise_of(between) > 5e-4


def test_an_exact_track_of_a_robot_that_does_not_move_tells_nothing():
    """All limbs turn alike, so its hub stays. A residual of rounding does not make rounding a slope."""
    swum, scene = synthetic(RINGING, dict(zip(NAMES, TRUE, strict=True)), 6, noise=0.0), RINGING
    alike = replace(swum, commands=np.ones_like(swum.commands), nodes=(0,), positions=np.zeros((len(swum.time), 1, 2)))
    found = identify(scene, NAMES, alike)
    assert found.unsure == NAMES
    assert set(found.intervals()) <= {*NAMES, UNSURE} and "Cannot tell" in found.report()


@pytest.mark.parametrize("turn, shift", [(0.0, (0.0, 0.0)), (6e-3, (5e-4, -8e-4)), (-8e-3, (-7e-4, 0.0))])
def test_an_error_of_the_frame_is_no_error_of_the_robot(turn, shift):
    """As of a frame that was taken from one picture with noise; without it, drag and modulus take it up."""
    seen = track()
    c, s = np.cos(turn), np.sin(turn)
    found = identify(RINGING, NAMES, replace(seen, positions=seen.positions @ [[c, s], [-s, c]] + shift))
    assert found.values == pytest.approx(TRUE, rel=0.03) and not found.is_doubted
    assert ((found.lower < TRUE) & (found.upper > TRUE)).all()


def test_points_that_were_taken_for_others_are_left_out():
    seen, rng = track(), np.random.default_rng(0)
    for picture in np.flatnonzero(rng.random(len(seen.time)) < 0.05):
        one, other = rng.choice([1, 2, 3], 2, replace=False)
        seen.positions[picture, [one, other]] = seen.positions[picture, [other, one]]
    found = identify(RINGING, NAMES, seen)
    assert found.values == pytest.approx(TRUE, rel=0.03) and not found.is_doubted and found.left_out > 5
    assert f"{found.left_out} points were left out" in found.report()
    assert np.isnan(found.residuals).any(axis=2).sum() == found.left_out


def test_a_scene_that_lacks_something_is_told_and_its_intervals_are_not_trained_on(tmp_path):
    from agents.run import read_intervals

    seen, some = track(replace(RINGING, limb_strengths=(0.5, 1.0, 1.0)), n_strokes=2), NAMES[::2]
    found = identify(RINGING, some, seen)
    assert found.is_doubted and "the scene lacks something" in found.report()
    picture, node, off = found.farthest
    there = found.residuals[seen.time.tolist().index(picture), seen.nodes.index(node)]
    assert f"node {node} at {picture:.3f} s" in found.report()
    assert np.hypot(*there) == pytest.approx(off) and off > 3.0 * found.noise
    seen.to_csv(tmp_path / "path.csv", tmp_path / "commands.csv")
    (tmp_path / "scene.json").write_text(json.dumps(RINGING.to_dict()))
    file = tmp_path / "intervals.json"
    words = ["--scene", tmp_path / "scene.json", "--intervals", file, "--out", tmp_path / "fitted.json", "--fit", *some]
    assert its_command.main([str(word) for word in (tmp_path / "path.csv", tmp_path / "commands.csv", *words)]) == 0
    assert json.loads(file.read_text())[DOUBT] == pytest.approx(found.ratio, rel=0.2)
    with assert_refused("times the noise of its track", "--intervals-anyway"):
        read_intervals(file)
    assert set(read_intervals(file, anyway=True).distributions) == set(some)
    assert Scene.from_dict(json.loads((tmp_path / "fitted.json").read_text())).numerics == RINGING.numerics


WATER = "fluid.drag_coefficient", "fluid.density"
"""Forces know their product alone."""


def test_intervals_of_what_a_fit_cannot_tell_are_not_trained_on(tmp_path):
    from agents.run import read_intervals

    hub = track(n_strokes=2)
    hub = replace(hub, positions=hub.positions[:, :1], nodes=hub.nodes[:1])
    found, file = identify(with_parameters(RINGING, NAMES, TRUE), WATER, hub), tmp_path / "intervals.json"
    file.write_text(json.dumps(found.intervals(), allow_nan=False))
    with assert_refused(f"cannot tell {', '.join(WATER)}", "--intervals-anyway"):
        read_intervals(file)


@pytest.mark.parametrize(
    "change, words",
    [
        (lambda m: replace(m, positions=1e3 * m.positions[:2], time=m.time[:2]), ["may be in mm."]),
        (lambda m: replace(m, positions=1e2 * m.positions), ["may be in cm."]),
        (lambda m: replace(m, positions=0.5 * m.positions), ["at rest", "Scaled by 0.5"]),
        (lambda m: replace(m, positions=m.positions * [1.0, -1.0]), ["at rest"]),
        (lambda m: replace(m, positions=rotated(m.positions, 0.5)), ["at rest", "Turned by 2"]),
        (lambda m: replace(m, positions=m.positions + [0.03, 0.0]), ["at rest", "Moved by ("]),
        (lambda m: replace(m, positions=m.positions[:, [0, 1, 3, 2]]), ["at rest", "Mirrored"]),
        (lambda m: replace(m, time=1e3 * m.time, command_times=1e3 * np.arange(6.0)), ["40 s apart", "milliseconds"]),
        (lambda m: replace(m, command_times=1e3 * np.arange(6.0)), ["0.04 s apart", "1000 s, for", "milliseconds"]),
        (lambda m: replace(m, time=m.time + 1.7e9, command_times=np.arange(6.0)), ["1.7e+09 s", "of 0 s", "clock."]),
    ],
    ids=["mm", "cm", "scaled", "mirrored", "turned", "moved", "swapped", "milliseconds", "commands", "clocks"],
)
def test_what_is_no_track_of_the_robot_is_refused_with_the_likely_reason(change, words):
    with assert_refused(*words):
        identify(RINGING, NAMES, change(track()))


def test_a_track_that_begins_in_a_stroke_is_refused():
    seen = track(n_strokes=5, noise=3e-4)
    late = seen.time >= 3.1
    cut = replace(seen, time=seen.time[late] - 3.1, positions=seen.positions[late] - seen.positions[late][:1, :1],
                  commands=seen.commands[3:])  # fmt: skip
    with assert_refused("begins at rest"):
        identify(RINGING, NAMES, replace(cut, time=np.minimum(cut.time, 1.9)))
