"""The accuracy study: its errors against closed forms, its promises against errors that cancel, and its files."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

from seastar_gym import Numerics
from seastar_gym.gaits import PAIRS, STRAIGHT
from seastar_gym.scene.fidelity import Promise
from seastar_gym.simulator import Simulator
from studies.accuracy import convergence
from studies.accuracy import rows as accuracy_rows
from studies.accuracy import study as accuracy
from studies.accuracy import tables as accuracy_tables
from studies.accuracy.cases import (
    Cases,
    Swim,
    errors,
    gaits,
    hub_path_lengths,
    joined,
    pentagon,
    random_sequences,
    scene_of,
    swim,
    swims,
    symmetric_form,
)
from studies.accuracy.rows import Row
from studies.accuracy.settings import MS, Plan

TINY = Plan(
    n_random=2, side=(1, 0), converged=(("sdirk3", 1 * MS), ("implicit-midpoint", 0.5 * MS)), shortest=10 * MS,
    tolerances=(1e-6, 1e-8), nodes=(4,), fine=2 * MS, coarse_nodes=(), n_fine=3, n_spatial=6, rounds=1,
)  # fmt: skip


def row(scheme="sdirk2", step=0.01, tolerance=1e-8, path_tolerance=None, error=0.01, speed=1000.0, **others) -> Row:
    numerics = Numerics(scheme, step, tolerance, path_tolerance=path_tolerance)
    figures = dict.fromkeys(("straight", "pair", "pentagon", "random", "median", "gait", "heading", "end"), error)
    costs = {"iterations": 100.0, "steps": 50.0, "rejections": 0, "halvings": 0, "speed": speed}
    return Row(numerics, 10, path=error, worst="{1-,2+}", **figures, **costs, **others)


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
    distance = np.hypot(*swim(cases, Numerics("implicit-midpoint", 2e-3)).hub[-1].T)
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


# Errors


def swum(hub, heading=None) -> Swim:
    hub = np.asarray(hub, float)
    return Swim(hub, np.zeros(hub.shape[:2]) if heading is None else np.asarray(heading, float), 1.0, 1.0, 0, 0, 0)


def test_path_error_is_the_largest_distance_over_the_length_of_the_converged_path():
    exact = swum([[[3.0, 4.0]], [[3.0, 9.0]]])
    assert hub_path_lengths(exact.hub) == pytest.approx([10.0])
    off = errors(swum([[[3.0, 4.5]], [[3.0, 9.1]]]), exact)
    assert off.path == pytest.approx([0.05]) and off.end == pytest.approx([0.01])


def test_heading_error_knows_that_a_turn_is_a_turn():
    hub = [[[1.0, 0.0]]]
    assert errors(swum(hub, [[3.1]]), swum(hub, [[-3.1]])).heading == pytest.approx([2.0 * np.pi - 6.2])


def test_a_failed_robot_makes_every_error_infinite():
    hub = [[[1.0, 0.0]]]
    assert np.isinf(np.array(errors(swum(hub)._replace(failed=1), swum(hub)))).all()


def test_heading_is_what_a_robot_was_turned_by():
    simulator = Simulator(scene_of(Numerics()), 3)
    simulator.reset(heading=[0.0, 0.4, -2.5])
    np.testing.assert_allclose(simulator.heading(), [0.0, 0.4, -2.5], atol=1e-12)


def test_groups_swim_as_the_whole_batch_does():
    cases = joined(swims(), random_sequences(7, np.random.default_rng(5)))
    numerics = Numerics("sdirk2", 20 * MS)
    whole, groups = swim(cases, numerics), convergence.in_groups(cases)
    assert [len(group) for group in groups] == [8, 4]
    parts = convergence.together([swim(group, numerics) for group in groups])
    np.testing.assert_array_equal(parts.hub, whole.hub)
    assert parts.iterations == pytest.approx(whole.iterations)
    assert parts.steps == pytest.approx(whole.steps) == 50.0


def test_extrapolation_is_exact_for_errors_of_first_and_second_order():
    limit = np.array([[1.0, -2.0]])
    paths = [limit + 0.3 / edges + 5.0 / edges**2 for edges in (9, 18, 36, 72)]
    np.testing.assert_allclose(convergence.extrapolated(paths), limit, rtol=1e-13)


@pytest.mark.slow
def test_two_schemes_of_different_kind_agree_on_the_converged_straight_swim():
    """38.4133 mm after ten strokes and 4.91276 mm after one, to 1e-5."""
    straight = swims().first(1)
    sdirk3 = swim(straight, Numerics("sdirk3", 0.02 * MS, convergence.TIGHT))
    midpoint = swim(straight, Numerics("implicit-midpoint", 0.01 * MS, convergence.TIGHT))
    assert errors(midpoint, sdirk3).path[0] < 1e-5
    for found in (sdirk3, midpoint):
        assert found.hub[0, 0, 0] == pytest.approx(4.91276e-3, rel=1e-5)
        assert found.hub[-1, 0, 0] == pytest.approx(38.4133e-3, rel=1e-5)


# Promises


def test_a_promise_is_the_worst_of_all_settings_that_are_no_coarser():
    rows = [
        row(step=0.02, error=0.02),
        row(step=0.01, error=0.03),
        row(step=0.005, error=0.01),
        row(step=0.02, tolerance=1e-6, error=0.01),
        row(step=0.005, tolerance=1e-4, error=0.5),
        row("sdirk3", step=0.005, error=0.7),
    ]
    assert [each.path_promise for each in accuracy_rows.promised(rows)] == [0.03, 0.03, 0.01, 0.03, 0.5, 0.7]


def test_adapted_steps_are_promised_by_themselves():
    fixed = row("implicit-midpoint", step=0.001, error=0.5)
    tight = row("implicit-midpoint", step=0.005, path_tolerance=0.005, error=0.02)
    loose = row("implicit-midpoint", step=0.005, path_tolerance=0.02, error=0.01)
    assert [each.path_promise for each in accuracy_rows.promised([fixed, tight, loose])] == [0.5, 0.02, 0.02]


def test_front_keeps_what_no_other_setting_beats():
    rows = [row(step=s, error=e, speed=v) for s, e, v in ((1, 0.1, 9e3), (2, 0.2, 8e3), (3, 0.05, 7e3), (4, 0.05, 6e3))]
    best = accuracy_rows.front(rows, lambda each: each.path, lambda each: each.speed)
    assert [each.numerics.step for each in best] == [1, 3]
    assert accuracy_rows.front([row(error=np.inf)], lambda each: each.path, lambda each: each.speed) == []


@pytest.mark.parametrize(
    "value, rounded, up", [(0.04912, 0.049, 0.05), (17_432.0, 17_000.0, 18_000.0), (0.03, 0.03, 0.03), (0.0, 0.0, 0.0)]
)
def test_stored_figures_have_two_digits_and_errors_are_rounded_upwards(value, rounded, up):
    assert accuracy_tables.two_digits(value) == rounded
    assert accuracy_tables.two_digits(value, up=True) == up


# The study


@pytest.fixture(scope="module")
def found():
    return accuracy.study(TINY, progress=False)


def test_study_measures_every_setting_in_time_and_space(found):
    own = [each for each in found.rows if each.nodes_per_limb == 10]
    assert [each.numerics for each in own] == accuracy.settings(TINY)
    assert {each.nodes_per_limb for each in found.rows} == {10, 4}
    for each in found.rows:
        assert 0.0 < each.path < 0.5 and 0.0 < each.spatial < 1.0 and each.speed > 0.0 and each.straight_speed > 0.0
        assert each.path == max(each.straight, each.pair, each.pentagon, each.random)
    assert all(each.path_promise >= each.path for each in own)


def test_study_finds_the_converged_straight_swim_and_that_finer_limbs_converge(found):
    assert found.straight[-1] == pytest.approx(38.41e-3, rel=5e-3)
    assert 33e-3 < found.limit < 36e-3
    errors_over_nodes = [each.straight for each in found.space]
    assert errors_over_nodes == sorted(errors_over_nodes, reverse=True)
    assert found.agreement["straight"] < 1e-2


def test_presets_and_the_chapters_steps_are_among_the_settings():
    measured = accuracy.settings(Plan())
    chapter = (Numerics("implicit-euler", 3 * MS), Numerics("implicit-euler", 20 * MS))
    assert {*accuracy_rows.presets().values(), *chapter} <= set(measured)
    assert len(measured) == len(set(measured))


def test_tables_and_csv_are_written(found, tmp_path):
    accuracy_tables.write_csv(found.rows, tmp_path / "a.csv")
    rows = list(csv.DictReader((tmp_path / "a.csv").read_text().splitlines()))
    assert len(rows) == len(found.rows)
    assert {"scheme", "step_s", "nodes_per_limb", "path", "spatial", "heading_deg", "end", "speed"} <= set(rows[0])
    assert float(rows[0]["path"]) == pytest.approx(found.rows[0].path, rel=1e-4)
    lines = accuracy_tables.as_markdown(found).splitlines()
    assert all(line.count("|") == len(accuracy_tables.COLUMNS) + 1 for line in lines if line.startswith("|"))
    for name in accuracy_rows.presets():
        assert any(line.startswith(f"| {name} |") for line in lines)
    assert accuracy_tables.as_table(found).row_count == len(accuracy_tables.summary(found))


def test_pictures_are_drawn(found, tmp_path):
    from studies.accuracy import pictures as accuracy_pictures

    for path in accuracy_pictures.draw_all(found, tmp_path):
        assert 20_000 < path.stat().st_size < 250_000


def test_what_is_stored_can_be_promised(found, tmp_path):
    agreed = replace(found, agreement=dict.fromkeys(accuracy_tables.AGREEMENT, 1e-6))
    accuracy_tables.store(agreed, tmp_path / "presets.json")
    stored = json.loads((tmp_path / "presets.json").read_text())
    assert list(stored["presets"]) == list(accuracy_rows.presets())
    by_numerics = {each.numerics: each for each in found.rows if each.nodes_per_limb == 10}
    for entry in (*stored["presets"].values(), *stored["front"]):
        kept = Promise(**entry)
        numerics = Numerics(kept.scheme, kept.step, kept.newton_tolerance, path_tolerance=kept.path_tolerance)
        measured = by_numerics[numerics]
        assert measured.path <= kept.path_error <= 1.11 * measured.path_promise
    speeds = [entry["speed"] for entry in stored["front"]]
    assert speeds == sorted(speeds, reverse=True)


def test_a_study_without_a_converged_solution_is_not_stored(found, tmp_path):
    doubtful = replace(found, agreement={**dict.fromkeys(accuracy_tables.AGREEMENT, 1e-6), "pair": 2e-4})
    with pytest.raises(ValueError, match=r"2.0e-04 of the path on the pair swims.*nothing is stored"):
        accuracy_tables.store(doubtful, tmp_path / "presets.json")
    assert not (tmp_path / "presets.json").exists()


def test_quick_studies_cannot_be_stored(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["accuracy", "--quick", "--store"])
    with pytest.raises(SystemExit):
        accuracy.main()
    assert "--store needs the whole study" in capsys.readouterr().err
