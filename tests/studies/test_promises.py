"""Promised errors are held against fresh sequences, class by class, and every exceedance is counted."""

import json

import pytest

from seastar_gym import Certificate, Numerics, Scene, Seastar
from seastar_gym.accuracy import measure
from seastar_gym.accuracy.commands import CLASSES, draw_classes
from seastar_gym.accuracy.setting import resolved
from studies.accuracy import promises
from studies.command import main
from studies.frame import Results

ROBOT = "short, L = 5 cm"


@pytest.fixture(scope="module", autouse=True)
def screened():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(promises, "SCREEN", Numerics("implicit-midpoint", 1.25e-3, 1e-7))
        yield


@pytest.fixture(scope="module")
def certificate(few_settings):
    return measure.certify(Scene(Seastar(limb_length=0.05)), 12)


def test_more_nodes_are_checked_with_shorter_steps(certificate):
    checks = promises.certified_checks(certificate)
    assert [(c.scene.robot.nodes_per_limb, c.scene.numerics.step) for c in checks] == [(5, 2e-2), (9, 2e-3)]
    assert all(set(check.errors) == set(CLASSES) for check in checks)


@pytest.fixture(scope="module")
def counts(certificate):
    return promises.exceedances(certificate.scene, promises.certified_checks(certificate), 16, seed=1)


@pytest.mark.parametrize("name", CLASSES)
def test_of_fresh_sequences_few_exceed_the_largest_of_twelve(counts, name):
    """A share of 1/13 does on average; half of sixteen would with a probability of a thousandth."""
    assert all(count[name] <= 8 for count in counts.values())


def test_screening_with_longer_steps_changes_no_count(certificate, monkeypatch):
    checks = [each._replace(errors={k: 0.6 * e for k, e in each.errors.items()})
              for each in promises.certified_checks(certificate)]  # fmt: skip
    screened = promises.exceedances(certificate.scene, checks, 4, seed=2)
    assert sum(sum(row.values()) for row in screened.values()) > 0
    monkeypatch.setattr(promises, "CLOSE", -1.0)
    assert promises.exceedances(certificate.scene, checks, 4, seed=2) == screened
    last = checks[-1]
    exact = resolved(certificate.scene, measure.MANY_NODES, measure.SHORT)
    limit, swum = measure.swim_all([exact, last.scene], draw_classes(4, 5, 2))
    errors = measure.errors(swum, limit, measure.path_lengths(exact, limit.hub)).path.reshape(len(CLASSES), 4)
    beyond = {name: int((each > last.errors[name]).sum()) for name, each in zip(CLASSES, errors, strict=True)}
    assert screened[last.name] == beyond


def test_what_is_promised_for_nothing_is_exceeded_by_all(certificate):
    checks = [each._replace(errors=dict.fromkeys(CLASSES, 0.0)) for each in promises.certified_checks(certificate)]
    counts = promises.exceedances(certificate.scene, checks, 2, seed=1)
    assert all(set(row.values()) == {2} for row in counts.values())


def test_the_table_promises_gaits_and_small_commands_their_own_errors():
    for check in promises.table_checks():
        assert set(check.errors) == set(CLASSES)
        assert check.errors["random ternary"] <= check.errors["repeated ternary"] < check.errors["small"]


def test_a_robot_that_is_done_is_not_swum_again(few_settings, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(promises, "CERTIFIED", 2)
    out, folder = tmp_path / "promises.json", tmp_path / "certificates"

    def run(samples):
        promises.run(Results({}, out), samples, (ROBOT,), folder)

    run(2)
    (file,) = folder.iterdir()
    assert Certificate.load(file).samples == 2
    first = json.loads(out.read_text())
    assert set(first["robots"]) == {ROBOT} and first["robots"][ROBOT]["certified"] == 2
    assert ROBOT in capsys.readouterr().out
    monkeypatch.setattr(promises, "examine", lambda *_: pytest.fail("swum again"))
    run(2)
    assert json.loads(out.read_text()) == first
    with pytest.raises(ValueError, match="give another --out"):
        run(3)


@pytest.mark.slow
def test_certified_errors_hold_on_fresh_sequences_of_every_class(tmp_path):
    """The study with 20 fresh sequences per class: one share above 15 % in 20 may come of the draw alone."""
    found = promises.examine(ROBOT, tmp_path, 20)
    counts = [count for row in found["exceeded"].values() for count in row.values()]
    assert sum(count > 3 for count in counts) <= 0.1 * len(counts)


def test_results_of_another_version_are_not_mixed(tmp_path, capsys):
    (tmp_path / "promises.json").write_text(json.dumps({"samples": 2, "version": "0.0.1"}))
    assert main(["accuracy.promises", "--out", str(tmp_path)]) == 2
    assert "another version" in capsys.readouterr().err
