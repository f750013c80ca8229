"""Symmetries of robots as tests want them, from their definitions, and swims in worlds that are carried by them."""

from dataclasses import replace

import numpy as np

from seastar_gym import Numerics, SymmetryReduction
from seastar_gym.envs.group import is_mirror, n_limbs_of, n_turns_of
from seastar_gym.envs.layout import Layout
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.symmetry import Symmetry


def symmetry_for(group, mirror=(), mode="limbs", entries=()):
    """Symmetry of a robot with this group and numbers of its limbs, whose tasks show these entries."""
    return Symmetry(group, mirror, Layout(n_limbs_of(group), len(mirror), entries), mode)


def turns_and_axis(group):
    return (group, 0.0) if isinstance(group, int) else (group.n_turns, group.axis)


def matrix(element, group):
    """Of an element of a group, or of that of a regular polygon of so many limbs, from its definition."""
    n_turns, axis = turns_and_axis(group)
    k = (element + 1) // 2
    c, s = np.cos(2 * np.pi * k / n_turns), np.sin(2 * np.pi * k / n_turns)
    turn = np.array([[c, s], [-s, c]])
    if element % 2 == 0:
        return turn
    c, s = np.cos(2 * axis), np.sin(2 * axis)
    return np.array([[c, s], [s, -c]]) @ turn


def compose(second, first, group):
    """Elements of doing `first` and then `second`."""
    k_first, k_second = (np.asarray(first) + 1) // 2, (np.asarray(second) + 1) // 2
    k = k_first + np.where(is_mirror(first), -k_second, k_second)
    return (2 * k - (np.asarray(first) + second) % 2) % (2 * n_turns_of(group))


def mirrored(actuator, numbers):
    """Numbers of `state` or `observe` of limbs, shape (..., k), as a mirror shows them."""
    index, sign = np.array((actuator.mirror or ())[: numbers.shape[-1]], dtype=int).reshape(-1, 2).T
    return numbers[..., index] * sign


def elements_of(group):
    n_turns, axis = turns_and_axis(group)
    return np.arange(0, 2 * n_turns, 2 if axis is None else 1)


def assert_equivariant(policy, seen):
    """For carried observations of robots of five limbs, shape (n, size), the policy does the carried thing."""
    symmetry = symmetry_for(5, mode=policy.actions)
    actions, _ = policy.predict(seen, deterministic=True)
    for element in elements_of(5):
        elements = np.full(len(seen), element)
        carried, _ = policy.predict(symmetry.carry(seen, elements), deterministic=True)
        np.testing.assert_array_equal(carried, symmetry.carry_actions(actions, elements))


def reduced_swim(scene, randomization, carry, actions, **arguments):
    """Rewards and reduced observations of the same reduced actions, in a world carried by a matrix."""
    path = np.array([[0.02, 0.013], [-0.03, 0.02], [0.02, -0.03]]) @ carry.T
    scene = replace(scene, numerics=Numerics.preset("fast"))
    env = SymmetryReduction(SeastarSwimEnv(path, "pairs", scene=scene, randomization=randomization, **arguments))
    seen, rewards = [env.reset(seed=0)[0]], []
    for action in actions:
        observation, reward, *_ = env.step(action)
        seen.append(observation)
        rewards.append(reward)
    return np.array(rewards), np.array(seen)
