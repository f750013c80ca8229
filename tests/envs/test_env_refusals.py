"""Helpers of environments refuse in a sentence what they could not use, and take what is just allowed."""

import gymnasium as gym
import numpy as np
import pytest

from refusals import assert_refused
from seastar_gym import DomainRandomization, Scene, Seastar, Sight, SmaPulse, SmaWires, SymmetryReduction, Uniform
from seastar_gym.envs.commands import action_space, choices, command_table, to_commands
from seastar_gym.envs.goal import GoalForm
from seastar_gym.envs.headings import HeadingTargets
from seastar_gym.envs.layout import Layout
from seastar_gym.envs.options import SwimOptions
from seastar_gym.envs.paths import FARTHEST, make_path, register_path
from seastar_gym.envs.randomization import LogUniform, Normal
from seastar_gym.envs.reward import RewardWeights
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.symmetry import (
    Symmetry,
    VectorFrameStack,
    VectorSymmetryReduction,
    memory_mirror,
    symmetry_of,
)
from seastar_gym.envs.task_env import checked_options
from seastar_gym.envs.tasks.course import Pursuit, draw_course
from seastar_gym.envs.tasks.obst_trap import ObstTrap, draw_discs
from seastar_gym.envs.vector import SeastarSwimVectorEnv, checked_seeds
from symmetries import symmetry_for

LIMBS, SHARES, JOINT = (Symmetry(5, (), Layout(5), mode) for mode in ("limbs", "continuous", "joint"))
ONE = np.zeros(1, int)
WIRES = memory_mirror(SmaWires())
NINE = Scene(Seastar(9), actuator=SmaPulse(0.1))
RNG, SLOW = np.random.default_rng(0), Pursuit(1e-3, 1e-3)


def goals(achieved, desired):
    """Rewards of goals."""
    env = GoalForm(gym.make("SeastarSwim-v0", fidelity="fast"))
    return env.compute_reward(achieved, desired, {})


def swimmers(**options):
    """Two of them."""
    return SeastarSwimVectorEnv(2, fidelity="fast", threads=1, **options)


def drawing(name, low, high):
    """Environment that draws a number for every episode."""
    return SeastarSwimEnv(randomization=DomainRandomization({name: Uniform(low, high)}))


REFUSED = {
    "goals of two shapes": (lambda: goals(np.zeros((3, 2)), np.zeros(2)), "Goals must have one shape (..., 2)"),
    "goals in space": (lambda: goals(np.zeros(3), np.zeros(3)), "Goals must have one shape (..., 2)"),
    "goals of a cart": (lambda: GoalForm(gym.make("CartPole-v1")), "GoalForm needs an environment of waypoints"),
    "goals seen by a camera": (lambda: GoalForm(gym.make("SeastarSwim-v0", sight=Sight())), "which no camera knows"),
    "entries in a list": (lambda: Layout(entries=["scalar"]), "entries must be a tuple of scalar"),
    "an entry of no text": (lambda: Layout(entries=(3,)), "entries must be a tuple of scalar"),
    "an unknown entry": (lambda: Layout(entries=("tensor",)), "entries must be a tuple of scalar"),
    "limbs without number": (lambda: Layout(0), "n_limbs"),
    "a path without name": (lambda: register_path(""), "The name of a path must be a text"),
    "a path named 3": (lambda: register_path(3), "The name of a path must be a text"),
    "a path that is none": (lambda: register_path("mine")(3), "A path"),
    "a path without rng": (lambda: make_path("line", 3), "rng"),
    "a range downwards": (lambda: Uniform(2.0, 1.0), "low must not exceed high"),
    "a range beyond floats": (lambda: Uniform(-1e308, 1e308), "high - low must be finite"),
    "a range to infinity": (lambda: Uniform(0.0, np.inf), "high must be a finite number"),
    "a range of texts": (lambda: Uniform("0", 1.0), "low must be a finite number"),
    "a range of ranges": (lambda: Uniform(np.array([0.0, 1.0]), 1.0), "low must be a finite number"),
    "logarithms of zero": (lambda: LogUniform(0.0, 1.0), "low must be a positive"),
    "a mean that is none": (lambda: Normal(np.nan, 1.0), "mean must be a finite number"),
    "a negative deviation": (lambda: Normal(0.0, -1.0), "deviation"),
    "a deviation of truth": (lambda: Normal(1.0, True), "deviation"),
    "no distributions": (lambda: DomainRandomization({}), "needs distributions by name"),
    "a number as a draw": (lambda: DomainRandomization({"fluid.density": 3.0}), "fluid.density", "needs a Uniform"),
    "a misspelt draw": (lambda: drawing("limb_strength", 0.5, 1.0), "'limb_strength'", "limb_strengths"),
    "a draw without name": (lambda: drawing(3, 0.5, 1.0), "3", "limb_strengths"),
    "a draw of everything": (lambda: SeastarSwimEnv(randomization="all"), "DomainRandomization", "'all'"),
    "a draw of limbs": (lambda: drawing("robot.n_limbs", 3, 5), "robot.n_limbs", "same for all robots of a batch"),
    "a draw of lengths below zero": (lambda: drawing("robot.limb_length", -0.1, 0.2), "limb_length", "positive"),
    "a draw of densities below zero": (lambda: drawing("robot.density", -1.0, 0.2), "density", "positive"),
    "a draw of peaks": (lambda: drawing("actuator.peak_angle", 0.1, 4.0), "peak angle", "4 rad"),
    "a draw of no current": (lambda: drawing("fluid.current.u_x", 0.1, 0.2), "fluid.current.u_x"),
    "strong limbs": (lambda: DomainRandomization({"limb_strengths": Uniform(0.5, 1.1)}), "drawn from 0 to 1"),
    "limbs that push back": (lambda: DomainRandomization({"limb_strengths": Uniform(-0.1, 1.0)}), "drawn from 0 to 1"),
    "a mirror of lists": (lambda: Symmetry(5, [(0, 1)], Layout(5, 1)), "mirror must be a tuple of pairs"),
    "a mirror of triples": (lambda: Symmetry(5, ((0, 1, 1),), Layout(5, 1)), "mirror must be a tuple of pairs"),
    "a mirror beyond": (lambda: Symmetry(5, ((1, 1),), Layout(5, 1)), "mirror must be a tuple of pairs"),
    "a mirror before": (lambda: Symmetry(5, ((-1, 1),), Layout(5, 1)), "mirror must be a tuple of pairs"),
    "a mirror that doubles": (lambda: Symmetry(5, ((0, 2),), Layout(5, 1)), "mirror must be a tuple of pairs"),
    "a mirror of shares": (lambda: Symmetry(5, ((0, 1.0),), Layout(5, 1)), "mirror must be a tuple of pairs"),
    "a group of no limbs": (lambda: Symmetry(0, (), Layout(5)), "group"),
    "another number of limbs": (lambda: Symmetry(4, (), Layout(5)), "A group of 4 limbs and a mirror of 0 numbers"),
    "another number of numbers": (lambda: Symmetry(5, (), Layout(5, 1)), "do not fit a layout of 5 limbs and 1"),
    "no layout": (lambda: Symmetry(5, (), "five"), "layout"),
    "seen of seven limbs": (lambda: symmetry_for(7).reduce(np.zeros((1, 186))), "not that of a robot of 7 limbs"),
    "seen of wires alone": (lambda: symmetry_for(5, WIRES).reduce(np.zeros((1, 186))), "not that of a robot of 5"),
    "seen of more than that": (lambda: symmetry_for(5).reduce(np.zeros((1, 206))), "not that of a robot of 5 limbs"),
    "seen of headings": (lambda: symmetry_for(5, WIRES).reduce(np.zeros((1, 200))), "not that of a robot of 5 limbs"),
    "actions below": (lambda: JOINT.restore(np.array([-1]), ONE), "an action is a whole number from 0 to 242"),
    "actions beyond": (lambda: JOINT.restore(np.array([243]), ONE), "an action is a whole number from 0 to 242"),
    "halves of actions": (lambda: JOINT.restore(np.array([0.5]), ONE), "an action is a whole number from 0 to 242"),
    "a reduced cart": (lambda: SymmetryReduction(gym.make("CartPole-v1").unwrapped), "SeastarSwim-v0", "CartPole"),
    "reduced carts": (
        lambda: VectorSymmetryReduction(gym.make_vec("CartPole-v1", 2, "sync")), "SeastarSwim-v0", "SyncVectorEnv",
    ),
    "no past": (lambda: VectorFrameStack(swimmers(), 0), "past must be"),
    "a past of headings": (lambda: VectorFrameStack(swimmers(headings=HeadingTargets()), 2), "Asked headings have no"),
    "a symmetry of no scene": (lambda: symmetry_of(3), "scene must be a Scene"),
    "a mirror of no actuator": (lambda: memory_mirror(3), "actuator must be an actuator, such as SmaWires"),
    "whole observations": (lambda: LIMBS.reduce(np.zeros((1, 186), int)), "Observations must be floats"),
    "one number": (lambda: LIMBS.reduce(np.float32(1.0)), "Observations must be floats"),
    "elements of floats": (lambda: LIMBS.restore(np.zeros((1, 5), int), [0.0]), "elements must be whole numbers"),
    "elements below": (lambda: LIMBS.restore(np.zeros((1, 5), int), [-1]), "elements must be whole numbers from 0"),
    "elements above": (lambda: LIMBS.restore(np.zeros((1, 5), int), [10]), "elements must be whole numbers from 0"),
    "shares of texts": (lambda: SHARES.carry_actions(np.full((1, 5), "a"), ONE), "an action is numbers, not"),
    "options in a list": (lambda: checked_options(["path"], {"path"}), "options must be a dictionary"),
    "unknown options": (lambda: checked_options({"way": 1}, {"path"}), "Unknown reset option(s)"),
    "seeds that are too few": (lambda: swimmers().reset(seed=[1]), "seed must be one number or 2 of them, not 1"),
    "a seed below zero": (lambda: checked_seeds([1, -1], 2), "seed"),
    "a radius beyond": (lambda: SwimOptions(waypoint_radius=2e6), "waypoint_radius must be at most 1e+06 m"),
    "a table of limbs": (lambda: command_table("limbs", 5), "not a table of commands: use LIMB_COMMANDS"),
    "too many limbs": (lambda: command_table("joint", 9), "would have 3^9 = 19,683 actions for 9 limbs"),
    "an action for nine limbs": (lambda: SeastarSwimEnv(scene=NINE, actions="joint"), "19,683 actions"),
    "a table of shares": (lambda: command_table("continuous", 5), 'actions="continuous" has no finite number'),
    "choices of shares": (lambda: choices("continuous", 5), 'actions="continuous" has no finite number of actions'),
    "no action mode": (lambda: action_space("Limbs", 5), "actions must be one of", "'limbs', 'joint', 'pairs'"),
    "too large a share": (lambda: to_commands("continuous", 1, [[1.001]], 1), "is numbers from -1 to 1"),
    "an action of shares": (lambda: to_commands("pairs", 5, [1.0], 1), "are whole numbers of shape (1,)"),
    "a heading beyond": (lambda: HeadingTargets(1.1e6), "HeadingTargets.target must be"),
    "half a turn and more": (lambda: HeadingTargets(tolerance=3.2), "HeadingTargets.tolerance must be at most pi"),
    "an aim beyond": (lambda: RewardWeights(aim=1.01), "RewardWeights.aim must be from 0 to 1"),
    "a goal too far": (lambda: ObstTrap(distance=(0.45, 0.61)), "ObstTrap.distance must lie from 0.45 to 0.6"),
    "a goal too near": (lambda: ObstTrap(distance=(0.1, 0.5)), "ObstTrap.distance must lie from 0.45 to 0.6 m"),
    "no potential": (lambda: ObstTrap(potential="by air"), "ObstTrap.potential must be one of 'straight', 'geodesic'"),
    "prey too fast": (lambda: draw_course(RNG, (9.0, 10.0), (0.5, 1.0), 0.1, SLOW), "a robot could meet none"),
    "discs without end": (lambda: draw_discs(RNG, np.array([0.5, 0.0]), 3, 0.4), "none can be passed"),
    "frames without end": (lambda: SeastarSwimEnv(frames_per_stroke=1_000_001), "frames_per_stroke"),
}  # fmt: skip
"""What is refused, and words of the sentence."""


@pytest.mark.parametrize("case", REFUSED)
def test_what_nobody_could_use_is_refused_in_a_sentence(case):
    make, *words = REFUSED[case]
    with assert_refused(*words):
        make()


def test_what_is_just_allowed_is_taken():
    assert goals(np.zeros((3, 2)), np.zeros((3, 2))).tolist() == [0.0] * 3
    near = [[0.1 - 1e-9, 0.0], [0.1 + 1e-9, 0.0]]  # the radius of waypoints in limb lengths
    assert goals(near, np.zeros((2, 2))).tolist() == [0.0, -1.0]
    assert make_path([[FARTHEST, -FARTHEST]], np.random.default_rng(0)).tolist() == [[1e6, -1e6]]
    assert SwimOptions(waypoint_radius=FARTHEST).waypoint_radius == 1e6
    assert command_table("joint", 8).shape == (6561, 8) and command_table("pairs", 1).tolist() == [[0.0]]
    assert to_commands("continuous", 2, [[1.0, -1.0]], 1).tolist() == [[1.0, -1.0]]
    assert to_commands("pairs", 5, [20, 0], 2)[:, 4].tolist() == [1.0, 0.0]
    assert Uniform(1.0, 1.0).draw(np.random.default_rng(0)) == 1.0 and Normal(2.0, 0.0).bounds == (2.0, 2.0)
    assert HeadingTargets((1e6, -1e6)).target == (1e6, -1e6) and HeadingTargets(tolerance=np.pi).tolerance == np.pi
    assert RewardWeights(aim=1.0).aim == 1.0 and ObstTrap(distance=(0.45, 0.6)).distance == (0.45, 0.6)
    assert Symmetry(5, ((0, -1),), Layout(5, 1)).mirror == ((0, -1),)
    assert LIMBS.restore(np.ones((2, 5), int), [0, 9]).shape == (2, 5)
    assert checked_seeds([1, None], 2) == [1, None] and checked_seeds(3, 2) == [3, 4]
    assert checked_seeds(None, 2) == [None, None]
    assert checked_options(None, {"path"}) == {}
    one = SeastarSwimVectorEnv(1, 1, fidelity="fast")
    one.reset(seed=0)
    assert one.step(np.zeros((1, 5), int))[3].tolist() == [True]
    assert HeadingTargets((0.1, 0.2)).of_path(np.ones((2, 2)), np.random.default_rng(0)).tolist() == [0.1, 0.2]
    assert DomainRandomization({"limb_strengths": Uniform(0.0, 1.0)}).distributions
