"""Every actuator keeps the same promises by itself; tests/simulator/test_bits.py has it swim."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from every_part import ACTUATORS
from seastar_gym import Limited, Scene, SmaLimb, SmaPulse, SmaWires, ThermalSma
from seastar_gym.scene.actuators.base import complete
from symmetries import mirrored

SINGLE = {name: actuator for name, actuator in ACTUATORS.items() if Scene(actuator=actuator).n_robots is None} | {
    "wires": SmaWires(),
    "refractory wires": SmaWires(refractory=True),
    "thermal": ThermalSma(),
    "hot": ThermalSma(largest_temperature=50.0),
    "slow": Limited(SmaPulse(), largest_rate=0.4),
    "measured limb": SmaLimb(),
}
REMEMBERING = [name for name, actuator in SINGLE.items() if complete(actuator).has_memory]
EACH = [name for name, actuator in ACTUATORS.items() if Scene(actuator=actuator).n_robots is not None]


def after_some(actuator, rng, n, shape):
    """State after n intervals with random commands, from rest."""
    state = np.broadcast_to(actuator.rest, (*shape, len(actuator.rest)))
    for _ in range(n):
        _, state = actuator.respond(np.array([0.0, rng.uniform(0.01, 0.3)]), rng.uniform(-1.0, 1.0, shape), state)
    return state


@pytest.mark.parametrize("name", REMEMBERING)
@given(
    cuts=st.lists(st.floats(1e-3, 1.2), min_size=1, max_size=6, unique=True),
    seed=st.integers(0, 1000),
    before=st.integers(0, 3),
)
@example(cuts=[0.01, 0.02, 0.03, 0.06, 0.2, 0.9], seed=0, before=0)  # several within the heating of a wire
@settings(max_examples=30)
def test_pieces_of_an_interval_are_the_whole(name, cuts, seed, before):
    """Angles, state and seconds of heating."""
    actuator, rng = complete(SINGLE[name]), np.random.default_rng(seed)
    cuts = [0.0, *sorted(min(cut, actuator.period) for cut in cuts)]
    commands, start = rng.uniform(-1.0, 1.0, 5), after_some(actuator, rng, before, (5,))
    whole, after = actuator.respond(np.array(cuts), commands, start)
    state, heated = start, 0.0
    for k, piece in enumerate(pairwise(cuts)):
        heated = heated + actuator.seconds_heated(np.array(piece), commands, state)
        turned, state = actuator.respond(np.array(piece), commands, state)
        np.testing.assert_allclose(turned[-1], whole[k + 1], atol=1e-12)
    np.testing.assert_allclose(state, after, atol=1e-11)
    np.testing.assert_allclose(heated, actuator.seconds_heated(np.array([0.0, cuts[-1]]), commands, start), atol=1e-12)


@pytest.mark.parametrize("name", REMEMBERING)
def test_a_mirrored_limb_turns_the_other_way(name):
    actuator, rng, t = complete(SINGLE[name]), np.random.default_rng(0), np.array([0.0, 0.03, 0.1, 0.3])
    state = after_some(actuator, rng, 0, (50, 5))
    for begin in (0.0, 0.0, 0.3):
        commands = rng.uniform(-1.0, 1.0, (50, 5))
        seen = mirrored(actuator, state)
        turned, state = actuator.respond(begin + t, commands, state)
        other, after = actuator.respond(begin + t, -commands, seen)
        np.testing.assert_array_equal(other, -turned)
        np.testing.assert_array_equal(after, mirrored(actuator, state))
        np.testing.assert_array_equal(actuator.observe(after), mirrored(actuator, actuator.observe(state)))
        np.testing.assert_array_equal(mirrored(actuator, after), state)


@pytest.mark.parametrize("name", EACH)
def test_every_robot_turns_as_its_own_actuators_do(name):
    scene, t = Scene(actuator=ACTUATORS[name]), np.array([0.0, 0.02, 0.05, 0.2])
    commands = np.random.default_rng(0).uniform(-1.0, 1.0, (scene.n_robots, 5))
    each = complete(scene.actuator)
    for robot, its_commands in enumerate(commands):
        own = complete(scene.of_robot(robot).actuator)
        np.testing.assert_array_equal(each.delta_psi(t)[..., robot], own.delta_psi(t))
        if own.has_memory:
            rest = np.shape(own.rest)
            found = each.respond(t, commands, np.broadcast_to(each.rest, (scene.n_robots, 5, *rest)))
            turned, state = own.respond(t, its_commands, np.broadcast_to(own.rest, (5, *rest)))
            np.testing.assert_array_equal(found[0][:, robot], turned)
            np.testing.assert_array_equal(found[1][robot], state)
            seen = each.observe(found[1])
            np.testing.assert_array_equal(seen[robot], own.observe(state))
            recalled = each.recall(seen)
            if recalled is not None:
                np.testing.assert_allclose(each.observe(recalled), seen, rtol=1e-12, atol=1e-15)
