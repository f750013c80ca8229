"""Every constant of der/stepping/foresight.py is what plain Newton needs: ten times more or less fails here."""

from functools import cache

import numpy as np
import pytest

from seastar_gym.der.stepping.foresight import CURVATURE, EASY, FORESEEABLE_T, LATE
from seastar_gym.der.stepping.scales import SLENDER
from seastar_gym.simd.lanes import N_LANES
from studies.speed import foresight as study

STROKES = 150

tails_of_eight_lanes = pytest.mark.skipif(N_LANES != 8, reason="rare stages are drawn otherwise with other lanes")
"""Of tests about one stage of a thousand, whose draws depend on the number of robots that are drawn together."""


@cache
def stages(name: str) -> study.Stages:
    return study.sample(getattr(study, name), STROKES, seed=0)


@cache
def decisions(name: str) -> study.Decisions:
    return study.decisions(stages(name))


def quantile(numbers: np.ndarray, share: float) -> float:
    return float(np.quantile(numbers, share)) if len(numbers) else np.nan


def test_a_step_that_is_left_out_is_as_small_as_foreseen_in_99_of_100_ordinary_stages():
    excesses = study.excesses_after(decisions("STROKES"), 0, EASY)
    assert 0.3 < quantile(excesses, 0.99) < 1.0
    assert quantile(excesses, 0.999) < 2.0 and excesses.max() < 20.0


@tails_of_eight_lanes
def test_light_edges_need_the_curvature_in_one_of_1000_stages():
    assert 0.3 * CURVATURE < quantile(study.curvatures_of_light_edges(decisions("STROKES")), 0.999) < CURVATURE


def test_slender_stiff_edges_need_the_curvature_rate_in_one_of_1000_stages():
    assert 0.3 < quantile(study.excesses_of_stiff_edges(decisions("LONG")), 0.999) < 1.0


def test_thick_stiff_edges_need_that_the_rate_is_reduced_by_their_slenderness_and_no_further():
    assert 0.5 * SLENDER < study.slenderness_that_thick_edges_need(decisions("STROKES"), 0.99) < 2.0 * SLENDER


def test_after_the_last_easy_step_one_of_1000_needs_that_it_counts_as_late():
    assert 0.3 * LATE < quantile(study.late_excesses(decisions("STROKES")), 0.999) < LATE


@tails_of_eight_lanes
def test_only_the_easy_steps_foresee_anything_where_robots_move_violently():
    assert quantile(study.excesses_after(decisions("VIOLENT"), EASY - 1, EASY), 0.999) < 1.0
    assert quantile(study.excesses_after(decisions("VIOLENT"), EASY, 10.0 * EASY), 0.999) > 1e3


def test_steps_are_foreseen_up_to_the_largest_hub_t_and_ever_worse_beyond():
    t, seen = FORESEEABLE_T, decisions("THICK_NEAR_POLES")
    assert quantile(study.excesses_near_poles(seen, 0.25 * t, t), 0.99) < 2.0
    assert quantile(study.excesses_near_poles(seen, 2.5 * t, 10.0 * t), 0.99) > 2.0


@tails_of_eight_lanes
def test_drag_takes_what_predictable_steps_create_and_not_what_more_energetic_ones_do():
    assert study.share_that_gains(stages("NEAR_POLES"), 0.1, 1.0) < 5e-4
    assert study.share_that_gains(stages("NEAR_POLES"), 1.0, 10.0) > 5e-4


def test_the_table_has_a_row_for_every_constant():
    rows = study.measure(2)
    for name in ("CURVATURE", "curvature_rate", "SLENDER", "LATE", "EASY", "FORESEEABLE_T", "PREDICTABLE_STRAIN"):
        assert any(row.what.startswith(name) for row in rows)
    assert study.as_table(rows).row_count == len(rows)
