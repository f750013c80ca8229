"""The page that swims: what it records, and that it works in a browser, from disk and offline."""

import base64
import json
import re
from pathlib import Path

import numpy as np
import pytest

from seastar_gym.envs.paths import load_path
from seastar_gym.scene import Scene
from seastar_gym.simulator import Simulator
from studies import swim_page
from studies.swim_page import CYCLE, FRAMES_PER_SECOND, N_LIMBS, SEEN, UNIT, record, straight_gaits, transitions

NODES = 1 + SEEN * N_LIMBS
COMMITTED = (Path(__file__).parents[2] / "docs" / "swim.html").read_text(encoding="utf-8")
PATH = [[0.05, 0.03], [0.02, 0.08]]


@pytest.fixture(scope="module")
def data():
    return record("fast", most=6)


@pytest.fixture(scope="module")
def file(data, tmp_path_factory):
    file = tmp_path_factory.mktemp("page") / "swim.html"
    file.write_text(swim_page.page(data), encoding="utf-8")
    return file


def unpacked(text):
    return UNIT * np.frombuffer(base64.b64decode(text), "<i2")


def test_it_records_gaits_in_ten_directions_and_swims_with_a_frame_every_tenth_of_a_second(data):
    hub, turn = np.array(data["map"]["hub"]), np.array(data["map"]["turn"])
    angles = np.degrees(np.arctan2(hub[0, :, 1], hub[0, :, 0])) - 36.0 * np.arange(10)
    np.testing.assert_allclose((angles + 180) % 360 - 180, 0.0, atol=1.0)
    mirrored = -np.arange(10) % 10
    np.testing.assert_allclose(hub[:, mirrored] * [1, -1], hub, atol=2e-5)
    np.testing.assert_allclose(turn[:, mirrored], -turn, atol=2e-4)
    shapes = unpacked(data["map"]["nodes"]).reshape(3, 10, data["map"]["frames"], NODES, 2)
    np.testing.assert_allclose(shapes[:, :, 0, 0], 0.0, atol=UNIT)
    np.testing.assert_allclose(shapes[:, :, -1, 0], hub, atol=UNIT)
    for swim, decision in zip(data["swims"], (0.2, 1.0), strict=True):
        frames = unpacked(swim["nodes"]).reshape(-1, NODES, 2)
        assert len(frames) == len(swim["waypoint"]) == 1 + round(6 * decision * FRAMES_PER_SECOND)
        assert np.abs(frames[-1, 0]).max() > 1e-3


def test_the_committed_page_is_of_this_template_with_the_strokes_of_the_simulator():
    head, tail = swim_page.TEMPLATE.read_text(encoding="utf-8").split("{{data}}")
    assert COMMITTED.startswith(head) and COMMITTED.endswith(tail)
    assert not re.findall(r'\b(?:src|href)="(?!data:)', head + tail)  # it needs nothing beside it
    hub = json.loads(re.search(r'"map":\{.*?"hub":(\[\[\[.*?\]\]\])', COMMITTED)[1])
    np.testing.assert_allclose(hub, transitions("balanced")["hub"], atol=UNIT)


# In a browser


@pytest.fixture
def opened(open_offline, file, request):
    tab = open_offline(file, *getattr(request, "param", ()), reduced_motion="reduce")
    yield tab
    tab.context.close()


def test_it_opens_offline_without_a_complaint_and_moves_the_robot_where_the_recording_has_it(opened, file, data):
    assert opened.complaints == []
    assert [url for url in opened.requests if not url.startswith("data:")] == [file.as_uri()]
    assert opened.inner_text("h1") == opened.title() and opened.get_attribute("#back", "href").startswith("index.")
    frames = unpacked(data["swims"][0]["nodes"]).reshape(-1, NODES, 2)
    opened.locator("#time").fill("7")
    np.testing.assert_allclose(opened.evaluate("swimPage.nodes()"), frames[7], atol=1e-9)
    assert "t = 0.7 s" in opened.inner_text("#readout")


def test_the_simulator_swims_where_a_plan_says_and_nothing_jumps(opened):
    """Strokes of different recordings join: nothing moves farther than a tip in the fastest 0.1 s."""
    script = "path => { const s = swimPage.plan(path, [0, 0]); return [s.gaits, s.frames, s.waypoint.at(-1)]; }"
    gaits, frames, reached = opened.evaluate(script, PATH)
    frames, simulator, swum = np.array(frames), Simulator(Scene.preset("fast")), [np.zeros(2)]
    for stroke, command in enumerate(straight_gaits()[gaits].reshape(-1, N_LIMBS)):
        simulator.stroke(command[None])
        if stroke % CYCLE == CYCLE - 1:
            swum.append(simulator.hub_position()[0])
    length = np.linalg.norm(np.diff(swum, axis=0), axis=1).sum()
    assert np.linalg.norm(np.array(swum) - frames[:: CYCLE * FRAMES_PER_SECOND, 0], axis=1).max() < 0.1 * length
    assert reached == len(PATH) and np.linalg.norm(np.diff(frames, axis=0), axis=-1).max() < 0.08


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
