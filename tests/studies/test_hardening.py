"""The cost of safeguards compares the same stroke: plain Newton and the simulator's kernel end in the same bits."""

import numpy as np
import pytest

from studies.speed import hardening


@pytest.mark.parametrize("numerics", hardening.SETTINGS, ids=lambda numerics: numerics.scheme)
def test_both_kernels_make_the_same_stroke_in_as_many_iterations(numerics):
    pair, ends = hardening.Pair(numerics), []
    for safeguarded in (True, False):
        assert pair.seconds(safeguarded) > 0.0
        ends.append((pair.q.copy(), pair.v.copy(), pair.report[:, hardening.NEWTON_ITERATIONS].copy()))
    for one, other in zip(*ends, strict=True):
        np.testing.assert_array_equal(one, other)
    assert not np.array_equal(ends[0][0], pair.start[0])


def test_a_cost_is_a_ratio_within_its_quartiles():
    cost = hardening.measure_cost(hardening.SETTINGS[0], pairs=2, rounds=2)
    assert cost.plain > 0.0 and cost.quartiles[0] <= cost.ratio <= cost.quartiles[1]
    assert hardening.cost_table([cost]).row_count == 1
