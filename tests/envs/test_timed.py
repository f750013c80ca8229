"""Decisions within a stroke: the timed environments, their actions, masks, heat and pictures."""

import numpy as np
import pytest

from own_actuators import Triangle
from seastar_gym import Limited, Numerics, RewardWeights, Scene, SmaPulse, SmaWires, SymmetryReduction, ThermalSma
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.vector import SeastarSwimVectorEnv

FAST = Numerics.preset("fast")
REFRACTORY = Scene(actuator=SmaWires(refractory=True), numerics=FAST)
HOT = Scene(actuator=ThermalSma(largest_temperature=240.0 - 220.0 * np.exp(-0.05 / 0.42)), numerics=FAST)
"""Wires reach the largest temperature after 0.05 s."""
STRAIGHT = np.array([0, 1, 0, 0, 2])


# Decision periods


def test_a_decision_is_a_stroke_unless_another_period_is_asked_for():
    for arguments in ({}, {"decision_period": 1.0}, {"decision_period": None}):
        env = SeastarSwimEnv(fidelity="fast", **arguments)
        assert env.decision_period == 1.0 and env.scene == Scene.preset("fast")
    assert SeastarSwimEnv(scene=Scene(actuator=ThermalSma(cooling_time=0.4))).decision_period == 0.5
    assert SeastarSwimEnv(scene=Scene(), decision_period=1.5).decision_period == 1.5


# Heat


@pytest.mark.parametrize("actuator", [SmaPulse(), SmaWires(), ThermalSma(), Limited(SmaPulse(heating_power=3.0), 0.3)])
def test_pulses_and_shares_of_them_cost_what_they_are(actuator):
    env = SeastarSwimEnv(scene=Scene(actuator=actuator, numerics=FAST), actions="continuous")
    env.reset(seed=0)
    commands = ([0, 0, 0, 0, 0], 0.0), ([0, 1, 0, 0, -1], 2.0), ([1] * 5, 5.0), ([0, 0.5, 0, 0, -0.25], 0.75)
    for command, pulses in commands:
        info = env.step(np.array(command, np.float32))[4]
        assert info["reward_effort"] == pytest.approx(-0.01 * pulses, rel=1e-12)
        assert info["limbs_heated"] == np.count_nonzero(command)
        assert info["heating_time"] == pytest.approx(0.1 * pulses)
        power = getattr(actuator, "actuator", actuator).heating_power  # of what is limited, if anything is
        assert info["energy"] == pytest.approx(power * info["heating_time"])


def test_heat_that_an_actuator_does_not_tell_is_unknown_and_priced_by_command():
    env = SeastarSwimEnv(scene=Scene(actuator=Triangle(), numerics=FAST))
    env.reset(seed=0)
    info = env.step(STRAIGHT)[4]
    assert np.isnan([info["heating_time"], info["energy"], info["energy_per_metre"]]).all()
    assert info["reward_effort"] == -0.02


def test_energy_per_metre_is_that_since_the_reset():
    env = SeastarSwimEnv(actions="pairs", fidelity="fast", decision_period=0.5)
    straight = env.command_table.tolist().index([0.0, 1.0, 0.0, 0.0, -1.0])
    for _ in range(2):
        assert env.reset(seed=0)[1]["energy_per_metre"] == 0.0
        energy, progress = 0.0, 0.0
        for action in (straight, 0, straight):
            info = env.step(action)[4]
            energy, progress = energy + info["energy"], progress + info["reward_progress"] / 200.0
            assert info["energy_per_metre"] == pytest.approx(energy / progress)
    env.reset(seed=0, options={"path": [[-1.0, 0.0]]})
    assert env.step(straight)[4]["energy_per_metre"] == np.inf
    env = SeastarSwimEnv(fidelity="fast", decision_period=0.05, reward=RewardWeights(effort=1.0))
    env.reset(seed=0)
    terms = [env.step(action)[4]["reward_effort"] for action in (STRAIGHT, [0] * 5, [0] * 5)]
    assert terms == pytest.approx([-1.0, -1.0, 0.0])  # decisions that end within a pulse pay for it all the same


# Masks


@pytest.mark.parametrize("scene", [REFRACTORY, HOT])
def test_a_masked_command_does_nothing_costs_nothing_and_is_counted(scene):
    """After 0.05 s, wires of the last pulse are still heated, or as hot as they may be."""
    env, other = (SeastarSwimEnv(scene=scene, decision_period=0.05) for _ in range(2))
    for one in (env, other):
        assert one.reset(seed=0)[1]["action_mask"].all()
        info = one.step(STRAIGHT)[4]
    masked = np.array([1, 1, 1, 1, 0, 0 if scene is REFRACTORY else 1])
    np.testing.assert_array_equal(info["action_mask"][:6], masked)
    np.testing.assert_array_equal(env.action_masks(), info["action_mask"].astype(bool))
    assert info["masked_limbs"] == 0 and info["action_mask"].dtype == np.int8
    observation, reward, _, _, info = env.step([1, 1, 0, 0, 2])
    expected, its_reward, _, _, its_info = other.step([1, 0, 0, 0, 0])
    np.testing.assert_array_equal(observation, expected)
    assert reward == its_reward and info["limbs_heated"] == its_info["limbs_heated"] == 1
    assert info["masked_limbs"] == 2 and its_info["masked_limbs"] == 0


@pytest.mark.parametrize("actions", ["limbs", "joint", "pairs"])
def test_a_masked_policy_never_loses_a_command_and_wires_that_always_follow_have_no_mask_in_info(actions):
    """The masks are those of Gymnasium's `sample`, for one robot and for each of a batch."""
    arguments = {"actions": actions, "scene": REFRACTORY, "decision_period": 0.2}
    env, batch = SeastarSwimEnv(**arguments), SeastarSwimVectorEnv(2, **arguments)
    one, space = SymmetryReduction(env), batch.single_action_space
    one.reset(seed=0), batch.reset(seed=0)
    env.action_space.seed(0), space.seed(0)
    for _ in range(20):
        info = one.step(env.action_space.sample(mask=one.sampling_mask()))[4]
        infos = batch.step(np.array([space.sample(mask=mask) for mask in batch.sampling_mask()]))[4]
        assert info["masked_limbs"] == 0 and not infos["masked_limbs"].any()
    assert not env.action_masks().all() and SeastarSwimEnv(actions="continuous").sampling_mask() is None
    if actions != "limbs":
        np.testing.assert_array_equal(one.sampling_mask(), one.action_masks().astype(np.int8))
    for arguments in ({}, {"decision_period": 0.5}, {"scene": Scene(actuator=ThermalSma())}):
        env = SeastarSwimEnv(**arguments)
        assert not {"action_mask", "masked_limbs"} & set(env.reset(seed=0)[1])
        assert env.action_masks().shape == (15,) and env.action_masks().all()
