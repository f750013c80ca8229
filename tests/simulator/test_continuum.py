"""The continuum's discretisation: ten nodes swim as infinitely many do, and keep what mechanics keeps."""

from dataclasses import replace

import numpy as np
import pytest

import oracle
from along_oracle import Bent
from hubs import TEN
from momenta import momenta
from refusals import assert_refused
from seastar_gym import (
    AlongLimb,
    Limb,
    MeasuredCurve,
    Numerics,
    Scene,
    Seastar,
    Simulator,
    SmaPulse,
    SmaWires,
    State,
    Stiffening,
)
from seastar_gym.envs.symmetry import require_symmetry
from seastar_gym.gaits import PAIRS, STRAIGHT
from seastar_gym.identify.parameters import get_parameter, with_parameters
from seastar_gym.model.rods import make_rods
from seastar_gym.scene.per_robot import numbers_of

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


@pytest.mark.parametrize("nodes_per_limb", OF_NODES)
def test_few_nodes_swim_as_the_prototype_did(nodes_per_limb):
    np.testing.assert_allclose(distances(nodes_per_limb, 5e-4)[:4], OF_NODES[nodes_per_limb], rtol=1e-3)


def test_ten_nodes_swim_as_infinitely_many_do():
    np.testing.assert_allclose(distances(10, 1e-3)[:4], list(LIMIT.values()), rtol=1e-2)


@pytest.mark.slow
def test_73_nodes_swim_as_infinitely_many_do():
    np.testing.assert_allclose(distances(73, 5e-5), [*LIMIT.values(), AFTER_ONE], rtol=1e-4)


def test_in_vacuum_momentum_angular_momentum_and_small_energies_stay():
    scene = Scene(TEN, None, SmaPulse(0.0), Numerics("implicit-midpoint", 5e-4, newton_tolerance=1e-12))
    rods, rng, simulator = make_rods(scene), np.random.default_rng(0), Simulator(scene)
    noise = 1e-3 * rng.standard_normal((1, 46, 2))
    simulator.set_state(State(TEN.nodes()[None], noise, np.zeros(1)))

    def kept() -> np.ndarray:
        linear, spin = momenta(rods, simulator.positions, simulator.velocities)
        return np.array([*linear[0], *spin])

    before, energy = kept(), simulator.elastic_energy() + simulator.kinetic_energy()
    simulator.stroke(np.zeros((1, 5)))
    np.testing.assert_allclose(kept(), before, rtol=1e-8, atol=1e-14)
    np.testing.assert_allclose(simulator.elastic_energy() + simulator.kinetic_energy(), energy, rtol=0.02)


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
    off = [
        np.abs(swum(replace(robot, along=AlongLimb(profile=(1.0, *(0.0,) * points)))) - at_hub).max()
        for points in (100, 1000)
    ]
    assert off[0] < 0.02 * np.abs(at_hub - robot.nodes()).max()
    assert off[1] == pytest.approx(0.1 * off[0], rel=0.05)


@pytest.mark.parametrize("relaxation_time", [None, pytest.param(1e-3, marks=pytest.mark.slow)])
def test_no_share_along_the_limb_and_no_stiffening_change_no_bit(relaxation_time):
    robot = Seastar(nodes_per_limb=6, relaxation_time=relaxation_time)
    for along, stiffening in ((AlongLimb(0.0), None), (None, Stiffening(1.0)), (AlongLimb(0.0), Stiffening(1.0))):
        np.testing.assert_array_equal(swum(replace(robot, along=along, stiffening=stiffening)), swum(robot))


def test_commanding_the_next_limb_turns_the_swim_and_mirrored_commands_mirror_it():
    robot = Seastar(nodes_per_limb=6, along=AlongLimb(0.8, (1.0, 0.5)), stiffening=Stiffening())
    command, mirror = np.array([1.0, -0.5, 0.0, 0.2, 0.0]), [0, 4, 3, 2, 1]

    def moved(q: np.ndarray, order) -> np.ndarray:
        return np.vstack([q[:1], q[1:].reshape(5, -1, 2)[order].reshape(-1, 2)])

    q, angle = swum(robot, command), 2.0 * np.pi / 5.0
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    assert np.abs(q - robot.nodes()).max() > 1e-3
    np.testing.assert_allclose(swum(robot, np.roll(command, 1)), moved(q, [4, 0, 1, 2, 3]) @ turn, atol=1e-9)
    np.testing.assert_allclose(swum(robot, -command[mirror]), moved(q, mirror) * [1.0, -1.0], atol=1e-9)


def test_few_nodes_bend_and_swim_as_many_do():
    """Errors fall with the second power of the edge length: 10, 19 and 37 nodes."""
    ends = []
    for nodes in (10, 19, 37):
        along, hot = AlongLimb(0.8, (1.0, 0.5)), Stiffening()
        robot = Seastar(nodes_per_limb=nodes, along=along, stiffening=hot, relaxation_time=5e-3)
        ends.append(swum(robot, strokes=2, numerics=Numerics("implicit-midpoint", 0.004))[0, 0])
    coarse, middle, fine = ends
    assert abs(coarse - fine) < 0.01 * abs(fine)
    assert abs(middle - fine) < 0.4 * abs(coarse - fine)


# The oracle


BENT = Bent(
    3, 5, directions=(0.0, 2.0 * np.pi / 3.0, 4.0 * np.pi / 3.0), lengths=(0.1,) * 3, radii=((1.6e-3,) * 2,) * 3,
    moduli=((1e6,) * 2,) * 3, curvatures=(0.0,) * 3, share=0.8, ratio=2.5, peak=0.6, relaxation_time=2e-3,
)  # fmt: skip
TWIN = Seastar(3, 5, along=AlongLimb(0.8), stiffening=Stiffening(2.5), relaxation_time=2e-3)


@pytest.mark.parametrize("scheme", ["implicit-euler", "implicit-midpoint"])
def test_steps_of_a_robot_that_bends_and_stiffens_are_those_of_the_oracle(scheme):
    h, command = 0.01, np.array([1.0, -0.7, 0.2])
    numerics = Numerics(scheme, h, newton_tolerance=1e-13)
    simulator = Simulator(Scene(TWIN, actuator=SmaPulse(0.6, 4 * h, 4 * h), numerics=numerics))
    simulator.advance(3 * h, [command])
    q, v = BENT.rest, np.zeros_like(BENT.rest)
    gamma = h if scheme == "implicit-euler" else 0.5 * h
    for k in range(3):
        now = BENT.at(command * 0.6 * (k * h + gamma) / (4 * h))
        ends, velocities = oracle.stage(now, q, v, gamma, np.zeros(3))
        q, v = (ends, velocities) if scheme == "implicit-euler" else (2.0 * ends - q, 2.0 * velocities - v)
    assert np.abs(q - BENT.rest).max() > 1e-3
    np.testing.assert_allclose(simulator.positions[0], q, rtol=0.0, atol=1e-11)
    np.testing.assert_allclose(simulator.velocities[0], v, rtol=0.0, atol=1e-8)


def test_energy_grows_by_the_work_of_the_actuators():
    """In vacuum and without damping, U + K changes by what U changes by at rest, while actuators move."""
    h, command, peak = 2.5e-4, np.array([1.0, -0.7, 0.2]), 0.6
    robot, star = replace(TWIN, relaxation_time=None), replace(BENT, relaxation_time=0.0)
    numerics = Numerics("implicit-midpoint", h, newton_tolerance=1e-12)
    simulator = Simulator(Scene(robot, None, SmaPulse(peak, 0.02, 0.04), numerics))
    work, stroke, before, start = 0.0, simulator.stroke_in_parts([command], 240), star.rest, 0.0
    scale = 0.0
    for time in stroke:
        at_start, at_end = (command * oracle.pulse(t, peak, 0.02, 0.04) for t in (start, time - 1e-12))
        middle = 0.5 * (before + simulator.positions[0])
        work += oracle.elastic_energy(star.at(at_end), middle, np.zeros(3))
        work -= oracle.elastic_energy(star.at(at_start), middle, np.zeros(3))
        energy = float(simulator.elastic_energy()[0] + simulator.kinetic_energy()[0])
        scale = max(scale, energy)
        assert energy == pytest.approx(work, abs=0.01 * scale)
        before, start = simulator.positions[0], time
    assert scale > 1e-5


def test_a_robot_that_stiffens_violently_gains_no_energy_but_the_actuators():
    """Implicit Euler in vacuum, with steps that straddle most of the transformation: the guard keeps the balance."""
    h, peak = 0.01, 0.6
    robot, star = replace(TWIN, relaxation_time=None, stiffening=Stiffening(20.0)), replace(BENT, ratio=20.0)
    simulator = Simulator(Scene(robot, None, SmaPulse(peak, 0.02, 0.02), Numerics("implicit-euler", h)))
    command, q, start, energy = np.array([1.0, -1.0, 1.0]), star.rest, 0.0, 0.0
    for _ in range(5):
        for time in simulator.stroke_in_parts([command], 4):
            put_in = oracle.elastic_energy(
                star.at(command * oracle.pulse(time - 1e-12, peak, 0.02, 0.02)), q, np.zeros(3)
            )
            put_in -= oracle.elastic_energy(star.at(command * oracle.pulse(start, peak, 0.02, 0.02)), q, np.zeros(3))
            now = float(simulator.elastic_energy()[0] + simulator.kinetic_energy()[0])
            assert now <= energy + put_in + 1e-9 * abs(now)
            energy, q, start = now, simulator.positions[0], time % 0.04
    assert not simulator.failed.any()


# Batches, actuators, refusals


def test_wires_bend_a_limb_that_is_still_warm():
    simulator = Simulator(Scene(ALONG, actuator=SmaWires(0.6)))
    simulator.advance(0.15, [[1.0, 0.0, 0.0]])
    simulator.advance(0.1, [[-1.0, 0.0, 0.0]])
    assert not simulator.failed.any()
    assert abs(curvatures(simulator.positions[0, :6])[2]) < 6.0  # both wires are warm and pull against each other


@pytest.mark.parametrize(
    "make, words",
    [
        (lambda: Seastar(hub_hinge="turning", discretisation="continuum"), 'only discretisation="chapter"'),
        (lambda: Scene(TEN, actuator=SmaPulse(3.2)), "pi"),
        (lambda: Seastar(discretisation="fine"), "discretisation must be one of"),
        (lambda: Seastar(along=AlongLimb(), discretisation="chapter"), 'only discretisation="continuum"'),
        (lambda: Seastar(along=1.0), "along must be AlongLimb"),
        (lambda: AlongLimb(1.2), "from 0 to 1"),
        (lambda: AlongLimb(profile=(1.0, -1.0)), "bend it to one side"),
        (lambda: AlongLimb(profile=(-1.0, 0.9)), "bend it to one side"),
        (lambda: AlongLimb(profile=(1.0, float("nan"))), "finite numbers"),
        (lambda: Scene(Seastar(nodes_per_limb=3, along=AlongLimb()), actuator=SmaPulse(7.0)), "more nodes per limb"),
        (lambda: Seastar(2, limbs=(Limb(joint_stiffness=1e-4),) * 2, stiffening=Stiffening()), "joints"),
        (lambda: Stiffening(1e4), "ratio"),
        (lambda: Stiffening(width=0.01), "width"),
    ],
)
def test_what_cannot_be_modelled_is_refused(make, words):
    with assert_refused(words):
        make()


def test_what_just_can_be_modelled_is_taken():
    assert AlongLimb(profile=(3.0, -2.0)).profile == (3.0, -2.0)
    assert Scene(Seastar(along=AlongLimb()), actuator=SmaPulse(7.0)).actuator.peak_angle == 7.0


def test_numbers_of_bent_limbs_can_be_drawn_identified_and_written():
    scene = Scene(Seastar(along=AlongLimb(0.5, (1.0, 0.5)), stiffening=Stiffening(2.0)))
    assert {"robot.along.share", "robot.stiffening.ratio"} <= set(numbers_of(scene))
    assert get_parameter(scene, "robot.stiffening.ratio") == 2.0
    changed = with_parameters(scene, ["robot.along.share"], [0.7])
    assert changed.robot.along == AlongLimb(0.7, (1.0, 0.5))
    assert Scene.from_dict(changed.to_dict()) == changed
    require_symmetry(changed)
