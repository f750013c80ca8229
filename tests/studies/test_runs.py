"""Every study of speed, devices, policies and pictures runs in its shortest form, and what its numbers promise."""

import gc
import json
import os
import re
import subprocess
import tracemalloc
from functools import partial

import numpy as np
import pytest

from seastar_gym import TASKS, Numerics, Scene, Seastar
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.scene.actuators.sma_limb import FREQUENCIES, MEASURED
from studies import benchmark, extremes, fit, gallery, gpu, mutants, robustness, swim_page, tasks
from studies.command import main
from studies.frame import DOCS
from studies.operations import count_operations, flops
from studies.pages import numbers

CURVES = fit.read_curves()
KEPT = os.environ.get("NUMBA_CACHE_DIR", "")
"""Folder of code that is there, in place of empty ones, which take a minute to fill."""
SHORTEST = {
    "benchmark --parts throughput --seconds 0": ({"speed_history.json"}, {
        "studies.benchmark": {"NODES_PER_LIMB": (5, 10), "BATCH": 8},
    }),
    "benchmark --beside .": ({"speed_history.json", "speed_history.png"}, {
        "studies.benchmark": {"SWIMS": {"one robot": ("fast", 1, 1)}, "ENVIRONMENTS": {}, "ROUNDS": 1, "MANY": 1,
                              "run_in": lambda checkout, words, _, run=benchmark.run_in: run(checkout, words, KEPT),
                              "first_stroke": lambda checkout, cache: 2.0, "training": lambda checkout, cache: 1.0},
    }),
    "extremes": ({"extremes.json"}, {
        "studies.extremes": {"PRESETS": {"rapid": extremes.PRESETS["rapid"]}, "STROKES": 1},
    }),
    "film": ({""}, {"studies.film": {"SeastarSwimEnv": partial(SeastarSwimEnv, path=[[0.02, 0.0]])}}),
    "fit": (set(), {"studies.fit": {"read_curves": lambda: {40: CURVES[40]}}}),
    "gallery": ({"gallery.json", "default.png", "tubes.png"}, {
        "studies.gallery": {"EXHIBITS": [each for each in gallery.EXHIBITS if each.name in ("default", "tubes")],
                            "STROKES": 1, "ROUNDS": 1, "ROBOTS": 1},
    }),
    "gpu --device scalar --compared 'observations, pairs'": ({"gpu.json"}, {}),
    "ids": ({"SeastarPrey-v0.png", "SeastarPrey-v0.gif"}, {
        "studies.ids": {"IDS": {"SeastarPrey-v0": TASKS["SeastarPrey-v0"]}, "SECONDS": 2, "SHOWN": 1},
    }),
    "robustness": ({"robustness.json"}, {
        "studies.robustness": {"N_PATHS": 1, "PERIODS": {robustness.CAMERA: 0.2},
                               "CONDITIONS": {"soft": robustness.Condition(modulus=0.5)}},
    }),
    "swim_page": ({""}, {"studies.swim_page": {"record": partial(swim_page.record, "fast", 1)}}),
    "tasks": (set(), {
        "studies.tasks": {"TASKS": ["SeastarPrizes-v0"], "held_out": partial(tasks.held_out, n=2)},
    }),
}  # fmt: skip
"""Commands, files that they write, "" for the one that --out names, and what of them is made shorter."""


@pytest.mark.parametrize("command", SHORTEST)
def test_a_study_runs_in_its_shortest_form_and_writes_its_files(command, tmp_path, monkeypatch, capsys):
    files, shorter = SHORTEST[command]
    for module, values in shorter.items():
        for name, value in values.items():
            monkeypatch.setattr(f"{module}.{name}", value)
    out = tmp_path / ("file.gif" if files == {""} else "folder")
    words = [word.strip("'") for word in re.findall(r"'[^']*'|\S+", command)]
    assert main([*words, "--out", str(out)]) == 0
    assert out.is_file() if files == {""} else files <= {each.name for each in out.glob("*")}
    assert capsys.readouterr().out


def test_a_robot_is_small_and_a_stroke_leaves_nothing_behind():
    n_robots = 512
    tracemalloc.start()
    swim = benchmark.straight(Scene(), n_robots)
    held = tracemalloc.get_traced_memory()[0]
    swim()
    gc.collect()
    before = tracemalloc.get_traced_memory()[0]
    for _ in range(20):
        swim()
    gc.collect()
    left = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    assert held < n_robots * 64 * 1024 and left < 20 * n_robots * 8  # B: less than one number per robot and stroke


# Operations of a Newton iteration: they show on any machine when kernels become slower.


THE_CHAPTERS = Scene(Seastar(discretisation="chapter"), numerics=Numerics.preset("chapter"))
TEN = Scene(Seastar(nodes_per_limb=10), numerics=Numerics.preset("chapter"))


@pytest.mark.parametrize("scene, most", [(THE_CHAPTERS, (11_600, 227, 91, 1_300)), (TEN, (13_720, 276, 137, 1_310))])
def test_an_iteration_costs_no_more_than_when_it_was_tuned(scene, most):
    parts = count_operations(scene)
    iteration = parts["iteration"]
    found = flops(iteration), iteration["divide"], iteration["root"], flops(parts["step"])
    assert all(now <= before for now, before in zip(found, most, strict=True)), found  # lower them when it is less


@pytest.mark.parametrize("number, values", [("nodes_per_limb", (10, 20, 30)), ("n_limbs", (4, 6, 8))])
def test_every_node_and_every_limb_costs_the_same(number, values):
    few, more, most = (flops(count_operations(Scene(Seastar(**{number: n})))["iteration"]) for n in values)
    assert most - more == more - few > 0


# What other studies promise


def test_all_scenes_and_environments_had_the_bits_of_the_processor_on_the_gpu():
    results = numbers(DOCS, gpu.STUDY)
    bits, observations = results["bits"], results["observations"]
    assert set(bits) == set(gpu.scenes()) and set(observations) == set(gpu.environments())
    assert all(found["same"] for found in (*bits.values(), *observations.values()))
    assert not any(found["failed"] for found in bits.values())
    assert results["traffic"] == {preset: gpu.traffic(preset) for preset in gpu.PRESETS}


@pytest.mark.parametrize("liquid_metal", MEASURED)
def test_presets_of_limbs_are_as_near_to_the_measurements_as_a_fit(liquid_metal):
    curves = CURVES[liquid_metal]
    assert (curves[0].frequency, curves[-1].frequency) == FREQUENCIES[liquid_metal]
    both = MEASURED[liquid_metal], fit.fit(curves, starts=2)
    error, fitted = (np.sqrt(np.mean(fit.errors(numbers, curves) ** 2)) for numbers in both)
    assert error < 1.01 * fitted and error < (0.07 if liquid_metal > 30 else 0.035)


TOY = {
    "toy/code.py": 'def larger(x: int, /):\n    if x > 1:\n        raise ValueError(f"{1 + 1}")\n    return x * 3\n',
    "tests/toy/test_code.py": "from pytest import mark\nfrom toy.code import larger\n"
    "def test_core(): assert larger(1) > 0\n"
    "@mark.skipif('not config.option.all')\ndef test_all(): assert larger(1) == 3\n",
    "conftest.py": "def pytest_addoption(parser):\n"
    "    parser.addoption('--all', action='store_true')\n    parser.addoption('--core', action='store_true')\n",
}


def test_mutants_are_killed_by_the_core_by_all_or_by_nothing_and_the_checkout_stays(tmp_path, monkeypatch):
    for name, text in TOY.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    for words in (["init", "-q"], ["add", "."]):
        subprocess.run(["git", *words], cwd=tmp_path, check=True)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(mutants, "PACKAGE", "toy")
    monkeypatch.delenv("PYTEST_ADDOPTS", raising=False)  # options of plugins that are not loaded
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")  # a start of pytest takes half as long
    for _ in range(2):  # what has a line is not run again
        assert main(["mutants", "--count", "9", "--kernels", "0", "--out", "runs"]) == 0
        rows = [json.loads(line) for line in (tmp_path / "runs/mutants.jsonl").read_text().splitlines()]
        assert len(rows) == 4 and {row["after"]: row["killed by"] for row in rows} == {
            "if x <= 1:": "core", "if x > 2:": "nothing", "return x / 3": "all", "return x * 4": "all",
        }  # fmt: skip
    assert all((tmp_path / name).read_text() == text for name, text in TOY.items())
    assert mutants.drawn(tmp_path, 3, 0, 1) == mutants.drawn(tmp_path, 3, 0, 1) != mutants.drawn(tmp_path, 3, 0, 2)
