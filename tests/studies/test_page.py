"""The page that swims: what it records, and that it works in a browser, from disk and offline."""

import base64
import json
import re

import numpy as np
import pytest
from studies.swim_page import CYCLE, N_LIMBS, SEEN, UNIT, packed, record, runs, straight_gaits, transitions

from seastar_gym.evaluation.path_file import load_path
from seastar_gym.gaits import STRAIGHT
from seastar_gym.scene import Scene
from seastar_gym.simulator import Simulator
from studies import swim_page as page
from studies.frame import DOCS

NODES = 1 + SEEN * N_LIMBS
COMMITTED = (DOCS / "swim.html").read_text(encoding="utf-8")
PATH = [[0.05, 0.03], [0.02, 0.08]]


@pytest.fixture(scope="module")
def data():
    return record("fast", most=6)


@pytest.fixture(scope="module")
def file(data, tmp_path_factory):
    written = tmp_path_factory.mktemp("page") / "swim.html"
    written.write_text(page.page(data), encoding="utf-8")
    return written


def unpacked(text):
    return UNIT * np.frombuffer(base64.b64decode(text), "<i2")


def test_numbers_are_packed_to_a_tenth_of_a_millimetre_and_runs_have_the_changes_only():
    values = np.array([0.0, 0.12344, -0.3])
    np.testing.assert_allclose(unpacked(packed(values / UNIT)), values, atol=0.5 * UNIT)
    assert runs(["a", "a", "b", "b", "a"]) == [[0, "a"], [2, "b"], [4, "a"]]


def test_the_map_has_ten_directions_is_symmetric_and_begins_with_the_chapters_pairs(data):
    hub, turn, mirrored = np.array(data["map"]["hub"]), np.array(data["map"]["turn"]), -np.arange(10) % 10
    angles = np.degrees(np.arctan2(hub[0, :, 1], hub[0, :, 0])) - 36.0 * np.arange(10)
    np.testing.assert_allclose((angles + 180) % 360 - 180, 0.0, atol=1.0)
    np.testing.assert_allclose(hub[:, mirrored] * [1, -1], hub, atol=2e-5)
    np.testing.assert_allclose(turn[:, mirrored], -turn, atol=2e-4)
    np.testing.assert_array_equal(straight_gaits()[[0, N_LIMBS], [1, 0]], [STRAIGHT, -STRAIGHT])


def test_shapes_begin_at_the_origin_and_swims_have_a_frame_every_tenth_of_a_second(data):
    shapes = unpacked(data["map"]["nodes"]).reshape(3, 10, data["map"]["frames"], NODES, 2)
    np.testing.assert_allclose(shapes[:, :, 0, 0], 0.0, atol=UNIT)
    np.testing.assert_allclose(shapes[:, :, -1, 0], data["map"]["hub"], atol=UNIT)
    for swim, decision in zip(data["swims"], (0.2, 1.0), strict=True):
        frames = unpacked(swim["nodes"]).reshape(-1, NODES, 2)
        assert len(frames) == len(swim["waypoint"]) == 1 + round(6 * decision * page.FRAMES_PER_SECOND)
        assert np.abs(frames[-1, 0]).max() > 1e-3


def test_the_committed_page_is_of_this_template_and_simulator_and_needs_nothing_beside_it():
    first, last = page.TEMPLATE.read_text(encoding="utf-8").split("{{data}}")
    assert COMMITTED.startswith(first) and COMMITTED.endswith(last) and "{{" not in COMMITTED
    assert not re.findall(r'\b(?:src|href)="(?!data:)', COMMITTED)
    hub = json.loads(re.search(r'"map":\{.*?"hub":(\[\[\[.*?\]\]\])', COMMITTED)[1])
    np.testing.assert_allclose(hub, transitions("balanced")["hub"], atol=UNIT)


# In a browser


@pytest.fixture
def opened(open_offline, file, request):
    tab = open_offline(file, *getattr(request, "param", ()), reduced_motion="reduce")
    yield tab
    tab.context.close()


def test_it_opens_offline_and_the_slider_moves_the_robot_where_the_recording_has_it(opened, data, file):
    assert [url for url in opened.requests if not url.startswith("data:")] == [file.as_uri()]
    assert opened.inner_text("h1") == opened.title() and opened.get_attribute("#back", "href").startswith("index.")
    opened.locator("#time").fill("7")
    np.testing.assert_allclose(
        opened.evaluate("swimPage.nodes()"), unpacked(data["swims"][0]["nodes"]).reshape(-1, NODES, 2)[7], atol=1e-9
    )
    assert "t = 0.7 s" in opened.inner_text("#readout") and opened.complaints == []


def test_a_plan_reaches_its_waypoints_without_a_jump_and_the_simulator_swims_there(opened):
    """Strokes of different recordings join without a jump: nothing moves farther than a tip in the fastest 0.1 s."""
    script = "path => { const s = swimPage.plan(path, [0, 0]); return [s.gaits, s.frames, s.waypoint.at(-1)]; }"
    gaits, frames, reached = opened.evaluate(script, PATH)
    frames = np.array(frames)
    assert reached == len(PATH) and np.linalg.norm(np.diff(frames, axis=0), axis=-1).max() < 0.08
    simulator, swum = Simulator(Scene.preset("fast")), [np.zeros(2)]
    for gait in straight_gaits()[gaits]:
        for command in gait:
            simulator.stroke(command[None])
        swum.append(simulator.hub_position()[0])
    length = np.linalg.norm(np.diff(swum, axis=0), axis=1).sum()
    hub = frames[:: CYCLE * page.FRAMES_PER_SECOND, 0]
    assert np.linalg.norm(np.array(swum) - hub, axis=1).max() < 0.1 * length


def test_a_path_is_drawn_with_the_mouse_and_is_a_file_for_the_policy(opened, tmp_path):
    box = opened.locator("#water").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    opened.mouse.move(x, y)
    opened.mouse.down()
    opened.mouse.move(x + 80, y - 60, steps=5)
    opened.mouse.up()
    assert "A planner swims your path" in opened.inner_text("#who") and opened.inner_text("#play") == "Pause"
    assert opened.evaluate("swimPage.swim.path.length") >= 2 and opened.complaints == []
    opened.evaluate("path => swimPage.choose(swimPage.plan(path.map(([x, y]) => [x + 0.1, y]), [0.1, 0]))", PATH)
    with opened.expect_download() as saved:
        opened.click("#who a")
    saved.value.save_as(tmp_path / "path.csv")
    np.testing.assert_allclose(load_path(str(tmp_path / "path.csv")), PATH, atol=1e-4)


def test_it_plays_to_the_end_and_begins_again(opened, data):
    last = len(data["swims"][0]["waypoint"]) - 1
    opened.select_option("#speed", "16")
    opened.click("#play")
    opened.wait_for_function("document.getElementById('play').textContent === 'Play'")
    assert float(opened.locator("#time").input_value()) == last
    opened.select_option("#speed", "1")
    opened.click("#play")
    assert opened.inner_text("#play") == "Pause" and float(opened.locator("#time").input_value()) < last


@pytest.mark.parametrize(
    "opened", [(390, 700), (820, 1000), (1400, 720)], indirect=True, ids=["phone", "tablet", "desk"]
)
def test_it_fits_the_screen(opened):
    size = opened.viewport_size
    assert opened.evaluate("document.documentElement.scrollWidth") <= size["width"]
    box = opened.locator("#water").bounding_box()
    assert box["width"] > 0.9 * size["width"] and box["height"] > 0.4 * size["height"]
