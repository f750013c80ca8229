"""What is written of swims is as kept in tests/golden, and the report works in a browser, from disk and offline."""

import json
import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from PIL import Image

from drawn import drawn
from evaluation.made_up import MARKUP, swims
from refusals import assert_refused
from seastar_gym import Scene, UniformCurrent, Vortex
from seastar_gym.controllers.open_loop import scripted
from seastar_gym.envs.rendering import Frame
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.evaluation import pictures, report
from seastar_gym.evaluation.comparison import evaluate
from seastar_gym.evaluation.films import CLOSING_SECONDS, durations, film, shrunk
from seastar_gym.evaluation.playback import UNIT, Playback, RecordingEnv
from seastar_gym.evaluation.report import Curve, Remarks, ResultsTable
from seastar_gym.evaluation.results import COLUMNS, as_text, results, statistics, time_series, write_csv
from seastar_gym.evaluation.swim import swim
from seastar_gym.evaluation.trials import MEASURED
from seastar_gym.evaluation.trials import as_text as trials_as_text

MM = 1000.0
SHORT = [[0.02, 0.0], [0.02, 0.02]]
MINUS = "\u2212"
PROGRESS = {
    "straight": [[0, 400, 0], [1000, 400, 3], [2000, 200, 5], [3000, 170, 5]],
    "b": [[1000, 300, 5], [2000, 210, 5], [3000, 160, 5]],
    MARKUP: [[1000, 400, 4], [2000, 180, 5], [3000, 180, 5], [4000, 150, 5]],
}
"""Learning curves: strokes trained, strokes round the pentagon, waypoints reached."""
ENDS = [name + end for name in MEASURED for end in ("", "_low", "_high")]
TRIALS = ["path", "disturbance", "agent", "fidelity", "swims", *ENDS]
OF_SUCCESS, OF_OTHERS = (0.9951, 0.9912, 0.9983), (423, 400, 450, 80.02, 79.5, 80.5, 300, 290, 310)
TRIAL = ["random", "none", "a", "fast", 1000, *OF_SUCCESS, 160.04, 159, 161, "nan", "nan", "nan", *OF_OTHERS]
"""Names and numbers of a line of trials."""


def csv_of(*rows):
    return "\n".join(",".join(map(str, row)) for row in rows)


# Tables, CSV files, pictures and pages


@pytest.fixture
def kept(golden):
    """`golden` for texts whose numbers are rounded to a millionth, so that they are the same on every machine."""

    def rounded(number):
        return f"{round(float(number[0]), 6) + 0.0:.12g}"

    return lambda name, text: golden(name, re.sub(r"-?\d+\.\d{7,}(e-?\d+)?", rounded, text))


def test_tables_and_files_of_swims_are_as_kept(kept, tmp_path):
    done = swims()
    for name, rows in (("evaluation.csv", results(done)), ("trajectories.csv", time_series(done))):
        write_csv(rows, tmp_path / name)
        kept(name, (tmp_path / name).read_text(encoding="utf-8"))
    kept("evaluation.txt", "\n\n".join([as_text(done[:2]), as_text(done[2:])]))
    kept("statistics.txt", "\n".join(f"{name}: {found}" for name, found in statistics(done).items()))
    short = [replace(done[0], agent="straight"), replace(done[1], agent="2-,5+")]
    assert max(map(len, as_text(short).splitlines())) <= 80


def test_trials_are_as_kept(kept, tmp_path):
    file = tmp_path / "trials.csv"
    file.write_text(csv_of(TRIALS, TRIAL))
    rows = report.read_trials(file)
    kept("trials.txt", "\n\n".join([trials_as_text(rows), trials_as_text(rows, 0.2)]))
    kept("trials.html", report.table_html(report.trials_table(file)))


def test_traces_are_drawn_as_kept(kept, monkeypatch):
    """In the colours and styles of ten agents; the view is not stretched by who swims far away. With a current, too."""
    done, flow = swims(), UniformCurrent(1e-3, 0.0)
    many = drawn(monkeypatch, pictures, partial(pictures.draw_traces, [*done[:2], *done[:1] * 8], 2e-3))
    one = drawn(monkeypatch, pictures, partial(pictures.draw_traces, done[2:], 2e-3, current=flow))
    kept("traces.txt", f"{many}\n\n{one}")


def of_figure(figure, **how):
    """A figure of plotly as text, a trace or an entry of the layout a line."""
    made = json.loads(figure.to_json())
    template = made["layout"].pop("template")
    assert not template["data"].keys() - {"scatter"}
    lines = [*made["data"], *({name: entry} for name, entry in made["layout"].items()), how]
    return "\n".join(["", *(json.dumps(line, sort_keys=True) for line in lines), ""])


def playback_of(done):
    """A recorded swim of two frames a stroke."""
    nodes, command = Scene().robot.nodes()[::9], np.array([0.0, 1.0, 0.0, 0.0, -0.5])
    frames = [
        Frame(nodes + done.hub[(k + 1) // 2], command * (k > 2), done.hub[:0], int(done.waypoint_index[k // 2]), k / 2)
        for k in range(2 * done.strokes + 1)
    ]  # fmt: skip
    return Playback(done.agent, done.waypoints, 1.0, tuple(frames))


def test_a_report_is_as_kept(kept, monkeypatch, tmp_path):
    """With all that it can show; names and sentences are text, not markup."""
    (tmp_path / "report_template.html").write_text("{{title}}\n{{plotly}}\n{{sections}}\n{{swims}}\n")
    monkeypatch.setattr(report, "PAGE", tmp_path / "report_template.html")
    monkeypatch.setattr("plotly.offline.get_plotlyjs", lambda: "(plotly)")
    monkeypatch.setattr("plotly.io.to_html", of_figure)
    done = swims()[:2]
    curves = [Curve.of(name, rows) for name, rows in PROGRESS.items()]
    evil = {"agent": MARKUP, "success_rate": 1.0, "agent_low": MARKUP, "agent_high": MARKUP}
    table = ResultsTable("<Trials>", {"agent": "<agent>", "success_rate": "success"}, [evil])
    remarks = Remarks("<Test>", ["It was <easy>."], ["python <one>", "python two"], curves, [table])
    one, *two = Curve.of("a", PROGRESS["b"]), Curve.of("b", PROGRESS["b"][:1]), Curve.of("c", PROGRESS["b"])
    full = {"current": Vortex(1e-3), "films": {MARKUP: "stray &.mp4"}}
    for name, path, more, shown in (
        ("full", "pentagon", remarks, full),
        ("curves", SHORT, Remarks(curves=[one]), {}),
        ("plain", "pentagon", Remarks(curves=two), {}),
    ):
        recorded = list(map(playback_of, done))
        report.write_report(tmp_path / "report.html", path, done, recorded, 2e-3, more, **shown)
        text = (tmp_path / "report.html").read_text(encoding="utf-8")
        *_, swum = text.splitlines()
        assert MARKUP not in text and "<" not in swum and json.loads(swum)["swims"][1]["agent"] == MARKUP
        kept(f"report_{name}.txt", text.replace(',"', ',\n"'))
    titles = (re.sub(r"^(mean|largest) | \[.*", "", " ".join(title.split())) for title in COLUMNS.values())
    assert [title for title in titles if title not in f"{report._terms()} agent waypoints reached"] == []


READ = {
    "trials.csv": report.trials_table,
    "progress.csv": lambda file: report.read_progress(file.parent),
    "curve": lambda file: Curve.of("a", []),
}
"""Readers of files that a report shows."""


@pytest.mark.parametrize(
    "name, text, words",
    [
        ("trials.csv", "a,b\n1,2\n", "trials.csv is not what trials write"),
        ("trials.csv", csv_of(TRIALS), "trials.csv is not what trials write"),
        ("trials.csv", csv_of(TRIALS, [*TRIAL[:9], "x", *TRIAL[10:]]), "line 2: 'x' is no number"),
        ("trials.csv", csv_of(TRIALS, [*TRIAL, 3]), "line 2: the line must have 23"),
        ("progress.csv", "1000,400,3\n2000,2", "line 2: every line must have"),
        ("progress.csv", "1,2,.5\n", "be whole"),
        ("curve", "", "The training of a has no learning curve yet"),
    ],
)  # fmt: skip
def test_damaged_files_of_a_report_are_refused(name, text, words, tmp_path):
    (tmp_path / name).write_text(text)
    with assert_refused(words):
        READ[name](tmp_path / name)


def test_a_band_of_trainings_is_where_all_have_finished():
    """Also nowhere, and in two parts."""
    laps = {"a": [9, 8, 7, 6], "b": [9, None, 8, 7], "c": [8, 7, 6, 5]}
    curves = [
        Curve.of(name, [[k, lap or 400, 5 if lap else 3] for k, lap in enumerate(each)], 0.5)
        for name, each in laps.items()
    ]  # fmt: skip
    ranges = [trace for trace in report.curves_figure(curves, {}).data if trace.name == "range"]
    assert [(list(one.x), list(one.y), one.showlegend) for one in ranges] == [
        ([0.0], [4.5], True), ([2.0, 3.0], [4.0, 3.5], False)
    ]  # fmt: skip
    never = [Curve.of(name, [[k, 400, 0] for k in range(3)]) for name in laps]
    apart = [Curve.of(name, [[k, 9, 5]]) for k, name in enumerate(laps)]
    for others in (never, apart):
        assert "range" not in {trace.name for trace in report.curves_figure(others, {}).data}


# Recording, and the page in a browser


class ForthAndBack:
    """Two strokes {2+, 5-}, a rest, then {1+, 3-} for ever; its recurrent state counts."""

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        stroke = 0 if state is None else state
        return np.array([[0, 1, 0, 0, 2]] * 2 + [[0] * 5, [1, 0, 2, 0, 0]])[min(stroke, 3)], stroke + 1


def test_a_recording_is_the_swim_in_frames_and_changes_nothing():
    env = RecordingEnv(path=SHORT, fidelity="fast", frames_per_stroke=4)
    swim("before", ForthAndBack(), env, max_strokes=1)
    done = swim("a", ForthAndBack(), env, max_strokes=5)
    first, *_, last = [frame.trail for frame in env.playback("a").frames]
    assert len(first) == 1 and len(last) == 21 and np.shares_memory(first, last)  # or it costs the square of the length
    packed = env.playback("a").packed()
    assert packed["stroke"] == [0] + [stroke for stroke in range(1, 6) for _ in range(4)]
    ends = np.array(packed["nodes"])[::4]
    np.testing.assert_allclose(ends[:, :2] * UNIT, done.hub, atol=0.51 * UNIT)
    np.testing.assert_allclose(packed["time"], np.arange(21) / 4, atol=0.02)  # the nearest time steps
    assert packed["unit"] == "stroke"
    assert packed["commands"] == [[0] * 5, [0, 1, 0, 0, -1], [0, 1, 0, 0, -1], [0] * 5] + 2 * [[1, 0, -1, 0, 0]]
    assert packed["waypoint"][::4] == done.waypoint_index.tolist()
    plain = swim("a", ForthAndBack(), SeastarSwimEnv(path=SHORT, fidelity="fast"), max_strokes=5)
    np.testing.assert_array_equal(done.hub, plain.hub)
    assert env.render() == []


@pytest.fixture(scope="module")
def evaluated(tmp_path_factory):
    """Folder and swims of an evaluation with a report."""
    folder = tmp_path_factory.mktemp("report")
    remarks = Remarks(curves=[Curve.of("straight", PROGRESS["straight"])])
    agents = {"straight": scripted("straight"), MARKUP: ForthAndBack()}
    options = {"max_strokes": 9, "waypoint_radius": 2e-3, "fidelity": "fast", "video": False, "say": lambda text: None}
    return folder, evaluate(agents, SHORT, out=folder, report=remarks, **options)


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
        colours = self.page.evaluate("document.getElementById('playback').data.map(({line}) => line && line.color)")
        return [bytes.fromhex(colour[1:]) if colour else None for colour in colours]


@pytest.fixture(scope="module")
def opened(open_offline, evaluated):
    watched = Watched(open_offline(evaluated[0] / "report.html"))
    yield watched
    watched.page.context.close()


def test_the_robot_moves_as_slider_strokes_and_play_say_and_its_actuated_limbs_are_blue(opened, evaluated):
    folder, (straight, stray) = evaluated
    opened.choose("straight")
    opened.page.wait_for_selector("#curves .main-svg")
    assert [url for url in opened.requests if not url.startswith("data:")] == [(folder / "report.html").as_uri()]
    for stroke in (0, 1, 4):
        opened.move_to(3 * stroke)
        _, trail, resting, minus, plus, hub, _ = opened.lines()
        np.testing.assert_allclose(hub[0], MM * straight.hub[stroke], atol=0.06)
        np.testing.assert_allclose(trail[::3], MM * straight.hub[: stroke + 1], atol=0.06)
        of_limb = Scene.preset("fast").robot.nodes_per_limb
        heated = 0 if stroke == 0 else of_limb
        assert (len(resting), len(minus), len(plus)) == (5 * of_limb - 2 * heated, heated, heated)
        assert f"stroke {stroke} of {straight.strokes}" in opened.page.inner_text("#readout")
    _, _, *colours, _, _ = opened.colours()
    assert [blue > 1.4 * max(red, green) for red, green, blue in colours] == [False, True, True]
    items, play, time = (opened.page.locator(name) for name in ("#strokes li", "#play", "#time"))
    assert items.count() == straight.strokes
    opened.choose(MARKUP)
    assert items.count() == stray.strokes
    listed = [" ".join(item.split()) for item in items.all_inner_texts()]
    assert listed[:4] == [f"1 2+ 5{MINUS}", f"2 2+ 5{MINUS}", "3 rest", f"4 1+ 3{MINUS}"]
    items.nth(3).click()
    assert time.input_value() == str(3 * 4)
    assert opened.page.locator("#strokes [aria-current]").inner_text().split()[0] == "4"
    np.testing.assert_allclose(opened.lines()[5][0], MM * stray.hub[4], atol=0.06)
    opened.choose("straight")
    opened.move_to(3 * straight.strokes - 1)
    play.click()
    opened.page.wait_for_function("document.getElementById('play').textContent === 'Play'")
    assert time.input_value() == str(3 * straight.strokes)
    play.click()
    assert play.inner_text() == "Pause"
    play.click()
    assert int(time.input_value()) < 3 * straight.strokes and opened.complaints == []


# Films have their pictures, in their order and for their time.


BLUE, RED = (np.array(colour, np.uint8) for colour in ((20, 60, 200), (200, 30, 30)))


def picture(colour, column):
    """A picture with a bar at a column."""
    made = np.full((96, 128, 3), 250, np.uint8)
    made[:, column : column + 16] = colour
    return made


@pytest.mark.parametrize("fps", [10.0, 25.0])
def test_a_gif_shows_every_picture_and_rests_on_the_last(tmp_path, fps):
    shown = [picture(BLUE, 0), picture(RED, 40), picture(BLUE, 80)]
    with film(tmp_path / "film.gif", fps) as add:
        for each in shown:
            add(each)
    with Image.open(tmp_path / "film.gif") as frames:
        times = []
        for number in range(frames.n_frames):
            frames.seek(number)
            times.append(frames.info["duration"])
            if number < 3:
                np.testing.assert_allclose(np.asarray(frames.convert("RGB")), shrunk(shown[number]), atol=12)
    assert times[:2] == [round(1000 / fps)] * 2
    assert sum(times[2:]) == pytest.approx(1000 * (1 / fps + CLOSING_SECONDS), rel=0.1)


@pytest.mark.parametrize("name", ["film.gif", "film.mp4"])
def test_a_film_without_pictures_or_that_fails_leaves_what_was_there(name, tmp_path):
    (tmp_path / name).write_text("before")
    with film(tmp_path / name, 10.0):
        pass
    with pytest.raises(ValueError, match="A picture must be"), film(tmp_path / name, 10.0) as add:
        (add(picture(BLUE, 0)), add("no picture"))
    assert {file.name: file.read_text() for file in tmp_path.iterdir()} == {name: "before"}


@pytest.mark.parametrize("fps", [0.5, 7.0, 30.0, 40.0, 66.0, 200.0, 1000.0])
def test_a_gif_is_as_long_as_its_pictures_and_none_is_too_short_to_be_shown(fps):
    shown = durations(100, fps)
    assert sum(shown.values()) == pytest.approx(10000.0 / fps, abs=2.0) and min(shown.values()) >= 2
    assert min(shown) == 0 and (fps > 40.0 or len(shown) == 100)
