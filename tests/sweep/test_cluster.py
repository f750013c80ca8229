"""A sweep on a cluster of a head and two worker nodes, all processes of this machine, one of which is killed."""

import itertools
import os
from pathlib import Path

import pytest

import works
from refusals import assert_refused
from seastar_gym.scene import Scene
from seastar_gym.sweep.axes import Range
from seastar_gym.sweep.designs import Sweep
from seastar_gym.sweep.parts import Parts
from seastar_gym.sweep.run import run

ray = pytest.importorskip("ray")
ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def cluster(monkeypatch):
    """Head without processors for tasks, and two nodes with one each."""
    from ray.cluster_utils import Cluster

    monkeypatch.setenv("PYTHONPATH", f"{ROOT}{os.pathsep}{ROOT / 'tests'}")
    made = Cluster(initialize_head=True, head_node_args={"num_cpus": 0, "include_dashboard": False})
    made.nodes = [made.add_node(num_cpus=1), made.add_node(num_cpus=1)]
    yield made
    ray.shutdown()
    made.shutdown()


@pytest.mark.slow
def test_a_node_that_is_killed_in_mid_sweep_costs_its_cells(cluster, tmp_path):
    from seastar_gym.sweep.executors.on_ray import RayTasks

    axis = Range("robot.limb_length", 0.05, 0.15).spaced(24)
    sweep = Sweep(Scene.preset("fast"), (axis,), settling=0, measured=1, robots=1)
    counted = itertools.count(1)

    def kill_a_node(tally):
        if next(counted) == 6:
            cluster.remove_node(cluster.nodes[0], allow_graceful=False)

    tally = run(sweep.cells(), tmp_path, RayTasks(cluster.address), kill_a_node, works.slow)
    print(f"{tally.done} cells done, {tally.losses} lost with their node and run again")
    assert tally.done == 24 and not tally.problems
    assert 1 <= tally.losses <= 4
    assert set(Parts(tmp_path).names()) == {cell.name for cell in sweep.cells()}


@pytest.mark.parametrize("address", ["127.0.0.1:1", "127.0.0.1:99999"])
def test_there_is_no_cluster_at_a_wrong_address(address):
    from seastar_gym.sweep.executors.on_ray import RayTasks

    with assert_refused("no Ray cluster", address):
        next(RayTasks(address).run(works.named, iter(())))


def test_an_address_has_a_port():
    from seastar_gym.sweep.executors.on_ray import RayTasks

    with assert_refused("HOST:PORT", "head"):
        next(RayTasks("head").run(works.named, iter(())))
