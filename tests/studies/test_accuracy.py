"""The accuracy study: its sequences, its promises against errors that cancel, and its files."""

import csv
from dataclasses import replace

import numpy as np
import pytest

from seastar_gym import Numerics, Scene
from seastar_gym.accuracy import Certificate
from seastar_gym.accuracy.measure import Errors, Swims, errors, path_lengths, rounded_up
from seastar_gym.accuracy.measure import swim as swim_commands
from seastar_gym.accuracy.setting import at
from seastar_gym.gaits import PAIRS, STRAIGHT
from seastar_gym.scene.numerics import PRESETS, Resolution
from studies.accuracy import rows as accuracy_rows
from studies.accuracy import study as accuracy
from studies.accuracy import tables as accuracy_tables
from studies.accuracy.cases import (
    SLOW,
    Cases,
    gaits,
    pentagon,
    random_gaits,
    random_sequences,
    slow_sequences,
    swims,
    symmetric_form,
)
from studies.accuracy.rows import Figures, Row, medians
from studies.accuracy.settings import MILLI, Plan, settings
from studies.frame import rounded

TINY = Plan(
    n_random=2, n_slow=1, n_gaits=1, side=(1, 0), limit=(13, 5 * MILLI), fine=5 * MILLI, opinion=(4, 5 * MILLI),
    meshes=(("continuum", 10), ("chapter", 4)), shortest=10 * MILLI, rounds=1,
)  # fmt: skip
KINDS = ("path", "straight", "pair", "pentagon", "random", "slow", "gait", "heading", "end")


def ten(numerics: Numerics) -> Scene:
    return at(Scene(), Resolution("chapter", 10, numerics))


def swim(cases: Cases, scene: Scene) -> Swims:
    return swim_commands(scene, cases.commands)


def same(error: float) -> Figures:
    return Figures(*[error] * len(KINDS), "{1-,2+}", "+0-00")


def row(
    scheme="sdirk2", step=0.01, tolerance=1e-8, path_tolerance=None, space=0.1, time=0.01, speed=1000.0, nodes=10,
    discretisation="continuum",
) -> Row:  # fmt: skip
    numerics = Numerics(scheme, step, tolerance, path_tolerance=path_tolerance)
    costs = {"iterations": 100.0, "steps": 50.0, "rejections": 0, "halvings": 0, "speed": speed}
    return Row(Resolution(discretisation, nodes, numerics), same(space), same(time), **costs)


# Cases


def test_gaits_are_every_command_up_to_turns_and_mirrors():
    """Burnside: 243 commands make 30 kinds, of which rest, all limbs alike and the four pairs are left out."""
    found = gaits()
    assert len(found) == 30 - 2 - 4
    forms = {symmetric_form(command) for command in found.commands[0]}
    assert len(forms) == len(found)
    assert not forms & {symmetric_form(command) for command in PAIRS.values()}
    assert set(found.names[0]) <= set("+-0")


def test_commands_of_one_kind_swim_the_same_distance_and_others_do_not():
    turned, mirrored = np.roll(PAIRS["{1-,4+}"], 2), -PAIRS["{1-,4+}"][[0, 4, 3, 2, 1]]
    assert symmetric_form(turned) == symmetric_form(mirrored) == symmetric_form(PAIRS["{1-,4+}"])
    commands = np.array([PAIRS["{1-,4+}"], turned, mirrored, PAIRS["{1-,5+}"]])
    cases = Cases(tuple("abcd"), ("gait",) * 4, np.repeat(commands[None], 2, axis=0))
    distance = np.hypot(*swim(cases, ten(Numerics("implicit-midpoint", 2e-3))).hub[-1].T)
    np.testing.assert_allclose(distance[:3], distance[0], rtol=1e-7)
    assert abs(distance[3] / distance[0] - 1.0) > 1e-3


def test_pentagon_swims_the_sides_of_the_chapter():
    commands = pentagon(2, 1).commands[:, 0]
    assert len(commands) == 15
    np.testing.assert_array_equal(commands[:2], [STRAIGHT, STRAIGHT])
    assert not commands[2::3].any()
    heated = [tuple(np.flatnonzero(side) + 1) for side in commands[::3]]
    assert heated == [(2, 5), (1, 3), (2, 4), (3, 5), (1, 4)]  # (13.15)


def test_random_sequences_are_reproducible_and_half_of_them_are_actions_of_the_environment():
    commands = random_sequences(6, np.random.default_rng(3)).commands
    np.testing.assert_array_equal(commands, random_sequences(6, np.random.default_rng(3)).commands)
    whole = np.isin(commands, (-1.0, 0.0, 1.0)).all(axis=(0, 2))
    assert whole.tolist() == [True, False] * 3
    assert np.abs(commands).max() <= 1.0


def test_slow_swims_are_a_tenth_of_random_ones_and_gaits_repeat():
    slow = slow_sequences(4, np.random.default_rng(2)).commands
    np.testing.assert_array_equal(slow, SLOW * random_sequences(4, np.random.default_rng(2)).commands)
    found = random_gaits(3, np.random.default_rng(2))
    assert found.kinds == ("gait",) * 3 + ("slow",) * 3 + ("gait",) * 3
    once, slow, alternating = np.split(found.commands, 3, axis=1)
    assert (once == once[0]).all() and (alternating == np.tile(alternating[:2], (5, 1, 1))).all()
    np.testing.assert_array_equal(slow, SLOW * once)
    assert np.isin(alternating[:, ::2], (-1.0, 0.0, 1.0)).all()


# Errors


def test_figures_leave_gaits_and_slow_swims_out_of_the_path_error():
    cases = Cases(("a", "b", "c", "d"), ("straight", "random", "gait", "slow"), np.zeros((1, 4, 5)))
    path = np.array([0.1, 0.2, 0.3, 0.4])
    found = accuracy_rows.figures([cases], [Errors(path, 0.5 * path, np.radians(path))])
    assert (found.path, found.worst, found.straight, found.random) == (0.2, "b", 0.1, 0.2)
    assert (found.gait, found.worst_gait, found.slow, found.pair) == (0.3, "c", 0.4, 0.0)
    assert (found.heading, found.end) == (pytest.approx(0.2), 0.1)


@pytest.mark.slow
def test_limit_is_that_of_the_continuum():
    """34.360 mm after ten strokes straight on, 28.189, 34.360, 39.355 and 32.282 mm of the pairs, to 1e-4."""
    found = swim(swims(), at(Scene(), accuracy.tight(*Plan().limit)))
    distances = np.hypot(*found.hub[-1].T)
    np.testing.assert_allclose(1e3 * distances, [34.360, 28.189, 34.360, 39.355, 32.282], rtol=1e-4)


@pytest.mark.slow
def test_two_schemes_of_different_kind_agree_on_the_converged_straight_swim():
    """38.4133 mm after ten strokes and 4.91276 mm after one in the chapter's discretisation, to 1e-5."""
    straight = swims().first(1)
    sdirk3 = swim(straight, ten(Numerics("sdirk3", 0.02 * MILLI, 1e-12)))
    midpoint = swim(straight, ten(Numerics("implicit-midpoint", 0.01 * MILLI, 1e-12)))
    assert errors(midpoint, sdirk3, path_lengths(Scene(), sdirk3.hub)).path[0] < 1e-5
    for found in (sdirk3, midpoint):
        assert found.hub[0, 0, 0] == pytest.approx(4.91276e-3, rel=1e-5)
        assert found.hub[-1, 0, 0] == pytest.approx(38.4133e-3, rel=1e-5)


# Promises


def test_a_promise_is_the_sum_of_space_and_time_with_a_margin_for_gaits_that_were_not_measured():
    (only,) = accuracy_rows.promised([row(space=0.1, time=0.02)])
    assert only.total("path") == only.promise("path") == pytest.approx(0.12)
    assert only.promise("gait") == only.promise("slow") == pytest.approx(1.5 * only.total("gait"))


def promised_times(rows: list[Row]) -> list[float]:
    return [each.sure_time.gait for each in accuracy_rows.promised(rows)]


def test_a_promised_error_of_time_is_the_worst_of_all_settings_that_are_no_coarser():
    rows = [
        row(step=0.02, time=0.02),
        row(step=0.01, time=0.03),
        row(step=0.005, time=0.01),
        row(step=0.02, tolerance=1e-6, time=0.01),
        row(step=0.005, tolerance=1e-4, time=0.5),
        row("sdirk3", step=0.005, time=0.7),
        row(step=0.001, time=0.9, nodes=19),
        row(step=0.001, time=0.9, discretisation="chapter"),
    ]
    assert promised_times(rows)[:6] == [0.03, 0.03, 0.01, 0.03, 0.5, 0.7]


def test_a_promised_error_of_space_is_the_worst_of_as_many_nodes_and_more():
    rows = [row(nodes=n, space=e) for n, e in ((6, 0.02), (10, 0.001), (19, 0.005))]
    rows.append(row(nodes=37, space=0.3, discretisation="chapter"))
    assert [each.sure_space.path for each in accuracy_rows.promised(rows)] == [0.02, 0.005, 0.005, 0.3]


def test_adapted_steps_are_promised_by_themselves():
    fixed = row("implicit-midpoint", step=0.001, time=0.5)
    tight = row("implicit-midpoint", step=0.005, path_tolerance=0.005, time=0.02)
    loose = row("implicit-midpoint", step=0.005, path_tolerance=0.02, time=0.01)
    assert promised_times([fixed, tight, loose]) == [0.5, 0.02, 0.02]


def test_front_keeps_what_no_other_setting_beats():
    steps = ((1, 0.1, 9e3), (2, 0.2, 8e3), (3, 0.05, 7e3), (4, 0.05, 6e3))
    rows = [row(step=s, time=e, space=0.0, speed=v) for s, e, v in steps]
    best = accuracy_rows.front(rows, lambda each: each.total("path"), lambda each: each.speed)
    assert [each.resolution.numerics.step for each in best] == [1, 3]
    failed = [row(time=np.inf)]
    assert accuracy_rows.front(failed, lambda each: each.total("path"), lambda each: each.speed) == []


def test_every_mesh_has_a_front_of_its_own():
    fast, dear = row(nodes=7, space=0.01, speed=9e3), row(nodes=19, space=0.02, speed=1e3)
    assert [each.resolution for each in accuracy_rows.fronts(accuracy_rows.promised([dear, fast]))] == [
        fast.resolution, dear.resolution,
    ]  # fmt: skip


@pytest.mark.parametrize(
    "value, nearest, up", [(0.04912, 0.049, 0.05), (17_432.0, 17_000.0, 18_000.0), (0.03, 0.03, 0.03), (0.0, 0.0, 0.0)]
)
def test_stored_figures_have_two_digits_and_errors_are_rounded_upwards(value, nearest, up):
    assert rounded(value, 2) == nearest
    assert rounded_up(value) == up


# The study


@pytest.fixture(scope="module")
def found():
    return accuracy.study(TINY)


def test_study_measures_every_setting_in_time_and_space(found):
    assert [each.resolution for each in found.rows] == settings(TINY)
    assert {("continuum", 10), ("chapter", 4)} <= {each.mesh for each in found.rows}
    for each in found.rows:
        assert 0.0 < each.time.path < 1.0 and 0.0 <= each.space.path < 1.0
        assert each.speed > 0.0 and each.straight_speed > 0.0
        for part in (each.space, each.time):
            assert part.path == max(part.straight, part.pair, part.pentagon, part.random)
        assert each.promise("path") >= each.total("path") and each.promise("gait") >= each.total("gait")


def test_study_knows_its_limit_and_the_doubt_about_it(found):
    assert found.distances["straight"] == pytest.approx(34.36e-3, rel=0.01)
    assert list(found.distances) == ["straight", *PAIRS]
    assert len(found.doubt) == 3 and all(0.0 < each.path < 0.2 for each in found.doubt.values())


def test_presets_and_the_chapters_steps_are_among_the_settings():
    measured = settings(Plan())
    chapter = {Resolution("chapter", 10, Numerics("implicit-euler", 20 * MILLI, 1e-6))}
    assert {*PRESETS.values()} | chapter <= set(measured)
    assert len(measured) == len(set(measured))


def test_tables_and_csv_are_written(found, tmp_path):
    accuracy_tables.write_csv(found, tmp_path / "a.csv")
    rows = list(csv.DictReader((tmp_path / "a.csv").read_text().splitlines()))
    assert len(rows) == len(found.rows)
    some = {"scheme", "step_s", "nodes_per_limb", "space_path", "time_gait", "promise_heading_deg", "speed"}
    assert some <= set(rows[0])
    assert float(rows[0]["time_path"]) == pytest.approx(found.rows[0].time.path, rel=1e-4)
    assert float(rows[0]["promise_path"]) == pytest.approx(found.rows[0].promise("path"), rel=1e-4)
    lines = accuracy_tables.as_markdown(found).splitlines()
    assert all(line.count("|") == len(accuracy_tables.COLUMNS) + 1 for line in lines if line.startswith("|"))
    for name in PRESETS:
        assert any(line.startswith(f"| {name} |") for line in lines)
    assert sum(line.startswith("| ") for line in lines) == 1 + len(accuracy_tables.summary(found))


def test_pictures_are_drawn(found, tmp_path):
    from studies.accuracy import pictures as accuracy_pictures

    for path in accuracy_pictures.draw_all(found, tmp_path):
        assert 20_000 < path.stat().st_size < 250_000


def test_what_is_stored_can_be_promised(found, tmp_path):
    sure = replace(found, doubt=dict.fromkeys(found.doubt, same(1e-6)))
    accuracy_tables.store(sure, tmp_path / "strokes.json")
    stored = Certificate.load(tmp_path / "strokes.json")
    assert [each.resolution for each in stored.settings[: len(PRESETS)]] == list(PRESETS.values())
    assert stored.limit_error >= stored.settings[3].space_error / 3.0
    by_resolution = {each.resolution: each for each in found.rows}
    for kept in stored.settings:
        measured = by_resolution[kept.resolution]
        path_error = kept.errors["random"]
        assert measured.total("path") <= path_error * (1 + 1e-5)
        assert path_error <= 1.11 * measured.promise("path") + 1e-12
        assert path_error == pytest.approx(kept.space_error + kept.time_error, rel=1e-5)
        assert measured.typical.random <= kept.typical["random"] <= 1.11 * path_error
        assert measured.typical.gait <= kept.typical["repeated"] <= kept.errors["repeated"]
    speeds = [each.speed for each in stored.settings[len(PRESETS) :]]
    assert speeds == sorted(speeds, reverse=True)


def test_medians_are_of_the_sum_of_both_errors():
    cases = Cases(("a", "b", "c", "d"), ("random", "random", "random", "gait"), np.zeros((1, 4, 5)))
    paths = np.array([1.0, 5.0, 2.0, 7.0]), np.array([9.0, 1.0, 2.0, 1.0])
    space, time = (Errors(path, np.zeros(4), np.zeros(4)) for path in paths)
    found = medians([cases], [space], [time])
    assert (found.random, found.gait) == (6.0, 8.0) and np.isnan(found.slow)


def test_a_study_whose_limit_is_in_doubt_is_not_stored(found, tmp_path):
    doubtful = replace(found, doubt={"space, from 37 and 73 nodes": same(4e-4)})
    with pytest.raises(ValueError, match=r"in doubt by 4.0e-04 of the path \(space.*nothing is stored"):
        accuracy_tables.store(doubtful, tmp_path / "strokes.json")
    assert not (tmp_path / "strokes.json").exists()


def test_quick_studies_cannot_be_stored():
    with pytest.raises(ValueError, match="--store needs the whole study"):
        accuracy.Options(quick=True, store=True)
