"""Whoever shares a lane group with a robot, and whatever becomes of them, it moves to the same bits as alone."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hubs import TEN
from seastar_gym import (
    Body,
    Contact,
    Limb,
    Numerics,
    Scene,
    Seastar,
    Simulator,
    SmaPulse,
    State,
    UniformCurrent,
    Water,
)
from seastar_gym.envs.stations import heading_of
from seastar_gym.scene.per_robot import side_by_side
from seastar_gym.simd.lanes import N_LANES

pytestmark = pytest.mark.filterwarnings("ignore:Limbs of robot:RuntimeWarning")

SCHEMES = ["implicit-euler", "sdirk2", "sdirk3", "implicit-midpoint"]
KINDS = ("at rest", "shifted", "coinciding", "fast", "crossed", "crumpled", "far out", "no number")


def nasty(kind: str, scene: Scene, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """(positions, velocities) of a robot of some kind, shape (n_nodes, 2)."""
    robot = scene.robot
    q, edge = robot.nodes(), robot.edge_length
    v = 0.01 * rng.standard_normal(q.shape)
    match kind:
        case "shifted":
            q = q + edge * rng.uniform(-1.0, 1.0, q.shape)
        case "coinciding":
            first, second = rng.permutation(len(q))[: 2 * (len(q) // 4)].reshape(2, -1)
            q[first] = q[second]
        case "fast":
            v *= 10.0 ** rng.uniform(0.0, 5.0)
        case "crossed":
            limb = slice(1, robot.nodes_per_limb)
            c, s = np.cos(rng.uniform(1.0, 2.0)), np.sin(rng.uniform(1.0, 2.0))
            q[limb] = q[limb] @ [[c, s], [-s, c]]
        case "crumpled":
            q = edge * rng.uniform(-1.0, 1.0, q.shape)
        case "far out":
            q = q + 10.0 ** rng.uniform(0.0, 8.0) * rng.standard_normal(q.shape)
    return q, v


def put(simulator: Simulator, states: list[tuple[np.ndarray, np.ndarray]], ill: list[bool]) -> None:
    """Give robots their states; one that is ill has a number that is none."""
    simulator.set_state(State(*(np.stack(part) for part in zip(*states, strict=True)), np.zeros(len(states))))
    for k in np.flatnonzero(ill):
        group, lane = divmod(int(k), N_LANES)
        simulator.q[group, 3, lane] = np.nan


def assert_alike_in_company(scene: Scene, kinds: list[str], seed: int) -> None:
    """Every robot of a batch has the bits, and the report, that it has alone."""
    rng = np.random.default_rng(seed)
    states = [nasty(kind, scene, rng) for kind in kinds]
    ill = [kind == "no number" for kind in kinds]
    commands = rng.integers(-1, 2, (2, len(kinds), scene.robot.n_limbs)).astype(float)
    together = Simulator(scene, len(kinds), threads=1)
    alone = [Simulator(scene, 1) for _ in kinds]
    put(together, states, ill)
    for k, single in enumerate(alone):
        put(single, states[k : k + 1], ill[k : k + 1])
    for command in commands:
        report = together.stroke(command)
        for k, single in enumerate(alone):
            own = single.stroke(command[k : k + 1])
            np.testing.assert_array_equal(together.positions[k], single.positions[0], err_msg=kinds[k])
            np.testing.assert_array_equal(together.velocities[k], single.velocities[0], err_msg=kinds[k])
            for name, value, wanted in zip(report._fields, report, own, strict=True):
                np.testing.assert_array_equal(value[k : k + 1], wanted, err_msg=f"{kinds[k]}: {name}")


KINDS_OF_A_GROUP = st.lists(st.sampled_from(KINDS), min_size=N_LANES, max_size=N_LANES)


def brief(scheme: str, step: float, robot: Seastar = TEN, **terms) -> Scene:
    """A scene whose strokes take four steps."""
    pulse, numerics = SmaPulse(0.5, 2.0 * step, 2.0 * step), Numerics(scheme, step, max_iterations=20)
    return Scene(robot, actuator=pulse, numerics=numerics, **terms)


ROBOTS = {
    "plain": {},
    "touching": {"contact": Contact()},
    "every term": {
        "robot": Seastar(n_limbs=4, nodes_per_limb=6, relaxation_time=1e-4),
        "fluid": Water(tangential_drag_coefficient=0.1, current=UniformCurrent(0.1, -0.05), added_mass_coefficient=1.0),
        "contact": Contact(),
        "loads": ((7, 1e-3, 2e-3),),
    },
}


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("scheme", SCHEMES)
@settings(derandomize=True, max_examples=10)
@given(kinds=KINDS_OF_A_GROUP, step=st.sampled_from([1e-3, 5e-3, 0.02]), seed=st.integers(0, 1000))
def test_a_robot_moves_alike_in_nasty_company(name, scheme, kinds, step, seed):
    assert_alike_in_company(brief(scheme, step, **ROBOTS[name]), kinds, seed)


def test_a_neighbours_listed_pairs_take_no_place_from_a_robot_with_long_chains():
    """Chains too long for all pairs of node and edge at once; the pairs near a robot are counted robot by robot."""
    scene = brief("implicit-euler", 5e-3, robot=Seastar(nodes_per_limb=40), contact=Contact())
    assert_alike_in_company(scene, ["shifted", *["crumpled"] * (N_LANES - 2), "crossed"], 1)


CURVED = Seastar(4, 5, limbs=(Limb(natural_curvature=(0.0, 6.0, -3.0)), Limb(), Limb(), Limb()))
"""Three robots whose first limbs are bent differently at rest."""
ON_A_BODY = replace(CURVED, body=Body.rectangle(0.06, 0.03))


def unequal(robot: Seastar, order: list[int]) -> Simulator:
    """Some of the three robots, in any order, each with a heading of its own."""
    scene = side_by_side([Scene(robot).of_robot(k) for k in order])
    simulator = Simulator(scene, len(order))
    simulator.reset(heading=0.5 * np.array(order) - 0.3)
    return simulator


@pytest.mark.parametrize("order", [[0, 1, 2], [2, 0, 1], [1], [2]])
@pytest.mark.parametrize("read", [Simulator.heading, heading_of])
def test_a_heading_is_that_of_a_robots_own_shape_at_rest(read, order):
    found = read(unequal(CURVED, order))
    np.testing.assert_allclose(found, 0.5 * np.array(order) - 0.3, rtol=0.0, atol=1e-14)
    alone = [read(unequal(CURVED, [robot]))[0] for robot in order]
    np.testing.assert_array_equal(found, alone)


@pytest.mark.parametrize("order", [[0, 1, 2], [2, 1, 0]])
def test_a_state_without_orientation_has_that_of_every_robots_own_shape(order):
    simulator = unequal(ON_A_BODY, order)
    simulator.set_state(State(*simulator.get_state()[:3]))
    np.testing.assert_allclose(simulator.orientation(), 0.5 * np.array(order) - 0.3, rtol=0.0, atol=1e-14)
    assert simulator.elastic_energy().max() < 1e-20 and not simulator.spin().any()
