"""The certificates of the best designs: of the robots of the tables, kept, and told on the page."""

import json
from dataclasses import replace
from importlib.util import find_spec

import pytest

if find_spec("pyarrow") is None:
    pytest.skip("the extra sweep is not installed", allow_module_level=True)

from seastar_gym.accuracy import Certificate, Setting, measure
from seastar_gym.accuracy.setting import physics
from seastar_gym.scene import Contact
from seastar_gym.version import __version__
from studies.command import main
from studies.designs import certificates
from studies.designs.certificates import CLASS, ENDS, NODES, ROBOTS, STEPS, WINNERS, certificate_of, rows, scene_of

ROWS = rows()


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


@pytest.mark.parametrize("name", ENDS)
def test_robots_of_the_front_are_certified_with_contact_and_their_radii(name):
    scene = scene_of(ROWS[name])
    (radius,) = {limb.radius for limb in scene.robot.limbs}
    assert radius == pytest.approx([1e-3 * each for each in ROWS[name]["radius_mm"]])
    assert scene.contact == Contact() and scene_of(ROWS["fastest"]).contact is None


def test_a_certificate_is_made_once(tmp_path, monkeypatch):
    calls = []

    def certify(scene, samples, progress):
        calls.append(samples)
        progress(1.0)
        return made(scene, samples)

    monkeypatch.setattr(measure, "certify", certify)
    scene = scene_of(ROWS["fastest"])
    first = certificate_of("fastest", scene, tmp_path, 3)
    assert certificate_of("fastest", scene, tmp_path, 3) == first and calls == [3]
    with pytest.raises(ValueError, match="of another scene"):
        certificate_of("fastest", scene_of(ROWS["fastest of them without taper"]), tmp_path, 3)


def test_numbers_that_are_there_stay_and_others_are_added_or_made_anew(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(measure, "certify", lambda scene, samples, progress: made(scene, samples))
    monkeypatch.setattr(certificates, "told", lambda certificate: {"samples": certificate.samples})
    monkeypatch.setattr(certificates, "STUDY", replace(certificates.STUDY, tables={}))

    def run(samples, *robots):
        options = ["--samples", str(samples), "--robots", *robots, "--out", str(tmp_path)]
        assert main(["designs.certificates", *options]) == 0
        found = json.loads((tmp_path / "certificates.json").read_text(encoding="utf-8"))["robots"]
        return {name: row["samples"] for name, row in found.items()}

    assert run(3, *WINNERS) == dict.fromkeys(WINNERS, 3)
    assert run(2, *ENDS) == dict.fromkeys(WINNERS, 3) | dict.fromkeys(ENDS, 2)
    assert run(3, *ROBOTS) == dict.fromkeys(ROBOTS, 3)


def test_errors_are_told_beside_speeds():
    found = certificates.told(made(scene_of(ROWS["fastest"]), 3))
    coarse, fine = found["7 nodes, 5 ms"], found["19 nodes, 1 ms"]
    assert coarse["repeated_percent"] == 7.0 and fine["repeated_percent"] == 19.0
    assert coarse["typical_percent"] == 3.5 and fine["typical_percent"] == 9.5
    assert coarse["mm_per_s"] == pytest.approx(ROWS["fastest"]["mm_per_s"]["fast"], rel=0.01)


def test_the_table_has_two_settings_of_every_robot():
    found = certificates.told(made(scene_of(ROWS["fastest"]), 3))
    lines = certificates.table({"robots": {"one": found}}).splitlines()
    assert len(lines) == 3 and lines[2] == "| one | 3 | 7 | 7 | 1 | 19 | 19 | 1 |"
