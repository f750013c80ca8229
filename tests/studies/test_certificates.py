"""The certificates of the fastest designs: of the robots of the table, kept, and told on the page."""

import json
from dataclasses import replace
from importlib.util import find_spec

import pytest

if find_spec("pyarrow") is None:
    pytest.skip("the extra sweep is not installed", allow_module_level=True)

from seastar_gym.accuracy import Certificate, Setting
from seastar_gym.accuracy.setting import physics
from seastar_gym.version import __version__
from studies.command import main
from studies.designs import certificates
from studies.designs.certificates import CLASS, NODES, STEPS, WINNERS, certificate_of, scene_of
from studies.designs.study import STUDY
from studies.frame import DOCS
from studies.pages import numbers

ROWS = numbers(DOCS, STUDY)


def made(scene, samples):
    """A certificate that nobody measured."""
    settings = tuple(
        Setting(
            nodes, "implicit-midpoint", step, 1e-6, {CLASS: 0.01 * nodes}, {CLASS: 0.005 * nodes}, 0.0, 0.0, 1.0, 1.0
        )
        for nodes, step in zip(NODES, STEPS, strict=True)
    )
    return Certificate(physics(scene), settings, (CLASS,), (CLASS,), samples, 0.0, 1, __version__, "none")


@pytest.mark.parametrize("name", WINNERS)
def test_a_row_of_the_table_is_its_robot(name):
    robot = scene_of(ROWS[name]).robot
    assert robot.n_limbs == ROWS[name]["n_limbs"]
    assert robot.limb_length == pytest.approx(1e-3 * ROWS[name]["limb_length_mm"])
    radius = robot.limbs[0].radius
    root = radius[0] if isinstance(radius, tuple) else radius
    assert root == pytest.approx(1e-3 * ROWS[name]["root_radius_mm"], rel=1e-3)


def test_a_certificate_is_made_once(tmp_path, monkeypatch):
    calls = []

    def certify(scene, samples, progress):
        calls.append(samples)
        progress(1.0)
        return made(scene, samples)

    monkeypatch.setattr(certificates, "certify", certify)
    scene = scene_of(ROWS["fastest"])
    first = certificate_of("fastest", scene, tmp_path, 3)
    assert certificate_of("fastest", scene, tmp_path, 3) == first and calls == [3]
    with pytest.raises(ValueError, match="of another scene"):
        certificate_of("fastest", scene_of(ROWS["fastest of them without taper"]), tmp_path, 3)


def test_some_robots_leave_the_numbers_of_all_in_place(tmp_path, monkeypatch, capsys):
    """The file is written when the last robot has its certificate, in the order of the winners."""
    monkeypatch.setattr(certificates, "certify", lambda scene, samples, progress: made(scene, samples))
    monkeypatch.setattr(certificates, "told", lambda certificate: {"samples": certificate.samples})
    monkeypatch.setattr(certificates, "STUDY", replace(certificates.STUDY, tables={}))
    kept = tmp_path / "certificates.json"
    kept.write_text("whole")

    def run(*robots):
        assert main(["designs.certificates", "--samples", "3", "--out", str(tmp_path), "--robots", *robots]) == 0

    run(*WINNERS[1:])
    assert kept.read_text() == "whole" and "too: fastest." in capsys.readouterr().out
    run("fastest")
    assert list(json.loads(kept.read_text())["robots"]) == list(WINNERS)


def test_errors_are_told_beside_speeds():
    found = certificates.told(made(scene_of(ROWS["fastest"]), 3))
    coarse, fine = found["7 nodes, 5 ms"], found["19 nodes, 1 ms"]
    assert coarse["repeated_percent"] == 7.0 and fine["repeated_percent"] == 19.0
    assert coarse["typical_percent"] == 3.5 and fine["typical_percent"] == 9.5
    assert coarse["mm_per_s"] == pytest.approx(ROWS["fastest"]["mm_per_s"]["fast"], rel=0.01)


def test_the_table_has_two_settings_of_every_robot():
    found = certificates.told(made(scene_of(ROWS["fastest"]), 3))
    lines = certificates.table({"robots": {"one": found}}).splitlines()
    assert len(lines) == 4 and lines[2].startswith("| one | 7 nodes, 5 ms | 7 | 3.5 | 7 | 1 |")
