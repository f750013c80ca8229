"""Mechanical work of the actuators, and the largest moment that limbs resist them with."""

import pickle

import numpy as np
import pytest

from seastar_gym import AlongLimb, Numerics, Scene, Seastar, Simulator, SmaPulse, SmaWires
from seastar_gym.scene.actuators.actuator import Actuator
from strokes import finished

PEAK, HEATING = 0.3, 0.1
COMMAND = [[1.0, -1.0, 0.0, 0.5, 0.0]]
EI = 1e6 * np.pi * 1.6e-3**4 / 4.0


def swimmer(step: float = 5e-3, actuator: Actuator = SmaPulse(PEAK), **scene: object) -> Simulator:
    numerics = Numerics("implicit-midpoint", step)
    return Simulator(Scene(Seastar(5, 8), actuator=actuator, numerics=numerics, **scene), effort=True)


def held(robot: Seastar) -> Simulator:
    """A robot of two limbs whose nodes all stay where they are."""
    nodes = tuple(range(robot.n_nodes))
    numerics = Numerics("implicit-midpoint", 1e-3)
    return Simulator(Scene(robot, None, SmaPulse(PEAK, HEATING), numerics, held_nodes=nodes), effort=True)


def test_a_clamp_that_cannot_follow_resists_by_its_stiffness_times_the_sine_of_its_rotation():
    robot = Seastar(2, 6)
    simulator, K = held(robot), EI / (5.0 / 12.0 * robot.limb_length / 5)
    turned = simulator.advance(HEATING, [[1.0, -1.0]])
    assert turned.peak_moment[0] == pytest.approx(K * np.sin(PEAK), rel=1e-9)
    assert turned.work[0] == pytest.approx(2.0 * K * (1.0 - np.cos(PEAK)), rel=1e-4)
    back = simulator.advance(0.9)
    assert back.work[0] == pytest.approx(-turned.work[0], rel=1e-3)  # what limbs give back is negative


def test_a_straight_limb_that_is_to_bend_along_resists_by_its_stiffness_times_its_curvature():
    robot = Seastar(2, 20, along=AlongLimb())
    turned = held(robot).advance(HEATING, [[1.0, -1.0]])
    assert turned.peak_moment[0] == pytest.approx(EI * PEAK / robot.limb_length, rel=0.03)
    assert turned.work[0] == pytest.approx(EI * PEAK**2 / robot.limb_length, rel=0.03)


def lack(step: float) -> tuple[float, float]:
    """Work less what it became in vacuum, and the work [J], while limbs turn."""
    numerics = Numerics("implicit-midpoint", step)
    simulator = Simulator(Scene(Seastar(5, 4), None, SmaPulse(PEAK), numerics), effort=True)
    work = simulator.advance(0.05, COMMAND).work[0]
    return work - (simulator.elastic_energy() + simulator.kinetic_energy())[0], work


def test_in_vacuum_work_becomes_elastic_and_kinetic_energy_to_second_order_of_the_step():
    (coarse, _), (fine, work) = lack(5e-4), lack(2.5e-4)
    assert abs(fine) < 1e-6 * work
    assert coarse / fine == pytest.approx(4.0, rel=0.1)


def test_work_in_water_converges_and_most_of_it_is_lost_to_drag():
    coarse, middle, fine = swimmer(4e-3), swimmer(2e-3), swimmer(1e-3)
    work = [simulator.stroke(COMMAND).work[0] for simulator in (coarse, middle, fine)]
    assert abs(work[1] - work[2]) < 0.5 * abs(work[0] - work[1]) < 0.01 * work[2]
    assert 0.0 < (fine.elastic_energy() + fine.kinetic_energy())[0] < 0.1 * work[2]


@pytest.mark.parametrize("actuator", [SmaPulse(PEAK), SmaWires(PEAK)], ids=["pulse", "wires"])
def test_who_asks_for_the_effort_changes_no_bit_and_who_does_not_is_told_nothing(actuator):
    asked, silent = swimmer(actuator=actuator), Simulator(swimmer(actuator=actuator).scene)
    for _ in range(2):
        told, untold = asked.stroke(COMMAND), silent.stroke(COMMAND)
    assert told.work[0] > 0.0 and told.peak_moment[0] > 0.0
    assert np.isnan(untold.work).all() and np.isnan(untold.peak_moment).all()
    np.testing.assert_array_equal(asked.q, silent.q)
    np.testing.assert_array_equal(asked.v, silent.v)


def test_pauses_copies_and_company_change_no_bit_of_the_effort():
    whole, parts = swimmer(), swimmer()
    copied, crowd = pickle.loads(pickle.dumps(whole)), Simulator(whole.scene, 11, 3, effort=True)
    _, in_parts = finished(parts.stroke_in_parts(COMMAND, 7))
    found = [in_parts, copied.stroke(COMMAND), crowd.stroke(np.repeat(COMMAND, 11, axis=0))]
    expected = whole.stroke(COMMAND)
    for report in found:
        assert (report.work == expected.work[0]).all() and (report.peak_moment == expected.peak_moment[0]).all()
