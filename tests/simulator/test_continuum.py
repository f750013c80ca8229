"""The continuum's discretisation: ten nodes swim as infinitely many do, and keep what mechanics keeps."""

from dataclasses import replace

import numpy as np
import pytest

import oracle
from seastar_gym import AlongLimb, MeasuredCurve, Numerics, Scene, Seastar, Simulator, SmaPulse, Stiffening
from seastar_gym.gaits import PAIRS, STRAIGHT
from simulator.test_oracle_steps import BENT, TWIN

LIMIT = {"straight": 34.360, "{1-,2+}": 28.189, "{1-,4+}": 39.355, "{1-,5+}": 32.282}
"""Distances after ten strokes with N to infinity and h to 0 [mm]."""
AFTER_ONE = 4.708
"""That of the straight swim after one stroke [mm]."""
OF_NODES = {
    10: (34.364, 27.977, 39.333, 32.085),
    19: (34.365, 28.159, 39.362, 32.229),
    37: (34.361, 28.182, 39.358, 32.279),
}
"""Those after ten strokes with h to 0, over the nodes per limb, as a prototype of its own found them [mm]."""


def distances(nodes_per_limb: int, step: float) -> np.ndarray:
    """Distances after ten strokes [mm] of the commands of LIMIT, after the first stroke of the straight one, too."""
    commands = np.array([STRAIGHT, *(PAIRS[name] for name in list(LIMIT)[1:])])
    robot = Seastar(nodes_per_limb=nodes_per_limb)
    simulator, found = Simulator(Scene(robot, numerics=Numerics("implicit-midpoint", step)), len(commands)), []
    for _ in range(10):
        assert not simulator.stroke(commands).status.any()
        found.append(1e3 * np.hypot(*simulator.hub_position().T))
    assert abs(simulator.hub_position()[0, 1]) < 1e-9
    return np.array([*found[-1], found[0][0]])


@pytest.mark.parametrize(
    "nodes_per_limb, step, expected, error",
    [
        *((nodes, 5e-4, found, 1e-3) for nodes, found in OF_NODES.items()),
        (10, 1e-3, LIMIT.values(), 1e-2),
        pytest.param(73, 5e-5, [*LIMIT.values(), AFTER_ONE], 1e-4, marks=pytest.mark.slow),
    ],
)
def test_few_nodes_swim_as_the_prototype_did_and_as_infinitely_many_do(nodes_per_limb, step, expected, error):
    found = distances(nodes_per_limb, step)[: len(expected)]
    np.testing.assert_allclose(found, [*expected], rtol=error)


# Limbs that actuators bend along their length, and that stiffen when hot.


CURVE = 1.3
"""Peak angle of a limb [rad]."""
HOLD = MeasuredCurve((0.0, 0.1, 3.9, 4.0), (0.0, CURVE, CURVE, 0.0))
ALONG = Seastar(3, 6, along=AlongLimb(), stiffening=Stiffening(2.0), relaxation_time=2e-3)


def curvatures(nodes: np.ndarray) -> np.ndarray:
    """Curvature of the circle through three nodes in a row [1/m], shape (n_nodes - 2,)."""
    a, b, c = nodes[:-2], nodes[1:-1], nodes[2:]
    sides = [np.linalg.norm(p - q, axis=1) for p, q in ((b, a), (c, b), (a, c))]
    cross = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    return 2.0 * cross / np.prod(sides, axis=0)


def test_a_free_limb_takes_the_prescribed_arc_and_stores_nothing():
    robot = replace(ALONG, relaxation_time=0.05)
    simulator = Simulator(Scene(robot, actuator=HOLD, numerics=Numerics("implicit-midpoint", 0.01)))
    simulator.advance(3.8, [[1.0, -0.5, 0.2]])
    limbs = simulator.positions[0, 1:].reshape(3, 5, 2)
    hub = simulator.positions[0, :1]
    for limb, command in zip(limbs, (1.0, -0.5, 0.2), strict=True):
        np.testing.assert_allclose(curvatures(np.vstack([hub, limb])), command * CURVE / 0.1, rtol=5e-3)
    roots = np.angle((limbs[:, 0] - hub) @ [1.0, 1j])
    turned = (roots[1:] - roots[0]) % (2.0 * np.pi) - 0.1 * CURVE * np.array([-0.5 - 1.0, 0.2 - 1.0])
    np.testing.assert_allclose(turned, [2.0 * np.pi / 3.0, 4.0 * np.pi / 3.0], rtol=1e-4)
    assert simulator.elastic_energy()[0] < 1e-6 * 0.5 * 5.1e-6 * CURVE**2 / 0.1


def test_a_profile_leaves_the_limb_with_its_curvature():
    robot = replace(ALONG, along=AlongLimb(profile=(0.0, 1.0, 0.0)), nodes_per_limb=11, relaxation_time=0.05)
    simulator = Simulator(Scene(robot, actuator=HOLD, numerics=Numerics("implicit-midpoint", 0.01)))
    simulator.advance(3.8, [[1.0, 0.0, 0.0]])
    found = curvatures(simulator.positions[0, :11])
    mean_at_peak = 1.0 - 0.2 / 3.0  # over a hat function, which is a fifth as wide as the profile
    np.testing.assert_allclose(found[[1, 4, 7]], 2.0 * CURVE / 0.1 * np.array([0.4, mean_at_peak, 0.4]), rtol=5e-3)


def swum(robot: Seastar, commands=STRAIGHT, strokes: int = 2, **scene) -> np.ndarray:
    parts = {"actuator": SmaPulse(0.6), "numerics": Numerics("implicit-midpoint", 0.01), **scene}
    simulator = Simulator(Scene(robot, **parts))
    for _ in range(strokes):
        assert not simulator.stroke([commands]).status.any()
    return simulator.positions[0]


def test_a_profile_at_the_root_is_the_rotation_at_the_hub_in_the_limit():
    robot, at_hub = Seastar(nodes_per_limb=6), swum(Seastar(nodes_per_limb=6))
    profiles = (AlongLimb(profile=(1.0, *(0.0,) * points)) for points in (100, 1000))
    off = [np.abs(swum(replace(robot, along=along)) - at_hub).max() for along in profiles]
    assert off[0] < 0.02 * np.abs(at_hub - robot.nodes()).max()
    assert off[1] == pytest.approx(0.1 * off[0], rel=0.05)


def test_a_robot_that_stiffens_violently_gains_no_energy_but_the_actuators():
    """Implicit Euler in vacuum, with steps that straddle most of the transformation: the guard keeps the balance."""
    h, peak = 0.01, 0.6
    robot, star = replace(TWIN, relaxation_time=None, stiffening=Stiffening(20.0)), replace(BENT, ratio=20.0, peak=peak)
    simulator = Simulator(Scene(robot, None, SmaPulse(peak, 0.02, 0.02), Numerics("implicit-euler", h)))
    command, q, start, energy = np.array([1.0, -1.0, 1.0]), star.rest, 0.0, 0.0
    for _ in range(5):
        for time in simulator.stroke_in_parts([command], 4):
            turned = (star.at(command * oracle.pulse(t, peak, 0.02, 0.02)) for t in (time - 1e-12, start))
            put_in = np.subtract(*(oracle.elastic_energy(each, q, np.zeros(3)) for each in turned))
            now = float(simulator.elastic_energy()[0] + simulator.kinetic_energy()[0])
            assert now <= energy + put_in + 1e-9 * abs(now)
            energy, q, start = now, simulator.positions[0], time % 0.04
    assert not simulator.failed.any()
