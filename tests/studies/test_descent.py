"""Steps along gradients, and the swims that they led to."""

import json

import numba
import numpy as np
import pytest

from seastar_gym.gradients import record
from studies.descent import EVERY, STUDY, WAYPOINTS, passed, read, smallest_change, when_due, wires
from studies.frame import DOCS


def test_the_smallest_change_does_what_is_asked_and_stays_within_bounds():
    rng = np.random.default_rng(0)
    commands, slopes, excess = rng.choice([-1.0, 0.0, 1.0], (8, 5)), rng.standard_normal((3, 8, 5)), np.full(3, 0.01)
    change = smallest_change(commands, slopes, excess)
    np.testing.assert_allclose(np.tensordot(slopes, change, 2), -excess, rtol=1e-9)
    assert np.abs(commands + change).max() <= 1.0
    free = np.abs(commands + change) < 1.0
    rows = slopes[:, free]
    assert np.linalg.norm(change) == pytest.approx(np.linalg.norm(np.linalg.pinv(rows) @ excess), rel=1e-9)


def test_waypoints_are_due_when_the_hub_is_near_them():
    hub = np.array([[0.0, 0.0], [0.05, 0.0], [0.095, 0.0], [0.1, 0.02], [0.1, 0.07], [0.1, 0.13]])
    goals = np.array([[0.1, 0.0], [0.1, 0.1], [0.1, 0.13]])
    np.testing.assert_array_equal(when_due(hub, goals), [2, 4, 5])
    np.testing.assert_array_equal(passed(hub, goals), [2])


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="lanes of a tape have compiled code alone")
def test_committed_pulses_swim_round_the_pentagon():
    found = json.loads(STUDY.committed(DOCS, STUDY.file).read_text(encoding="utf-8"))["pulses"]["pentagon"]
    hub = record(wires("fast"), np.array(found["commands"]), duration=EVERY).swim.hub
    reached = passed(hub, np.array(read(WAYPOINTS)["waypoints_m"]))
    assert len(reached) == 5
    assert reached[-1] * EVERY == pytest.approx(found["shortest_s"][-1][1])
