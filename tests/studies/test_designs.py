"""The study of designs: its space, and what becomes of a small part of it."""

import json
import math
from importlib.util import find_spec

import numpy as np
import pytest

if find_spec("pyarrow") is None or find_spec("pandas") is None:
    pytest.skip("the extra sweep is not installed", allow_module_level=True)

import pandas

from seastar_gym.executors.here import Here
from seastar_gym.scene import Seastar
from seastar_gym.sweep.result_files import read_results
from seastar_gym.sweep.run import run
from studies.designs.pictures import COLOURS, draw, summary
from studies.designs.space import BODIES, SPREADS, Body, all_designs, inner_half, masses, spread
from studies.designs.study import STUDY, scene_of
from studies.frame import DOCS
from studies.pages import numbers


def test_there_are_more_than_a_hundred_thousand_designs():
    sweep = all_designs()
    assert sweep.n_designs == 102_480 and sweep.n_batches == 240 and len(BODIES) == 120


@pytest.mark.parametrize("taper", SPREADS)
def test_spread_limbs_have_the_chapter_s_mass_and_bending_stiffness(taper):
    limb, chapter = spread(taper, 400), Seastar()
    radius, moduli = np.array(limb.radius), np.array(limb.youngs_modulus)
    assert np.mean(radius**2) == pytest.approx(chapter.rod_radius**2, rel=3e-3)
    assert moduli * radius**4 == pytest.approx(chapter.youngs_modulus * chapter.rod_radius**4)
    inner = np.sum(radius[:200] ** 2) / np.sum(radius**2)
    assert inner_half(taper) == pytest.approx(inner, abs=3e-3)


def test_a_tapered_body_keeps_its_mean_radius():
    root, tip = Body(5, 2e-3, 0.25).profile
    assert 0.5 * (root + tip) == pytest.approx(2e-3) and tip / root == pytest.approx(0.25)


def test_a_row_of_results_is_a_scene_again(tmp_path):
    cell = next(all_designs(2).batches())
    run([cell], tmp_path, Here())
    row = read_results(tmp_path).to_pandas().iloc[0]
    scene = scene_of(row)
    assert scene.robot.n_limbs == 3 and scene.robot.limb_length == row["robot.limb_length"]
    assert scene.actuator.peak_angle == row["actuator.peak_angle"]


def test_density_is_simulated_side_by_side():
    assert masses().n_batches == len(SPREADS) and masses().designs_per_configuration == 21


def test_the_page_tells_what_was_measured():
    found = numbers(DOCS, STUDY)
    page = " ".join((DOCS / "designs.md").read_text(encoding="utf-8").split())
    assert f"{found['designs'] - found['count']:,} robots do not count" in page and found["failed"] == 0
    for name in ("the chapter's", "fastest", "fastest at the chapter's length and angle"):
        for speed in found[name]["mm_per_s"].values():
            assert f"{speed:.2f}" in page
    chapter, fastest = found["the chapter's"], found["fastest"]

    def times(robot, measure):
        return robot[measure]["reference"] / chapter[measure]["reference"]

    assert f"{times(fastest, 'mJ_per_stroke'):.0f} times the work per stroke" in page
    assert f"{times(fastest, 'peak_mN_m'):.0f} times the peak moment" in page
    assert f"{fastest['J_per_metre'] / chapter['J_per_metre']:.0f} times the work per metre" in page
    gain = found["fastest"]["mm_per_s"]["reference"] / found["the chapter's"]["mm_per_s"]["reference"]
    assert math.isclose(gain, 5.4, abs_tol=0.06)


def test_the_picture_is_drawn_from_what_is_written(tmp_path):
    """Medians and percentiles go to the file, so that the picture can be drawn again without the designs."""
    rng = np.random.default_rng(0)
    rows = 4000
    table = pandas.DataFrame({
        "robot.limb_length": rng.uniform(0.05, 0.15, rows), "actuator.peak_angle": rng.uniform(0.2, 1.2, rows),
        "robot.youngs_modulus": 1e6 * np.exp(rng.uniform(np.log(0.2), np.log(5.0), rows)),
        "taper": rng.choice(list(COLOURS), rows), "n_limbs": rng.integers(3, 8, rows),
        "radius": rng.choice([0.8e-3, 2e-3], rows), "speed": 5e-3 * rng.gamma(4.0, 0.3, rows),
    })  # fmt: skip
    found = numbers(DOCS, STUDY)
    found["picture"] = json.loads(json.dumps(summary(table)))
    some = table[(table.taper == 0.5) & (table["actuator.peak_angle"] < 0.2 + 1.0 / 24.0)]
    expected = 1e3 * float(np.median(some.speed))
    assert found["picture"]["curves"]["actuator.peak_angle"]["0.5"]["50"][0] == pytest.approx(expected, rel=0.03)
    assert found["picture"]["spreads"]["radius"].keys() == {"0.8", "2.0"}
    draw(found, tmp_path / "designs.png")
    assert (tmp_path / "designs.png").stat().st_size > 50_000
