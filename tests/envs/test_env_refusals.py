"""Helpers of environments refuse in a sentence what they could not use, and take what is just allowed."""

import copy
import importlib
import json
import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest

import seastar_gym.envs
from refusals import assert_refused
from seastar_gym import (
    Body,
    DomainRandomization,
    Limited,
    MeasuredCurve,
    Numerics,
    Scene,
    Seastar,
    Sight,
    SmaPulse,
    SmaWires,
    SymmetryReduction,
    Uniform,
)
from seastar_gym.envs.commands import choices, command_table
from seastar_gym.envs.goal import GoalForm
from seastar_gym.envs.headings import HeadingTargets
from seastar_gym.envs.layout import Layout
from seastar_gym.envs.paths import PATHS, make_path, register_path
from seastar_gym.envs.rendering import Frame, Renderer
from seastar_gym.envs.rewards import RewardWeights
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.sight import TEMPLATE, read_camera
from seastar_gym.envs.symmetry import Symmetry, VectorFrameStack, VectorSymmetryReduction, memory_mirror
from seastar_gym.envs.tasks.obst_trap import ObstTrap, draw_discs
from seastar_gym.envs.tasks.prey import Pursuit, draw_course
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.scene.serial import to_dict
from symmetries import symmetry_for

LIMBS, SHARES, JOINT = (Symmetry(5, (), Layout(5), mode) for mode in ("limbs", "continuous", "joint"))
ONE = np.zeros(1, int)
WIRES = memory_mirror(SmaWires())
NINE = Scene(Seastar(9), actuator=SmaPulse(0.1))
LEG = np.array([[0.1, 0.0]])
RNG, SLOW = np.random.default_rng(0), Pursuit(1e-3, 1e-3)


def goals(achieved, desired):
    """Rewards of goals."""
    env = GoalForm(gym.make("SeastarSwim-v0", fidelity="fast"))
    return env.compute_reward(achieved, desired, {})


def path(given):
    return make_path(given, RNG)


def drawn_of(name):
    """Values of a number of a robot with a body."""
    scene = Scene(Seastar(body=Body(radius=0.02, drag_coefficient=1.0)))
    return DomainRandomization({name: Uniform(0.1, 0.2)}).first_values(scene, 2)


def drawn_by(size=(480, 360), **changed):
    """Picture of a robot that rests."""
    pytest.importorskip("pygame")
    robot = Seastar(nodes_per_limb=10)
    shown = {"positions": robot.nodes(), "command": np.zeros(5), "trail": np.zeros((1, 2))} | changed
    return Renderer(robot, LEG, 0.01, size).draw(Frame(**shown, waypoint_index=0, time=0.0))


def swimmers(**options):
    """Two of them."""
    return SeastarSwimVectorEnv(2, fidelity="fast", threads=1, **options)


def drawing(name, low, high, **options):
    """Environment that draws a number for every episode."""
    return SeastarSwimEnv(**options, randomization=DomainRandomization({name: Uniform(low, high)}))


REFUSED = {
    "goals of two shapes": (lambda: goals(np.zeros((3, 2)), np.zeros(2)), "Goals must have one shape (..., 2)"),
    "goals of a cart": (lambda: GoalForm(gym.make("CartPole-v1")), "GoalForm needs an environment of waypoints"),
    "goals seen by a camera": (lambda: GoalForm(gym.make("SeastarSwim-v0", sight=Sight())), "which no camera knows"),
    "a range beyond floats": (lambda: Uniform(-1e308, 1e308), "high - low must be finite"),
    "a number as a draw": (lambda: DomainRandomization({"fluid.density": 3.0}), "fluid.density", "needs a Uniform"),
    "a misspelt draw": (lambda: drawing("limb_strength", 0.5, 1.0), "'limb_strength'", "limb_strengths"),
    "a draw of limbs": (lambda: drawing("robot.n_limbs", 3, 5), "robot.n_limbs", "same for all robots of a batch"),
    "a draw of lengths below zero": (lambda: drawing("robot.limb_length", -0.1, 0.2), "limb_length", "positive"),
    "a draw of peaks": (lambda: drawing("actuator.peak_angle", 0.1, 4.0), "peak angle", "4 rad"),
    "a draw of no current": (lambda: drawing("fluid.current.u_x", 0.1, 0.2), "fluid.current.u_x"),
    "strong limbs": (lambda: DomainRandomization({"limb_strengths": Uniform(0.5, 1.1)}), "drawn from 0 to 1"),
    "limbs that push back": (lambda: DomainRandomization({"limb_strengths": Uniform(-0.1, 1.0)}), "drawn from 0 to 1"),
    "a mirror beyond": (lambda: Symmetry(5, ((1, 1),), Layout(5, 1)), "mirror must be a tuple of pairs"),
    "a mirror before": (lambda: Symmetry(5, ((-1, 1),), Layout(5, 1)), "mirror must be a tuple of pairs"),
    "a mirror that doubles": (lambda: Symmetry(5, ((0, 2),), Layout(5, 1)), "mirror must be a tuple of pairs"),
    "another number of limbs": (lambda: Symmetry(4, (), Layout(5)), "A group of 4 limbs and a mirror of 0 numbers"),
    "another number of numbers": (lambda: Symmetry(5, (), Layout(5, 1)), "do not fit a layout of 5 limbs and 1"),
    "seen of wires alone": (lambda: symmetry_for(5, WIRES).reduce(np.zeros((1, 186))), "not that of a robot of 5"),
    "seen of headings": (lambda: symmetry_for(5, WIRES).reduce(np.zeros((1, 200))), "not that of a robot of 5 limbs"),
    "actions beyond": (lambda: JOINT.restore(np.array([243]), ONE), "an action is a whole number from 0 to 242"),
    "a reduced cart": (lambda: SymmetryReduction(gym.make("CartPole-v1").unwrapped), "SeastarSwim-v0", "CartPole"),
    "reduced carts": (
        lambda: VectorSymmetryReduction(gym.make_vec("CartPole-v1", 2, "sync")), "SeastarSwim-v0", "SyncVectorEnv",
    ),
    "a past of headings": (lambda: VectorFrameStack(swimmers(headings=HeadingTargets()), 2), "Asked headings have no"),
    "whole observations": (lambda: LIMBS.reduce(np.zeros((1, 186), int)), "Observations must be floats"),
    "elements above": (lambda: LIMBS.restore(np.zeros((1, 5), int), [10]), "elements must be whole numbers from 0"),
    "seeds that are too few": (lambda: swimmers().reset(seed=[1]), "seed must be one number or 2 of them, not 1"),
    "a table of limbs": (lambda: command_table("limbs", 5), "not a table of commands: use LIMB_COMMANDS"),
    "too many limbs": (lambda: command_table("joint", 9), "would have 3^9 = 19,683 actions for 9 limbs"),
    "an action for nine limbs": (lambda: SeastarSwimEnv(scene=NINE, actions="joint"), "19,683 actions"),
    "a table of shares": (lambda: command_table("continuous", 5), 'actions="continuous" has no finite number'),
    "choices of shares": (lambda: choices("continuous", 5), 'actions="continuous" has no finite number of actions'),
    "a goal too far": (lambda: ObstTrap(distance=(0.45, 0.61)), "ObstTrap.distance must lie from 0.45 to 0.6"),
    "no potential": (lambda: ObstTrap(potential="by air"), "ObstTrap.potential must be one of 'straight', 'geodesic'"),
    "prey too fast": (lambda: draw_course(RNG, (9.0, 10.0), (0.5, 1.0), 0.1, SLOW), "a robot could meet none"),
    "discs without end": (lambda: draw_discs(RNG, np.array([0.5, 0.0]), 3, 0.4), "none can be passed"),
    "a camera that may foresee": (lambda: Sight(delay=Uniform(-0.1, 0.1)), "Sight.delay"),
    "a path that stays": (lambda: path([[0.0, 0.0]]), "must lead away from the origin"),
    "a path beyond": (lambda: path([[0.0, -1.1e6]]), "within"),
    "one name for two paths": (lambda: register_path("line")(lambda rng: LEG), "a path of the name 'line' already"),
    "a body's drag that is not": (lambda: drawn_of("robot.body.drag_along"), "number 'robot.body.drag_along' to draw",
                                  ", since it leaves that out (None): give it a value there."),
    "a body's radius": (lambda: drawn_of("robot.body.radius"), "'robot.body.radius'", "same for all robots of a"),
    "a colour": (lambda: drawn_of("robot.colour"), "has no number 'robot.colour' to draw: it has ", "fluid.density"),
    "a window of a batch": (lambda: SeastarSwimVectorEnv(2, render_mode="human"), 'draws with render_mode="rgb_array"'),
    "no mode of a task": (lambda: SeastarSwimEnv(task="prey", render_mode="film"), "render_mode"),
    "films of tasks": (lambda: gym.make_vec("SeastarPrey-v0", render_mode="film"), "The batch draws"),
    "no task": (lambda: SeastarSwimEnv(task="swim"), "one of 'miswired', 'prey', 'fast-prey', 'station'"),
    "a task in plain": (lambda: SeastarSwimEnv(task={"kind": "Prey"}), "a dict with a version"),
    "a path of a task": (lambda: SeastarSwimEnv([[0.1, 0.0]], task="prey"), "path belongs to swims along a path"),
    "a split of paths": (lambda: SeastarSwimEnv(split="test"), "other paths are no draws"),
    "two draws": (lambda: drawing("fluid.drag_coefficient", 0.5, 1.0, task="fail-blind"), "leave out randomization"),
    "no split": (lambda: SeastarSwimVectorEnv(task="prey", split="validation"), "split must be one of 'train', 'test'"),
    "pictures too small": (lambda: drawn_by(size=(100, 100)), "at least 320 x 240 pixels, not 100 x 100"),
    "a node that is missing": (lambda: drawn_by(positions=np.zeros((45, 2))), "must be finite and of shape (46, 2)"),
    "a command of four": (lambda: drawn_by(command=np.zeros(4)), "must have shape (5,), not (4,)"),
    "an endless trail": (lambda: drawn_by(trail=np.full((3, 2), np.inf)), "must be finite and of shape (k, 2)"),
}  # fmt: skip
"""What is refused, and words of the sentence."""


def test_what_nobody_could_use_is_refused_in_a_sentence(subtests):
    for case, (make, *words) in REFUSED.items():
        with subtests.test(case), assert_refused(*words):
            make()


SCENE = Scene(Seastar(nodes_per_limb=4), actuator=SmaPulse(0.5), numerics=Numerics.preset("fast"))
CURVE = MeasuredCurve((0.0, 0.5, 1.0), (0.0, 0.3, 0.0))
CORNERS = [[0.05, 0.0], [0.05, 0.05], [0.0, 0.0]]
SEEN = {"decision_period": 0.5, "sight": Sight()}


def draws(name, low=0.0, high=1.0):
    return {"randomization": DomainRandomization({name: Uniform(low, high)})}


ARGUMENTS = [
    ({"path": "hexagon"}, "hexagon"), ({"waypoint_radius": 1e300}, "waypoint_radius"),
    ({"scene": Scene(Seastar(hub_hinge="turning", discretisation="chapter"))}, "turning"),
    ({"scene": Scene(Seastar(hub_hinge="turning", discretisation="chapter"), actuator=SmaPulse(0.3)),
      **draws("actuator.peak_angle", 0.3, np.pi / 5.0)}, "close a hub hinge"),
    ({"scene": Scene(numerics=Numerics()), "fidelity": "fast"}, "Numerics()", "give one of them"),
    ({"scene": {}}, "plain Scene is a dict with a version"),
    ({"scene": to_dict(RewardWeights())}, "plain RewardWeights, not a Scene"),
    ({"scene": {**SCENE.to_dict(), "version": 2}}, "version 2"),
    ({"reward": {"progress": 1.0}}, "plain RewardWeights is a dict with a version"),
    ({"randomization": {"robot.density": [900, 1000]}}, "plain DomainRandomization is a dict with a version"),
    ({"headings": "along"}, "eading"), ({"headings": {"kind": "HeadingTargets"}}, "eading"),
    ({"headings": HeadingTargets((0.1, 0.2))}, "2 angles", "5 waypoint"),
    ({"path": [[0.1, 0.0], [0.1, 0.0], [0.2, 0.0]], "headings": HeadingTargets()}, "leg to waypoint 2"),
    ({"action_delay": Sight()}, "action_delay"), ({**draws("sight.delay"), "decision_period": 0.5}, "sight.delay"),
    ({**draws("sight.rate"), **SEEN}, "sight.rate"), ({**draws("sight.delay", 0.0, 9.0), **SEEN}, "at most 5 s"),
    ({**draws("action_delay", -1.0), **SEEN}, "action_delay"),
    *(({"action_delay": 0.1, "scene": scene}, "action_delay", "whole decisions of 1 s", "SmaWires")
      for scene in (None, Scene(actuator=SmaPulse()))),
    *(({"decision_period": 0.5, "scene": Scene(actuator=each)}, "decision_period", type(each).__name__, "SmaWires")
      for each in (SmaPulse(), CURVE, Limited(SmaPulse(), 0.3))),
]  # fmt: skip
"""Arguments of an environment, and words of the sentence that refuses them."""


@pytest.mark.parametrize("make", [SeastarSwimEnv, SeastarSwimVectorEnv])
def test_arguments_that_mean_nothing_are_refused(make, subtests):
    for arguments, *words in ARGUMENTS:
        with subtests.test(**arguments), assert_refused(*words):
            make(**arguments)


def resets():
    """Environments, options of a reset, and words of the sentence that refuses them."""
    one, batch = SeastarSwimEnv(fidelity="fast"), SeastarSwimVectorEnv(3, fidelity="fast")
    asked = {"path": CORNERS, "headings": HeadingTargets((0.1, 0.2, 0.3)), "fidelity": "fast"}
    for env in (one, batch):
        yield env, {"heading": 1.0}, "Unknown reset option(s)"
        yield env, {"path": "hexagon"}, "hexagon"
        yield env, {"path": [[np.nan, 0]]}, "finite"
    for wrong in ([1, 0, 0], [[True], [True, False]], "True", np.array([True]), np.zeros(3, bool)):
        yield batch, {"reset_mask": wrong}, "reset_mask"
    for env in (SeastarSwimEnv(**asked), SeastarSwimVectorEnv(**asked)):
        yield env, {"path": "pentagon"}, "3 angles", "5 waypoint"
    task = SeastarSwimEnv(actions="pairs", task="prey", fidelity="fast", split="test")
    for number in (-1, 1000, 1.0, True, [1, 2, 3], "one"):
        yield task, {"instance": number}, "instance must be a whole number from 0 to 999"
    yield task, {"path": "line"}, "Unknown reset option"


def test_resets_that_mean_nothing_are_refused_and_the_episode_goes_on():
    for env, options, *words in resets():
        env.reset(seed=0)
        good = env.action_space.sample()
        env.step(good)
        twin = copy.deepcopy(env)
        with assert_refused(*words):
            env.reset(options=options)
        for one, other in zip(env.step(good)[:4], twin.step(good)[:4], strict=True):
            np.testing.assert_array_equal(one, other)
    with pytest.raises(gym.error.ResetNeeded, match="first reset"):
        SeastarSwimVectorEnv(3, fidelity="fast").reset(options={"reset_mask": np.array([True, False, True])})


REFUSED_FIRST = """
import gymnasium as gym, numpy as np, seastar_gym
for id in [id for id in gym.registry if id.startswith("Seastar")]:
    for make in (gym.make, gym.make_vec):
        env, other = (make(id, fidelity="fast") for _ in range(2))
        for refused in ({"seed": -1}, {"seed": "1"}, {"options": {"no": 1}}, {"options": [1]},
                        {"options": {env.unwrapped.task.option: [[np.nan, 0.0]]}}):
            try:
                env.reset(**refused)
            except ValueError as sentence:
                assert str(sentence).endswith("."), sentence
            else:
                raise AssertionError((id, refused))
            try:
                env.step(env.action_space.sample())
            except gym.error.ResetNeeded:
                pass
        action = env.action_space.sample()
        for one in (env, other):
            one.reset(seed=0)
        for _ in range(2):
            np.testing.assert_array_equal(env.step(action)[0], other.step(action)[0])
"""


def test_resets_that_are_refused_before_the_first_success_cost_nothing():
    """By `gym.make` and `gym.make_vec`, of every id, in a process of its own."""
    done = subprocess.run([sys.executable, "-c", REFUSED_FIRST], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    "text, words",
    [
        (None, "There is no camera in"),
        ("{", "is no JSON that can be read"),
        ("[30]", "it must be such as"),
        ('{"fps": 30}', "'fps'"),
        ('{"action_dely": 0.1}', "sees, action_delay"),
        ('{"rate": -30}', "Sight.rate must be"),
        ('{"delay": {"kind": "Uniform", "low": 0.1}}', "'high'"),
        ('{"action_delay": 99}', "action_delay must be at most"),
        ('{"kind": "SmaWires"}', "not a Sight"),
    ],
)
def test_a_file_that_is_no_camera_is_refused_in_a_sentence(text, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    if text is not None:
        (tmp_path / "camera.json").write_text(text)
    with pytest.raises((ValueError, FileNotFoundError), match=r"^[^\n]*camera\.json[^\n]*\.$") as refused:
        read_camera("camera.json")
    assert words in str(refused.value)


def test_a_camera_is_read_from_the_template_and_from_what_a_sight_is_written_as(tmp_path):
    file = tmp_path / "camera.json"
    file.write_text(TEMPLATE)
    camera = read_camera(file)
    assert camera.sight.delay == Uniform(0.05, 0.15) and camera.action_delay == 0.0
    file.write_text(json.dumps(to_dict(camera.sight) | {"action_delay": {"kind": "Uniform", "low": 0.0, "high": 0.1}}))
    assert read_camera(file) == camera._replace(action_delay=Uniform(0.0, 0.1))


def test_modules_and_names_of_paths_are_registered_again_without_a_word(recwarn):
    """As a notebook does that loads modules or runs its cells again."""
    registered = dict(gym.registry)
    for module in (seastar_gym.envs, seastar_gym):
        importlib.reload(module)
    assert not recwarn and gym.registry == registered

    def zigzag(rng):
        return LEG

    try:
        register_path("zigzag")(zigzag)
        register_path("zigzag")(type(zigzag)(zigzag.__code__, globals(), "zigzag"))
        with assert_refused("zigzag"):
            register_path("zigzag")(path)
    finally:
        PATHS.pop("zigzag", None)
