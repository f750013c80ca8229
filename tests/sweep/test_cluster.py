"""A sweep on a cluster of a head and two worker nodes, all processes of this machine, one of which is killed."""

import itertools
import os
from collections import Counter
from pathlib import Path

import pytest

import works
from refusals import assert_refused
from seastar_gym.scene import Scene
from seastar_gym.sweep.designs import Range, Sweep
from seastar_gym.sweep.executors import RayTasks
from seastar_gym.sweep.run import ResultFiles, read_result_file, run

ray = pytest.importorskip("ray")
ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def cluster(monkeypatch, tmp_path):
    """Head without processors for tasks, and two nodes with one each. Batches of `works` wait for both."""
    from ray.cluster_utils import Cluster

    (tmp_path / "nodes").write_text("2")
    monkeypatch.setenv("MEETING", str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", f"{ROOT}{os.pathsep}{ROOT / 'tests'}")
    made = Cluster(initialize_head=True, head_node_args={"num_cpus": 0, "include_dashboard": False})
    made.nodes = [made.add_node(num_cpus=1), made.add_node(num_cpus=1)]
    yield made
    ray.shutdown()
    made.shutdown()


@pytest.mark.slow
def test_a_node_that_is_killed_in_mid_sweep_costs_its_cells(cluster, tmp_path):
    axis = Range("robot.limb_length", 0.05, 0.15).spaced(24)
    sweep = Sweep(Scene.preset("fast"), (axis,), settling=0, measured=1, robots=1)
    counted = itertools.count(1)

    def kill_a_node(tally):
        if next(counted) == 6:
            cluster.remove_node(cluster.nodes[0], allow_graceful=False)

    tally = run(sweep.batches(), tmp_path, RayTasks(cluster.address), kill_a_node, works.slow)
    parts = ResultFiles(tmp_path)
    nodes = Counter(read_result_file(parts.file(name))["text"][0].as_py() for name in parts.names())
    assert tally.done == 24 and not tally.problems
    assert 1 <= tally.losses <= 4
    assert set(parts.names()) == {batch.name for batch in sweep.batches()}
    assert len(nodes) == 2 and min(nodes.values()) <= 6  # what was done on the killed node before


@pytest.mark.parametrize(
    "address, words", [*((f"127.0.0.1:{port}", "no cluster") for port in (1, 99999)), ("head", "HOST:PORT")]
)
def test_there_is_no_cluster_at_a_wrong_address(address, words):
    with assert_refused(words, address):
        RayTasks(address)


@pytest.mark.slow
def test_a_full_disk_on_a_node_costs_cells_that_need_it(cluster, tmp_path, small_disk):
    """One node of three has no room. Its batches are run again, elsewhere by luck; a later run does the rest."""
    place, grow = small_disk(size=4096)
    (place / "filler").write_bytes(bytes(4096))
    cluster.add_node(num_cpus=1, env_vars={"TMPDIR": str(place), "NUMBA_CACHE_DIR": str(place)})
    (tmp_path / "nodes").write_text("3")
    axis = Range("robot.limb_length", 0.05, 0.15).spaced(30)
    sweep = Sweep(Scene.preset("fast"), (axis,), settling=0, measured=1, robots=1)
    executor = RayTasks(cluster.address)
    tally = run(sweep.batches(), tmp_path / "out", executor, work=works.scratching)
    assert tally.losses >= 1 and tally.done + len(tally.problems) == 30 and tally.done >= 15
    assert all("no space left on device" in problem for problem in tally.problems.values())
    grow()
    again = run(sweep.batches(), tmp_path / "out", executor, work=works.scratching)
    assert again.kept == tally.done and again.done == len(tally.problems) and not again.problems


@pytest.mark.slow
def test_simulating_needs_no_disk_on_a_node(cluster, tmp_path, small_disk):
    """A node that can keep no compiled code compiles in every process, and gives the same bits."""
    place, _ = small_disk(size=4096)
    (place / "filler").write_bytes(bytes(4096))
    for node in cluster.nodes:
        cluster.remove_node(node, allow_graceful=True)
    cluster.add_node(num_cpus=1, env_vars={"TMPDIR": str(place), "NUMBA_CACHE_DIR": str(place)})
    axis = Range("robot.limb_length", 0.05, 0.15).spaced(4)
    sweep = Sweep(Scene.preset("fast"), (axis,), settling=0, measured=1, robots=2)
    tally = run(sweep.batches(), tmp_path / "full", RayTasks(cluster.address))
    assert tally.done == 2 and not tally.losses
    run(sweep.batches(), tmp_path / "here")
    full, here = ResultFiles(tmp_path / "full"), ResultFiles(tmp_path / "here")
    for name in here.names():
        assert full.file(name).read_bytes() == here.file(name).read_bytes()
