"""The accuracy study and its scan: sequences, fronts, what is stored, and what is told of fresh swims."""

from dataclasses import replace

import numpy as np
import pytest

from refusals import assert_refused
from seastar_gym import Scene
from seastar_gym.accuracy import Certificate
from seastar_gym.accuracy.commands import SLOWEST
from seastar_gym.accuracy.measure import path_lengths, swim
from seastar_gym.gaits import PAIRS, STRAIGHT
from seastar_gym.scene.numerics import PRESETS
from studies import accuracy as study
from studies import front
from studies.command import main
from studies.frame import DOCS
from studies.pages import numbers

MILLI = 1e-3
TINY = {
    "strokes": replace(study.TABLES["strokes"], samples=2, limit=(9, 5 * MILLI), fine=5 * MILLI, side=(1, 0), front=""),
    "wires": replace(study.TABLES["wires"], samples=4, periods=(0.2, 0.5), limit=(9, 5 * MILLI), fine=5 * MILLI,
                     finest=5 * MILLI, front=""),
}  # fmt: skip


def test_commands_are_every_one_up_to_turns_and_mirrors():
    """Burnside: 243 commands make 30 kinds, of which rest and all limbs alike are left out."""
    found, pair = study.every_command(), PAIRS["{1-,4+}"]
    assert len(found) == len(set(map(study.symmetric_form, found))) == 30 - 2
    assert {study.symmetric_form(each) for each in (STRAIGHT, *PAIRS.values())} <= {*map(study.symmetric_form, found)}
    commands = np.array([pair, np.roll(pair, 2), -pair[[0, 4, 3, 2, 1]], PAIRS["{1-,5+}"]])
    assert [study.symmetric_form(each) == study.symmetric_form(pair) for each in commands] == [True] * 3 + [False]
    distance = np.hypot(*swim(Scene.preset("chapter"), np.tile(commands, (2, 1, 1))).hub[-1].T)
    np.testing.assert_allclose(distance[:3], distance[0], rtol=1e-6)
    assert abs(distance[3] / distance[0] - 1.0) > 1e-3


def test_the_chapters_swims_and_what_policies_do_are_classes():
    ten, pentagon = study.of_strokes(2, 0, (2, 1))
    heated = [tuple(np.flatnonzero(side) + 1) for side in pentagon.commands["chapter's"][::3, 0]]
    assert heated == [(2, 5), (1, 3), (2, 4), (3, 5), (1, 4)]  # (13.15)
    np.testing.assert_array_equal(ten.commands["chapter's"][:, 0], [STRAIGHT] * 10)
    np.testing.assert_array_equal(ten.commands["repeated ternary"][-1], study.every_command())
    timed = study.in_time(3, 0, 0.2).commands
    assert timed["policies"].shape == (50, 3, 5) and np.abs(timed["policies"]).max() == 1.0
    np.testing.assert_array_equal(timed["policies"][20:40], timed["policies"][:20])


def point(cost: float, random: float, repeated: float) -> front.Point:
    return front.Point(7, "implicit-midpoint", 0.005, 0.0, 1e-5, cost, random, random, repeated, repeated)


def test_a_dearer_setting_is_on_the_front_only_if_it_errs_noticeably_less():
    some = [point(1, 0.1, 0.2), point(2, 0.099, 0.3), point(3, 0.05, 0.21), point(4, 0.06, 0.1)]
    assert front.front(some, front.of_random) == [some[0], some[2]]
    assert front.front(some, front.of_any) == [some[0], some[3]]


def test_the_scan_is_whole_and_its_front_has_no_setting_that_another_beats():
    kept = numbers(DOCS, front.STUDY)
    for kind in front.SCENES:
        some = front.points(kept, kind)
        wanted = {front.keys_of(each) for each in front.settings()}
        assert {front.keys_of(each.resolution) for each in some} == wanted and len(wanted) > 500
        best = front.front(some, front.of_any)
        for each in best:
            enough = (1.0 - front.NOTICEABLE) * front.of_any(each)
            assert not any(other.cost < each.cost and front.of_any(other) < enough for other in some)
        assert {each.resolution.nodes_per_limb for each in best} >= {7, 12}
        assert {*front.chosen(kind)} <= {*front.settings()}


def test_what_a_setting_errs_and_costs_is_measured_alike_whoever_asks():
    kept = numbers(DOCS, front.STUDY)["strokes"]
    nodes, numerics = front.keys_of(PRESETS["rapid"])
    np.testing.assert_allclose(front.measured("strokes", PRESETS["rapid"]), kept[nodes][numerics], rtol=0.02)


@pytest.mark.slow
def test_a_study_stores_every_preset(tmp_path, monkeypatch):
    monkeypatch.setattr(study, "TABLES", TINY)
    monkeypatch.setattr(study.chapter, "FOLDER", tmp_path)
    assert main(["accuracy", "--store", "--only", "strokes", "wires"]) == 0
    strokes, timed = (Certificate.load(tmp_path / f"{name}.json") for name in TINY)
    for certificate in (strokes, timed):
        assert [each.resolution for each in certificate.settings] == [*PRESETS.values()]
        assert certificate.limit_error > 0.0 and all(each.speed > 0.0 for each in certificate.settings)
    assert timed.measured_over["periods"] == [0.2, 0.5] and "policies" in timed.promised
    with assert_refused("needs the whole study"):
        study.Options(quick=True, store=True)
    with assert_refused("Unknown table"):
        study.Options(only=("air",))


def test_errors_of_fresh_sequences_are_told_over_the_promise(monkeypatch):
    monkeypatch.setattr(study, "FRESH", ("fast",))
    monkeypatch.setattr(study, "FRESH_PERIODS", (0.2,))
    monkeypatch.setattr(study.measuring, "MANY_NODES", 13)
    found, known = study.exceeding("wires", 4)["fast"], study.in_table("fast", "wires")
    assert 0.0 < max(map(np.max, found.values())) < 1.2 and {*found} == {*known.errors}
    half = replace(known, errors={name: 0.5 * each for name, each in known.errors.items()})
    monkeypatch.setattr(study, "in_table", lambda *_: half)
    for name, each in study.exceeding("wires", 4)["fast"].items():
        np.testing.assert_allclose(each, 2.0 * found[name], rtol=0.02)
    assert study.told_of(np.array([0.5, 1.234, 2.0])) == [2, 3, 2.0]


# What comes with the package


@pytest.mark.parametrize("name", study.TABLES)
def test_certificates_are_of_the_whole_study_and_dearer_presets_err_less(name):
    stored, table = study.certificate_of(name), study.TABLES[name]
    assert stored.samples == table.samples * max(1, len(table.periods))
    assert [each.resolution for each in stored.settings] == table.settings()
    worst = [each.error(stored.promised) for each in stored.settings[:5]]
    assert worst[0] > worst[3] > worst[4] and worst[2] > worst[3]
    if table.periods:
        assert stored.measured_over["periods"] == [*table.periods]


def test_a_path_that_goes_nowhere_counts_as_a_slow_one():
    hub = np.zeros((10, 2, 2))
    hub[:, 1, 0] = 0.02 * np.arange(1, 11)
    np.testing.assert_allclose(path_lengths(Scene(), hub, 10 * SLOWEST), [10 * SLOWEST * 0.1, 0.2])
