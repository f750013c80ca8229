"""The page that swims: what it records, and that it works in a browser, from disk and offline."""

import base64
import re
from pathlib import Path

import numpy as np
import pytest

from seastar_gym.evaluation.path_file import load_path
from seastar_gym.gaits import STRAIGHT
from seastar_gym.scene import Scene
from seastar_gym.simulator import Simulator
from studies.scenes import page
from studies.scenes.page import CYCLE, N_LIMBS, SEEN, UNIT, packed, record, runs, straight_gaits

NODES = 1 + SEEN * N_LIMBS
COMMITTED = Path(__file__).parents[2] / "docs" / "swim.html"
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


def test_numbers_are_packed_to_a_tenth_of_a_millimetre():
    values = np.array([0.0, 0.12344, -0.3])
    np.testing.assert_allclose(unpacked(packed(values / UNIT)), values, atol=0.5 * UNIT)


def test_runs_have_the_changes_only():
    assert runs(["a", "a", "b", "b", "a"]) == [[0, "a"], [2, "b"], [4, "a"]]


def test_gaits_lie_in_ten_directions(data):
    hub = np.array(data["map"]["hub"])[0]
    angles = np.degrees(np.arctan2(hub[:, 1], hub[:, 0])) % 360
    np.testing.assert_allclose((angles - 36.0 * np.arange(10) + 180) % 360 - 180, 0.0, atol=1.0)


def test_the_first_gait_and_its_opposite_are_the_chapters_pairs():
    gaits = straight_gaits()
    assert gaits.shape == (2 * N_LIMBS, CYCLE, N_LIMBS)
    np.testing.assert_array_equal(gaits[0][1], STRAIGHT)
    np.testing.assert_array_equal(gaits[N_LIMBS][0], -STRAIGHT)


def test_the_map_is_symmetric_under_the_mirror(data):
    hub, turn = np.array(data["map"]["hub"]), np.array(data["map"]["turn"])
    mirrored = -np.arange(10) % 10
    np.testing.assert_allclose(hub[:, mirrored] * [1, -1], hub, atol=2e-5)
    np.testing.assert_allclose(turn[:, mirrored], -turn, atol=2e-4)


def test_shapes_begin_at_the_origin_and_end_where_the_map_says(data):
    shapes = unpacked(data["map"]["nodes"]).reshape(3, 10, data["map"]["frames"], NODES, 2)
    np.testing.assert_allclose(shapes[:, :, 0, 0], 0.0, atol=UNIT)
    np.testing.assert_allclose(shapes[:, :, -1, 0], data["map"]["hub"], atol=UNIT)


def test_recorded_swims_have_a_frame_every_tenth_of_a_second(data):
    for swim, decision in zip(data["swims"], (0.2, 1.0), strict=True):
        frames = unpacked(swim["nodes"]).reshape(-1, NODES, 2)
        assert len(frames) == len(swim["waypoint"]) == 1 + round(6 * decision * page.FRAMES_PER_SECOND)
        assert np.abs(frames[-1, 0]).max() > 1e-3


def test_the_page_needs_nothing_beside_it(file):
    text = file.read_text(encoding="utf-8")
    assert not re.findall(r'\b(?:src|href)="(?!data:)', text)
    assert "{{" not in text


def test_the_committed_page_is_of_this_template():
    ours, theirs = page.TEMPLATE.read_text(encoding="utf-8").split("{{data}}"), COMMITTED.read_text(encoding="utf-8")
    assert theirs.startswith(ours[0]) and theirs.endswith(ours[1])


# In a browser


@pytest.fixture
def opened(open_offline, file, request):
    tab = open_offline(file, *getattr(request, "param", ()), reduced_motion="reduce")
    yield tab
    tab.context.close()


def planned(tab):
    """Swim along PATH that the page plans: commands of every stroke, and the hub at the end of every cycle [m]."""
    script = "path => { const s = swimPage.plan(path, [0, 0]); return [s.gaits, s.frames.map(f => f[0])]; }"
    gaits, hub = tab.evaluate(script, PATH)
    strokes = straight_gaits()[gaits].reshape(-1, N_LIMBS)
    return strokes, np.array(hub)[:: CYCLE * page.FRAMES_PER_SECOND]


def test_it_opens_offline_without_a_complaint(opened, file):
    assert opened.complaints == []
    assert [url for url in opened.requests if not url.startswith("data:")] == [file.as_uri()]


def test_the_slider_moves_the_robot_where_the_recording_has_it(opened, data):
    frames = unpacked(data["swims"][0]["nodes"]).reshape(-1, NODES, 2)
    opened.locator("#time").fill("7")
    np.testing.assert_allclose(opened.evaluate("swimPage.nodes()"), frames[7], atol=1e-9)
    assert "t = 0.7 s" in opened.inner_text("#readout")


def test_a_plan_reaches_its_waypoints(opened):
    reached = opened.evaluate("path => swimPage.plan(path, [0, 0]).waypoint.at(-1)", PATH)
    assert reached == len(PATH)


def test_the_simulator_swims_where_the_page_says(opened):
    strokes, hub = planned(opened)
    simulator, swum = Simulator(Scene.preset("fast")), [np.zeros(2)]
    for stroke, command in enumerate(strokes):
        simulator.stroke(command[None])
        if stroke % CYCLE == CYCLE - 1:
            swum.append(simulator.hub_position()[0])
    length = np.linalg.norm(np.diff(swum, axis=0), axis=1).sum()
    assert np.linalg.norm(np.array(swum) - hub, axis=1).max() < 0.1 * length


def test_neighbouring_frames_of_a_plan_are_near(opened):
    """Strokes of different recordings join without a jump: nothing moves farther than a tip in the fastest 0.1 s."""
    jumps = opened.evaluate(
        "path => { const f = swimPage.plan(path, [0, 0]).frames; return f.slice(1).map((g, i) =>"
        " Math.max(...g.map(([x, y], n) => Math.hypot(x - f[i][n][0], y - f[i][n][1])))); }",
        PATH,
    )
    assert max(jumps) < 0.08


def test_a_path_is_drawn_with_the_mouse(opened):
    box = opened.locator("#water").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    opened.mouse.move(x, y)
    opened.mouse.down()
    opened.mouse.move(x + 80, y - 60, steps=5)
    opened.mouse.up()
    assert "A planner swims your path" in opened.inner_text("#who")
    assert opened.inner_text("#play") == "Pause"
    assert opened.evaluate("swimPage.swim.path.length") >= 2
    assert opened.complaints == []


def test_a_drawn_path_is_a_file_for_the_policy(opened, tmp_path):
    opened.evaluate("path => swimPage.choose(swimPage.plan(path.map(([x, y]) => [x + 0.1, y]), [0.1, 0]))", PATH)
    with opened.expect_download() as saved:
        opened.click("#who a")
    saved.value.save_as(tmp_path / "path.csv")
    np.testing.assert_allclose(load_path(str(tmp_path / "path.csv")), PATH, atol=1e-4)
    opened.evaluate("swimPage.choose(swimPage.swims[0])")
    assert opened.inner_text("#who") == "A bundled policy swims, recorded from the simulator."


def test_the_page_has_a_title_and_a_way_back_unless_the_guide_frames_it(opened, file, tmp_path):
    assert opened.inner_text("h1") == opened.title() and opened.get_attribute("#back", "href").startswith("index.")
    (tmp_path / "index.html").write_text(f'<iframe src="{file.as_uri()}"></iframe>')
    opened.goto((tmp_path / "index.html").as_uri())
    opened.frame_locator("iframe").locator("#play").wait_for()
    assert not opened.frame_locator("iframe").locator("h1").is_visible()


def test_it_plays_to_the_end_and_begins_again(opened, data):
    last = len(data["swims"][0]["waypoint"]) - 1
    opened.select_option("#speed", "16")
    opened.click("#play")
    opened.wait_for_function("document.getElementById('play').textContent === 'Play'")
    assert float(opened.locator("#time").input_value()) == last
    opened.select_option("#speed", "1")
    opened.click("#play")
    assert opened.inner_text("#play") == "Pause"
    assert float(opened.locator("#time").input_value()) < last


@pytest.mark.parametrize(
    "opened", [(390, 700), (820, 1000), (1400, 720)], indirect=True, ids=["phone", "tablet", "desk"]
)
def test_it_fits_the_screen(opened):
    size = opened.viewport_size
    assert opened.evaluate("document.documentElement.scrollWidth") <= size["width"]
    box = opened.locator("#water").bounding_box()
    assert box["width"] > 0.9 * size["width"] and box["height"] > 0.4 * size["height"]
