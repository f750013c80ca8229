"""The protocol from the tank to a policy, walked through at a tenth of its length, and the numbers on its page."""

import numpy as np
import pytest

from seastar_gym import SmaWires
from studies import protocol


def test_a_speed_is_that_after_the_start():
    times = np.arange(0.2, 10.2, 0.2)
    places = np.column_stack((np.where(times < 5.0, 0.0, 0.02 * (times - 5.0)), np.zeros_like(times)))
    np.testing.assert_allclose(protocol.speed(times, places), 20.0)


def test_intervals_cover_the_mean_of_swims_that_scatter():
    rng = np.random.default_rng(0)
    covered = 0
    for _ in range(200):
        values = np.exp(np.log(2.0) + 0.1 * rng.standard_normal((15, 1)))
        _, low, high = protocol.intervals({"fit": {"values": values.tolist()}})
        covered += bool(low[0] <= 2.0 <= high[0])
    assert 180 <= covered <= 198  # 95 %


def test_a_bench_finds_the_wires():
    found, true = protocol.wires(), protocol.truth()
    assert isinstance(true.actuator, SmaWires)
    np.testing.assert_allclose(found["cooling_time"], true.actuator.cooling_time, rtol=0.05)
    np.testing.assert_allclose(found["peak_angle"], np.array(true.limb_strengths) * true.actuator.peak_angle, rtol=0.05)


@pytest.mark.slow
def test_every_step_of_the_protocol_runs(monkeypatch):
    for name, value in {"SWIMS": 2, "PULSES": 20, "SECONDS": 7.0, "DRAWS": 8, "GAITS": ("lagged",)}.items():
        monkeypatch.setattr(protocol, name, value)
    results = {"bench": protocol.wires()}
    results["fit"] = protocol.fit(results)
    modulus, drag, along = protocol.intervals(results)[0]
    assert 0.5e6 < modulus < 2e6 and 0.5 < drag < 2.0 and 0.2 < along < 2.0
    early, middle, late = results["fit"]["late"]
    assert 0.05 < early < middle < late < 0.15  # 85 ms and 15 ms of jitter
    results["forecast"] = protocol.forecast(results)
    lagged = results["forecast"]["lagged"]
    assert lagged["measured"] == pytest.approx(lagged["forecast"], rel=0.5)
    assert "`robot.youngs_modulus` [MPa]" in protocol.numbers_table(results)
    assert "inside:" in protocol.forecasts(results)


def test_a_policy_that_was_taught_on_the_fit_runs_in_the_tank(monkeypatch):
    short = {"DECISIONS": 4096, "ENOUGH": 8192, "TIME_LIMIT": 3.0, "RUNS": 1, "PATHS": ("pentagon",)}
    for name, value in short.items():
        monkeypatch.setattr(protocol, name, value)
    values = [[1.1e6, 1.0, 0.6], [1.2e6, 1.1, 0.5], [1.15e6, 1.05, 0.55]]
    results = {"bench": protocol.wires(), "fit": {"values": values, "late": [0.08, 0.1, 0.13]}}
    results["runs"] = protocol.runs(results)
    assert list(results["runs"]) == ["trained on the fit", "bundled", "script"]
    assert all(list(paths) == ["pentagon"] for paths in results["runs"].values())
    assert "3.0 (3.0 to 3.0)" in protocol.times(results)
