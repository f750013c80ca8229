"""The accuracy study and its scan: sequences, fronts, and what is stored."""

from dataclasses import replace

import numpy as np
import pytest

from refusals import assert_refused
from seastar_gym.accuracy import Certificate
from seastar_gym.gaits import STRAIGHT
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


def test_the_chapters_swims_and_what_policies_do_are_classes():
    ten, _ = study.of_strokes(2, 0, (2, 1))
    np.testing.assert_array_equal(ten.commands["chapter's"][:, 0], [STRAIGHT] * 10)
    np.testing.assert_array_equal(ten.commands["repeated ternary"][-1], study.every_command())
    timed = study.in_time(3, 0, 0.2).commands
    assert timed["policies"].shape == (50, 3, 5) and np.abs(timed["policies"]).max() == 1.0
    np.testing.assert_array_equal(timed["policies"][20:40], timed["policies"][:20])


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
    with assert_refused("Unknown table"):
        study.Options(only=("air",))


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
