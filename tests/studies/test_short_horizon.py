"""Short-horizon actor-critic: it differentiates what the environment computes."""

from dataclasses import replace

import numba
import numpy as np
import pytest
import torch

from seastar_gym import Simulator
from seastar_gym.scene import Scene
from studies.learning.short_horizon import FEW, LEARNERS, SETTINGS, Shac, by_ppo, by_shac, reached, swimmers, table

SMALL = replace(SETTINGS, robots=2, window=3)
compiled = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="lanes of a tape have compiled code alone")


@compiled
def test_observations_and_rewards_are_those_of_the_environment():
    learner, env = Shac(SMALL, seed=0), swimmers(SMALL.robots)
    window = learner.explore()
    found = learner.gradient(window)
    seen = [env.reset(seed=0)[0]]
    for k in range(SMALL.window):
        after, rewards, *_ = env.step(window.commands[:, k])
        seen.append(after)
        np.testing.assert_allclose(found.rewards[:, k], rewards, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(found.seen, np.stack(seen, axis=1), rtol=1e-6, atol=1e-6)


def swum(learner, window, scene):
    """Positions, velocities and commands of a window that the actor swims as it is now."""
    simulator, states, commands = Simulator(scene, SMALL.robots, threads=1), [], []
    simulator.set_state(window.state)
    for k in range(SMALL.window + 1):
        states.append([torch.from_numpy(each.copy()) for each in (simulator.positions, simulator.velocities)])
        if k < SMALL.window:
            with torch.no_grad():
                commands.append(learner.commands(learner.swim.observed(*states[-1]), window.noise[:, k]))
            simulator.stroke(commands[-1].numpy())
    places, velocities = (torch.stack(each, dim=1) for each in zip(*states, strict=True))
    return places, velocities, torch.stack(commands, dim=1)


def returned(learner, window, scene):
    """Return per decision of such a window."""
    places, velocities, commands = swum(learner, window, scene)
    rewards = learner.swim.rewards(places, commands)
    with torch.no_grad():
        total = SMALL.discount**SMALL.window * learner.value(
            learner.target, learner.swim.observed(places[:, -1], velocities[:, -1])
        )
    for k in range(SMALL.window):
        total += SMALL.discount**k * rewards[:, k]
    return float(total.mean()) / SMALL.window


@compiled
def test_the_gradient_of_the_actor_is_a_difference_of_returns():
    """Through observations, too, of which its commands depend; Newton's tolerance is far below the differences."""
    exact = Scene.preset("fast")
    exact = replace(exact, numerics=replace(exact.numerics, newton_tolerance=1e-12))
    learner = Shac(SMALL, seed=0)
    learner.scene = exact
    torch.manual_seed(1)
    with torch.no_grad():
        for weight in learner.weights:
            weight += 0.05 * torch.randn_like(weight)
    window = learner.explore()
    window = window._replace(commands=swum(learner, window, exact)[-1].numpy())
    found = learner.gradient(window)
    assert found.value == pytest.approx(returned(learner, window, exact), rel=1e-10)
    for weight, slope in zip(learner.weights, found.slopes, strict=True):
        was, change = weight.detach().clone(), torch.randn_like(weight)
        values = []
        for share in (1e-4, -1e-4):
            with torch.no_grad():
                weight.copy_(was + share * change / change.norm())
            values.append(returned(learner, window, exact))
        with torch.no_grad():
            weight.copy_(was)
        expected = (values[0] - values[1]) / 2e-4
        assert float((slope * change).sum() / change.norm()) == pytest.approx(expected, rel=1e-4)


@compiled
def test_both_learn_for_an_update():
    for scores in (by_shac(24, 0, SMALL), by_ppo(256, 0)):
        done, seconds, found = scores[-1]
        assert done in (24, 256) and seconds > 0.0 and np.isfinite(found)


def test_the_table_tells_when_a_return_was_reached():
    scores = [[96, 1.0, 5.0], [192, 2.0, 8.0], [FEW, 30.0, 9.0]]
    assert reached(scores, 8.0) == (192, 2.0) and reached(scores, 10.0) == (np.inf, np.inf)
    results = {"rules": {"the straight gait, steered": 10.0}, "learners": {name: {"0": scores} for name in LEARNERS}}
    assert "| SHAC | 3,072 | 30 | 9.0 (9.0-9.0) | 192 | 2 |" in table(results)
