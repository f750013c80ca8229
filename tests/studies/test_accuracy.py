"""The accuracy study: its sequences, its promises against errors that cancel, and what it stores."""

from dataclasses import replace

import numpy as np
import pytest

from seastar_gym import Numerics, Scene
from seastar_gym.accuracy import Certificate, timed_certificate
from seastar_gym.accuracy.measure import CLASSES, Errors, path_lengths, swim
from seastar_gym.gaits import PAIRS, STRAIGHT
from seastar_gym.scene.numerics import PRESETS, Resolution
from studies import accuracy as study
from studies.accuracy import MILLI, PERIODS, Plan, Row, gaits, pentagon, random_gaits, random_sequences
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
    timed = study.timed_sequences(0.2, 2)
    repeats = (timed[:5] == timed[5:10]).all(axis=(0, 2)).tolist()
    assert timed.shape == (50, 4, 5) and repeats == [False, False, True, True]


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


def test_random_and_repeated_commands_in_time_are_bounded_apart():
    space, in_time = np.array([0.01, 0.03, 0.02, 0.5, 0.4, 0.1]), np.array([0.02, 0.01, 0.01, 0.1, 0.3, 0.1])
    found = study.timed_setting(PRESETS["fast"], space, in_time)
    assert (found.space_error, found.time_error) == (0.03, 0.02)
    assert found.errors == {"random": 0.05, "repeated": 0.8} and found.typical == {"random": 0.03, "repeated": 0.6}


@pytest.mark.slow
def test_a_study_stores_every_preset_and_nothing_whose_limit_is_in_doubt(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(study, "Plan", lambda: TINY)
    (tmp_path / "shipped").mkdir()
    monkeypatch.setattr(study.chapter, "FOLDER", tmp_path / "shipped")
    assert main(["accuracy", "--store", "--periods", "1"]) == 2
    assert "nothing is stored" in capsys.readouterr().err and not [*(tmp_path / "shipped").iterdir()]
    monkeypatch.setattr(study, "LARGEST_DOUBT", 1.0)
    assert main(["accuracy", "--store", "--periods", "1", "0.5"]) == 0
    strokes, timed = (Certificate.load(tmp_path / "shipped" / name) for name in ("strokes.json", "wires_0.5s.json"))
    assert [each.resolution for each in strokes.settings[: len(PRESETS)]] == [*PRESETS.values()]
    assert strokes.limit_error >= strokes.settings[3].space_error / 3.0 and timed.decision_period == 0.5
    for each in strokes.settings:
        assert each.errors["random"] == pytest.approx(each.space_error + each.time_error, rel=1e-5)
        assert 0.0 < each.typical["random"] <= 1.11 * each.errors["random"] and each.speed > 0.0
    assert [each.resolution for each in timed.settings] == [*PRESETS.values()]
    assert 0.0 < timed.settings[1].space_error < timed.settings[0].space_error < 0.2
    with pytest.raises(ValueError, match="--store needs the whole study"):
        study.Options(quick=True, store=True)


def test_fresh_sequences_that_exceed_a_promise_are_counted(monkeypatch):
    monkeypatch.setattr(study.measuring, "SHORT", Numerics("implicit-midpoint", 1e-3, 1e-7))
    known = study.in_table("fast")
    assert max(study.exceeding("fast", 2).values()) == 0.0
    monkeypatch.setattr(study, "in_table", lambda _: replace(known, errors=dict.fromkeys(known.errors, 0.0)))
    assert study.exceeding("fast", 2) == dict.fromkeys(CLASSES, 1.0)


# What comes with the package


@pytest.mark.parametrize("period", PERIODS)
def test_certificates_in_time_are_of_the_whole_study_and_dearer_presets_err_less(period):
    stored = timed_certificate(period)
    assert stored.decision_period == period and stored.samples == stored.measured_over["random"] == Plan().timed
    assert [each.resolution for each in stored.settings] == [*PRESETS.values()]
    for column in ("errors", "typical"):
        for kind in ("random", "repeated"):
            found = [getattr(each, column)[kind] for each in stored.settings[:4]]
            assert found == sorted(found, reverse=True), (column, kind)


def test_a_path_that_goes_nowhere_counts_as_a_slow_one():
    hub = np.zeros((10, 2, 2))
    hub[:, 1, 0] = 0.02 * np.arange(1, 11)
    np.testing.assert_allclose(path_lengths(Scene(), hub, 10 * study.SLOWEST), [10 * study.SLOWEST * 0.1, 0.2])
