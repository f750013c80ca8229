"""The command `seastar`: what it shows, writes and refuses, in a sentence each."""

import json
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from core import run
from seastar_gym import Numerics, Scene, Seastar, Sight, SmaWires
from seastar_gym.cli import compile, played, screen
from seastar_gym.cli.main import main
from seastar_gym.cli.play import Steering, known_keys, typed
from seastar_gym.controllers.description import Description
from seastar_gym.controllers.learned import LearnedPolicy, save
from seastar_gym.gaits import lagged_gait
from seastar_gym.scene.serial import to_dict

FAST = ["--path", "path.csv", "--fidelity", "fast"]
WEAK = "from seastar_gym import Scene\nscene = Scene(limb_strengths=(0.5, 0.5, 0.5, 0.5, 0.5))\n"
THREE_LIMBS = "from seastar_gym import Scene, Seastar\nscene = Scene(robot=Seastar(n_limbs=3))\n"


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """Where commands run: a path, scenes, and files that are no good."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(Path(__file__).parents[1] / "controllers")
    for name, content in {
        "path.csv": "0.03, 0.0\n", "ragged.csv": "0.1, 0.0\n0.2\n", "three.py": THREE_LIMBS,
        "three.json": json.dumps(Scene(robot=Seastar(n_limbs=3)).to_dict()),
        "wrong.py": "import math\nscene = nothing\n",
    }.items():  # fmt: skip
        Path(name).write_text(content)
    Path("runs").mkdir(), Path("folder.gif").mkdir()
    return tmp_path


def frames(file):
    """Pictures of a GIF, shape (n, height, width, 3)."""
    with Image.open(file) as film:
        found = []
        for number in range(film.n_frames):
            film.seek(number)
            found.append(np.asarray(film.convert("RGB"), dtype=np.int16))
        return np.stack(found)


SWIM = """
given = dict(actuator=seastar_gym.SmaWires())
swim(gym.make('SeastarSwim-v0', scene=Scene(**given), fidelity='fast', decision_period=0.2))
stroke(2, robot=Seastar(youngs_modulus=np.array([1e6, 2e6])), **given)
"""


def test_what_another_process_asks_for_was_compiled_before(tmp_path):
    """That it finds it stands in rods/test_compilation.py."""
    (tmp_path / "scene.py").write_text("import seastar_gym as s; scene = s.Scene(actuator=s.SmaWires())")
    command = "from seastar_gym.cli import main\nmain.main(['compile', '--scene', 'scene.py', '--per-robot'])\n"
    (*told, compiled), (wanted,) = run(command), run(SWIM)
    assert told[0].startswith("SeastarSwim-v0: ") and told[1:] == [f"Machine code: {compile.energies.stats.cache_path}"]
    assert len(json.loads(wanted)) > 3 and {*json.loads(wanted)} <= {*json.loads(compiled)}


def test_code_that_cannot_be_kept_is_not_said_to_be(monkeypatch, capsys):
    monkeypatch.setattr(compile, "energies", SimpleNamespace(stats=SimpleNamespace(cache_path=None)))
    assert main(["compile", "--fidelity", "fast"]) == 2
    assert "set NUMBA_CACHE_DIR" in capsys.readouterr().err


def test_a_swim_is_filmed_without_a_display(no_display, capsys):
    assert main(["swim", "--agent", "straight", *FAST, "--film", "films/swim.gif"]) == 0
    said = capsys.readouterr().out
    assert "straight: 1 of 1 waypoints in" in said and "films/swim.gif" in said
    pictures = frames("films/swim.gif")
    seconds = float(said.split(" in ")[1].split(" s")[0])
    assert len(pictures) == 1 + seconds * screen.GIF_FPS / 4  # four times as fast; equal ones become one, longer
    assert np.abs(pictures[-1] - pictures[0]).max() > 100


TIMED = "SeastarSwimTimedModerate-v0"
CAMERA = ["--sight", "sight.json", "--action-delay", "1"]


@pytest.mark.parametrize(
    "options, said",
    [
        ([], "learned: 0 of 5 waypoints in 0.4 s."),
        (["--agent", "straight"], "straight: 0 of 5 waypoints in 1.0 s."),
        (["--decision-period", "1"], "learned: 0 of 5 waypoints in 1.0 s."),
        (["--task", "SeastarSwim-v0"], "learned: 0 of 5 waypoints in 1.0 s."),
        (["--task", TIMED, "--seconds", "1", "--film", "swim.mp4"], "0 of 5 waypoints in 1.0 s"),
        (["--agent", "straight", *FAST, "--seconds", "99", *CAMERA], "straight: 1 of 1 waypoints in"),
        (["--agent", "straight", *FAST, "--seconds", "2", "--scene", "weak.py"], "0 of 1 waypoints in 2.0 s"),
    ],
)
def test_a_swim_is_what_options_ask_for(options, said, folder, no_display, capsys):
    """Without any, the policy of the picture on top swims, which decides every 0.2 s; cameras and robots are files."""
    Path("sight.json").write_text(json.dumps(to_dict(Sight(delay=0.1, sees=1))))
    Path("weak.py").write_text(WEAK)
    plain = ["--fidelity", "fast", "--speed", "8", "--seconds", "0.4", "--film", "swim.gif"]
    assert main(["swim", *plain, *options]) == 0
    assert said in capsys.readouterr().out
    assert [file.stat().st_size > 1000 for file in folder.glob("swim.*")] == [True]


def test_a_window_shows_a_swim_until_it_is_closed(dummy_window, monkeypatch, capsys):
    arguments = ["swim", "--agent", "straight", *FAST, "--speed", "100"]
    assert main(arguments) == 0
    assert "1 of 1" in capsys.readouterr().out
    monkeypatch.setattr(screen.Window, "show", lambda self, *arguments: self.close())
    looks = iter([True, True, True, False])
    monkeypatch.setattr(screen.Window, "is_wanted", lambda self, size: next(looks))
    assert main(arguments) == 0
    assert "0 of 1 waypoints in 2.0 s" in capsys.readouterr().out


NAMES = "planner, gait-planner, files of policies, and module:function"
REFUSED = [
    ("swim", "No window can be opened here: write a film, --film swim.mp4 or swim.gif."),
    ("swim --film swim.avi", "A film is an .mp4 or a .gif, not swim.avi."),
    ("swim --task Nothing-v0", "There is no task 'Nothing-v0': choose of SeastarSwim-v0, "),
    ("swim --path nowhere", "Unknown path 'nowhere'"),
    ("swim --speed -1", "--speed must be"),
    ("swim --scene none.json", "none.json is no file."),
    ("swim --sight 7", "Sight.sees must be"),
    ("swim --sight pose --film x.gif", "for full sight, and is given a camera that sees the pose alone"),
    ("play", "No window can be opened here"),
    ("play --film x.gif", "A film needs the keys"),
    ("play --keys 9", "There is no key '9'"),
    ("evaluate --agents runs", "runs is no file of a policy, such as runs/policy.safetensors."),
    ("evaluate --agents pentagram", f"Unknown scripted agent 'pentagram'|{NAMES}"),
    ("evaluate --agents no_such_module:make", "No module named 'no_such_module'"),
    ("evaluate --agents own_agents:Failing", "own_agents.py, line 40: ZeroDivisionError: division by zero."),
    ("swim --agent own_agents:FailingRobot --film x.gif", "own_agents.py, line 40: ZeroDivisionError: division"),
    ("evaluate --agents own_agents:missing", "the module own_agents has no function missing"),
    ("evaluate --agents own_agents:number", "the module own_agents has no function number"),
    ("evaluate --agents own_agents:nothing", "is a int, which has no predict"),
    ("evaluate --agents own_agents:of_nothing", "a function of one argument, the environment: of_nothing(env)."),
    ("evaluate --agents own_agents:OfOneArgument", "needs predict(observation, state, episode_start, deterministic)."),
    ("evaluate --agents own_agents:Stateless", "own_agents:Stateless: predict must return an action"),
    ("evaluate --agents own_agents:StatelessRobot", "predict must return an action and the state for its next call"),
    ("evaluate --path ragged.csv", "ragged.csv, line 2: every line must have x and y"),
    ("evaluate --seconds 0", "--seconds must be"),
    ("evaluate --waypoint-radius -1", "--waypoint-radius must be"),
    ("evaluate --fidelity fast balanced", "Several fidelities are for --sets"),
    ("evaluate --video", "needs a folder, --out"),
    ("evaluate --runs .", "name --report, too"),
    ("evaluate --swims 4", "leave out --swims"),
    ("evaluate --sets nominal --path square", "leave out --path"),
    ("evaluate --path none.csv", "There is no file none.csv"),
    ("evaluate --out out.csv", "--out is a folder for them, not out.csv"),
    ("evaluate --task SeastarSwim-v0 --seconds 20", "leave out --seconds"),
    ("evaluate --sets nominal --swims 0", "--swims must be"),
    ("evaluate --report --out out --runs .", "progress.csv"),
    ("evaluate --task CartPole-v1", "There is no task 'CartPole-v1': choose of SeastarSwim-v0, "),
    ("evaluate --task SeastarSwim-v0 --agents rest rest", "Two agents are called rest: name them with LABEL=AGENT."),
    ("evaluate --task SeastarSwim-v0 --seeds 0", "--seeds must be"),
    ("evaluate --task SeastarSwim-v0 --sets nominal", "leave out --sets"),
    ("evaluate --task SeastarStation-v0 --agents rest --seeds 1 --decisions 2", "count after 30 s"),
    ("evaluate --fidelity none", "usage: seastar evaluate"),
    ("fly", "usage: seastar"),
    ("export greedy --to c", "greedy is no learned policy: name a file, .safetensors or the model.zip"),
    ("export none.safetensors --to c", "There is no trained policy at none.safetensors"),
    ("export learned --to onnx --points 3", "--points is for c"),
    ("drive straight --plant usb", "A plant is sim, sim:FILE, or serial:/dev/"),
    ("drive straight --plant sim:none.json", "none.json"),
    ("drive straight --plant serial:", "A plant is sim, sim:FILE, or serial:/dev/"),
    ("drive learned --dry", "learned was trained for full sight, which no plant gives"),
    ("drive straight --sight nodes", "A tracker sees no nodes"),
    ("sweep robot=@nowhere.json", "There is no file nowhere.json"),
    *((f"{command} wrong.py", "wrong.py, line 2: NameError: name 'nothing' is not defined.") for command in (
        "swim --scene", "evaluate --scene", "certify", "sweep --scene", "identify a.csv b.csv --scene",
    )),
]  # fmt: skip
"""Commands, and words of what is said."""


@pytest.mark.parametrize("command, words", REFUSED, ids=[command for command, _ in REFUSED])
def test_what_cannot_be_done_is_said_in_a_sentence_and_nothing_is_written(command, words, no_display, folder, capsys):
    before = set(folder.iterdir())
    try:
        code = main(command.split())
    except SystemExit as ended:
        code = ended.code
    printed = capsys.readouterr()
    assert code == 2 and not printed.out and set(folder.iterdir()) == before
    if words.startswith("usage"):
        assert printed.err.startswith(words) and "error: " in printed.err
        return
    assert printed.err.count("\n") == 1 and printed.err.endswith(".\n"), printed.err
    assert all(word in printed.err for word in words.split("|")), printed.err


@pytest.mark.parametrize(
    "command", ["evaluate --task SeastarSwim-v0 --out", "evaluate --sets nominal --out", "swim --film"]
)
def test_a_folder_in_the_place_of_a_file_is_refused_before_anything_swims(command, no_display, folder, monkeypatch):
    monkeypatch.setattr("seastar_gym.simulator.Simulator.advance", None)
    with pytest.raises(FileExistsError, match=r"^folder\.gif is no file that can be written over\.$"):
        main([*command.split(), "folder.gif"])


# Playing


def test_keys_swim_into_a_film(no_display, capsys):
    """Straight on for four seconds: the robot arrives, and the film goes on to show it."""
    assert main(["play", "--path", "path.csv", "--keys", "a*20 .", "--film", "play.gif", "--speed", "2"]) == 0
    assert "1 of 1 waypoints in" in capsys.readouterr().out
    pictures = frames("play.gif")
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


def test_the_keyboard_plays_in_a_window(dummy_window, monkeypatch, capsys):
    import pygame

    keys = Pressed("a", "", "", "f1", "z", "escape")
    monkeypatch.setattr(pygame.key, "get_pressed", keys.get_pressed)
    monkeypatch.setattr(pygame.key, "get_just_pressed", lambda: keys)
    seen = []
    step = played.PlayedEnv.step
    monkeypatch.setattr(played.PlayedEnv, "step", lambda env, action: seen.append(action.tolist()) or step(env, action))
    assert main(["play", "--path", "path.csv", "--speed", "100", "--decision-period", "0.2"]) == 0
    assert seen[0] == [0, 1, 0, 0, 2] and not keys.held
    assert "You reached 0 of 1 waypoints" in capsys.readouterr().out


# Evaluation and training


def compared(capsys, *options, code=0):
    """Table of agents without its titles, as words, and what is said of those that are left out."""
    assert main(["evaluate", *(FAST[:2] if "--fidelity" in options else FAST), *options]) == code
    said = capsys.readouterr()
    lines = said.out.splitlines()
    assert max(map(len, lines[:-1])) <= 80 and "of 1" in lines[3]
    return [line.split() for line in lines[3:] if not line.startswith("Written")], said.err.splitlines()


def test_agents_are_compared_in_a_table_and_files(folder, capsys):
    """Those that fit: the others are left out with a sentence each. One of robots half as strong is slower."""
    rows, _ = compared(capsys, "--agents", "straight", "2-,5+", "--seconds", "5", "--out", "out")
    assert [row[0] for row in rows] == ["straight", "2-,5+"]
    assert {file.name for file in (folder / "out").iterdir()} == {"evaluation.csv", "traces.png"}
    for ending in (".py", ".json"):
        rows, _ = compared(capsys, "--scene", f"three{ending}", "--seconds", "2")
        assert [row[0] for row in rows] == ["greedy", "straight"]
    names = ["learned", "straight", "pentagon", "nobody", "none.zip"]
    rows, left_out = compared(capsys, "--agents", *names, "--scene", "three.py", "--seconds", "2", code=2)
    assert [row[0] for row in rows] == ["straight"] and all(sentence.endswith(".") for sentence in left_out)
    out = [sentence.partition(" is left out: ")[0] for sentence in left_out]
    assert out == ["learned", "pentagon", "nobody", "none"]
    Path("weak.py").write_text(WEAK)
    whole, weak = (compared(capsys, "--agents", "straight", "greedy", *own)[0] for own in ([], ["--scene", "weak.py"]))
    assert all(float(one[2]) < float(other[2]) for one, other in zip(whole, weak, strict=True))


FAILS = """
import numpy as np

class Late:
    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        if state == 2:
            np.zeros(5) + np.zeros(4)
        return np.zeros(5, int), (state or 0) + 1

def make(env):
    return Late()
"""


@pytest.mark.parametrize("more, file", [([], "out/evaluation.csv"), (["--sets", "nominal"], "out.csv")])
def test_an_agent_that_fails_under_way_costs_the_others_nothing(more, file, folder, capsys, monkeypatch):
    Path("fails.py").write_text(FAILS)
    monkeypatch.syspath_prepend(folder)
    words = [*more, "--seconds", "4", "--fidelity", "fast", "--out", file.removesuffix("/evaluation.csv")]
    assert main(["evaluate", "--agents", "straight", "--agents", "fails:make", *words]) == 2
    said = "".join(capsys.readouterr())
    assert "fails:make" in said and "fails.py, line 7: ValueError: operands could not be broadcast" in said
    assert "straight" in Path(file).read_text() and "fails" not in Path(file).read_text()
    monkeypatch.delitem(sys.modules, "fails")


def test_a_policy_of_a_file_brings_its_robot_and_how_often_it_decides(folder, no_display, capsys):
    numerics = Numerics("implicit-midpoint", 2.5e-3, damping=0.003)
    scene = Scene(Seastar(3, 7), actuator=SmaWires(), numerics=numerics)
    about = Description("pairs", True, scene, (), 0.5)
    weights = {name: np.zeros(shape, np.float32) for name, shape in about.shapes().items()}
    save(LearnedPolicy(about, weights), "own.safetensors")
    Path("robot.json").write_text(json.dumps(scene.to_dict()))
    swims = {}
    for named in ([], ["--scene", "robot.json"], ["--fidelity", "rapid"], ["--fidelity", "balanced"]):
        rows, left_out = compared(capsys, "--agents", "own.safetensors", "greedy", "--seconds", "2", *named)
        assert [row[0] for row in rows] == ["own", "greedy"] and not left_out
        swims[" ".join(named)] = rows[1][1:]
    own, of_file, rapid, balanced = swims.values()
    assert own == of_file and len({tuple(own), tuple(rapid), tuple(balanced)}) == 3
    for named in ([], ["--scene", "robot.json"], ["--fidelity", "fast"]):
        assert main(["swim", "--agent", "own.safetensors", *named, "--seconds", "0.5", "--film", "swim.gif"]) == 0
        assert "0 of 5 waypoints in 0.5 s" in capsys.readouterr().out


def test_a_report_has_the_curves_of_runs_and_how_it_was_made(folder, capsys):
    """Runs of the same name in two folders; those of half a second are drawn in seconds, too."""
    for place, period in (("a/run", 1.0), ("b/run", 0.5)):
        Path(place).mkdir(parents=True)
        Path(place, "progress.csv").write_text("1000,200,5\n2000,190,5\n")
        Path(place, "config.json").write_text(json.dumps({"options": {"ppo": {"decision_period": period}}}))
    arguments = ["--agents", "learned", "straight", "--waypoint-radius", "0.5", "--report"]
    arguments += ["--runs", "a/run", "--runs", "b/run"]
    assert main(["evaluate", *arguments, "--fidelity", "fast", "--out", "out"]) == 0
    assert "report.html" in capsys.readouterr().out
    page = (folder / "out" / "report.html").read_text(encoding="utf-8")
    names = '"name":"a\\u002frun"', '"name":"b\\u002frun"'
    assert all(name in page for name in names) and '"name":"learned"' not in page and "agent straight: 1 s" in page
    assert "[200.0,190.0]" in page and "[100.0,95.0]" in page
    assert "python train.py" in page and "seastar evaluate --agents learned straight" in page


def test_policies_are_exported(folder, monkeypatch, capsys):
    assert main(["export", "learned", "--to", "c", "--points", "3"]) == 0
    assert capsys.readouterr().out.startswith("learned.c: ")
    assert "#define SEASTAR_POINTS 11\n" in Path("learned.c").read_text()
    assert main(["export", "timed-0.2s", "--to", "c"]) == 0
    assert "Policy timed-0.2s" in Path("timed-0.2s.c").read_text(encoding="utf-8")
    capsys.readouterr()
    monkeypatch.setitem(sys.modules, "onnx", None)
    assert main(["export", "learned", "--to", "onnx", "--out", "mine.onnx"]) == 2
    assert capsys.readouterr().err == 'ONNX files need onnx: pip install "seastar-gym[export]".\n'


@pytest.mark.parametrize(
    "words",
    [
        "identify path.csv commands.csv --scene own.py --out own.py",
        "identify path.csv commands.csv --intervals commands.csv",
        "track2csv path.csv --from table --out ./path.csv",
        "certify own.py --out own.py",
        "certify own.py --chosen own.py",
        "export own.safetensors --to c --out own.json",
        f"swim --agent {300 * 'x'} --scene own.py --film own.py",
        "swim --scene own.py --film own.py",
    ],
)
def test_what_a_command_reads_is_not_replaced(words, folder, capsys):
    for name in ("path.csv", "commands.csv", "own.py", "own.safetensors", "own.json"):
        Path(name).write_text("mine")
    assert main(words.split()) == 2
    told = capsys.readouterr()
    assert "would replace a file that is read" in told.err and told.err.count("\n") == 1
    assert all(Path(name).read_text() == "mine" for name in ("path.csv", "commands.csv", "own.py", "own.json"))


def test_training_runs_the_checkout_s_own_script_and_says_where_there_is_none(folder, monkeypatch, capsys):
    monkeypatch.setattr("seastar_gym.cli.main.__file__", str(folder / "lib" / "seastar_gym" / "cli" / "main.py"))
    assert main(["train"]) == 2
    assert "Training needs a checkout" in capsys.readouterr().err
    (folder / "agents").mkdir()
    Path("train.py").write_text("import sys\nprint(sys.argv[1:])\nsys.exit(3)\n")
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(sys, "argv", list(sys.argv))
    assert main(["train", "--quick"]) == 3
    assert "['--quick']" in capsys.readouterr().out


# Keys mean the commands that the help says.


STAR = 2.0 * np.pi / 5 * np.arange(5)
"""Headings of the limbs at rest [rad]."""


def test_keys_mean_commands_as_kept(golden):
    """Arrows mean limbs where they point now; both wires of a limb cancel, and nothing is heated by key 6 of five."""
    told = [
        f"{keys}, turned by {turn}: {Steering(1.0, 5).command(set(keys.split()), STAR + turn * STAR[1]).tolist()}"
        for keys in (*sorted(known_keys(5)), "1 r", "1 q", "a d", "6")
        for turn in (0, 1)
    ]
    golden("keys.txt", "\n".join(told))


def test_a_key_that_is_held_swims_the_lagged_gait_from_its_beginning_and_words_are_keys():
    steering, gait = Steering(0.2, 5), lagged_gait(0.2)
    held = [steering.command({"s"}, STAR).tolist() for _ in range(7)]
    assert held == [np.roll(gait[k % 5], 1).tolist() for k in range(7)]
    assert steering.command(set(), STAR).tolist() == [0] * 5
    assert steering.command({"s"}, STAR).tolist() == held[0]
    assert list(typed("A*2 1w . up", 5)) == [{"a"}, {"a"}, {"1", "w"}, set(), {"up"}]
    assert len(known_keys(8)) == 3 * 8 + 4
    assert {"z", "f1", "escape"}.isdisjoint(known_keys(8))
