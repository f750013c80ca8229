"""Numbers drawn for every episode: from their distributions, the same alone and in a batch, and told in `info`."""

from dataclasses import replace

import numpy as np
import pytest

from seastar_gym import (
    DomainRandomization,
    LogUniform,
    Normal,
    Scene,
    Simulator,
    SmaPulse,
    ThermalSma,
    Uniform,
    UniformCurrent,
    Water,
)
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.scene import Numerics

DRAWS = DomainRandomization(
    {
        "robot.youngs_modulus": LogUniform(5e5, 2e6),
        "robot.limb_length": Uniform(0.08, 0.12),
        "fluid.drag_coefficient": Normal(1.0, 0.1),
        "actuator.peak_angle": Uniform(0.4, 0.6),
        "limb_strengths": Uniform(0.5, 1.0),
    }
)


@pytest.mark.parametrize("distribution", [Uniform(-2.0, 3.0), LogUniform(0.1, 10.0), Normal(1.0, 0.5)])
def test_draws_have_their_mean_and_stay_within_their_bounds(distribution):
    """A normal distribution is cut at three standard deviations."""
    rng = np.random.default_rng(0)
    drawn = np.array([distribution.draw(rng) for _ in range(20_000)])
    low, high = distribution.bounds
    assert low <= drawn.min() and drawn.max() <= high
    if isinstance(distribution, LogUniform):
        drawn, low, high = np.log(drawn), np.log(low), np.log(high)
    assert drawn.mean() == pytest.approx((low + high) / 2.0, abs=0.02 * (high - low))
    assert drawn.min() < low + 0.05 * (high - low) and drawn.max() > high - 0.05 * (high - low)
    if isinstance(distribution, Normal):
        assert (low, high) == (-0.5, 2.5) and drawn.std() / 0.5 == pytest.approx(0.987, abs=0.02)


@pytest.mark.parametrize("seed", [7, 8, 9])
def test_an_environment_swims_as_the_robot_that_was_drawn(seed):
    env = SeastarSwimEnv(fidelity="fast", randomization=DRAWS)
    _, own = env.reset(seed=seed)
    modulus, drag = own["robot.youngs_modulus"], own["fluid.drag_coefficient"]
    fast = Scene.preset("fast")
    robot = replace(fast.robot, youngs_modulus=modulus, limb_length=own["robot.limb_length"])
    pulse = SmaPulse(own["actuator.peak_angle"])
    plain = Simulator(Scene(robot, Water(drag_coefficient=drag), pulse, numerics=fast.numerics))
    command = np.array([0.0, 1.0, -1.0, 0.0, 1.0])
    env.simulator.stroke(command[None])
    plain.stroke(own["limb_strengths"] * command[None])
    np.testing.assert_array_equal(env.simulator.positions, plain.positions)


def test_lengths_are_seen_in_the_robots_own_limb_length():
    randomization = DomainRandomization({"robot.limb_length": Uniform(0.05, 0.2)})
    env, plain = SeastarSwimEnv(fidelity="fast", randomization=randomization), SeastarSwimEnv(fidelity="fast")
    (observation, info), (expected, _) = env.reset(seed=5), plain.reset(seed=5)
    np.testing.assert_allclose(observation[:90], expected[:90], rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(observation[-4:] * info["robot.limb_length"], 0.1 * expected[-4:], rtol=1e-6)


def test_every_episode_is_another_robot_and_the_scene_stays_as_it_was_given():
    env = SeastarSwimEnv(fidelity="fast", randomization=DRAWS)
    first, second = env.reset(seed=1)[1], env.reset()[1]
    assert all(np.all(first[name] != second[name]) for name in DRAWS.distributions)
    assert env.scene.robot.youngs_modulus == 1e6


def test_a_limb_that_has_failed_does_not_move_and_currents_can_be_drawn():
    scene, currents = Scene(fluid=Water(current=UniformCurrent())), {"fluid.current.u_x": Uniform(-0.1, 0.1)}
    env = SeastarSwimEnv(scene=scene, randomization=DomainRandomization(currents))
    drawn = env.reset(seed=3)[1]["fluid.current.u_x"]
    assert env.simulator.scene.fluid.current.u_x == (drawn,) and drawn != 0.0
    env = SeastarSwimEnv(fidelity="fast", randomization=DomainRandomization({"limb_strengths": Uniform(0.0, 0.0)}))
    _, info = env.reset(seed=0)
    np.testing.assert_array_equal(info["limb_strengths"], np.zeros(5))
    *_, info = env.step(np.ones(5, int))
    assert np.abs(info["hub_position"]).max() < 1e-12 and info["limbs_heated"] == 5


def test_drawn_strengths_weaken_what_limbs_turn_and_not_what_actuators_are_told():
    """A wire with heat is as warm in a weak limb; what the scene weakens already is weakened further."""
    weak = (1.0, 0.5, 1.0, 1.0, 1.0)
    scene = Scene(actuator=ThermalSma(), numerics=Numerics.preset("fast"), limb_strengths=weak)
    env = SeastarSwimEnv(scene=scene, randomization=DomainRandomization({"limb_strengths": Uniform(0.2, 0.9)}))
    _, info = env.reset(seed=3)
    simulator = env.unwrapped.simulator
    np.testing.assert_allclose(simulator.limb_strengths, info["limb_strengths"][None] * weak, rtol=1e-15)
    plain = SeastarSwimEnv(scene=scene)
    plain.reset(seed=3)
    for one in (env, plain):
        one.step(np.array([1, 2, 0, 1, 2]))
    np.testing.assert_array_equal(simulator.actuators, plain.unwrapped.simulator.actuators)
