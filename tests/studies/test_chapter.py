"""The chapter's figures show the swims that they name, and its statements stand beside the computed numbers."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

from seastar_gym import Numerics, Scene, Seastar, Simulator, SmaPulse
from seastar_gym.gaits import STRAIGHT, pentagon_gait
from studies import continuum as study
from studies.chapter import pictures, statements, swims
from studies.chapter import study as chapter
from studies.chapter.study import STUDY
from studies.chapter.swims import CHAPTER, swim
from studies.continuum import NAMES, scene
from studies.frame import DOCS, as_json, keep, rounded
from studies.pages import numbers

COARSE = replace(swims.CHAPTER, numerics=Numerics("implicit-euler", 10e-3))
PAIRS = list(statements.PAIRS.values())


def coarser(setting):
    """The setting with steps of 1 ms, if not longer."""
    return replace(setting, numerics=replace(setting.numerics, step=max(1e-3, setting.numerics.step)))


@pytest.fixture(scope="module")
def converged():
    """Settings with the chapter's ten nodes and in the continuum, nearly converged in time."""
    return [coarser(setting) for setting in swims.SETTINGS[1:]]


@pytest.fixture(scope="module")
def straight():
    """Swim of two strokes of the straight swim, with ten samples each."""
    return swims.swim(COARSE, np.tile(STRAIGHT, (2, 1, 1)), 10)


@pytest.fixture(scope="module")
def pentagon():
    return swims.swim(COARSE, pentagon_gait()[:, None], 10)


def values(rows, quantity):
    (found,) = [row.values for row in rows if row.quantity == quantity]
    return found


# Swims


def test_a_swim_is_sampled_at_its_times_and_begins_at_rest(straight):
    np.testing.assert_allclose(straight.time, np.linspace(0.0, 2.0, 21), atol=1e-12)
    np.testing.assert_array_equal(straight.positions[0, 0], COARSE.robot.nodes())
    assert not straight.velocities[0].any()
    assert straight.at(1.3) == 13 and straight.at(1.31) == 14
    np.testing.assert_array_equal(straight.at_strokes(), [0, 10, 20])


def test_a_swim_followed_is_the_swim_of_the_simulator(straight):
    simulator = Simulator(Scene(COARSE.robot, numerics=COARSE.numerics))
    for stroke in range(2):
        simulator.stroke(STRAIGHT[None])
        np.testing.assert_array_equal(straight.hub()[straight.at_strokes()[stroke + 1]], simulator.hub_position()[0])
    np.testing.assert_array_equal(straight.hub_velocity()[-1], simulator.hub_velocity()[0])


def test_limbs_are_blue_while_they_are_turned(straight, pentagon):
    assert straight.actuated(1.1).tolist() == [False, True, False, False, True]
    assert not any(straight.actuated(time).any() for time in (0.0, 1.0, 2.0))  # all rotations are zero at these times
    assert pentagon.actuated(72.1).tolist() == [True, False, True, False, False]
    assert not pentagon.actuated(47.5).any()


def test_settings_are_named_for_what_they_are():
    assert [setting.label for setting in swims.SETTINGS] == [
        "the chapter's setting (implicit Euler, 3 ms)",
        "its ten nodes, converged in time (implicit midpoint, 0.25 ms)",
        "continuum, ten nodes (implicit midpoint, 0.25 ms)",
    ]
    assert [setting.robot.discretisation for setting in swims.SETTINGS] == ["chapter", "chapter", "continuum"]


def test_signals_of_the_pentagon_are_pulses_with_sharp_corners(pentagon):
    time, plus, minus = pictures.signal_curves(pentagon, 0)
    assert time[0] == 0.0 and time[-1] == pytest.approx(250.0)
    assert np.all(np.diff(time) >= -1e-9)
    for rotation, begin in ((-minus, 50.0), (plus, 200.0)):
        np.testing.assert_allclose(time[np.isclose(rotation, np.pi / 5)], begin + 0.1 + np.arange(45))
        assert not rotation[(time < begin) | (time > begin + 45.0)].any()


# What the chapter states


def test_the_straight_swim_goes_forward_long_after_the_heating_and_then_far_back(converged):
    """The chapter states: forward during the actuating phase, slightly backward while cooling. The swim differs."""
    straight = [swims.swim(setting, np.tile(STRAIGHT, (10, 1, 1)), 100) for setting in converged]
    rows = statements.straight_statements(straight)
    names = ("forward while heated, 10th stroke", "forward after that", "backward", "turns back at")
    moves = np.array([values(rows, name) for name in names])
    np.testing.assert_allclose(moves[:, 0], [3.50, 11.11, 10.89, 0.44], atol=0.03)  # with the chapter's ten nodes
    np.testing.assert_allclose(moves[:, 1], [2.87, 11.09, 10.67, 0.44], atol=0.03)  # in the continuum
    assert max(values(rows, "largest |y|")) < 1e-6


def test_a_pentagon_closes_and_its_rests_are_almost_rests(pentagon):
    rows = statements.pentagon_statements([pentagon])
    hub = pentagon.hub()
    (side,) = values(rows, "mean side")
    assert side == pytest.approx(1e3 * np.hypot(*hub[pentagon.at(50.0)]), rel=1e-3)
    assert values(rows, "longest minus shortest side")[0] < 1e-3 * side
    assert values(rows, "end to start")[0] == pytest.approx(1e3 * np.hypot(*hub[-1]))
    coast = np.hypot(*(hub[pentagon.at(50.0)] - hub[pentagon.at(45.0)]))
    assert values(rows, "hub coasts back in the rest")[0] == pytest.approx(1e3 * coast, rel=1e-3)
    assert 0.0 < values(rows, "hub's speed after the rest")[0] < values(rows, "fastest node after the rest")[0] < 10.0


def test_pairs_go_along_their_bisectors_1_4_farthest_and_1_2_least(converged):
    """1 and 5 go farther than 1 and 3 with the chapter's ten nodes only, whatever the time step."""
    settings = [COARSE, *converged]
    rows = statements.pair_statements([swims.swim(each, np.tile(PAIRS, (10, 1, 1)), 1) for each in settings])
    distances = np.array([values(rows, f"distance of {name}") for name in statements.PAIRS]).T
    assert [list(np.argsort(row)) for row in distances[1:]] == [[0, 1, 3, 2], [0, 3, 1, 2]]
    assert max(values(rows, "largest angle off it")) < 1e-6
    assert distances[0, 1] == pytest.approx(36.025, rel=1e-3)  # the straight swim, mirrored
    np.testing.assert_allclose(distances[2], [27.98, 34.36, 39.33, 32.08], atol=0.1)
    np.testing.assert_allclose(
        values(rows, "distance of {1⁻, 3⁺} over that of {1⁻, 5⁺}"), distances[:, 1] / distances[:, 3]
    )


def test_the_committed_limit_of_the_pairs_is_that_of_37_nodes_too():
    """With 73 nodes, to 0.1 %; ten nodes of the same discretisation are up to 0.8 % off."""
    pairs = numbers(DOCS, STUDY)["pairs_mm"]
    few, limit = np.array(pairs[swims.CONTINUUM.label]), np.array(pairs[swims.LIMIT.label])
    np.testing.assert_allclose(limit, [28.19, 34.36, 39.36, 32.29], atol=0.01)
    assert 0.005 < np.abs(few / limit - 1.0).max() < 0.008
    again = swims.Setting("37 nodes", Seastar(nodes_per_limb=37), Numerics("implicit-midpoint", 1e-3))
    found = swims.swim(again, np.tile(PAIRS, (10, 1, 1)), 1)
    np.testing.assert_allclose(next(iter(chapter.distances([found]).values())), limit, rtol=2e-3)


def test_kept_strokes_are_the_first_and_the_last(straight):
    motion = chapter.motions([straight])[straight.label]
    assert set(motion) == {"first", "2th"}
    for name, start in (("first", 0), ("2th", 10)):
        x = 1e3 * straight.hub()[start : start + 11, 0]
        heated, after, back, turn = motion[name]
        assert heated == pytest.approx(x[1] - x[0], rel=1e-3) and back == pytest.approx(x.max() - x[-1], rel=1e-3)
        assert heated + after - back == pytest.approx(x[-1] - x[0], rel=1e-2) and 0.1 < turn < 1.0
    table = chapter.strokes_table({"straight_mm": {straight.label: motion}})
    assert len(table.splitlines()) == 4 and f"| {motion['first'][0]:.1f} |" in table


@pytest.mark.parametrize("robot", [swims.THE_CHAPTERS, Seastar()], ids=["chapter", "continuum"])
def test_newtons_matrix_becomes_indefinite_where_the_chapter_meets_numerical_issues(robot):
    assert not swims.needs_regularisation(Scene(robot, numerics=Numerics("implicit-euler", 10e-3)))
    assert swims.needs_regularisation(Scene(robot, numerics=Numerics("implicit-euler", 20e-3)))


def test_cost_is_measured_for_every_step():
    calls = []
    found = swims.measure_cost(swims.THE_CHAPTERS, np.array([3e-3, 40e-3]), 0.0, lambda: calls.append(1))
    assert len(calls) == 2
    assert found.regularised.tolist() == [False, True]
    assert np.all(found.alone > found.in_batch) and np.all(found.in_batch > 0.0)
    rows = statements.cost_statements([found, found])
    assert values(rows, "real-time factor at 3 ms, one robot alone")[0] == pytest.approx(1.0 / found.alone[0])
    assert values(rows, "smallest h at which Newton's matrix is indefinite")[0] == pytest.approx(40.0)
    never = statements.cost_statements([replace(found, regularised=np.array([False, False]))])
    assert values(never, "smallest h at which Newton's matrix is indefinite") == (np.inf,)


def test_statements_become_a_table_and_a_file(tmp_path):
    Statement = statements.Statement
    rows = [Statement("It moves.", "x", "mm", (1.0, 2.0, 4.0)), Statement("It moves.", "y", "mm", (3.0, 5.0))]
    lines = statements.as_table(rows).splitlines()
    assert len(lines) == 4 and [line[:20] for line in lines[2:]] == ["| It moves. | x | 1 ", "|  | y | 3 mm |  | 5"]
    statements.write_csv(rows, tmp_path / "s.csv")
    written = list(csv.reader((tmp_path / "s.csv").read_text(encoding="utf-8").splitlines()))
    x, y = ["It moves.", "x", "mm", "1.0", "2.0", "4.0", ""], ["It moves.", "y", "mm", "3.0", "", "5.0", ""]
    assert written[1:] == [x, y]


# Pictures


def picture(file):
    from matplotlib.image import imread

    return imread(file)[..., :3]


def pixels_like(image, colour):
    from matplotlib.colors import to_rgb

    return int(np.sum(np.abs(image - to_rgb(colour)).max(axis=-1) < 0.05))


def test_the_pulse_is_drawn_red_and_blue(tmp_path):
    pictures.draw_pulse(SmaPulse(), tmp_path / "b.png")
    image = picture(tmp_path / "b.png")
    assert pixels_like(image, pictures.PLUS) > 500 and pixels_like(image, pictures.MINUS) > 300


def test_snapshots_show_actuated_limbs_in_blue(pentagon, tmp_path):
    pictures.draw_pentagon_snapshots(pentagon, pentagon, tmp_path / "blue.png")
    at_rest = replace(pentagon, commands=np.zeros_like(pentagon.commands))
    pictures.draw_pentagon_snapshots(at_rest, at_rest, tmp_path / "grey.png")
    blue, grey = (pixels_like(picture(tmp_path / f"{name}.png"), pictures.ACTUATED) for name in ("blue", "grey"))
    assert blue > 10 * grey > 0  # the legend's line stays


@pytest.mark.slow
def test_the_study_writes_every_figure(tmp_path, monkeypatch):
    monkeypatch.setattr(chapter, "SETTINGS", tuple(map(coarser, swims.SETTINGS)))
    monkeypatch.setattr(chapter, "LIMIT", coarser(swims.LIMIT))
    monkeypatch.setattr(chapter, "STEPS", np.array([0.3, 1.0, 3.0, 10.0, 20.0, 40.0]) * 1e-3)
    monkeypatch.setattr(chapter, "SECONDS", 0.01)
    rows, found = chapter.make_figures(tmp_path)
    STUDY.write(found, tmp_path)
    names = {"13_2", "13_5b", "13_6", "13_7a", "13_7b", "13_8", "13_9"}
    assert {file.name for file in tmp_path.glob("*.png")} == {f"fig_{name}.png" for name in names}
    for file in tmp_path.glob("*.png"):
        image = picture(file)
        assert image.shape[0] > 450 and image.shape[1] > 700
        assert 0.01 < np.mean(np.any(image < 0.9, axis=-1)) < 0.4
    for name in ("13_2", "13_6", "13_7a", "13_9"):  # the chapter's setting is orange wherever it is shown
        assert pixels_like(picture(tmp_path / f"fig_{name}.png"), pictures.ORANGE) > 200
    distances = {row.quantity: row.values for row in rows if row.quantity.startswith("distance of")}
    for column in range(3):
        assert max(distances, key=lambda name: distances[name][column]) == "distance of {1⁻, 4⁺}"


# Both discretisations tend to the same robot, the chapter's with order 1 and the continuum's with order 2 or more.


@pytest.fixture(scope="module")
def rows():
    return study.measure(("damped", "three limbs", "unequal, tapered limbs", "curved limbs", "soft limbs"))


def test_both_discretisations_tend_to_the_same_robot(rows):
    for row in rows:
        assert (np.diff(row.errors) < 0.0).all(), row
        assert row.errors[-1] < (0.12 if row.discretisation == "chapter" else 1e-3), row


def test_the_table_has_the_rows_of_the_kept_numbers(rows):
    results = json.loads(json.dumps(study.as_data(rows)))
    table = study.table(results)
    for row, kept in zip(rows, study.rows_of(results), strict=True):
        assert kept[:2] == row[:2] and kept.order == pytest.approx(row.order, abs=1e-4)
        np.testing.assert_allclose(kept.errors, row.errors, rtol=1e-3)
        assert f"| {row.name} | " in table and f" {row.order:.1f} |" in table


def test_the_chapters_order_is_one_and_the_continuums_two_or_more(rows):
    orders = {kind: [row.order for row in rows if row.discretisation == kind] for kind in ("chapter", "continuum")}
    assert min(orders["chapter"]) > 0.7 and max(orders["chapter"]) < 1.3
    assert min(orders["continuum"]) > 1.9


def test_ten_nodes_are_within_about_a_per_cent(rows):
    ten = study.NODES.index(10)
    assert max(row.errors[ten] for row in rows if row.discretisation == "continuum") < 0.013


@pytest.mark.slow
def test_every_scene_and_consistent_added_mass_which_is_better_than_lumped():
    rows = study.measure(NAMES)
    errors = {(row.name, row.discretisation): row.errors for row in rows}
    for name in NAMES:
        assert (errors[name, "continuum"] < 0.4 * errors[name, "chapter"]).all(), name
    consistent, lumped = errors["added mass", "continuum"], errors[study.LUMPED, "continuum"]
    assert (consistent < 0.7 * lumped).all()


def test_orders_are_slopes_over_the_edge_length():
    errors = np.array([1.0, 0.1, 0.025, 0.00625])
    assert study.order(errors) == pytest.approx(2.0)


def test_the_picture_is_drawn(rows, tmp_path):
    study.STUDY.write(study.as_data(rows), tmp_path)
    assert (tmp_path / "continuum.png").stat().st_size > 10_000


@pytest.mark.parametrize("name", NAMES)
def test_every_scene_has_the_nodes_and_the_discretisation_asked_for(name):
    robot = scene(name, "chapter", 7).robot
    assert (robot.nodes_per_limb, robot.discretisation) == (7, "chapter")


# Numbers that are kept are read back as they were, and what is drawn from them is what was swum.


PLAIN = {"name": "a [list] of\nlines", "numbers": [1, 2.5, None], "rows": [[1, "two"], []], "inner": {"x": [0.1]}}


def test_json_comes_back_with_a_line_for_every_list_of_numbers(tmp_path):
    keep(PLAIN, tmp_path / "folder" / "kept.json")
    text = (tmp_path / "folder" / "kept.json").read_text(encoding="utf-8")
    assert json.loads(text) == PLAIN
    assert ' "numbers": [1, 2.5, null],\n' in text and '\n  [1, "two"],\n' in text


def test_numbers_that_are_not_finite_are_refused():
    with pytest.raises(ValueError, match="not JSON compliant"):
        as_json({"speed": float("nan")})


def test_numbers_keep_their_significant_digits():
    assert [rounded(each) for each in (123456.0, -0.00123456, 0.0)] == [123500.0, -0.001235, 0.0]


def test_a_swim_of_the_chapter_comes_back():
    commands = chapter.pair_commands()[:2]
    swum = swim(CHAPTER, commands, 10)
    again = chapter.from_data(json.loads(as_json(chapter.as_data(swum, (0.1, 1.5)))), commands)
    assert again.label == swum.label and again.scene == swum.scene
    np.testing.assert_allclose(again.time, swum.time, atol=1e-9)
    np.testing.assert_allclose(again.positions[:, :, 0], swum.positions[:, :, 0], atol=chapter.UNIT)
    for time in (0.1, 1.5):
        at = swum.at(time)
        np.testing.assert_allclose(again.positions[at, 0], swum.positions[at, 0], atol=chapter.UNIT)
    assert np.isnan(again.positions[3, 0, 1:]).all()
