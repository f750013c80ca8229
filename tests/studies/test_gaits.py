"""The study of gaits: classes are counted right, gaits swim as they are said to, and evolution and front improve."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from seastar_gym import Scene, SmaPulse, SmaWires
from seastar_gym.envs.symmetry import limb_order
from studies.gaits.crossing import crossings, limbs_cross
from studies.gaits.enumeration import all_codes, distinct_codes, gaits_of
from studies.gaits.evolution import evolve, free_numbers, mirrored_gaits, score
from studies.gaits.named import GAITS, SLOT, lagged
from studies.gaits.pages import what_evolved
from studies.gaits.periodic import events_of, measure, timed
from studies.gaits.study import QUICK, WANTED, by_numerics, evolved, front, pareto

FAST = replace(Scene.preset("fast"), actuator=SmaWires())


@pytest.fixture(scope="module")
def named():
    return {name: measure(FAST, each.gait[None], SLOT) for name, each in GAITS.items()}


def test_a_class_has_one_gait_and_all_classes_make_all_gaits():
    """Burnside: the number of classes is the mean number of gaits that an element leaves as they are."""
    slots, codes = 3, all_codes(5, 3)
    gaits = gaits_of(codes, slots)
    fixed = 0
    for element, shift in itertools.product(range(10), range(slots)):
        sign = -1.0 if element % 2 else 1.0
        moved = sign * np.roll(gaits, shift, axis=1)[:, :, limb_order(5)[element]]
        fixed += int((moved == gaits).all(axis=(1, 2)).sum())
    assert len(distinct_codes(5, slots)) == fixed / (10 * slots)


@pytest.mark.slow
def test_a_second_in_tenths_has_40890_classes():
    assert len(distinct_codes()) == 40_890


def test_pairs_that_wait_for_each_other_no_longer_swim_far_faster(named):
    assert named["lag 0.65"].speed[0] > 1.6 * named["synchronous"].speed[0]
    assert named["thrifty"].speed[0] > 1.6 * named["synchronous"].speed[0]
    assert named["thrifty"].energy_per_metre[0] < 0.75 * named["synchronous"].energy_per_metre[0]


def test_a_wave_turns_the_robot_and_the_pairs_do_not(named):
    assert np.degrees(named["wave"].turn[0]) < -8.0
    assert all(named[name].is_straight.all() for name in GAITS if "wave" not in name)


def test_heat_is_counted_by_hand(named):
    assert named["lag 0.6"].pulses[0] == pytest.approx(4.0)
    assert named["thrifty"].pulses[0] == pytest.approx(2.4)
    assert named["lag 0.6"].power[0] == pytest.approx(0.4 * SmaWires().heating_power)


def test_strokes_of_wires_and_of_pulses_are_the_same_gait():
    gait = np.array([[[0.0, 1.0, 0.0, 0.0, -1.0]]])
    pulse = measure(replace(FAST, actuator=SmaPulse()), gait, 1.0)
    np.testing.assert_array_equal(measure(FAST, gait, 1.0).velocity, pulse.velocity)


def test_events_are_written_as_they_are_read():
    gait = timed({0.0: "2+,5-", 0.65: "3+,4-"}, 1.0, SLOT)
    np.testing.assert_array_equal(gait, lagged(0.65))
    assert events_of(gait, SLOT) == "0: 2+,5-; 0.65: 3+,4-"
    with pytest.raises(ValueError, match="slot"):
        timed({0.03: "1+"}, 1.0, SLOT)


def test_free_numbers_make_the_gait_again_and_its_mirror_image_is_itself():
    gait = timed({0.0: "2+,5-", 0.6: "3+,4-"}, 1.0, 0.1)
    again = mirrored_gaits(free_numbers(gait)[None], 10)[0]
    np.testing.assert_allclose(again, gait)
    np.testing.assert_array_equal(-again[:, [0, 4, 3, 2, 1]], again)


def test_evolution_does_not_lose_what_it_found():
    start = timed({0.0: "2+,5-", 0.6: "3+,4-"}, 1.0, 0.1)
    gait, tried = evolve(FAST, start, 0.1, generations=3, population=12)
    worst = mirrored_gaits(np.random.default_rng(0).uniform(-1, 1, (1, 20)), 10)
    scores = score(measure(FAST, np.concatenate([gait[None], worst]), 0.1, 2, 2), 1.0, 0.0)
    assert tried == 36
    assert scores[0] > scores[1]
    assert scores[0] >= score(measure(FAST, start[None], 0.1, 2, 2), 1.0, 0.0)[0]


def test_the_chapters_strokes_evolve_in_their_amplitudes():
    wanted = next(each for each in WANTED if each.strokes == 2)
    np.testing.assert_array_equal(wanted.start, [[0, 0, 1, -1, 0], [0, 1, 0, 0, -1]])
    found = evolved(wanted, QUICK)
    assert found["fast"]["mm_per_s"] > 3.0 and len(found["pulses"]) == 2
    assert what_evolved(found) == "the chapter's strokes, amplitudes of 2 in turn"


def test_nobody_beats_the_front_in_both(named):
    points = np.array([[1.0, 1.0], [2.0, 3.0], [3.0, 2.0], [0.5, 0.5], [2.0, 2.5]])
    np.testing.assert_array_equal(pareto(points), [[0.5, 0.5], [1.0, 1.0], [2.0, 3.0]])
    best = np.array(front(named["lag 0.6"], [])["front"])
    assert best[0, 0] == pytest.approx(named["lag 0.6"].energy_per_metre[0], abs=0.01)


def test_crossing_limbs_are_seen():
    robot = Scene().robot
    nodes = robot.nodes()
    assert not limbs_cross(nodes, robot.n_limbs)
    crossed = nodes.copy()
    crossed[10:19] = nodes[1:10] + np.linspace([0.0, 0.01], [0.0, -0.012], 9)  # limb 2 along limb 1, from left to right
    assert limbs_cross(crossed, robot.n_limbs)
    assert crossings(FAST, lagged(0.6), SLOT) == 0


def test_speed_does_not_depend_on_the_scheme_or_the_nodes():
    gaits = {"lag 0.6": (lagged(0.6), SLOT)}
    speeds = {what: each["lag 0.6"]["mm_per_s"] for what, each in by_numerics(gaits).items()}
    chapters = speeds.pop("`chapter`: 10 nodes, Euler 3 ms")
    assert max(speeds.values()) < 1.05 * min(speeds.values()) and chapters > 0.5 * min(speeds.values())
