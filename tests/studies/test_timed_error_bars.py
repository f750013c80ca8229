"""Error bars of wires that are commanded several times a second."""

import pytest

from seastar_gym.scene.numerics import Numerics
from studies.accuracy import timed_error_bars as study
from studies.accuracy.error_bars import FIDELITIES
from studies.accuracy.timed import PERIODS, Plan


def test_a_table_has_the_coverage_of_every_preset():
    lines = study.table({0.5: dict.fromkeys(FIDELITIES, (0.998, 4.75)), 0.2: dict.fromkeys(FIDELITIES, (1.0, 5.0))})
    assert lines.splitlines()[0] == "| preset | 0.5 s | 0.2 s |"
    assert "| `fast` | 99.8 %, 4.8 | 100.0 %, 5.0 |" in lines


@pytest.mark.slow
@pytest.mark.parametrize("period", PERIODS)
def test_error_bars_cover_decisions_in_time_and_are_not_vacuous(period):
    true = study.TRUE._replace(nodes_per_limb=55, numerics=Numerics("implicit-midpoint", 0.5e-3, 1e-9))
    for coverage, sharpness in study.measure(period, Plan(samples=2, seconds=5), true, seed=11).values():
        assert coverage >= 0.9 and 1.0 < sharpness < 8.0
