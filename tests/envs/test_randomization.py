"""Numbers drawn for every episode: from their distributions, the same alone and in a batch, and told in `info`."""

from dataclasses import replace

import numpy as np
import pytest

from episodes import both, swim_together
from seastar_gym import (
    Body,
    DomainRandomization,
    LogUniform,
    Normal,
    Scene,
    Seastar,
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
    rng = np.random.default_rng(0)
    drawn = np.array([distribution.draw(rng) for _ in range(4000)])
    low, high = distribution.bounds
    assert low <= drawn.min() and drawn.max() <= high
    if isinstance(distribution, LogUniform):
        drawn, low, high = np.log(drawn), np.log(low), np.log(high)
    assert drawn.mean() == pytest.approx((low + high) / 2.0, abs=0.05 * (high - low))
    assert drawn.min() < low + 0.25 * (high - low) and drawn.max() > high - 0.25 * (high - low)


def test_a_normal_distribution_is_cut_at_three_standard_deviations():
    rng, normal = np.random.default_rng(0), Normal(5.0, 0.5)
    assert normal.bounds == (3.5, 6.5)
    drawn = (np.array([normal.draw(rng) for _ in range(20_000)]) - 5.0) / 0.5
    assert 2.8 < np.abs(drawn).max() <= 3.0 and drawn.std() == pytest.approx(0.987, abs=0.02)


def test_a_batch_draws_and_swims_as_single_environments_do():
    batch, singles = both("SeastarSwim-v0", 3, randomization=DRAWS, max_episode_steps=2)
    swim_together(batch, singles, 5)
    drawn = batch.step(np.zeros((3, 5), int))[4]
    assert all(len(np.unique(drawn[name], axis=0)) == 3 for name in DRAWS.distributions)


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


def test_peak_angles_that_would_close_a_hub_hinge_are_refused_before_they_are_drawn():
    robot = Seastar(hub_hinge="turning", discretisation="chapter")
    scene = Scene(robot, actuator=SmaPulse(0.3), numerics=Numerics.preset("fast"))
    with pytest.raises(ValueError, match="close a hub hinge"):
        SeastarSwimEnv(
            scene=scene, randomization=DomainRandomization({"actuator.peak_angle": Uniform(0.3, np.pi / 5.0)})
        )


def test_every_episode_is_another_robot_and_every_seed_the_same_one():
    env = SeastarSwimEnv(fidelity="fast", randomization=DRAWS)
    first = env.reset(seed=1)[1]["robot.youngs_modulus"]
    second = env.reset()[1]["robot.youngs_modulus"]
    again = env.reset(seed=1)[1]["robot.youngs_modulus"]
    assert first == again and first != second
    assert env.scene.robot.youngs_modulus == 1e6


def test_a_limb_that_has_failed_does_not_move():
    env = SeastarSwimEnv(fidelity="fast", randomization=DomainRandomization({"limb_strengths": Uniform(0.0, 0.0)}))
    _, info = env.reset(seed=0)
    np.testing.assert_array_equal(info["limb_strengths"], np.zeros(5))
    *_, info = env.step(np.ones(5, int))
    assert np.abs(info["hub_position"]).max() < 1e-12 and info["limbs_heated"] == 5


def test_currents_can_be_drawn():
    scene = Scene(fluid=Water(current=UniformCurrent()))
    randomization = DomainRandomization({"fluid.current.u_x": Uniform(-0.1, 0.1)})
    env = SeastarSwimEnv(scene=scene, randomization=randomization)
    _, info = env.reset(seed=3)
    assert env.simulator.scene.fluid.current.u_x == (info["fluid.current.u_x"],)


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


def test_equal_distributions_are_equal_have_one_hash_and_say_what_they_are():
    ours, theirs = (DomainRandomization({"fluid.density": Uniform(900.0, 1e3)}) for _ in range(2))
    other = DomainRandomization({"fluid.density": Uniform(900.0, 2e3)})
    assert ours == theirs != other and hash(ours) == hash(theirs) != hash(other) and ours != 3
    assert repr(ours) == "DomainRandomization({'fluid.density': Uniform(low=900.0, high=1000.0)})"


@pytest.mark.parametrize(
    "name, words",
    [
        ("robot.body.drag_along", ", since it leaves that out \\(None\\): give it a value there\\."),
        ("robot.body.radius", ", since it is the same for all robots of a batch\\."),
        ("robot.colour", ": it has .*fluid\\.density.*limb_strengths\\."),
    ],
)
def test_a_number_that_cannot_be_drawn_says_why(name, words):
    scene = Scene(Seastar(body=Body(radius=0.02, drag_coefficient=1.0)))
    with pytest.raises(ValueError, match=f"The scene has no number '{name}' to draw{words}"):
        DomainRandomization({name: Uniform(0.1, 0.2)}).first_values(scene, 2)
