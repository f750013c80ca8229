"""Budget of heat: what wires may be heated for, in a guard and in a server, and that environments' commands are."""

import itertools
from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest

from faults import Tank
from refusals import assert_refused
from seastar_gym import Scene, SmaWires, ThermalSma
from seastar_gym.controllers import scripted
from seastar_gym.controllers.learned import pretrained
from seastar_gym.plant import guard as heat
from seastar_gym.plant.guard import Guard, Limits
from seastar_gym.plant.plant import PlantError
from seastar_gym.plant.swim import PlantSwim


def guarded(pulse=None, **limits):
    plant = Tank()
    guard = Guard(plant, Limits(**limits), pulse)
    guard.begin()
    guard.wait_until(5.0)  # of earlier drives nothing is left
    return plant, guard


@pytest.mark.parametrize("pulse", [0.12, 0.1, 0.05])
def test_a_wire_that_is_heated_whenever_it_may_be_is_nearly_as_hot_as_it_may_be(pulse):
    plant, guard = guarded(pulse, shortest_rest=0.03)

    def hold(seconds, heeds):
        until = plant.time + seconds
        while plant.time < until:
            if not (heeds and guard.resting()[0, 0]):
                guard.heat([1, 0, 0, 0, 0], pulse)
            guard.wait_until(plant.time + (0.01 if heeds else pulse + 0.03))

    hold(10.0, heeds=True)
    assert 90.0 < plant.heated.hottest() <= 100.0
    guard.wait_until(plant.time + 0.2)
    with pytest.raises(PlantError, match=r"deg C hot, more than 100 deg C: all wires"):
        hold(10.0, heeds=False)
    assert plant.heated.hottest() <= 100.0 and plant.heated.last() <= plant.time


@pytest.mark.parametrize(
    "limits, wire, decisions",
    [({}, None, 2), ({"hottest": 80.0}, None, 1), ({}, ThermalSma(time_constant=1.0), 5),
     ({}, ThermalSma(steady_rise=100.0), 1000), ({}, ThermalSma(steady_rise=450.0), 0),
     ({}, ThermalSma(steady_rise=np.array([100.0, 220.0]), time_constant=np.array([0.42, 1.0])), 1)],
)  # fmt: skip
def test_so_many_pulses_in_a_row_a_wire_takes_by_its_numbers(limits, wire, decisions):
    plant, guard = guarded(0.1, wire=wire, **limits)
    taken = itertools.takewhile(lambda _: not guard.resting()[2, 1], range(1000))
    for _ in taken:
        guard.heat([0, 0, -1, 0, 0], 0.1)
        guard.wait_until(plant.time + 0.2)
    assert len(plant.heated.intervals[2, 1]) == decisions


@pytest.mark.parametrize("is_allowed", [False, True])
def test_both_wires_of_a_limb_are_heated_at_once_only_if_a_limit_says_so(is_allowed):
    plant, guard = guarded(antagonists=is_allowed)
    guard.heat([1, 0, 0, 0, 0], 0.1)
    guard.wait_until(plant.time + 0.05)
    assert guard.resting()[0].tolist() == [True, not is_allowed]
    if is_allowed:
        guard.heat([-1, 0, 0, 0, 0], 0.1)
        assert plant.heated.together() > 0.04
        return
    with pytest.raises(PlantError, match="Both wires of a limb"):
        guard.heat([-1, 0, 0, 0, 0], 0.1)
    assert plant.heated.last() == plant.time


@pytest.mark.parametrize("jump", [3600.0, 1.0])
def test_a_clock_that_jumps_is_no_rest(jump, monkeypatch):
    wall = [0.0]
    monkeypatch.setattr(heat, "time", SimpleNamespace(monotonic=lambda: wall[0]))
    plant, guard = guarded(0.1)
    for _ in range(2):
        guard.heat([1, 0, 0, 0, 0], 0.1)
        guard.wait_until(plant.time + 0.2)
    assert guard.resting()[0, 0]
    plant.time += jump
    assert guard.resting()[0, 0]
    wall[0] += 2.0
    plant.time += 2.0
    assert not guard.resting()[0, 0]  # two seconds by both clocks


@pytest.mark.parametrize("limbs", [[1, 0, 0, 0], [1] * 6, [2, 0, 0, 0, 0], [0, 0, 0, 0, np.nan], [-2, 0, 0, 0, 0]])
def test_wires_that_there_are_not_are_not_heated(limbs):
    plant, guard = guarded()
    with pytest.raises(PlantError, match="1, 0 or -1 for 5 limbs"):
        guard.heat(limbs, 0.05)
    assert not plant.heated.intervals


@pytest.mark.parametrize(
    "name, options, policy, most",
    [("SeastarSwim-v0", {"path": "pentagon"}, lambda: scripted("pentagon"), 0.0),
     ("SeastarSwim-v0", {"actions": "pairs"}, lambda: pretrained("strokes"), 0.0),
     ("SeastarSwimTimed-v0", {}, lambda: pretrained("timed-0.5s"), 0.0),
     ("SeastarSwimTimedModerate-v0", {}, lambda: pretrained("timed-0.2s"), 0.05)],
)  # fmt: skip
def test_what_policies_command_is_heated(name, options, policy, most):
    """But for a wire's third pulse of 0.1 s in 0.5 s."""
    env, policy = gym.make(name, fidelity="fast", **options), policy()
    observation, _ = env.reset(seed=0)
    plant, guard = guarded(0.1)
    state, masked, asked = None, 0, 0
    for decision in range(60):
        action, state = policy.predict(observation, state, np.array([decision == 0]), deterministic=True)
        observation, *_ = env.step(action)
        command = np.sign(env.unwrapped._robots.last_commands[0]).astype(int)
        resting = guard.resting()
        follows = ~((command > 0) & resting[:, 0] | (command < 0) & resting[:, 1])
        masked, asked = masked + (~follows).sum(), asked + (command != 0).sum()
        guard.heat((command * follows).tolist(), 0.1)
        guard.wait_until(plant.time + env.unwrapped.decision_period)
    assert asked > 30 and masked <= most * asked and plant.heated.hottest() <= 100.0


@pytest.mark.parametrize(
    "make, words",
    [(lambda: Limits(hottest=20.0), "above the water's 20 deg C"),
     (lambda: PlantSwim(Tank(), scene=Scene(actuator=ThermalSma(steady_rise=450.0)).at("fast")), "120 deg C"),
     (lambda: PlantSwim(Tank(), Limits(0.3), scene=Scene(actuator=SmaWires(heating_time=0.3))), "134 deg C")],
)  # fmt: skip
def test_limits_that_cannot_be_and_wires_of_a_scene_that_would_be_too_hot_are_refused(make, words):
    with assert_refused(words):
        make()
