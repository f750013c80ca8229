"""Whatever is drawn, strokes end, robots keep their bits in any company, and what is conserved stays."""

from dataclasses import replace
from random import Random

import numpy as np
import pytest

from fuzz import promises
from fuzz.scenes import (
    BENT,
    COMPILED,
    CONTACT,
    EVERYTHING,
    FLUID,
    OWN,
    PLAIN,
    TERMS,
    TOUCHED_BODY,
    Case,
    Draw,
    draw_case,
    draw_parts,
    drawn,
)
from fuzz.sentences import assert_one_sentence
from seastar_gym import Limited, SmaPulse, Water


@drawn(200, [*COMPILED, TOUCHED_BODY, BENT])
def test_a_scene_is_accepted_or_refused_in_one_sentence(terms, seed):
    draw = Draw(Random(seed), 4 if OWN in terms else None)
    try:
        draw_parts(draw, terms)
    except ValueError as refusal:
        assert_one_sentence(refusal)


@drawn(40)
def test_strokes_end_finite_or_with_a_failure_that_is_told_and_in_bounded_work(terms, seed):
    promises.check_strokes_end(draw_case(Random(seed), terms))


@drawn(40)
def test_a_robot_has_the_same_bits_alone_and_beside_robots_in_trouble(terms, seed):
    promises.check_bits_alone(draw_case(Random(seed), terms))


@drawn(15)
def test_a_robot_has_the_same_bits_in_every_lane_and_batch(terms, seed):
    promises.check_bits_in_other_lanes(draw_case(Random(seed), terms))


@drawn(5)
def test_a_robot_has_the_same_bits_on_any_number_of_threads(terms, seed):
    promises.check_bits_on_threads(draw_case(Random(seed), terms))


@drawn(15)
def test_a_stroke_in_parts_and_a_state_that_is_set_again_go_on_to_the_same_bits(terms, seed):
    promises.check_bits_in_parts(draw_case(Random(seed), terms))


@drawn(15)
def test_a_state_that_is_set_again_within_a_stroke_goes_on_to_the_same_bits(terms, seed):
    promises.check_bits_of_pieces(draw_case(Random(seed), terms))


@drawn(30, [PLAIN, CONTACT])
def test_free_robots_in_vacuum_keep_their_momentum(terms, seed):
    promises.check_momentum(draw_case(Random(seed), terms))


@drawn(30, [PLAIN])
def test_implicit_euler_without_commands_creates_no_energy(terms, seed):
    promises.check_energy(draw_case(Random(seed), terms))


@drawn(25, [PLAIN, CONTACT, FLUID])
def test_a_robot_swims_alike_turned_mirrored_and_elsewhere(terms, seed):
    promises.check_frames(draw_case(Random(seed), terms, wild=False))


@drawn(80, [FLUID])
def test_a_robot_swims_alike_seen_from_a_moving_frame(terms, seed):
    promises.check_moving_frame(draw_case(Random(seed), terms, wild=False))


# --- combinations that no other test has ------------------------------------------------------------------------------


def in_water(case: Case) -> Case:
    return case._replace(scene=replace(case.scene, fluid=case.scene.fluid or Water()))


def in_vacuum(case: Case) -> Case:
    return case._replace(scene=replace(case.scene, fluid=None))


def limited(case: Case) -> Case:
    """The same robots, whose actuators are too slow and too short, and begin at rest: they may remember otherwise."""
    peak, period = float(np.max(case.scene.actuator.peak_angle)), case.scene.actuator.period
    pulse = SmaPulse(peak, 0.4 * period, 0.6 * period)
    actuator = Limited(pulse, 0.8 * peak or None, 2.0 * peak / period or None)
    return case._replace(scene=replace(case.scene, actuator=actuator), state=case.state._replace(actuators=None))


def check_everything(case: Case) -> None:
    promises.check_strokes_end(case)
    promises.check_bits_alone(case)
    promises.check_bits_in_other_lanes(case)


@drawn(10, [CONTACT])
def test_water_with_contact_and_nothing_else(terms, seed):
    check_everything(in_water(draw_case(Random(seed), terms)))


@drawn(10, [CONTACT])
def test_contact_in_vacuum(terms, seed):
    check_everything(in_vacuum(draw_case(Random(seed), terms)))


@drawn(15, [CONTACT])
def test_chapter_like_robots_with_contact(terms, seed):
    check_everything(in_water(draw_case(Random(seed), terms, wild=False)))


@drawn(15, [terms for terms in COMPILED if OWN in terms])
def test_robots_with_numbers_of_their_own_are_isolated(terms, seed):
    check_everything(draw_case(Random(seed), terms))


@pytest.mark.slow
@drawn(20, [EVERYTHING])
def test_all_terms_with_limited_actuators(terms, seed):
    check_everything(limited(draw_case(Random(seed), terms)))


@pytest.mark.slow
@drawn(20, [frozenset(TERMS)])
def test_all_terms_with_numbers_of_each_robot(terms, seed):
    check_everything(draw_case(Random(seed), terms))


@pytest.mark.slow
@drawn(15, [TOUCHED_BODY, BENT])
def test_limbs_on_a_body_and_limbs_that_bend_along_their_length(terms, seed):
    check_everything(draw_case(Random(seed), terms))


@pytest.mark.slow
@drawn(30, [TOUCHED_BODY])
def test_free_robots_with_a_body_keep_their_momentum(terms, seed):
    promises.check_momentum(draw_case(Random(seed), terms))


@pytest.mark.slow
@drawn(10, [TOUCHED_BODY, BENT])
def test_they_swim_alike_turned_mirrored_and_elsewhere(terms, seed):
    promises.check_frames(draw_case(Random(seed), terms, wild=False))
