"""Evaluation: the measures of a swim, and the table, CSV, picture and videos made of them."""

import csv
import subprocess
import sys
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import get_args

import gymnasium as gym
import imageio.v3 as imageio
import numpy as np
import pytest
from matplotlib.colors import to_rgb

from refusals import assert_told
from seastar_gym import TASKS, Scene, Seastar, SmaPulse, UniformCurrent
from seastar_gym.cli.evaluate import main
from seastar_gym.controllers.description import Description
from seastar_gym.controllers.learned import LearnedPolicy, save
from seastar_gym.controllers.registry import load_agents
from seastar_gym.controllers.scripted import scripted
from seastar_gym.envs.commands import Actions, action_space, decisions_in, to_commands
from seastar_gym.envs.options import SwimOptions
from seastar_gym.envs.paths import PENTAGON_SIDE, make_path
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.task import SwimTask
from seastar_gym.envs.tasks.envs import CHALLENGES
from seastar_gym.evaluation import pictures
from seastar_gym.evaluation.comparison import evaluate
from seastar_gym.evaluation.films import CLOSING_SECONDS
from seastar_gym.evaluation.measures import MEASURES, SECONDS, measure_of, measure_of_challenge
from seastar_gym.evaluation.pictures import COLOURS, FPS, FRAMES_PER_STROKE
from seastar_gym.evaluation.rollout import Episodes, TaskBatch, rollout
from seastar_gym.evaluation.swim import RECORDED, Swim, swim, swims_of
from seastar_gym.evaluation.tasks import make_batch

ROOT = Path(__file__).resolve().parents[2]
SHORT = [[0.02, 0.0]]
EASY = {"fidelity": "fast", "waypoint_radius": 2e-3, "say": lambda text: None}


def made_up_swim(hub, waypoint_index, waypoints=((0.1, 0.0), (0.1, 0.1)), limbs_heated=None):
    hub = np.array(hub, dtype=float)
    return Swim(
        agent="made up",
        waypoints=np.array(waypoints),
        hub=hub,
        waypoint_index=np.array(waypoint_index),
        time=np.arange(float(len(hub))),
        limbs_heated=np.full(len(hub) - 1, 2) if limbs_heated is None else np.array(limbs_heated),
        heating_time=np.full(len(hub) - 1, 0.2),
        energy=np.full(len(hub) - 1, 1.5),
        solver_message=None,
    )


# Measures of a swim


def test_following_the_path_round_a_corner_is_no_error():
    hub = [(0.0, 0.0), (0.095, 0.0), (0.1, 0.0), (0.1, 0.05), (0.1, 0.1)]
    done = made_up_swim(hub, [0, 1, 1, 1, 2])  # the first waypoint is reached 5 mm early
    np.testing.assert_allclose(done.cross_track_errors, 0.0, atol=1e-15)
    assert done.finished


def test_straying_is_measured_from_the_legs_at_hand():
    hub = [(0.0, 0.0), (0.05, 0.02), (0.11, 0.0), (0.13, 0.05)]
    done = made_up_swim(hub, [0, 0, 1, 1])
    np.testing.assert_allclose(done.cross_track_errors, [0.02, 0.01, 0.03])
    assert not done.finished


def test_a_leg_that_is_yet_to_come_does_not_count_as_the_path():
    done = made_up_swim([(0.0, 0.0), (0.05, 0.05)], [0, 0], waypoints=((0.1, 0.0), (0.1, 0.1), (0.0, 0.0)))
    np.testing.assert_allclose(done.cross_track_errors, [0.05])


def test_heating_is_counted_per_metre_of_the_hubs_way():
    done = made_up_swim([(0.0, 0.0), (0.03, 0.0), (0.03, 0.04)], [0, 0, 0], limbs_heated=[2, 5])
    assert done.heated_per_metre == pytest.approx(7 / 0.07)
    assert done.joules_per_metre == pytest.approx(3.0 / 0.07) and done.seconds_heated == pytest.approx(0.4)
    still = made_up_swim([(0.0, 0.0), (0.0, 0.0)], [0, 0])
    assert still.heated_per_metre is None and still.joules_per_metre is None


def test_the_way_of_a_timed_swim_is_that_from_second_to_second():
    """To and fro within a second is no way."""
    hub = [(0.0, 0.0), (0.02, 0.0), (0.01, 0.0), (0.03, 0.0), (0.02, 0.0), (0.04, 0.0)]
    done = made_up_swim(hub, [0] * 6)
    assert replace(done, time=0.5 * done.time).hub_path_length == pytest.approx(0.04)
    assert done.hub_path_length == pytest.approx(0.08)


def test_a_time_limit_counts_the_strokes_of_the_scenes_actuator():
    short = Scene(actuator=SmaPulse(cooling_time=0.4))
    assert [decisions_in(400.0, None, scene) for scene in (None, Scene(), short)] == [400, 400, 800]
    assert decisions_in(400.0, 0.2, short) == 2000 and decisions_in(0.1, None, short) == 1


def test_an_evaluation_ends_after_400_s_whatever_a_stroke_takes(monkeypatch):
    monkeypatch.setattr("seastar_gym.evaluation.comparison.TIME_LIMIT", 4.0)
    short = replace(Scene.preset("fast"), actuator=SmaPulse(cooling_time=0.4))
    (done,) = evaluate({"rest": scripted("rest")}, scene=short, say=str)
    assert done.strokes == 8 and done.time[-1] == pytest.approx(4.0)


def test_unknown_energy_is_no_number():
    done = made_up_swim([(0.0, 0.0), (0.03, 0.0)], [0, 0])
    unknown = replace(done, heating_time=np.full(1, np.nan), energy=np.full(1, np.nan))
    assert unknown.joules_per_metre is None and unknown.seconds_heated is None


def test_the_scripted_pentagon_rounds_the_pentagon():
    traced = make_path("pentagon", np.random.default_rng(0)) * (0.14356 / PENTAGON_SIDE)  # by the scripted gait
    (done,) = evaluate({"script": scripted("pentagon")}, traced, fidelity="balanced")
    assert done.waypoints_reached == 5
    assert 240 <= done.strokes <= 242  # it enters the last waypoint's radius before it stops
    assert done.cross_track_errors.mean() < 1e-3
    assert done.cross_track_errors.max() < 6e-3  # it overshoots the corners, and drifts back while it rests


def test_an_agent_swims_the_same_in_every_action_mode():
    agents = {actions: scripted("straight", actions) for actions in ("limbs", "joint", "pairs")}
    limbs, joint, pairs = evaluate(agents, SHORT, **EASY)
    np.testing.assert_array_equal(joint.hub, limbs.hub)
    np.testing.assert_array_equal(pairs.hub, limbs.hub)


def test_every_agent_gets_the_same_random_path_and_heading():
    agents = {"a": scripted("straight"), "b": scripted("rest")}
    a, b = evaluate(agents, "random", seed=5, max_strokes=2, random_heading=True, **EASY)
    np.testing.assert_array_equal(a.waypoints, b.waypoints)
    (again,) = evaluate({"a": agents["a"]}, "random", seed=5, max_strokes=2, random_heading=True, **EASY)
    (other,) = evaluate({"a": agents["a"]}, "random", seed=6, max_strokes=2, random_heading=True, **EASY)
    np.testing.assert_array_equal(again.hub, a.hub)
    assert not np.array_equal(other.hub, a.hub)


def test_a_path_may_come_with_the_reset():
    (done,) = evaluate({"a": scripted("straight")}, reset_options={"path": SHORT}, **EASY)
    np.testing.assert_array_equal(done.waypoints, SHORT)
    assert done.finished


# What is written


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Folder, swims and printed text of an evaluation of one agent that finishes and one that does not."""
    folder = tmp_path_factory.mktemp("evaluation")
    said = []
    agents = {"straight": scripted("straight"), "2-,5+": scripted("2-,5+")}
    swims = evaluate(agents, SHORT, max_strokes=8, out=folder, **EASY | {"say": said.append})
    return folder, swims, "\n".join(said)


def test_csv_holds_the_measures(written):
    folder, (finished, astray), _ = written
    with (folder / "evaluation.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["agent"] for row in rows] == ["straight", "2-,5+"]
    assert rows[0]["strokes_to_finish"] == str(finished.strokes)
    assert rows[1]["strokes_to_finish"] == ""
    assert [row["waypoints_reached"] for row in rows] == ["1", "0"]
    assert [row["waypoints"] for row in rows] == ["1", "1"]
    for row, done in zip(rows, (finished, astray), strict=True):
        assert float(row["simulated_time_s"]) == done.strokes
        assert float(row["mean_cross_track_error_mm"]) == pytest.approx(1e3 * done.cross_track_errors.mean())
        assert float(row["largest_cross_track_error_mm"]) == pytest.approx(1e3 * done.cross_track_errors.max())
        way = np.hypot(*np.diff(done.hub, axis=0).T).sum()
        assert float(row["limbs_heated_per_metre"]) == pytest.approx(2 * done.strokes / way)


def test_table_fits_eighty_columns_and_says_who_did_not_finish(written):
    _, (finished, astray), text = written
    assert max(map(len, text.splitlines()[:-1])) <= 80  # the last line names the folder
    assert "\u2026" not in text  # nothing is cut off
    (first,) = (line.split() for line in text.splitlines() if line.startswith("straight"))
    (second,) = (line.split() for line in text.splitlines() if line.startswith("2-,5+"))
    assert first[1:6] == [str(finished.strokes), f"{finished.strokes}.0", "1", "of", "1"]
    assert second[1:6] == ["\u2013", f"{astray.strokes}.0", "0", "of", "1"]


def test_picture_shows_every_trace_in_its_colour(written):
    folder, _, _ = written
    pixels = imageio.imread(folder / "traces.png")[..., :3].astype(float) / 255.0
    assert min(pixels.shape[:2]) > 200
    for colour in COLOURS[:2]:
        assert np.count_nonzero(np.abs(pixels - to_rgb(colour)).max(axis=-1) < 0.02) > 100


def test_picture_is_not_stretched_by_who_swims_far_away(tmp_path):
    agents = {"pentagon": scripted("pentagon"), "straight": scripted("straight")}
    evaluate({"pentagon": agents["pentagon"]}, out=tmp_path / "new" / "one", video=False, **EASY)
    evaluate(agents, out=tmp_path / "both", video=False, **EASY)
    one, both = (imageio.imread(tmp_path / name / "traces.png").shape for name in ("new/one", "both"))
    assert both[0] > 0.7 * one[0]


def test_picture_shows_its_view_and_the_current_there(monkeypatch):
    (done, current), figures = (made_up_swim([(0.0, 0.0), (0.2, 0.0)], [0, 0]), UniformCurrent(1e-3, 0.0)), []
    monkeypatch.setattr(pictures, "save_figure", lambda figure, *arguments, **options: figures.append(figure))
    pictures.draw_traces([done], 2e-3, Path(), current)
    axes, (low, high) = figures[0].axes[0], np.array([[-12.0, -12.0], [142.0, 112.0]])
    assert [*axes.get_xlim(), *axes.get_ylim()] == pytest.approx([low[0], high[0], low[1], high[1]])
    arrows = pictures.flow_in(current, low, high).arrows
    np.testing.assert_allclose(axes.collections[0].get_offsets(), 1e3 * arrows[:, 0])
    assert [text.get_text() for text in axes.texts] == ["start", "1", "2"]


def frames_of(video):
    """Frames, shape (n, height, width, 3), as signed numbers."""
    with imageio.imopen(video, "r", plugin="FFMPEG") as reader:
        assert reader.metadata()["fps"] == FPS
        return np.stack(list(reader.iter())).astype(np.int16)


def test_a_path_that_ends_where_it_starts_can_be_drawn(tmp_path):
    (done,) = evaluate({"a": scripted("rest")}, [[1e-3, 0.0], [0.0, 0.0]], out=tmp_path, video=False, **EASY)
    assert done.finished
    assert (tmp_path / "traces.png").is_file()


# imageio does not close the pipes of the process that it reads from.
@pytest.mark.filterwarnings("ignore:Exception ignored in:pytest.PytestUnraisableExceptionWarning")
def test_videos_show_every_stroke_and_rest_on_the_end_of_the_path(written):
    folder, swims, _ = written
    closing = round(CLOSING_SECONDS * FPS)
    for done, name in zip(swims, ("straight", "2-,5+"), strict=True):
        frames = frames_of(folder / f"{name}.mp4")
        assert frames.shape == (1 + FRAMES_PER_STROKE * done.strokes + closing, 720, 960, 3)
        assert np.abs(frames[1] - frames[0]).max() > 100
        np.testing.assert_allclose(frames[-1], frames[-10], atol=20)
        # The upper right corner counts the waypoints, or says that the path is completed.
        progress = frames[:, :40, 700:]
        assert np.abs(progress[-closing - 2] - progress[0]).max() < 40
        assert (np.abs(progress[-1] - progress[0]).max() > 100) == done.finished


def test_nothing_is_written_without_a_folder_and_no_video_on_request(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    evaluate({"a": scripted("straight")}, SHORT, max_strokes=1, **EASY)
    assert not list(tmp_path.iterdir())
    evaluate({"a": scripted("straight")}, SHORT, max_strokes=1, out="there", video=False, **EASY)
    assert {file.name for file in (tmp_path / "there").iterdir()} == {"evaluation.csv", "traces.png"}


def test_trajectories_have_a_row_for_every_stroke_of_every_swim(tmp_path):
    agents = {"a": scripted("straight"), "b": scripted("2-,5+")}
    swims = evaluate(agents, SHORT, max_strokes=3, out=tmp_path, video=False, trajectory=True, **EASY)
    with (tmp_path / "trajectories.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["agent"] for row in rows] == [done.agent for done in swims for _ in done.time]
    for name, values in {"time_s": "time", "waypoints_reached": "waypoint_index"}.items():
        assert [float(row[name]) for row in rows] == [x for done in swims for x in getattr(done, values)]
    hub = np.array([[row["hub_x_m"], row["hub_y_m"]] for row in rows], dtype=float)
    np.testing.assert_array_equal(hub, np.concatenate([done.hub for done in swims]))
    heat = [[0.0, *done.heating_time] for done in swims]
    assert [float(row["heating_time_s"]) for row in rows] == [seconds for of_swim in heat for seconds in of_swim]


@pytest.mark.parametrize("frames_per_stroke", [1, 3])
def test_an_environment_draws_as_many_frames_per_stroke_as_asked(frames_per_stroke):
    env = SeastarSwimEnv(fidelity="fast", render_mode="rgb_array_list", frames_per_stroke=frames_per_stroke)
    env.reset(seed=0)
    env.render()
    env.step(np.array([0, 1, 0, 0, 2]))
    assert len(env.render()) == frames_per_stroke
    assert env.metadata["render_fps"] == frames_per_stroke


@pytest.mark.parametrize(
    ("agents", "more", "complaint"),
    [
        ({}, {}, "at least one agent"),
        ({"a": scripted("rest")}, {"max_strokes": 0}, "max_strokes must be a whole number from 1"),
        ({"a": scripted("rest")}, {"scene": 5}, "scene must be a Scene"),
        ({"a b": scripted("rest"), "a/b": scripted("rest")}, {"out": "x"}, "same file name"),
    ],
)
def test_what_cannot_be_evaluated_is_refused(agents, more, complaint):
    with pytest.raises(ValueError, match=complaint):
        evaluate(agents, SHORT, **EASY, **more)


# The command line


def test_the_policy_in_the_box_and_scripted_agents_are_evaluated_without_torch():
    code = "import sys, seastar_gym.cli.evaluate as e; e.fitting_agents(['pentagon', 'random', 'learned'])"
    code += "; print(*sys.modules)"
    answer = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    loaded = set(answer.stdout.split())
    assert "seastar_gym.controllers.scripted" in loaded
    assert loaded.isdisjoint({"torch", "stable_baselines3", "matplotlib", "pygame"})


def damaged_model(folder):
    (folder / "damaged.zip").write_bytes(b"PK\x03\x04 and then nothing of use")
    return str(folder / "damaged.zip")


def damaged_policy(folder):
    (folder / "damaged.safetensors").write_bytes(b"nothing of use")
    (folder / "damaged.json").write_text("{}")
    return str(folder / "damaged.safetensors")


def policy_of_four_limbs(folder):
    description = Description("pairs", True, Scene(robot=Seastar(n_limbs=4)), (2,))
    weights = {name: np.zeros(shape, np.float32) for name, shape in description.shapes().items()}
    save(LearnedPolicy(description, weights), folder / "four.safetensors")
    return str(folder / "four.safetensors")


def ragged_path(folder):
    (folder / "ragged.csv").write_text("0.1, 0.0\n0.2\n")
    return str(folder / "ragged.csv")


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (lambda folder: ["--agents", str(folder / "none.zip")], "There is no trained policy at"),
        (lambda folder: ["--agents", str(folder / "none.safetensors")], "There is no trained policy at"),
        (lambda folder: ["--agents", damaged_policy(folder)], "is damaged"),
        (lambda folder: ["--agents", policy_of_four_limbs(folder)], "trained on a robot of 4 limbs, "),
        (lambda folder: ["--agents", damaged_model(folder)], "damaged"),
        (lambda folder: ["--agents", "pentagram"], "Unknown scripted agent 'pentagram'"),
        (lambda folder: ["--agents", "rest", "rest"], "'rest' is named twice"),
        (lambda folder: ["--path", "hexagon"], "Unknown path 'hexagon'"),
        (lambda folder: ["--path", ragged_path(folder)], "ragged.csv, line 2: every line must have x and y"),
        (lambda folder: ["--seconds", "0"], "--seconds must be"),
        (lambda folder: ["--waypoint-radius", "-1"], "--waypoint-radius must be"),
        (lambda folder: ["--fidelity", "fast", "balanced"], "Several fidelities are for --sets"),
        (lambda folder: ["--sets", "nominal", "--video"], "needs a folder, --out, and a path, no --sets"),
        (lambda folder: ["--sets", "nominal", "--swims", "0"], "--swims must be"),
    ],
)
def test_bad_input_is_answered_with_one_sentence(tmp_path, capsys, arguments, complaint):
    assert main([*arguments(tmp_path), "--out", str(tmp_path / "out")]) == 2
    printed = capsys.readouterr()
    assert complaint in printed.err
    assert printed.err.count("\n") == 1
    assert not printed.out
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("arguments", [["--fidelity", "none"], ["--sets"]])
def test_options_that_are_none_end_with_the_usage(arguments, capsys):
    with pytest.raises(SystemExit) as refusal:
        main(arguments)
    assert refusal.value.code == 2 and capsys.readouterr().err.startswith("usage: seastar evaluate")


def test_models_go_by_the_names_of_their_files(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    files = ["best.zip", "runs/last.safetensors", "runs/best.zip"]
    (tmp_path / "runs").mkdir()
    for file in files:
        Path(file).touch()
    monkeypatch.setattr("seastar_gym.controllers.checkpoint.load", lambda file: file)
    monkeypatch.setattr("seastar_gym.controllers.learned.load", lambda file: file)
    assert load_agents(files) == {"best": "best.zip", "last": "runs/last.safetensors", "runs/best": "runs/best.zip"}


def test_an_unknown_agent_is_told_every_name(capsys):
    assert main(["--agents", "nobody"]) == 2
    assert_told(capsys, "pentagon", "planner, gait-planner, files", "module:function")


# The one loop in which policies swim: what they are asked, when episodes end, and what is kept of them.


NEAR = [[0.02, 0.0]]


class Asked:
    """A policy that swims along limb 1 and writes down what it is asked. It counts the decisions of every episode."""

    def __init__(self):
        self.asked = []

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        alone = observation.ndim == 1
        before = np.zeros(1 if alone else len(observation), int) if state is None else state
        self.asked.append((None if state is None else state.tolist(), list(episode_start), deterministic))
        action = np.array([0, 1, 0, 0, 2])
        return action if alone else np.tile(action, (len(observation), 1)), np.where(episode_start, 0, before) + 1


def batch(n, **arguments):
    return make_batch("SeastarSwim-v0", n, 1, **{"fidelity": "fast", "max_episode_steps": 3, **arguments})


def test_a_policy_gets_its_state_back_and_hears_of_every_start_once():
    policy = Asked()
    done = swim("asked", policy, SeastarSwimEnv(fidelity="fast"), max_strokes=3, seed=0)
    assert policy.asked == [(None, [True], True), ([1], [False], True), ([2], [False], True)]
    assert done.strokes == 3
    np.testing.assert_array_equal(done.time, [0.0, 1.0, 2.0, 3.0])
    np.testing.assert_array_equal(done.limbs_heated, [2, 2, 2])
    policy = Asked()
    rollout(batch(2), policy, seeds=0)
    assert policy.asked == [(None, [True] * 2, True), ([1, 1], [False] * 2, True), ([2, 2], [False] * 2, True)]


@pytest.mark.parametrize("kind", ["vector_entry_point", "sync"])
def test_episodes_of_a_batch_are_those_of_one_robot_each(kind):
    """Whatever makes the batch; each in its own time: one robot arrives early and rests, the others have a limit."""
    own = {"path": [[0.06, 0.0]], "random_heading": True, "fidelity": "fast", "actions": "pairs"}
    own["waypoint_radius"] = 0.05
    robots = gym.make_vec("SeastarSwim-v0", 3, vectorization_mode=kind, **own)
    found = rollout(robots, scripted("straight", "pairs"), seeds=[0, 1, 2], until=8, record=(*RECORDED, "nothing"))
    assert "nothing" not in found.entries and found.decisions.tolist() == [6, 3, 8]
    for robot, seed in enumerate((0, 1, 2)):
        env = gym.make("SeastarSwim-v0", **own)
        alone = rollout(env, scripted("straight", "pairs"), seeds=seed, until=8, record=RECORDED)
        assert alone.decisions[0] == found.decisions[robot] and alone.success[0] == found.success[robot]
        assert alone.returns[0] == found.returns[robot] and alone.total("energy")[0] == found.total("energy")[robot]
        for name in ("time", "hub_position", "waypoint_index"):
            np.testing.assert_array_equal(alone.last(name)[0], found.last(name)[robot])
        np.testing.assert_array_equal(alone.of("energy")[:, 0], found.of("energy")[: alone.decisions[0], robot])
        assert np.isnan(found.of("energy")[alone.decisions[0] :, robot]).all()


def test_who_has_arrived_rests_until_all_have():
    task = SwimTask(SwimOptions("line", scene=Scene.preset("fast")), 2, 1)
    robots, commands = TaskBatch(task), []
    robots.reset(seed=0)
    step = robots.step
    robots.step = lambda actions: commands.append(np.array(actions)) or step(actions)
    paths = [np.array(NEAR), np.array([[0.04, 0.0]])]
    task._draw = lambda robot, rng, asked: task._set_path(robot, paths[robot])
    early, late = swims_of("asked", rollout(robots, Asked(), seeds=0, record=RECORDED))
    assert early.finished and late.finished and early.strokes < late.strokes == len(commands)
    assert [given[0].any() for given in commands] == [stroke < early.strokes for stroke in range(late.strokes)]
    assert all(given[1].any() for given in commands)
    np.testing.assert_array_equal(early.waypoints, paths[0])


@pytest.mark.parametrize("actions", get_args(Actions))
def test_zero_is_rest_in_every_action_mode(actions):
    zero = np.zeros_like(action_space(actions, 5).sample())
    assert not to_commands(actions, 5, np.array([zero]), 1).any()


def test_a_rollout_ends_when_it_is_told_to_and_shows_every_info():
    seen = []

    def look(info):
        seen.append(info["time"][0])
        return len(seen) == 3

    assert rollout(batch(1, max_episode_steps=9), Asked(), seeds=0, on_step=look).decisions.tolist() == [2]
    assert seen == [0.0, 1.0, 2.0]
    numbers = count()
    found = rollout(batch(1, max_episode_steps=9), Asked(), seeds=0, until=4, on_step=lambda info: next(numbers))
    assert found.decisions.tolist() == [4] and next(numbers) == 5  # a number is no wish to end
    assert not found.success.any()


# Every task is measured by what it asks for, over episodes that end with success or without.


@pytest.mark.parametrize("id", TASKS)
def test_every_task_is_measured_by_what_it_asks_for(id):
    """Prey that is caught, worth of prizes, the distance from the station, otherwise the time until all is done."""
    challenge = TASKS[id][0].removeprefix("fast-")
    wanted = {each.__name__.lower(): measure for each, measure in MEASURES.items()}.get(challenge, SECONDS)
    assert measure_of(gym.make(id, fidelity="fast").unwrapped) is wanted


def measured(challenge, **changes):
    """Measures of an episode of three decisions without success, and of one with success that ends with the first."""
    time = np.array([[10.0, 10.0], [20.0, 20.0], [40.0, 40.0]])
    entries = {"time": time, "distance": 0.001 * time, "catches": time / 10.0, "taken": time / 5.0} | changes
    of_reset = {name: np.concatenate([np.zeros((1, 2)), values]) for name, values in entries.items()}
    lengths = np.array([3, 1]) if not changes else np.array([3, 3])
    episodes = Episodes(of_reset, np.array([False, True]), np.zeros(2), lengths, (), limit=400.0)
    return measure_of_challenge(CHALLENGES[challenge]).of(episodes).tolist()


def test_measures_are_those_of_finished_and_unfinished_episodes():
    assert measured("miswired") == [400.0, 10.0]
    assert measured("prey") == [4.0, 1.0]
    assert measured("prizes") == [8.0, 2.0]
    assert measured("station", distance=0.001 * np.array([[9.0, 1], [8, 1], [2, 3]])) == pytest.approx([2.0, 3.0])
