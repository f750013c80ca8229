"""The report of an evaluation: what stands on the page, and that it works in a browser, from disk and offline."""

import csv
import json
import re
import sys
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from refusals import assert_refused, assert_told
from seastar_gym.cli.evaluate import main
from seastar_gym.controllers.scripted import scripted
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.evaluation.comparison import evaluate
from seastar_gym.evaluation.films import CLOSING_SECONDS, film, film_format, frequent_colours, shrunk, write_gif
from seastar_gym.evaluation.playback import UNIT, RecordingEnv
from seastar_gym.evaluation.report.charts import (
    Curve,
    curves_figure,
    paths_figure,
    read_progress,
    to_html,
)
from seastar_gym.evaluation.report.page import Remarks, ResultsTable, table_html, trials_table
from seastar_gym.evaluation.results import COLUMNS, number
from seastar_gym.evaluation.swim import swim
from seastar_gym.evaluation.trials import MEASURED
from seastar_gym.scene import Scene, Vortex, Water

MM = 1000.0
SHORT = [[0.02, 0.0], [0.02, 0.02]]
MINUS = "\u2212"
STRAY = '</script><b>"stray" & co</b>'
PROGRESS = [[1000, 400, 3], [2000, 200, 5], [3000, 170, 5]]


class ForthAndBack:
    """Two strokes {2+, 5-}, a rest, then {1+, 3-} for ever; its recurrent state counts."""

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        stroke = 0 if state is None else state
        return np.array([[0, 1, 0, 0, 2]] * 2 + [[0] * 5, [1, 0, 2, 0, 0]])[min(stroke, 3)], stroke + 1


@pytest.fixture(scope="module")
def evaluated(tmp_path_factory):
    """Folder and swims of an evaluation with a report."""
    folder = tmp_path_factory.mktemp("report")
    swims = evaluate(
        {"straight": scripted("straight"), STRAY: ForthAndBack()},
        SHORT,
        max_strokes=9,
        waypoint_radius=2e-3,
        fidelity="fast",
        video=False,
        out=folder,
        report=Remarks(
            title="Test",
            sentences=["It was <easy>."],
            commands=["python one", "python two"],
            curves=[Curve.of("straight", PROGRESS)],
        ),
        say=lambda text: None,
    )
    return folder, swims


@pytest.fixture(scope="module")
def text(evaluated):
    return (evaluated[0] / "report.html").read_text(encoding="utf-8")


# Recording


def test_a_recording_is_the_swim_in_frames():
    env = RecordingEnv(path=SHORT, fidelity="fast", frames_per_stroke=4)
    done = swim("a", ForthAndBack(), env, max_strokes=5)
    packed = env.playback("a").packed()
    assert packed["stroke"] == [0] + [stroke for stroke in range(1, 6) for _ in range(4)]
    ends = np.array(packed["nodes"])[::4]
    np.testing.assert_allclose(ends[:, :2] * UNIT, done.hub, atol=0.51 * UNIT)
    np.testing.assert_allclose(packed["time"], np.arange(21) / 4, atol=0.02)  # the nearest time steps
    assert packed["unit"] == "stroke"
    assert packed["commands"] == [[0] * 5, [0, 1, 0, 0, -1], [0, 1, 0, 0, -1], [0] * 5] + 2 * [[1, 0, -1, 0, 0]]
    assert packed["waypoint"][::4] == done.waypoint_index.tolist()


def test_recording_changes_nothing_and_draws_nothing():
    env = RecordingEnv(path=SHORT, fidelity="fast", frames_per_stroke=3)
    recorded = swim("a", ForthAndBack(), env, max_strokes=4)
    plain = swim("a", ForthAndBack(), SeastarSwimEnv(path=SHORT, fidelity="fast"), max_strokes=4)
    np.testing.assert_array_equal(recorded.hub, plain.hub)
    assert env.render() == []


def test_a_new_episode_is_a_new_recording():
    env = RecordingEnv(path=SHORT, fidelity="fast", frames_per_stroke=2)
    swim("a", ForthAndBack(), env, max_strokes=2)
    swim("a", ForthAndBack(), env, max_strokes=1)
    assert len(env.playback("a").frames) == 3


# The page as text


def test_the_page_needs_nothing_beside_it_and_is_light(text):
    assert len(text) < 6_000_000
    own = re.sub(r"<script>.*?</script>", "", text, flags=re.DOTALL)
    assert not re.findall(r'\b(?:src|href)="(?!data:)', own)
    assert "{{" not in own


def test_names_and_sentences_are_text_not_markup(text):
    assert STRAY not in text
    assert ">&lt;/script&gt;&lt;b&gt;&quot;stray&quot; &amp; co&lt;/b&gt;</td>" in text
    assert "It was &lt;easy&gt;." in text


def test_the_table_has_the_numbers_of_the_csv(evaluated, text):
    with (evaluated[0] / "evaluation.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    lines = [line for line in text.splitlines() if line.startswith('<tr><td class="words" data-name="agent">')]
    assert len(lines) == len(rows) == 2
    for line, row in zip(lines, rows, strict=True):
        shown = dict(re.findall(r'data-name="(\w+)">([^<]*)<', line))
        assert set(shown) == set(COLUMNS)
        for name in ("simulated_time_s", "mean_cross_track_error_mm", "limbs_heated_per_metre"):
            assert shown[name] == f"{float(row[name]):.1f}"
        assert shown["strokes_to_finish"] == (row["strokes_to_finish"] or "\u2013")
        assert shown["waypoints_reached"] == f"{row['waypoints_reached']} of {row['waypoints']}"


@pytest.mark.parametrize("value, shown", [(None, "\u2013"), (3, "3"), (2.345, "2.3"), ("1 of 5", "1 of 5")])
def test_numbers_are_shown_to_a_tenth(value, shown):
    assert number(value) == shown


def test_trials_are_shown_with_their_confidence_intervals(tmp_path):
    measured = [name + end for name in MEASURED for end in ("", "_low", "_high")]
    header = ["path", "disturbance", "agent", "fidelity", "swims", *measured]
    row = ["random", "none", "a", "fast", 1000]
    row += [0.9951, 0.9912, 0.9983, 160.04, 159, 161, "nan", "nan", "nan"]
    row += [423, 400, 450, 80.02, 79.5, 80.5, 300, 290, 310]
    (tmp_path / "trials.csv").write_text("\n".join(",".join(map(str, line)) for line in (header, row)) + "\n")
    table = trials_table(tmp_path / "trials.csv")
    cells = re.findall(r'data-name="(\w+)">(.*?)</td>', table_html(table))
    assert {name: re.sub("<.*?>", "", cell) for name, cell in cells} == {
        "path": "random", "disturbance": "none", "agent": "a", "fidelity": "fast", "swims": "1000",
        "success_rate": "99.5 [99.1, 99.8]",
        "strokes_to_finish": "160.0 [159.0, 161.0]", "mean_cross_track_error_mm": "\u2013",
        "limbs_heated_per_metre": "423.0 [400.0, 450.0]",
        "simulated_time_s": "80.0 [79.5, 80.5]", "energy_per_metre_J": "300.0 [290.0, 310.0]",
    }  # fmt: skip
    (tmp_path / "other.csv").write_text("a,b\n1,2\n")
    with pytest.raises(ValueError, match=r"other.csv is not what trials write"):
        trials_table(tmp_path / "other.csv")
    for place, field, words in ((9, "x", "line 2: 'x' is no number"), (8, "9,9", "line 2: the line must have 23")):
        wrong = [*row[:place], field, *row[place + 1 :]]
        (tmp_path / "other.csv").write_text("\n".join(",".join(map(str, line)) for line in (header, wrong)) + "\n")
        with assert_refused(words):
            trials_table(tmp_path / "other.csv")


def test_every_column_of_trials_is_text_not_markup(tmp_path):
    """Whatever columns a CSV has: `agent_low` would be an interval of the agent."""
    measured = [name + end for name in MEASURED for end in ("", "_low", "_high")]
    words = ["path", "disturbance", "agent", "fidelity", "swims"]
    header = [*words, *measured, *(name + end for name in words for end in ("_low", "_high"))]
    evil = '"<img src=x onerror=alert(1)>"'
    row = [*[evil] * 5, *["1.0"] * len(measured), *[evil] * 10]
    (tmp_path / "trials.csv").write_text(",".join(header) + "\n" + ",".join(row) + "\n")
    assert "<img" not in table_html(trials_table(tmp_path / "trials.csv"))
    rows = [{"agent": "a", "agent_low": "<img>", "agent_high": "<img>"}]
    assert "<img" not in table_html(ResultsTable("Trials", {"agent": "agent"}, rows))
    (tmp_path / "trials.csv").write_text(",".join(header) + "\n" + ",".join(["inf" if f == "1.0" else f for f in row]))
    with assert_refused("'inf' is no finite number"):
        trials_table(tmp_path / "trials.csv")


def test_errors_of_a_swim_that_never_arrived_are_grey(text):
    """The straight gait does not arrive, and no other number of it is grey."""
    for line in text.splitlines():
        if line.startswith('<tr><td class="words" data-name="agent">'):
            grey = re.findall(r'class="faint" title="[^"]+" data-name="(\w+)"', line)
            assert grey == ["mean_cross_track_error_mm", "largest_cross_track_error_mm"]
    arrived = {"agent": "a", "strokes_to_finish": 3, "mean_cross_track_error_mm": 1.0}
    assert "faint" not in table_html(ResultsTable("Results", dict.fromkeys(arrived, "t"), [arrived]))


def test_every_column_is_explained(text):
    terms = " ".join(re.findall(r"<dt>(.*?)</dt>", text))
    titles = (re.sub(r"^(mean|largest) | \[.*", "", " ".join(title.split())) for title in COLUMNS.values())
    assert [title for title in titles if title not in f"{terms} agent waypoints reached"] == []


# Learning curves


def test_a_curve_has_a_gap_where_the_pentagon_was_not_finished(tmp_path):
    (tmp_path / "progress.csv").write_text("\n".join(",".join(map(str, row)) for row in PROGRESS) + "\n")
    curve = Curve.of("a", read_progress(tmp_path))
    np.testing.assert_array_equal(curve.trained, [1000, 2000, 3000])
    np.testing.assert_array_equal(curve.pentagon, [np.nan, 200, 170])
    trace, unfinished = curves_figure([curve], {}).data
    assert list(trace.y) == [None, 200, 170]
    assert unfinished.name == "not finished" and list(unfinished.x) == [1000] and unfinished.y[0] > 200


@pytest.mark.parametrize(
    "text, words",
    [("1000,400,3\n2000,2", "line 2: every line must have"), ("1,2,x\n", "'x' is no number"), ("1,2,.5\n", "be whole")],
)
def test_a_damaged_curve_is_refused_with_its_line(tmp_path, text, words):
    (tmp_path / "progress.csv").write_text(text)
    with assert_refused(str(tmp_path / "progress.csv"), words):
        read_progress(tmp_path)


def test_a_curve_begins_with_the_untrained_policy():
    figure = curves_figure([Curve.of("a", [[0, 400, 0], *PROGRESS])], {})
    trace, unfinished = figure.data
    assert trace.x[0] == unfinished.x[0] == 0 and figure.layout.xaxis.rangemode == "tozero"
    assert len(curves_figure([Curve.of("a", PROGRESS[1:])], {}).data) == 1  # all finished


def test_a_training_without_a_checkpoint_has_no_curve():
    with assert_refused("The training of a has no learning curve yet"):
        Curve.of("a", [])


def test_several_curves_have_their_median_and_range():
    finished = {"a": 170, "b": 160, "c": 180}
    curves = [Curve.of(name, [[1, 9, 4], [2, strokes, 5]]) for name, strokes in finished.items()]
    lowest, highest, median, *each, unfinished = curves_figure(curves, {"script": 241}).data
    for trace, strokes in ((lowest, 160), (highest, 180), (median, 170)):  # common and finished: at 2
        assert (list(trace.x), list(trace.y)) == ([2], [strokes])
    assert [one.name for one in each] == ["a", "b", "c"] and list(unfinished.x) == [1, 1, 1]


def test_every_waypoint_is_a_circle(evaluated):
    circles = [[one.x0, one.x1, one.y0, one.y1] for one in paths_figure(evaluated[1], 2e-3).layout.shapes]
    np.testing.assert_allclose(circles, [[18.0, 22.0, -2.0, 2.0], [18.0, 22.0, 18.0, 22.0]])


def test_names_in_pictures_are_text_not_markup():
    page = to_html(curves_figure([Curve.of(STRAY, PROGRESS)], {STRAY: 241}), "curves")
    assert STRAY not in page


# The command line


def test_command_line_writes_the_report_with_the_curves_of_runs(tmp_path, capsys):
    run = tmp_path / "run"
    run.mkdir()
    (run / "progress.csv").write_text("1000,200,5\n2000,190,5\n")
    arguments = ["--agents", "learned", "straight", "--waypoint-radius", "0.5", "--no-video", "--report", "--runs"]
    assert main([*arguments, str(run), "--fidelity", "fast", "--out", str(tmp_path / "out")]) == 0
    assert "report.html" in capsys.readouterr().out
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert '"name":"run"' in page and '"name":"learned"' not in page and "agent straight: 1" in page
    assert "python train.py" in page
    assert "seastar evaluate --agents learned straight" in page


def test_a_folder_without_a_run_is_answered_with_one_sentence(tmp_path, capsys):
    assert main(["--report", "--runs", str(tmp_path), "--out", str(tmp_path / "out")]) == 2
    assert_told(capsys, "progress.csv")


# In a browser


class Watched:
    """A report in the browser, and what it complained about or asked for."""

    def __init__(self, page):
        self.page, self.complaints, self.requests = page, page.complaints, page.requests

    def choose(self, agent):
        self.page.get_by_role("radio", name=agent).click()

    def move_to(self, frame):
        self.page.locator("#time").fill(str(frame))

    def lines(self):
        """Points of every line of the player's picture [mm], by the order that it draws them in; without gaps."""
        data = self.page.evaluate("document.getElementById('playback').data.map(({x, y}) => [x, y])")
        return [np.array([point for point in zip(*line, strict=True) if None not in point]) for line in data]

    def colours(self):
        return self.page.evaluate("document.getElementById('playback').data.map(({line}) => line && line.color)")


@pytest.fixture(scope="module")
def page(open_offline, evaluated):
    watched = Watched(open_offline(evaluated[0] / "report.html"))
    yield watched
    watched.page.context.close()


def test_a_current_and_films_are_on_the_page(tmp_path):
    scene = replace(Scene.preset("fast"), fluid=Water(current=Vortex(1e-3)))
    agents = {"straight & on": scripted("straight")}
    evaluate(agents, SHORT, max_strokes=2, scene=scene, out=tmp_path, report=Remarks(), say=lambda text: None)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    (film,) = re.findall(r'Films: <a href="([^"]+)">straight &amp; on</a>', text)
    assert (tmp_path / film).is_file() and '"name":"current up to' in text
    (recorded,) = re.findall(r"^const recorded = (.*);$", text, flags=re.MULTILINE)
    assert np.array(json.loads(recorded)["current"]).shape[1:] == (2, 2)


def test_the_dark_mode_has_no_light_picture(open_offline, evaluated):
    watched = Watched(open_offline(evaluated[0] / "report.html", color_scheme="dark"))
    watched.page.wait_for_function("document.getElementById('playback').layout.font.color === '#e4e8ee'")
    papers = watched.page.evaluate("[...document.querySelectorAll('.bg, .main-svg')].map((e) => e.style.fill)")
    assert not [paper for paper in papers if "255" in paper]
    assert watched.page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(19, 20, 22)"
    watched.page.emulate_media(color_scheme="light")
    watched.page.wait_for_function("document.getElementById('playback').layout.font.color === '#3a404a'")
    assert watched.complaints == []
    watched.page.context.close()


@pytest.fixture
def opened(page):
    """One page for all tests, because it takes a while to load: with the first agent at the start."""
    page.choose("straight")
    page.move_to(0)
    return page


def test_it_opens_offline_without_a_complaint(opened, evaluated):
    opened.page.wait_for_selector("#curves .main-svg")
    assert opened.complaints == []
    assert [url for url in opened.requests if not url.startswith("data:")] == [(evaluated[0] / "report.html").as_uri()]


def test_the_slider_moves_the_robot(opened, evaluated):
    _, (straight, _) = evaluated
    for stroke in (0, 1, 4):
        opened.move_to(3 * stroke)
        _, trail, resting, minus, plus, hub, _ = opened.lines()
        np.testing.assert_allclose(hub[0], MM * straight.hub[stroke], atol=0.06)
        np.testing.assert_allclose(trail[::3], MM * straight.hub[: stroke + 1], atol=0.06)
        of_limb = Scene.preset("fast").robot.nodes_per_limb
        heated = 0 if stroke == 0 else of_limb
        assert (len(resting), len(minus), len(plus)) == (5 * of_limb - 2 * heated, heated, heated)
        assert f"stroke {stroke} of {straight.strokes}" in opened.page.inner_text("#readout")
    assert opened.complaints == []


def test_actuated_limbs_are_blue(opened):
    _, _, resting, minus, plus, *_ = opened.colours()
    for colour in (minus, plus):
        red, green, blue = bytes.fromhex(colour[1:])
        assert blue > 1.4 * max(red, green)
    red, green, blue = bytes.fromhex(resting[1:])
    assert blue < 1.4 * red


def test_every_stroke_is_listed_and_leads_there(opened, evaluated):
    _, (straight, stray) = evaluated
    items = opened.page.locator("#strokes li")
    assert items.count() == straight.strokes
    opened.choose(STRAY)
    assert items.count() == stray.strokes
    listed = [" ".join(item.split()) for item in items.all_inner_texts()]
    assert listed[:4] == [f"1 2+ 5{MINUS}", f"2 2+ 5{MINUS}", "3 rest", f"4 1+ 3{MINUS}"]
    items.nth(3).click()
    assert opened.page.locator("#time").input_value() == str(3 * 4)
    assert opened.page.locator("#strokes [aria-current]").inner_text().split()[0] == "4"
    np.testing.assert_allclose(opened.lines()[5][0], MM * stray.hub[4], atol=0.06)


def test_it_plays_to_the_end_and_begins_again(opened, evaluated):
    _, (straight, _) = evaluated
    opened.move_to(3 * straight.strokes - 1)
    play = opened.page.locator("#play")
    play.click()
    opened.page.wait_for_function("document.getElementById('play').textContent === 'Play'")
    assert opened.page.locator("#time").input_value() == str(3 * straight.strokes)
    play.click()
    assert play.inner_text() == "Pause"
    play.click()
    assert int(opened.page.locator("#time").input_value()) < 3 * straight.strokes


def test_a_phone_sees_every_column(open_offline, evaluated):
    watched = Watched(open_offline(evaluated[0] / "report.html", 390, 844))
    cells = watched.page.locator("tbody tr").first.locator("td")
    assert cells.count() == len(COLUMNS)
    for place in range(cells.count()):
        box = cells.nth(place).bounding_box()
        assert box["x"] >= 0 and box["x"] + box["width"] <= 390
        assert cells.nth(place).get_attribute("data-title")
    watched.page.context.close()


@pytest.mark.parametrize("size", [(1366, 768), (390, 844)], ids=["laptop", "phone"])
def test_it_fits_the_screen_with_equal_scales(open_offline, evaluated, size):
    watched = Watched(open_offline(evaluated[0] / "report.html", *size))
    watched.page.wait_for_selector("#paths .main-svg")
    assert watched.page.evaluate("document.documentElement.scrollWidth") <= size[0]
    watched.page.wait_for_selector("#speeds .main-svg")
    for name in ("playback", "paths"):
        scales = watched.page.evaluate(
            f"""['xaxis', 'yaxis'].map((axis) => {{
                const {{ range, _length }} = document.getElementById("{name}")._fullLayout[axis];
                return _length / (range[1] - range[0]);
            }})"""
        )
        assert scales[0] == pytest.approx(scales[1], rel=1e-3)
        box = watched.page.locator(f"#{name}").bounding_box()
        assert box["height"] <= size[1] and box["width"] >= 0.6 * min(size[0], 1120)
    titles = watched.page.evaluate(
        "[...document.querySelectorAll('.xtitle, .ytitle')].map((title) => title.textContent)"
    )
    assert len(titles) == 2 * len(["playback", "paths", "curves"])
    assert {"x [mm]", "y [mm]", "strokes trained"} <= set(titles)
    watched.page.context.close()
    assert watched.complaints == []


def test_the_recorded_swims_are_plain_json(text):
    (recorded,) = re.findall(r"^const recorded = (.*);$", text, flags=re.MULTILINE)
    assert [one["agent"] for one in json.loads(recorded)["swims"]] == ["straight", STRAY]
    assert json.loads(recorded)["path"] == [[0.0, 0.0], [20.0, 0.0], [20.0, 20.0]]


# Films have their pictures, in their order and for their time.


BLUE, RED = np.array([20, 60, 200], np.uint8), np.array([200, 30, 30], np.uint8)


def picture(colour, column):
    """A picture with a bar at a column."""
    made = np.full((96, 128, 3), 250, np.uint8)
    made[:, column : column + 16] = colour
    return made


@pytest.mark.parametrize("fps", [10.0, 25.0])
def test_a_gif_shows_every_picture_and_rests_on_the_last(tmp_path, fps):
    pictures = [picture(BLUE, 0), picture(RED, 40), picture(BLUE, 80)]
    with film(tmp_path / "film.gif", fps) as add:
        for one in pictures:
            add(one)
    with Image.open(tmp_path / "film.gif") as shown:
        times = []
        for number in range(shown.n_frames):
            shown.seek(number)
            times.append(shown.info["duration"])
            if number < 3:
                np.testing.assert_allclose(np.asarray(shown.convert("RGB")), shrunk(pictures[number]), atol=12)
    assert times[:2] == [round(1000 / fps)] * 2
    assert sum(times[2:]) == pytest.approx(1000 * (1 / fps + CLOSING_SECONDS), rel=0.1)


def test_a_small_flat_area_keeps_its_colour_among_many_others(tmp_path):
    """As a waypoint does, whose pale fill is near the paper's colour, beside lines that are blended."""
    many = np.full((120, 160, 3), 250, np.uint8)
    many[20:100, 20:140] = np.random.default_rng(0).integers(0, 255, (80, 120, 3))
    pale = np.array([219, 231, 245], np.uint8)
    many[4:12, 4:12] = pale
    assert frequent_colours(many, 2).tolist() == [[250] * 3, pale.tolist()]
    write_gif([many], tmp_path / "film.gif", 10.0)
    with Image.open(tmp_path / "film.gif") as shown:
        np.testing.assert_array_equal(np.asarray(shown.convert("RGB"))[8, 8], pale)


def test_a_small_picture_is_the_mean_of_blocks():
    made = np.zeros((3, 4, 3), np.uint8)
    made[0, 0] = 100
    assert shrunk(made).tolist() == [[[25] * 3, [0] * 3]]


def test_no_picture_makes_no_gif(tmp_path):
    with film(tmp_path / "film.gif", 10.0):
        pass
    assert not (tmp_path / "film.gif").exists()


def test_other_files_and_missing_writers_are_refused(tmp_path, monkeypatch):
    with assert_refused("A film is an .mp4 or a .gif, not film.webm."):
        film_format(tmp_path / "film.webm")
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    monkeypatch.setattr("seastar_gym.extras.find_spec", lambda name: None if name == "imageio_ffmpeg" else name)
    with pytest.raises(ModuleNotFoundError, match=r"Films need imageio_ffmpeg: pip install .*\[render\]"):
        film_format(tmp_path / "film.mp4")
    assert film_format(tmp_path / "film.GIF") == ".gif"
