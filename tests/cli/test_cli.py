"""The command `seastar`: what it shows, writes and refuses, in a sentence each."""

import json
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from refusals import assert_refused
from seastar_gym import Scene, Seastar, Sight
from seastar_gym.cli import compile, played, screen
from seastar_gym.cli.keys import Steering, known_keys, typed
from seastar_gym.cli.main import COMMANDS, main
from seastar_gym.controllers import learned
from seastar_gym.gaits import lagged_gait
from seastar_gym.scene.serial import to_dict

ROOT = Path(__file__).resolve().parents[2]
PREY = learned.of_task("prey", None)
SHORT = "0.03, 0.0\n"


@pytest.fixture
def path(tmp_path):
    file = tmp_path / "path.csv"
    file.write_text(SHORT)
    return str(file)


def frames(file):
    """Pictures of a GIF, shape (n, height, width, 3)."""
    with Image.open(file) as film:
        found = []
        for number in range(film.n_frames):
            film.seek(number)
            found.append(np.asarray(film.convert("RGB"), dtype=np.int16))
        return np.stack(found)


def test_help_tells_every_command_and_loads_none(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["--help"])
    text = capsys.readouterr().out
    assert ended.value.code == 0 and all(name in text for name in COMMANDS)
    code = (
        "import sys; from seastar_gym.cli.main import main\n"
        "try: main(['--help'])\n"
        "finally: print(*sys.modules, file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert set(done.stderr.split()).isdisjoint({"torch", "pygame", "imageio", "matplotlib", "safetensors", "rich"})


@pytest.mark.parametrize("command", sorted(set(COMMANDS) - {"train"}))
def test_every_command_has_help_under_its_name(command, capsys):
    with pytest.raises(SystemExit) as ended:
        main([command, "--help"])
    assert ended.value.code == 0
    assert capsys.readouterr().out.startswith(f"usage: seastar {command} ")


def test_what_is_compiled_before_is_found_by_another_process(tmp_path, monkeypatch):
    (tmp_path / "scene.py").write_text("import seastar_gym as s; scene = s.Scene(fluid=None, actuator=s.SmaWires())")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    command = [sys.executable, "-m", "seastar_gym.cli", "compile", "--scene", str(tmp_path / "scene.py"), "--per-robot"]
    first, second = (subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True) for _ in range(2))
    assert "seastar_gym compiles" in first.stderr and second.stderr == ""
    assert str(tmp_path / "cache") in first.stdout and first.stdout.startswith("SeastarSwim-v0: ")
    swim = (
        "import gymnasium as gym, numpy as np, seastar_gym as s, sys\n"
        "given = dict(fluid=None, actuator=s.SmaWires())\n"
        "env = gym.make('SeastarSwim-v0', scene=s.Scene(**given), fidelity='fast', decision_period=0.2)\n"
        "env.reset(seed=1), env.step(env.action_space.sample())\n"
        "stiffness = np.array([1e6, 2e6])\n"
        "s.Simulator(s.Scene(s.Seastar(youngs_modulus=stiffness), **given), 2).stroke(np.zeros((2, 5)))\n"
    )
    done = subprocess.run([sys.executable, "-c", swim], cwd=ROOT, capture_output=True, text=True, check=True)
    assert "compiles" not in done.stderr


def test_code_that_cannot_be_kept_is_not_said_to_be(monkeypatch, capsys):
    monkeypatch.setattr(compile, "energies", SimpleNamespace(stats=SimpleNamespace(cache_path=None)))
    assert main(["compile", "--fidelity", "fast"]) == 2
    assert "set NUMBA_CACHE_DIR" in capsys.readouterr().err


def test_a_swim_is_filmed_without_a_display(path, tmp_path, no_display, capsys):
    film = tmp_path / "films" / "swim.gif"
    assert main(["swim", "--agent", "straight", "--path", path, "--fidelity", "fast", "--film", str(film)]) == 0
    said = capsys.readouterr().out
    assert "straight: 1 of 1 waypoints in" in said and str(film) in said
    pictures = frames(film)
    seconds = float(said.split(" in ")[1].split(" s")[0])
    assert len(pictures) == 1 + seconds * screen.GIF_FPS / 4  # four times as fast; equal ones become one, longer
    assert np.abs(pictures[-1] - pictures[0]).max() > 100


def test_the_learned_policy_swims_in_a_registered_task(tmp_path, capsys):
    film = tmp_path / "swim.mp4"
    task = ["--task", "SeastarSwimTimedModerate-v0", "--fidelity", "fast", "--seconds", "1", "--speed", "8"]
    assert main(["swim", *task, "--film", str(film)]) == 0
    assert "0 of 5 waypoints in 1.0 s" in capsys.readouterr().out
    assert film.stat().st_size > 1000


@pytest.mark.parametrize(
    "more, seconds",
    [([], "0.4 s"), (["--agent", "straight"], "1.0 s"), (["--decision-period", "1"], "1.0 s"),
     (["--task", "SeastarSwim-v0"], "1.0 s")],
)  # fmt: skip
def test_without_options_the_policy_of_the_picture_on_top_swims(more, seconds, tmp_path, capsys):
    """It decides every 0.2 s; whoever asks for an agent, a task or a time between decisions gets that."""
    film = tmp_path / "swim.gif"
    arguments = ["--fidelity", "fast", "--speed", "8", "--seconds", "0.4", "--film", str(film)]
    assert main(["swim", *arguments, *more]) == 0
    assert f"0 of 5 waypoints in {seconds}." in capsys.readouterr().out


def test_a_swim_is_seen_through_a_camera_in_a_file(path, tmp_path, no_display, capsys):
    sight = tmp_path / "sight.json"
    sight.write_text(json.dumps(to_dict(Sight(delay=0.1, sees=1))))
    arguments = ["--agent", "straight", "--path", path, "--fidelity", "fast", "--film", str(tmp_path / "swim.gif")]
    assert main(["swim", *arguments, "--sight", str(sight), "--action-delay", "1"]) == 0
    assert "straight: 1 of 1 waypoints in" in capsys.readouterr().out


def test_a_window_shows_a_swim_until_it_is_closed(path, dummy_window, monkeypatch, capsys):
    arguments = ["swim", "--agent", "straight", "--path", path, "--fidelity", "fast", "--speed", "100"]
    assert main(arguments) == 0
    assert "1 of 1" in capsys.readouterr().out
    monkeypatch.setattr(screen.Window, "show", lambda self, *arguments: self.close())
    looks = iter([True, True, True, False])
    monkeypatch.setattr(screen.Window, "is_wanted", lambda self, size: next(looks))
    assert main(arguments) == 0
    assert "0 of 1 waypoints in 2.0 s" in capsys.readouterr().out


@pytest.mark.parametrize(
    "arguments, words",
    [
        (["swim"], "No window can be opened here: write a film, --film swim.mp4 or swim.gif."),
        (["play"], "No window can be opened here"),
        (["play", "--film", "x.gif"], "A film needs the keys"),
        (["play", "--keys", "9"], "There is no key '9'"),
        (["play", "--speed", "0"], "--speed must be"),
        (["swim", "--film", "swim.avi"], "A film is an .mp4 or a .gif, not swim.avi."),
        (["swim", "--agent", "nobody"], "Unknown scripted agent 'nobody'"),
        (["swim", "--task", "Nothing-v0"], "There is no task 'Nothing-v0': choose of SeastarSwim-v0, "),
        (["swim", "--path", "nowhere"], "Unknown path 'nowhere'"),
        (["swim", "--agent", str(PREY), "--film", "x.gif"], "was trained for the task prey, the environment's is"),
        (["swim", "--speed", "-1"], "--speed must be"),
        (["swim", "--scene", "none.json"], "none.json is no file."),
        (["swim", "--sight", "7"], "Sight.sees must be"),
        (["swim", "--sight", "none.json"], "There is no file none.json."),
        (["swim", "--sight", "pose", "--film", "x.gif"], "196"),
        (["evaluate", "--scene", "none.py"], "none.py is no file."),
        (["evaluate", "--seconds", "0"], "--seconds must be"),
    ],
)
def test_what_cannot_be_done_is_said_in_a_sentence(arguments, words, no_display, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    printed = capsys.readouterr()
    assert words in printed.err and printed.err.count("\n") == 1 and not printed.out
    assert not list(tmp_path.iterdir())


def test_an_unknown_command_is_refused(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["fly"])
    assert ended.value.code == 2 and "invalid choice: 'fly'" in capsys.readouterr().err


# Playing


def test_keys_swim_into_a_film(path, tmp_path, no_display, capsys):
    """Straight on for four seconds: the robot arrives, and the film goes on to show it."""
    film = tmp_path / "play.gif"
    arguments = ["--path", path, "--keys", "a*20 .", "--film", str(film), "--speed", "2"]
    assert main(["play", *arguments]) == 0
    assert "1 of 1 waypoints in" in capsys.readouterr().out
    pictures = frames(film)
    assert np.abs(pictures[10] - pictures[0]).max() > 100
    help_text = pictures[:, 22:76, 8:200]  # the keys are told all the time
    assert np.ptp(help_text[0]) > 100 and np.abs(help_text[-1] - help_text[0]).max() < 60


class Pressed:
    """A keyboard whose keys are down for some pictures each."""

    def __init__(self, *names):
        import pygame

        pygame.display.init()
        self.held = [pygame.key.key_code(name) if name else None for name in names]
        self.now = None

    def __getitem__(self, code):
        return code == self.now

    def get_pressed(self):
        self.now = self.held.pop(0)
        return self


def test_something_shows_before_the_simulator_is_loaded():
    """Numba and what it compiles take a second at best; pygame does not."""
    script = (
        "import sys\nfrom seastar_gym.cli import play, screen\n"
        "def show(picture): print('numba' in sys.modules, picture.std() > 1.0); return sys.exit()\n"
        "from contextlib import contextmanager\n"
        "screen._window = contextmanager(lambda fps: iter([show]))\n"
        "play.main([])\n"
    )
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60)
    assert result.stdout.split() == ["False", "True"], result.stderr


def test_the_keyboard_plays_in_a_window(path, dummy_window, monkeypatch, capsys):
    import pygame

    keys = Pressed("a", "", "", "f1", "z", "escape")
    monkeypatch.setattr(pygame.key, "get_pressed", keys.get_pressed)
    monkeypatch.setattr(pygame.key, "get_just_pressed", lambda: keys)
    seen = []
    step = played.PlayedEnv.step
    monkeypatch.setattr(played.PlayedEnv, "step", lambda env, action: seen.append(action.tolist()) or step(env, action))
    assert main(["play", "--path", path, "--speed", "100", "--decision-period", "0.2"]) == 0
    assert seen[0] == [0, 1, 0, 0, 2] and not keys.held
    assert "You reached 0 of 1 waypoints" in capsys.readouterr().out


# Evaluation and training


def test_agents_are_compared_without_rich(path, tmp_path, capsys):
    out = tmp_path / "out"
    arguments = ["--agents", "straight", "2-,5+", "--path", path, "--fidelity", "fast", "--seconds", "5"]
    assert main(["evaluate", *arguments, "--out", str(out)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines[:-1])) <= 80 and "of 1" in lines[3]
    assert [line.split()[0] for line in lines[3:5]] == ["straight", "2-,5+"]
    assert {file.name for file in out.iterdir()} == {"evaluation.csv", "traces.png"}


def test_a_robot_of_a_file_swims(path, tmp_path, capsys):
    """Half as strong as the chapter's, so it is slower; agents that plan know it."""
    scene = tmp_path / "weak.py"
    scene.write_text("from seastar_gym import Scene\nscene = Scene(limb_strengths=(0.5, 0.5, 0.5, 0.5, 0.5))\n")
    arguments = ["--agents", "straight", "greedy", "--path", path, "--fidelity", "fast"]
    seconds = []
    for own in ([], ["--scene", str(scene)]):
        assert main(["evaluate", *arguments, *own]) == 0
        rows = [line.split() for line in capsys.readouterr().out.splitlines()[3:5]]
        assert [row[0] for row in rows] == ["straight", "greedy"]
        seconds.append([float(row[2]) for row in rows])
    assert (np.array(seconds[0]) < seconds[1]).all()
    film = ["swim", "--agent", "straight", "--path", path, "--fidelity", "fast", "--speed", "8", "--seconds", "2"]
    assert main([*film, "--scene", str(scene), "--film", str(tmp_path / "x.gif")]) == 0
    assert "0 of 1 waypoints in 2.0 s" in capsys.readouterr().out


@pytest.mark.parametrize("command", ["swim", "evaluate", "certify", "sweep", "identify"])
def test_what_goes_wrong_in_a_scene_file_is_said_with_its_line(command, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("wrong.py").write_text("import math\nscene = nothing\n")
    scene = ["wrong.py"] if command == "certify" else ["--scene", "wrong.py"]
    assert main([command, *scene, *(["--synthetic"] if command == "identify" else [])]) == 2
    last = capsys.readouterr().err.splitlines()[-1]
    assert last == "wrong.py, line 2: NameError: name 'nothing' is not defined."


THREE_LIMBS = "from seastar_gym import Scene, Seastar\nscene = Scene(robot=Seastar(n_limbs=3))\n"


@pytest.mark.parametrize("ending", [".py", ".json"])
def test_a_robot_of_three_limbs_is_compared_by_agents_that_it_can_have(ending, path, tmp_path, capsys):
    scene = tmp_path / f"three{ending}"
    as_json = json.dumps(Scene(robot=Seastar(n_limbs=3)).to_dict())
    scene.write_text(THREE_LIMBS if ending == ".py" else as_json)
    arguments = ["--scene", str(scene), "--path", path, "--fidelity", "fast", "--seconds", "2"]
    assert main(["evaluate", *arguments]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()[3:]] == ["greedy", "straight"]


def test_agents_that_do_not_fit_are_left_out_with_a_sentence_each(path, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("three.py").write_text(THREE_LIMBS)
    arguments = ["--path", path, "--fidelity", "fast", "--scene", "three.py", "--seconds", "2"]
    assert main(["evaluate", "--agents", "learned", "straight", "pentagon", "nobody", "none.zip", *arguments]) == 0
    said = capsys.readouterr()
    assert "straight" in said.out and "learned" not in said.out
    sentences = said.err.splitlines()
    left_out = [sentence.partition(" is left out: ")[0] for sentence in sentences]
    assert left_out == ["learned", "pentagon", "nobody", "none"]
    assert all(sentence.endswith(".") for sentence in sentences)
    assert main(["evaluate", "--agents", "learned", *arguments]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_training_without_the_repository_says_what_it_needs(tmp_path, monkeypatch, capsys):
    from seastar_gym.cli import train

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(train, "__file__", str(tmp_path / "lib" / "seastar_gym" / "cli" / "train.py"))
    assert main(["train"]) == 2
    assert "Training needs a checkout" in capsys.readouterr().err


def test_training_runs_the_checkout_s_own_script(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "agents").mkdir()
    (tmp_path / "train.py").write_text("import sys\nprint(sys.argv[1:])\nsys.exit(3)\n")
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(sys, "argv", list(sys.argv))
    assert main(["train", "--quick"]) == 3
    assert "['--quick']" in capsys.readouterr().out


def test_pictures_of_a_decision_keep_the_speed():
    assert screen.rate(None, 1.0, 4.0) == (8, 32.0)
    number, fps = screen.rate(Path("a.gif"), 0.2, 2.0)
    assert number == 2 and fps == pytest.approx(20.0)
    assert screen.rate(None, 0.1, 30.0) == (1, 300.0)


# Keys mean the commands that the help says.


STAR = 2.0 * np.pi / 5 * np.arange(5)
"""Headings of the limbs at rest [rad]."""


def command(keys, period=1.0, headings=STAR):
    return Steering(period, 5).command(keys, headings).tolist()


@pytest.mark.parametrize(
    "keys, expected",
    [
        ("", [0, 0, 0, 0, 0]),
        ("1", [1, 0, 0, 0, 0]),
        ("r", [0, 0, 0, -1, 0]),
        ("1r", [1, 0, 0, -1, 0]),
        ("1q", [0, 0, 0, 0, 0]),  # both wires of a limb cancel
        ("a", [0, 1, 0, 0, -1]),  # the straight gait along limb 1
        ("d", [0, -1, 0, 1, 0]),
        ("ad", [0, 0, 0, 1, -1]),
        ("6", [0, 0, 0, 0, 0]),  # no such limb
    ],
)
def test_a_key_means_a_command(keys, expected):
    assert command(set(keys)) == expected


@pytest.mark.parametrize("arrow, key", [("right", "a"), ("up", "s"), ("down", "g")])
def test_an_arrow_takes_the_limb_that_points_its_way(arrow, key):
    assert command({arrow}) == command({key})
    turned = command({arrow}, headings=STAR + 2.0 * np.pi / 5)  # the limb before it is there now
    assert turned == np.roll(command({arrow}), -1).tolist()


def test_a_key_that_is_held_swims_the_lagged_gait_from_its_beginning():
    steering, gait = Steering(0.2, 5), lagged_gait(0.2)
    held = [steering.command({"s"}, STAR).tolist() for _ in range(7)]
    assert held == [np.roll(gait[k % 5], 1).tolist() for k in range(7)]
    assert steering.command(set(), STAR).tolist() == [0] * 5
    assert steering.command({"s"}, STAR).tolist() == held[0]


def test_words_are_the_keys_of_decisions():
    assert list(typed("a*2 1w . up", 5)) == [{"a"}, {"a"}, {"1", "w"}, set(), {"up"}]


@pytest.mark.parametrize("text, words", [("a 9", "There is no key '9'"), ("6", "'6'"), ("a*b", "how often, 'a*b'")])
def test_words_that_mean_nothing_are_refused(text, words):
    with assert_refused(words):
        list(typed(text, 5))


def test_every_limb_of_eight_has_keys_and_no_key_two_meanings():
    assert len(known_keys(8)) == 3 * 8 + 4
    assert {"z", "f1", "escape"}.isdisjoint(known_keys(8))
