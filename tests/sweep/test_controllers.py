"""Sweeps over controllers: designs that swim a path as policies say."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest

from refusals import assert_refused
from seastar_gym.controllers.learned import BUNDLED, load
from seastar_gym.envs.options import make_scene
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.evaluation.swim import swim as swim_one
from seastar_gym.scene import Scene
from seastar_gym.sweep.command import main
from seastar_gym.sweep.designs import Choices, Route, Sweep
from seastar_gym.sweep.executors import Processes
from seastar_gym.sweep.run import OF_CONTROLLERS, UNITS, ResultFiles, read_results, result_file_of, run, swim

TESTS = Path(__file__).resolve().parents[1]
FAST = Scene.preset("fast")
SHORT = Route([[0.04, 0.0], [0.04, 0.03]], seconds=40.0)
LENGTHS = Choices("robot.limb_length", (0.08, 0.1, 0.12))


def sweep_of(*controllers, axes=(), scene=FAST, route=SHORT, **options):
    return Sweep(scene, (Choices("controller", controllers), *axes), route=route, **options)


def names(sweep):
    return [batch.name for batch in sweep.batches()]


@pytest.fixture
def policy(tmp_path):
    """Copy of the bundled policy."""
    for file in (BUNDLED, BUNDLED.with_suffix(".json")):
        shutil.copy(file, tmp_path / file.name)
    return tmp_path / BUNDLED.name


def test_a_design_swims_as_the_environment_does():
    (batch,) = sweep_of("learned", axes=(LENGTHS,)).batches()
    found = swim(batch)
    scene = replace(FAST, robot=replace(FAST.robot, limb_length=0.12))
    env = SeastarSwimEnv(SHORT.path, actions=load().actions, scene=scene)
    done = swim_one("learned", load(), env, max_strokes=40)
    assert done.finished and found["waypoints"].tolist() == [2.0, 2.0, 2.0]
    assert found["time"][2] == done.time[-1] and found["energy"][2] == pytest.approx(done.energy.sum())
    np.testing.assert_allclose([found["ahead"][2], found["aside"][2]], done.hub[-1], rtol=1e-12)
    assert (found["work"] > 0.0).all() and (found["peak_moment"] > 0.0).all()
    assert found["speed"][2] == pytest.approx(0.07 / done.time[-1])
    assert found["strokes_per_metre"][2] == pytest.approx(done.time[-1] / 0.07)
    assert found["status"].tolist() == [0, 0, 0] and len(set(found["time"])) > 1


def test_who_does_not_arrive_has_no_time_and_the_speed_of_what_is_reached():
    (batch,) = sweep_of("rest", route=replace(SHORT, seconds=3.0)).batches()
    found = swim(batch)
    assert np.isnan(found["time"][0]) and found["waypoints"][0] == 0.0 == found["speed"][0]
    timed = sweep_of("rest", scene=make_scene(None, "fast", 0.5), route=Route(seconds=3.0, decision_period=0.5))
    assert [each.configuration.controller.decisions for each in (batch, *timed.batches())] == [3, 6]


def test_a_cell_is_named_by_its_controller_and_what_that_swims(policy):
    first = names(sweep_of("learned"))
    file = names(sweep_of(str(policy)))
    others = [
        names(sweep_of("straight")), names(sweep_of("learned", route=replace(SHORT, path="line"))),
        names(sweep_of("learned", route=replace(SHORT, seconds=39.0))), names(Sweep(FAST, ())),
    ]  # fmt: skip
    description = policy.with_suffix(".json")
    facts = json.loads(description.read_text())
    description.write_text(json.dumps(facts | {"training": {}}))
    others.append(names(sweep_of(str(policy))))
    assert first == names(sweep_of("learned")) == names(sweep_of("learned", route=replace(SHORT, decision_period=1.0)))
    assert len({*first, *file, *(name for each in others for name in each)}) == 7
    (batch,) = sweep_of(str(policy)).batches()
    policy.write_bytes(b"")
    with assert_refused("is another one here than where the sweep was planned"):
        swim(batch)


def test_agents_of_one_s_own_swim_every_robot(monkeypatch):
    monkeypatch.syspath_prepend(TESTS / "controllers")
    axes = (Choices("robot.n_limbs", (4, 5)),)
    found = [swim(batch) for batch in sweep_of("own_agents:Towards", axes=axes).batches()]
    assert all(each["status"][0] == 0 and np.isfinite(each["energy"][0]) for each in found)
    assert found[0]["ahead"][0] != found[1]["ahead"][0]


def test_a_part_says_controller_time_and_waypoints_with_the_same_bits_in_other_processes(tmp_path):
    sweep = sweep_of("straight", axes=(LENGTHS,), robots=2)
    tally = run(sweep.batches(), tmp_path, Processes(2))
    assert tally.done == 2 and tally.designs == 3 and tally.strokes == 0
    for batch in sweep.batches():
        assert ResultFiles(tmp_path).file(batch.name).read_bytes() == result_file_of(batch)
    table = pyarrow.parquet.read_table(ResultFiles(tmp_path).file(batch.name))
    assert table.column_names == ["controller", "robot.limb_length", *UNITS, *OF_CONTROLLERS]
    assert table.schema.field("time").metadata == {b"unit": b"s"}
    told = json.loads(table.schema.metadata[b"seastar_gym"])["pilot"]
    assert told["name"] == "straight" and told["waypoints"] == [[0.04, 0.0], [0.04, 0.03]]


def test_the_command_compares_controllers(tmp_path, capsys):
    path = tmp_path / "path.csv"
    path.write_text("0.03,0.0\n")
    words = ["controller=learned,straight", "robot.limb_length=0.09,0.11", "--path", str(path), "--seconds", "30"]
    assert main([*words, "--executor", "here", "--out", str(tmp_path / "out")]) == 0
    printed = capsys.readouterr()
    assert "New in" in printed.out and "designs/s" in printed.err and "strokes/s" not in printed.err
    table = read_results(tmp_path / "out").to_pandas()
    assert sorted(table.controller) == ["learned", "learned", "straight", "straight"]
    assert table[table.controller == "learned"].waypoints.tolist() == [1.0, 1.0]
    assert main(["controller=missing.safetensors", "--out", str(tmp_path)]) == 2
    assert "There is no trained policy at missing" in capsys.readouterr().err
