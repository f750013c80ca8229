"""The displacement map and the agent that swims by it."""

import numpy as np
import pytest

from seastar_gym import Numerics, Scene, Simulator
from seastar_gym.controllers import greedy
from seastar_gym.controllers.greedy import GreedyPolicy, displacement_map, measure_gaits
from seastar_gym.controllers.open_loop import to_actions
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.symmetry import action_table
from seastar_gym.evaluation.swim import swim
from seastar_gym.gaits import pair_gait

FAST = Scene(numerics=Numerics.preset("fast"))


@pytest.fixture(scope="module", autouse=True)
def cache(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cache")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(folder))
        yield folder


def test_the_map_has_the_symmetry_of_the_robot():
    """A turned or mirrored command moves the hub the turned or mirrored way."""
    hub, turn = displacement_map(FAST)
    x_y = hub @ [1.0, 1.0j]
    for k in range(1, 5):
        np.testing.assert_allclose(x_y[action_table("joint", 5)[2 * k]], x_y * np.exp(-0.4j * np.pi * k), atol=1e-7)
    mirrored = action_table("joint", 5)[9]
    np.testing.assert_allclose(x_y[mirrored], x_y.conj(), atol=1e-7)
    np.testing.assert_allclose(turn[mirrored], -turn, atol=1e-6)
    straight = to_actions(pair_gait(2, 5), "joint", 5)[0]
    assert hub[straight, 0] > 3e-3 and abs(hub[straight, 1]) < 1e-7


def test_the_map_is_measured_once_for_every_scene_and_again_where_its_file_is_damaged(cache, monkeypatch):
    first = displacement_map(FAST)
    files = list((cache / "seastar-gym").iterdir())
    for file in files:
        file.write_bytes(b"no map")
    np.testing.assert_array_equal(displacement_map(FAST).hub, first.hub)
    monkeypatch.setattr(greedy, "measure_gaits", None)  # would fail if called
    np.testing.assert_array_equal(displacement_map(FAST).hub, first.hub)
    assert list((cache / "seastar-gym").iterdir()) == files
    with pytest.raises(TypeError):
        displacement_map(Scene(numerics=Numerics.preset("accurate")))


def test_it_swims_a_path_with_a_random_heading():
    agent = GreedyPolicy(FAST)
    env = SeastarSwimEnv(path=[[0.05, 0.0], [0.05, 0.05]], random_heading=True, actions=agent.actions, fidelity="fast")
    done = swim("greedy", agent, env, max_strokes=60, seed=1)
    assert done.finished


def test_displacements_are_a_stroke_s_share_in_the_frame_in_which_they_begin(monkeypatch):
    """Turns are the short way round, such as from a heading of 3 rad to one of -3 rad."""
    gaits = np.array([[[1.0, 0.0, -1.0, 0.0, 0.0]]])
    simulator = Simulator(FAST, 1)
    simulator.stroke(gaits[:, 0])
    hub, heading = simulator.hub_position(), greedy.heading_of(simulator)
    simulator.stroke(gaits[:, 0])
    simulator.stroke(gaits[:, 0])
    way = (simulator.hub_position() - hub) @ [1.0, 1.0j] * np.exp(-1j * heading) / 2.0
    found = measure_gaits(FAST, gaits, settling=1, measured=2)
    np.testing.assert_allclose(found.hub @ [1.0, 1.0j], way, atol=1e-12)
    np.testing.assert_allclose(found.turn, (greedy.heading_of(simulator) - heading) / 2.0, atol=1e-12)
    alternation = np.concatenate([pair_gait(3, 4), pair_gait(2, 5)])[None]  # over whole periods
    both = measure_gaits(FAST, np.concatenate([alternation, alternation[:, ::-1]]), settling=10, measured=4)
    np.testing.assert_allclose(both.hub[0], both.hub[1], atol=1e-5)
    assert 4.4e-3 < both.hub[0, 0] < 5.5e-3  # a stroke's share
    headings = iter([np.array([3.0]), np.array([-3.0])])
    monkeypatch.setattr(greedy, "heading_of", lambda simulator: next(headings))
    found = measure_gaits(FAST, np.zeros((1, 1, 5)), settling=0, measured=2)
    np.testing.assert_allclose(found.turn, np.pi - 3.0)
