"""The command line of sweeps, from its words to its results."""

import json
import subprocess
import sys
import time
from pathlib import Path

import pyarrow.parquet
import pytest

from seastar_gym.command import INTERRUPTED
from seastar_gym.scene import Scene, Seastar
from seastar_gym.scene.actuators.wires import SmaWires
from seastar_gym.scene.scene import load_scene
from seastar_gym.scene.serial import to_dict
from seastar_gym.sweep.command import axis_of, main
from seastar_gym.sweep.designs import Choices, Range
from seastar_gym.sweep.run import Progress, ResultFiles, read_results

ROOT = Path(__file__).resolve().parents[2]
SEVEN = Seastar(n_limbs=7)
QUICK = ("--settling", "0", "--measured", "1", "--executor", "here")


def test_axes_are_words(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("seven.json").write_text(json.dumps(to_dict(SEVEN)))
    for text, axis in {
        "robot.n_limbs=3,4": Choices("robot.n_limbs", (3, 4)),
        "robot.limb_length=0.05:0.15": Range("robot.limb_length", 0.05, 0.15),
        "robot.youngs_modulus=1e5:1e7:log": Range("robot.youngs_modulus", 1e5, 1e7, is_log=True),
        "robot.limb_length=0.1:0.2:3": Range("robot.limb_length", 0.1, 0.2).spaced(3),
        "gait=straight/1+,3-": Choices("gait", ("straight", "1+,3-")),
        "fidelity=fast,chapter": Choices("fidelity", ("fast", "chapter")),
        "actuator=SmaWires,SmaPulse": Choices("actuator", (SmaWires(), Scene().actuator), ("SmaWires", "SmaPulse")),
        "fluid=Water,None": Choices("fluid", (Scene().fluid, None), ("Water", "None")),
        "robot.relaxation_time=None,0.01": Choices("robot.relaxation_time", (None, 0.01), ("None", 0.01)),
        "robot=@seven.json,Seastar": Choices("robot", (SEVEN, Seastar()), ("seven", "Seastar")),
        "robot.density=1e2:1e4:3:log": Range("robot.density", 1e2, 1e4, is_log=True).spaced(3),
        "x=1:2:1000000": Range("x", 1.0, 2.0).spaced(1_000_000),
        "robot.n_limbs=3:7:3": Choices("robot.n_limbs", (3, 5, 7)),
    }.items():
        assert axis_of(text) == axis, text


def test_a_sweep_from_words_to_a_table(tmp_path, capsys):
    (tmp_path / "scene.py").write_text('from seastar_gym import Scene\nscene = Scene.preset("fast")\n')
    words = "robot.limb_length=0.05:0.15", "robot.n_limbs=3,5", "--latin", "3", "--out", str(tmp_path)
    words += "--scene", str(tmp_path / "scene.py")
    assert main([*words, *QUICK]) == 0
    printed = capsys.readouterr()
    assert "6 designs in 2 batches" in printed.out and "strokes/s" in printed.err
    assert read_results(tmp_path).num_rows == 6
    part = next(iter(ResultFiles(tmp_path).names()))
    told = pyarrow.parquet.read_schema(ResultFiles(tmp_path).file(part)).metadata[b"seastar_gym"]
    assert Scene.from_dict(json.loads(told)["scene"]).numerics == Scene.preset("fast").numerics
    assert main([*words, *QUICK]) == 0
    assert "batches: 0; there before, batches: 2" in capsys.readouterr().out


OWN = """from dataclasses import dataclass
from seastar_gym import Scene, SmaPulse, register_part

@register_part
@dataclass(frozen=True)
class Weaker(SmaPulse):
    peak_angle: float = 0.3

scene = Scene.preset("fast")
"""


@pytest.mark.parametrize("executor", ["here", pytest.param("processes", marks=pytest.mark.slow)])
def test_parts_that_the_file_of_the_scene_defines_are_values_of_an_axis(executor, tmp_path, capsys):
    (file := tmp_path / f"weaker_{executor}.py").write_text(OWN)
    words = "actuator=Weaker,SmaPulse", "--scene", str(file), "--executor", executor, "--out", str(tmp_path)
    assert main([*QUICK[:-2], *words]) == 0
    assert read_results(tmp_path).num_rows == 2


@pytest.mark.parametrize("gait", ["lagged", "thrifty"])
def test_gaits_in_time_are_measured_over_whole_periods(gait, tmp_path):
    (file := tmp_path / "wires.py").write_text(
        "from seastar_gym import Scene, Seastar, SmaWires\n"
        "scene = Scene(Seastar(nodes_per_limb=7), actuator=SmaWires(), numerics=Scene.preset('fast').numerics)"
    )
    speeds = []
    for settling, measured in ((2, 2), (2, 8)):
        out, counts = tmp_path / str(measured), ("--settling", str(settling), "--measured", str(measured))
        assert main([f"gait={gait}", "--scene", str(file), "--out", str(out), *counts, "--executor", "here"]) == 0
        speeds.append(read_results(out).column("speed").to_pylist()[0])
    assert speeds[0] == pytest.approx(speeds[1], rel=0.05)


REFUSED = {
    "say --latin N or --optuna N": ["robot.limb_length=0.05:0.15"],
    "leave one out": ["robot.limb_length=0.05:0.15", "--latin", "2", "--optuna", "2"],
    "--address is for --executor ray or dask": ["--address", "head:1"],
    "--minutes is for --executor slurm": ["--minutes", "5"],
}


@pytest.mark.parametrize("sentence", REFUSED)
def test_options_that_a_sweep_would_not_heed_are_refused(sentence, tmp_path, capsys):
    assert main([*REFUSED[sentence], "--out", str(tmp_path)]) == 2
    assert sentence in capsys.readouterr().err


def test_the_best_design_with_parts_of_one_s_own_is_python_that_registers_them(tmp_path):
    (tmp_path / "own.py").write_text(
        "from own_terms import Trap\nfrom seastar_gym import Scene\nscene = Scene(terms=(Trap(c=1e-3),))"
    )
    words = "robot.limb_length=0.1,0.12", "--scene", str(tmp_path / "own.py"), "--out", str(tmp_path)
    assert main([*words, *QUICK]) == 0
    assert load_scene(tmp_path / "best.py") == load_scene(tmp_path / "best.json")
    assert f"load_scene({str(tmp_path / 'own.py')!r})" in (tmp_path / "best.py").read_text()


def test_the_best_is_one_of_the_sweep_at_hand_which_says_what_has_no_result(tmp_path, capsys):
    for limbs, searched in (("0.08,0.1", ()), ("0.05:0.06", ("--optuna", "2")), ("-0.05,0.04", ())):
        words = f"robot.limb_length={limbs}", "--out", str(tmp_path), *searched
        if searched:
            pytest.importorskip("optuna")
        assert main([*words, *QUICK]) == 0
        told = capsys.readouterr().out
        best = load_scene(tmp_path / "best.json").robot.limb_length
        assert best in (0.08, 0.1) if limbs == "0.08,0.1" else 0.04 <= best <= 0.06
    assert "Designs without result: 1, with status -1: no scene has such a robot" in told and best == 0.04


def test_designs_that_swam_nowhere_have_no_best(tmp_path, capsys):
    assert main(["controller=rest", "--seconds", "2", "--out", str(tmp_path), *QUICK]) == 0
    assert "There is no best design" in capsys.readouterr().out and not (tmp_path / "best.json").exists()


def test_counting_simulates_nothing(tmp_path, capsys):
    words = "limb_length=0.05:0.15:100", "n_limbs=3,5", "density=500:2000:100", "youngs_modulus=1e5:1e7:50"
    assert main([*(f"robot.{word}" for word in words), "--robots", "1", "--count", "--out", str(tmp_path)]) == 0
    assert "1,000,000 designs in 1,000,000 batches." in capsys.readouterr().out
    assert not list(tmp_path.iterdir())


def test_a_search_from_words_to_its_best(tmp_path, capsys):
    """Which does not write through a link."""
    optuna, tmp_path = pytest.importorskip("optuna"), tmp_path / "is/not yet there"
    words = "robot.limb_length=0.05:0.15", "--optuna", "4", "--robots", "2", "--minimize", "--out", str(tmp_path)
    assert main([*words, *QUICK]) == 0
    found = read_results(tmp_path).column("speed").to_pylist()
    assert len(found) == 4 and f"Best speed: {min(found):.6g}" in capsys.readouterr().out
    [study] = optuna.get_all_study_summaries(f"sqlite:///{tmp_path}/study.db")
    assert study.direction.name == "MINIMIZE"
    (tmp_path / "study.db").rename(tmp_path / "somebody's")
    (tmp_path / "study.db").symlink_to(tmp_path / "somebody's")
    before = (tmp_path / "somebody's").read_bytes()
    assert main([*words, *QUICK]) == 2
    assert "study.db is a link" in capsys.readouterr().err
    assert (tmp_path / "somebody's").read_bytes() == before


def command(tmp_path, *words):
    seastar = "from seastar_gym.cli.main import run; run()"
    arguments = [sys.executable, "-c", seastar, "sweep", *words, "--out", str(tmp_path)]
    told = dict.fromkeys(("stdout", "stderr"), subprocess.PIPE)
    return subprocess.Popen(arguments, cwd=ROOT, **told, text=True, start_new_session=True)


def finished(tmp_path, n_batches, process):
    """Wait until so many batches are finished."""
    end = time.monotonic() + 120
    while len(list(ResultFiles(tmp_path).names())) < n_batches:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < end
        time.sleep(0.05)


def test_a_killed_sweep_goes_on_where_it_was(tmp_path, monkeypatch):
    """Its workers end with it. ways/test_many_designs.py presses Ctrl-C."""
    words = "robot.limb_length=0.05:0.15:400", "--robots", "1", "--measured", "1", "--settling", "0", "--workers", "1"
    process = command(tmp_path, *words)
    finished(tmp_path, 3, process)
    process.kill()
    process.communicate(timeout=60)  # whoever holds its pipes has ended
    names = set(ResultFiles(tmp_path).names())
    assert len(names) >= 3
    assert all(ResultFiles(tmp_path).file(name).read_bytes()[-4:] == b"PAR1" for name in names)
    kept = []

    def interrupt(tally):
        kept.append(tally.kept)
        if tally.done == 3:
            raise KeyboardInterrupt

    monkeypatch.setattr("seastar_gym.sweep.command.bar_of", lambda *_: interrupt)
    assert main([*words[:-2], "--executor", "here", "--out", str(tmp_path)]) == INTERRUPTED
    assert {*kept} == {len(names)} and len(names | {*ResultFiles(tmp_path).names()}) == len(names) + 3


@pytest.mark.parametrize("problems, code", [({}, 0), ({"cell": "Lost."}, 1)])
def test_cells_without_result_are_an_exit_code(problems, code, tmp_path, monkeypatch):
    monkeypatch.setattr("seastar_gym.sweep.command.run", lambda *_: Progress(problems=problems))
    assert main(["--out", str(tmp_path), *QUICK]) == code
