"""The accuracy study: its sequences, its promises against errors that cancel, and what it stores."""

import math
from dataclasses import replace

import numpy as np
import pytest

from seastar_gym import Numerics, Scene
from seastar_gym.accuracy import Certificate
from seastar_gym.accuracy.measure import Errors, path_lengths, swim
from seastar_gym.gaits import PAIRS, STRAIGHT
from seastar_gym.scene.numerics import PRESETS, Resolution
from studies import accuracy as study
from studies.accuracy import MILLI, Plan, Row, gaits, pentagon, random_gaits, random_sequences
from studies.command import main

KINDS = ("path", "straight", "gait", "slow", "heading", "end")
TINY = replace(
    study.QUICK, n_random=2, n_slow=1, n_gaits=1, limit=(13, 5 * MILLI), fine=5 * MILLI, opinion=(4, 5 * MILLI),
    meshes=(("continuum", 10), ("chapter", 4)), shortest=10 * MILLI, timed_limit=(13, 2 * MILLI),
)  # fmt: skip


def row(
    scheme="sdirk2", step=0.01, tolerance=1e-8, path_tolerance=None, space=0.1, time=0.01, speed=1000.0, nodes=10,
    discretisation="continuum",
) -> Row:  # fmt: skip
    resolution = Resolution(discretisation, nodes, Numerics(scheme, step, tolerance, path_tolerance=path_tolerance))
    return Row(resolution, dict.fromkeys(KINDS, space), dict.fromkeys(KINDS, time), {}, speed)


def test_gaits_are_every_command_up_to_turns_and_mirrors():
    """Burnside: 243 commands make 30 kinds, of which rest, all limbs alike and the four pairs are left out."""
    found, pair = gaits(), PAIRS["{1-,4+}"]
    forms = {study.symmetric_form(command) for command in found.commands[0]}
    assert len(found) == len(forms) == 30 - 2 - 4 and not forms & set(map(study.symmetric_form, PAIRS.values()))
    commands = np.array([pair, np.roll(pair, 2), -pair[[0, 4, 3, 2, 1]], PAIRS["{1-,5+}"]])
    assert [study.symmetric_form(each) == study.symmetric_form(pair) for each in commands] == [True] * 3 + [False]
    distance = np.hypot(*swim(Scene.preset("chapter"), np.tile(commands, (2, 1, 1))).hub[-1].T)
    np.testing.assert_allclose(distance[:3], distance[0], rtol=1e-6)
    assert abs(distance[3] / distance[0] - 1.0) > 1e-3


def test_sequences_are_what_their_names_say_and_half_of_the_random_ones_are_actions():
    heated = [tuple(np.flatnonzero(side) + 1) for side in pentagon(2, 1).commands[::3, 0]]
    assert heated == [(2, 5), (1, 3), (2, 4), (3, 5), (1, 4)]  # (13.15)
    np.testing.assert_array_equal(pentagon(2, 1).commands[:3, 0], [STRAIGHT, STRAIGHT, np.zeros(5)])
    drawn = random_sequences(6, np.random.default_rng(2)).commands
    assert np.isin(drawn, (-1.0, 0.0, 1.0)).all(axis=(0, 2)).tolist() == [True, False] * 3 and np.abs(drawn).max() <= 1
    found = random_gaits(3, np.random.default_rng(2))
    once, slow, alternating = np.split(found.commands, 3, axis=1)
    assert found.kinds == ("gait",) * 3 + ("slow",) * 3 + ("gait",) * 3 and (once == once[0]).all()
    np.testing.assert_array_equal(slow, study.SLOW * once)
    np.testing.assert_array_equal(alternating, np.tile(alternating[:2], (5, 1, 1)))


@pytest.mark.parametrize("period", [0.1, 0.15, 0.3, 0.5])
def test_commands_in_time_are_what_their_classes_say(period):
    commands, places = study.timed_sequences(period, 8)
    drawn = {name: commands[:, place] for name, place in places.items()}
    n, a_second = round(study.SECONDS / period), round(1.0 / period)
    assert sum(each.shape[1] for each in drawn.values()) == commands.shape[1] and np.abs(commands).max() <= 1.0
    assert all(each.shape == (n, 8, 5) for name, each in drawn.items() if name != "repeated command")
    repeated = {study.symmetric_form(command) for command in drawn["repeated command"][-1]}
    assert len(repeated) == drawn["repeated command"].shape[1] == 30 - 2 and study.symmetric_form(STRAIGHT) in repeated
    assert (np.sort(drawn["pairs"], axis=-1) == study.PAIR).all()
    np.testing.assert_array_equal(drawn["repeated second"][a_second:], drawn["repeated second"][:-a_second])
    changes = (np.diff(drawn["held"], axis=0) != 0.0).any(axis=-1).sum(axis=0).reshape(len(study.HELD), 2)
    most = np.array([math.ceil(study.SECONDS / each) - 1 for each in study.HELD])
    assert (changes <= most[:, None]).all() and (changes[0] == 0).all() and (changes[-1] >= 6).all()
    assert (drawn["on-off"] == 0.0).all(axis=(1, 2)).mean() == pytest.approx(0.5, abs=0.05)


def test_largest_errors_leave_gaits_and_slow_swims_out_of_the_path_error():
    path = np.array([0.1, 0.2, 0.3, 0.4])
    found = study.largest(("straight", "random", "gait", "slow"), Errors(path, 0.5 * path, np.radians(path)))
    assert found == {"straight": 0.1, "gait": 0.3, "slow": 0.4, "path": 0.2, "end": 0.1, "heading": pytest.approx(0.2)}


ROWS = [
    (row(step=0.02, time=0.02), 0.03), (row(step=0.01, time=0.03), 0.03), (row(step=0.005, time=0.01), 0.01),
    (row(step=0.02, tolerance=1e-6, time=0.01), 0.03), (row(step=0.005, tolerance=1e-4, time=0.5), 0.5),
    (row("sdirk3", step=0.005, time=0.7), 0.7), (row(step=0.001, time=0.9, nodes=19), 0.9),
    (row(step=0.001, time=0.9, discretisation="chapter"), 0.9), (row("implicit-midpoint", step=0.001, time=0.5), 0.5),
    (row("implicit-midpoint", step=0.005, path_tolerance=0.005, time=0.02), 0.02),
    (row("implicit-midpoint", step=0.005, path_tolerance=0.02, time=0.01), 0.02),
]  # fmt: skip
"""Rows, and the errors of time that can be promised of them."""


def test_a_promise_is_the_worst_of_all_that_are_no_coarser_and_sums_space_and_time():
    assert [each.time["gait"] for each in study.promised([each for each, _ in ROWS])] == [time for _, time in ROWS]
    rows = [row(nodes=n, space=e) for n, e in ((6, 0.02), (10, 0.001), (19, 0.005))]
    rows.append(row(nodes=37, space=0.3, discretisation="chapter"))
    assert [each.space["path"] for each in study.promised(rows)] == [0.02, 0.005, 0.005, 0.3]
    assert rows[1].promise("path") == pytest.approx(0.011) and rows[1].promise("slow") == pytest.approx(1.5 * 0.011)


def test_every_class_in_time_is_bounded_by_its_worst_sum_of_space_and_time():
    space = {"random": np.array([0.01, 0.03, 0.02]), "held": np.array([0.02])}
    in_time = {"random": np.array([0.02, 0.01, 0.01]), "held": np.array([0.001])}
    found = study.joint([study.Timed(PRESETS["fast"], space, in_time)] * 2).setting()
    assert (found.space_error, found.time_error) == (0.03, 0.02)
    assert found.errors == {"random": 0.04, "held": 0.021} and found.typical == {"random": 0.03, "held": 0.021}


@pytest.mark.slow
def test_a_study_stores_every_preset_and_nothing_whose_limit_is_in_doubt(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(study, "Plan", lambda: TINY)
    (tmp_path / "shipped").mkdir()
    monkeypatch.setattr(study.chapter, "FOLDER", tmp_path / "shipped")
    assert main(["accuracy", "--store", "--only", "strokes"]) == 2
    assert "nothing is stored" in capsys.readouterr().err and not [*(tmp_path / "shipped").iterdir()]
    monkeypatch.setattr(study, "LARGEST_DOUBT", 1.0)
    assert main(["accuracy", "--store", "--only", "strokes", "wires"]) == 0
    strokes, timed = (Certificate.load(tmp_path / "shipped" / name) for name in ("strokes.json", "wires.json"))
    assert [each.resolution for each in strokes.settings[: len(PRESETS)]] == [*PRESETS.values()]
    assert strokes.limit_error >= strokes.settings[3].space_error / 3.0 and timed.measured_over["periods"] == [0.2, 0.5]
    for each in strokes.settings:
        assert each.errors["random"] == pytest.approx(each.space_error + each.time_error, rel=1e-5)
        assert 0.0 < each.typical["random"] <= 1.11 * each.errors["random"] and each.speed > 0.0
    assert [each.resolution for each in timed.settings] == [*PRESETS.values()]
    assert 0.0 < timed.settings[1].space_error < timed.settings[0].space_error < 0.2
    for wrong, words in (({"quick": True, "store": True}, "needs the whole study"), ({"only": ("air",)}, "not air")):
        with pytest.raises(ValueError, match=words):
            study.Options(**wrong)


def test_errors_of_fresh_sequences_are_told_over_the_promise(monkeypatch):
    monkeypatch.setattr(study.measuring, "SHORT", Numerics("implicit-midpoint", 1e-3, 1e-7))
    known = study.in_table("fast")
    found = study.exceeding("fast", 2)
    assert 0.0 < max(map(np.max, found.values())) < 1.0
    half = replace(known, errors={name: 0.5 * each for name, each in known.errors.items()})
    monkeypatch.setattr(study, "in_table", lambda _: half)
    for name, each in study.exceeding("fast", 2).items():
        np.testing.assert_allclose(each, 2.0 * found[name])


# What comes with the package


@pytest.mark.parametrize("robot", study.ROBOTS)
def test_certificates_in_time_are_of_the_whole_study_and_dearer_presets_err_less(robot):
    stored, plan = study.certificate_of(robot), Plan()
    n = study.timed_limit(robot, plan)[1]
    assert stored.measured_over["periods"] == [*plan.periods] and stored.samples == n * len(plan.periods)
    assert [each.resolution for each in stored.settings] == [*PRESETS.values()]
    worst = [each.error(stored.actions) for each in stored.settings[:4]]
    assert worst[0] > worst[2] > worst[3] and worst[1] > worst[2]


def test_a_path_that_goes_nowhere_counts_as_a_slow_one():
    hub = np.zeros((10, 2, 2))
    hub[:, 1, 0] = 0.02 * np.arange(1, 11)
    np.testing.assert_allclose(path_lengths(Scene(), hub, 10 * study.SLOWEST), [10 * study.SLOWEST * 0.1, 0.2])
