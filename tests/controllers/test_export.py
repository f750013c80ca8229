"""Exported policies see, decide and remember as those of Python do."""

import ctypes
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from refusals import assert_refused
from seastar_gym import Body, Limb, Numerics, Scene, Seastar, SmaWires
from seastar_gym.cli.export import load_policy
from seastar_gym.controllers import learned
from seastar_gym.controllers.description import Description
from seastar_gym.controllers.export import CODE, to_c, to_onnx
from seastar_gym.controllers.learned import LearnedPolicy
from seastar_gym.envs.commands import to_commands
from seastar_gym.envs.layout import VELOCITY_SCALE, Layout
from seastar_gym.envs.stations import heading_of

ROOT = Path(__file__).resolve().parents[2]
N_SWUM, N_DRAWN = 1500, 1500
ROBOTS = 50
CARRIED = 3e-7
"""Error of turned and mirrored numbers over the largest."""
ROUNDING = 1.5e-6
"""Error of logits over the largest: sums of some hundred numbers, each rounded to 6e-8, in another order."""
TASKS = {"learned": "SeastarSwim-v0", "timed-0.2s": "SeastarSwim-v0", "fail-blind": "SeastarFailBlind-v0",
         "miswired-0.5s": "SeastarMiswiredTimed-v0", "fast-prizes-0.5s": "SeastarPrizesTimed-v0"}  # fmt: skip
"""Policies of every kind, with memory and without, with limbs and without, and ids of what they swim."""
QUICK = ("learned", "miswired-0.5s")
SWUM = [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in TASKS]
"""Policies that swim, those that are not quick with --slow only."""

ON_A_BODY = Description("pairs", True, Scene(Seastar(nodes_per_limb=4, body=Body.rectangle(0.03, 0.03))), (4,))

needs_compiler = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler cc")


def random_policy(description: Description, seed: int = 0) -> LearnedPolicy:
    """Policy with random weights."""
    rng = np.random.default_rng(seed)
    shapes = description.shapes().items()
    weights = {name: (rng.normal(size=shape) / np.sqrt(shape[-1])).astype(np.float32) for name, shape in shapes}
    return LearnedPolicy(description, weights)


def four(*lengths: float) -> Seastar:
    """Robot of four limbs of these lengths [m]."""
    return Seastar(4, 5, limbs=tuple(Limb(length=length) for length in lengths), discretisation="continuum")


OWN = {
    "limbs": Description("limbs", True, Scene(actuator=SmaWires()), (16,)),
    "no-symmetry": Description("pairs", False, Scene(), (16, 8)),
    "no-symmetry-with-memory": Description("pairs", False, Scene(four(0.12, 0.1, 0.11, 0.09)), (8,), past=2),
    "three-limbs": Description("limbs", True, Scene(Seastar(n_limbs=3, nodes_per_limb=4)), (8,), past=2),
    "two-long-limbs-opposite": Description("joint", True, Scene(four(0.12, 0.1, 0.12, 0.1)), ()),
    "two-long-limbs-adjacent": Description("pairs", True, Scene(four(0.12, 0.12, 0.1, 0.1)), (16,), past=1),
    "limbs-all-unlike": Description("limbs", True, Scene(four(0.12, 0.1, 0.11, 0.09)), (16,)),
}
"""Kinds that are not bundled: no symmetry, half a turn and a mirror, a mirror not along limb 1, no hidden layers."""


def policy_of(name: str) -> LearnedPolicy:
    return random_policy(OWN[name]) if name in OWN else load_policy(name)


def built(folder: Path, policy: str, main: str, *flags: str) -> str:
    """File of what the compiler makes of C that includes that of a policy."""
    (folder / "policy.c").write_text(policy)
    (folder / "main.c").write_text(main)
    strict = "-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic"
    subprocess.run(["cc", *strict, *flags, str(folder / "main.c"), "-o", str(folder / "made"), "-lm"], check=True)
    return str(folder / "made")


class Compiled:
    """Functions of an exported policy, compiled as a shared library; robots have their own memory each."""

    def __init__(self, policy: LearnedPolicy, folder, points: int | None = None):
        text = to_c(policy, "tested", points)
        self._c, self.policy = ctypes.CDLL(built(folder, text, text, "-O2", "-shared", "-fPIC")), policy
        self.defined = {name: int(number) for name, number in re.findall(r"#define SEASTAR_(\w+) (\d+)$", text, re.M)}
        past = max(1, self.defined["PAST"]) * self.defined["SIZE"]
        self._robot = type("Robot", (ctypes.Structure,), {"_fields_": [("begun", ctypes.c_int),
                                                                      ("past", ctypes.c_float * past)]})  # fmt: skip

    def robots(self, n: int) -> list:
        """Robots at the beginning of an episode."""
        robots = [self._robot() for _ in range(n)]
        for robot in robots:
            robot.begun = 1
            self.begin(robot)
        return robots

    def begin(self, robot) -> None:
        self._c.seastar_begin(ctypes.byref(robot))

    def remember(self, robot, past: np.ndarray) -> None:
        """Give a robot past observations, shape (past, size)."""
        robot.begun = 1
        robot.past[:] = past.ravel().tolist()

    def seen(self, robot, observation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Input of the network, and its logits."""
        shown = np.zeros(self.defined["INPUTS"], np.float32)
        logits = np.zeros(self.defined["OUTPUTS"], np.float32)
        self._c.seastar_input(ctypes.byref(robot), _float(observation), _float(shown))
        self._c.seastar_logits(_float(shown), _float(logits))
        return shown, logits

    def act(self, robot, observation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Action and commands."""
        action = np.zeros(self.defined["NUMBERS"], np.int32)
        commands = np.full(self.defined["LIMBS"], np.nan, np.float32)
        to_action = action.ctypes.data_as(ctypes.POINTER(ctypes.c_int))
        self._c.seastar_act(ctypes.byref(robot), _float(observation), to_action, _float(commands))
        return action, commands

    def observe(self, *arguments: np.ndarray | float | None) -> np.ndarray:
        """Observation from positions and velocities, or from a history, its length and an interval."""
        out = np.zeros(self.defined["SIZE"], np.float32)
        moving = isinstance(arguments[1], np.ndarray)
        function = self._c.seastar_observe_moving if moving else self._c.seastar_observe
        function(*map(_argument, arguments), _float(out))
        return out

    def observe_pose(self, *arguments: np.ndarray) -> np.ndarray:
        """Observation from a pose."""
        out = np.zeros(self.defined["SIZE"], np.float32)
        self._c.seastar_observe_pose(*map(_argument, arguments), _float(out))
        return out


def _float(array: np.ndarray):
    assert array.dtype == np.float32 and array.flags.c_contiguous
    return array.ctypes.data_as(ctypes.POINTER(ctypes.c_float))


def _argument(value: np.ndarray | float | None):
    """Positions, a length of time or a count as C takes it."""
    if not isinstance(value, np.ndarray):
        return ctypes.c_double(value) if isinstance(value, float) else value
    assert value.dtype == np.float64 and value.flags.c_contiguous
    return value.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


def environment(name: str, policy: LearnedPolicy, n: int = ROBOTS):
    """Batch of environments of a policy."""
    task, scene = TASKS[name], replace(policy.scene, numerics=Numerics.preset("fast"))
    arguments = {"scene": scene, "decision_period": policy.decision_period, "path": "random", "random_heading": True,
                 "actions": policy.actions} if task == "SeastarSwim-v0" else {"fidelity": "fast"}  # fmt: skip
    return gym.make_vec(task, n, vectorization_mode="vector_entry_point", threads=1, **arguments)


def input_of(policy: LearnedPolicy, observations: np.ndarray, past: np.ndarray | None) -> np.ndarray:
    """What the network of Python sees, shape (n, inputs)."""
    if policy.frame_stack is not None:
        return policy.frame_stack.stacked(observations, past)[0]
    return observations if policy.reduction is None else policy.reduction.reduce(observations)[0]


def random_observations(policy: LearnedPolicy, n: int, seed: int = 0) -> np.ndarray:
    """Observations of nowhere, some with waypoints on the boundaries of sectors, or at the hub."""
    rng, size = np.random.default_rng(seed), policy.description.observation_size
    observations = rng.normal(size=(n, size)).astype(np.float32)
    angle = np.pi / policy.scene.robot.n_limbs * rng.integers(0, 10, n // 5)
    observations[: n // 5, -4:-2] = 2.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    observations[: n // 10, -2:] = observations[: n // 10, -4:-2]
    observations[:3, -4:-2] = 0.0
    return observations


def random_past(policy: LearnedPolicy, observations: np.ndarray, seed: int = 1):
    """What robots may remember, shape (n, past, size), and the state that holds it; None without memory."""
    if policy.frame_stack is None:
        return None, None
    shape = len(observations), policy.description.past, observations.shape[1]
    past = np.random.default_rng(seed).normal(size=shape).astype(np.float32)
    return past, (past,)


def check(compiled: Compiled, robots: list, observations: np.ndarray, past, chosen: np.ndarray) -> int:
    """Assert that C sees, by what robots remember, and does as Python does; how many decisions rounding may change."""
    policy, n_limbs = compiled.policy, compiled.policy.scene.robot.n_limbs
    expected = input_of(policy, observations, past)
    each = zip(robots, observations, strict=True)
    done = [(*compiled.seen(*one), *compiled.act(*one)) for one in each]
    seen, logits, actions, commands = map(np.array, zip(*done, strict=True))
    assert (np.abs(seen - expected) <= CARRIED * np.abs(expected).max(axis=1, keepdims=True)).all()
    close = require_rounding(policy, expected, logits.reshape(len(logits), *policy.description.distributions))
    np.testing.assert_array_equal(actions[~close], chosen.reshape(actions.shape)[~close])
    meant = to_commands(policy.actions, n_limbs, actions.reshape(chosen.shape), len(chosen))
    np.testing.assert_array_equal(commands, meant)
    return int(close.sum())


def require_rounding(policy: LearnedPolicy, shown: np.ndarray, logits: np.ndarray) -> np.ndarray:
    """Assert that logits are those of numpy but for rounding; returns where it could change an action, shape (n,)."""
    expected = policy.logits(shown)
    error = ROUNDING * np.abs(expected).max()
    assert np.abs(logits - expected).max() <= error
    first, second = np.sort(expected, axis=2)[..., :-3:-1].transpose(2, 0, 1)
    return (first - second <= 2.0 * error).any(axis=1)


@needs_compiler
@pytest.mark.parametrize("name", SWUM)
def test_c_decides_as_numpy_does_in_swims(name, tmp_path):
    """The policy swims, and C sees, remembers and decides the same, over 5,000 observations."""
    policy = policy_of(name)
    compiled, env = Compiled(policy, tmp_path), environment(name, policy)
    begun, ended, state, close = np.ones(ROBOTS, bool), np.zeros(ROBOTS, bool), None, 0
    robots, (observations, _) = compiled.robots(ROBOTS), env.reset(seed=0)
    for _ in range(N_SWUM // ROBOTS):
        past = None
        if policy.frame_stack is not None:
            at_first = np.repeat(observations[:, None], policy.description.past, axis=1)
            past = at_first if state is None else np.where(begun[:, None, None], at_first, state[0])
        for robot in np.flatnonzero(begun):
            compiled.begin(robots[robot])
        chosen, state = policy.predict(observations, state, begun, deterministic=True)
        close += check(compiled, robots, observations, past, chosen)
        observations, _, terminated, truncated, _ = env.step(chosen)
        begun, ended = ended, terminated | truncated  # the next episode begins a step after the end of the last
    assert close < 0.002 * N_SWUM


@needs_compiler
@pytest.mark.parametrize("name", [*TASKS, *OWN])
def test_c_decides_as_numpy_does_for_random_observations(name, tmp_path):
    """Over 5,000, whatever robots remember, and with waypoints on the boundaries of sectors."""
    policy = policy_of(name)
    compiled, observations = Compiled(policy, tmp_path), random_observations(policy, N_DRAWN)
    robots, (past, state) = compiled.robots(N_DRAWN), random_past(policy, observations)
    for robot, before in zip(robots, () if past is None else past, strict=past is not None):
        compiled.remember(robot, before)
    chosen, later = policy.predict(observations, state, deterministic=True)
    assert check(compiled, robots, observations, past, chosen) < 0.002 * N_DRAWN
    if past is not None:
        np.testing.assert_array_equal(np.array(robots[7].past).reshape(past.shape[1:]), later[0][7])


PROGRAM = Path(__file__).with_name("commands.c")
SANITISERS = "-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all"
ODD = np.array([np.nan, np.inf, -np.inf, 3.4e38, -1e31, 1e30, 1e20, 1e-45, -1e-40, 0.0], np.float32)


def odd_observations(policy: LearnedPolicy, n: int):
    """Observations, and what robots remember, of which most have numbers that cannot be, or hardly."""
    observations, rng = random_observations(policy, n), np.random.default_rng(2)
    past, _ = random_past(policy, observations)
    for array in (observations,) if past is None else (observations, past):
        odd = rng.random(array.shape) < rng.choice([0.0, 0.003, 0.3, 1.0], (n, *[1] * (array.ndim - 1)))
        odd[n // 2 :, ..., :-4] = False  # the waypoints alone
        array[odd] = rng.choice(ODD, odd.sum())
        array[n // 2 :, ..., -4:] = rng.choice(ODD, array[n // 2 :, ..., -4:].shape)
    return observations, past


def commands_and_margins(policy: LearnedPolicy, observations: np.ndarray, past: np.ndarray | None):
    """What Python commands, shape (n, n_limbs), and whether rounding could not change it, shape (n,)."""
    every = observations[:, None] if past is None else np.concatenate([observations[:, None], past], axis=1)
    known = (np.abs(every) <= 1e30).all(axis=(1, 2))
    chosen, _ = policy.predict(observations, None if past is None else (past,), deterministic=True)
    commands = to_commands(policy.actions, policy.scene.robot.n_limbs, chosen, len(chosen))
    assert known.any() and not known.all() and not commands[~known].any() and commands[known].any()
    logits = policy.logits(input_of(policy, *(None if a is None else a[known] for a in (observations, past))))
    first, second = np.sort(logits, axis=2)[..., :-3:-1].transpose(2, 0, 1)
    sure = np.ones(len(known), bool)
    sure[known] = (first - second > 1e-4 * np.abs(logits).max(axis=2)).all(axis=1)
    return commands, sure


@needs_compiler
@pytest.mark.parametrize("name", [*TASKS, *OWN])
def test_c_rests_as_numpy_does_by_what_cannot_be_and_no_sanitiser_finds_anything(name, tmp_path):
    policy = policy_of(name)
    program = built(tmp_path, to_c(policy, name), PROGRAM.read_text(encoding="utf-8"), "-O1", *SANITISERS)
    observations, past = odd_observations(policy, 2000)
    rows = [observations] if past is None else [observations, past.reshape(2000, -1)]
    done = subprocess.run([program], input=np.concatenate(rows, axis=1).tobytes(), capture_output=True)
    assert done.returncode == 0, done.stderr.decode()
    commands, sure = commands_and_margins(policy, observations, past)
    found = np.array(done.stdout.split(), float).reshape(commands.shape)
    np.testing.assert_array_equal(found[sure], commands[sure])
    assert sure.mean() > 0.9


@needs_compiler
@pytest.mark.parametrize("name", ["learned", "timed-0.2s", "miswired-0.5s"])
def test_c_sees_what_the_environment_shows(name, tmp_path):
    """From positions and velocities, to float32's rounding; from a short history, to the error of differences."""
    policy, layout = policy_of(name), policy_of(name).description.layout
    env = environment(name, policy, 4)
    inner = env.unwrapped
    compiled = Compiled(policy, tmp_path, inner.scene.robot.nodes_per_limb)
    env.reset(seed=3)
    env.action_space.seed(0)
    for _ in range(3):
        observations = env.step(env.action_space.sample())[0]
    simulator, targets = inner.simulator, inner.task.targets(inner._robots)
    x, v = simulator.positions, simulator.velocities
    for robot, expected in enumerate(observations):
        limbs = expected[layout.actuators].astype(float) if layout.of_limb else None
        rest = limbs, None, np.ascontiguousarray(targets[robot])
        found = compiled.observe(x[robot], v[robot], *rest)
        np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6)
        history = np.stack([x[robot], x[robot] - 1e-3 * v[robot], x[robot] - 2e-3 * v[robot]])
        for n in (2, 3):
            np.testing.assert_allclose(compiled.observe(history, n, 1e-3, *rest), expected, rtol=1e-5, atol=1e-5)
        still = compiled.observe(history, 1, 1e-3, *rest)
        assert (still[layout.velocities] == 0.0).all() and (still[layout.hub_velocity] == 0.0).all()


@needs_compiler
def test_a_policy_that_does_not_see_its_limbs_needs_a_pose_alone(tmp_path):
    policy, env = policy_of("fail-blind"), environment("fail-blind", policy_of("fail-blind"), 4)
    inner, layout = env.unwrapped, policy.description.layout
    compiled = Compiled(policy, tmp_path)
    env.reset(seed=3)
    env.action_space.seed(0)
    for _ in range(3):
        observations = env.step(env.action_space.sample())[0]
    simulator, targets = inner.simulator, inner.task.targets(inner._robots)
    poses = np.column_stack([simulator.hub_position(), heading_of(simulator)])
    for pose, target, expected in zip(poses, targets, observations, strict=True):
        limbs, further = expected[layout.actuators].astype(float), expected[layout.further].astype(float)
        found = compiled.observe_pose(pose, limbs, further, np.ascontiguousarray(target))
        np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6)


@needs_compiler
def test_fewer_points_may_be_tracked_and_velocities_of_three_pictures_are_of_second_order(tmp_path):
    """With the hub and two points of every limb, a straight robot is seen as with all nodes."""
    policy = policy_of("learned")
    full = Compiled(policy, tmp_path)
    (tmp_path / "few").mkdir()
    few = Compiled(policy, tmp_path / "few", points=3)
    robot, targets = policy.scene.robot, np.array([[0.1, 0.2], [0.3, 0.1]])
    nodes, some = (replace(robot, nodes_per_limb=n).nodes() for n in (robot.nodes_per_limb, 3))
    expected, found = (each.observe(at, 0.0 * at, None, None, targets) for each, at in ((full, nodes), (few, some)))
    np.testing.assert_allclose(found, expected, atol=1e-6)
    assert few.defined["POINTS"] == 11
    history = np.stack([nodes + [0.01 * (1.0 - 0.1 * k) ** 2, 0.0] for k in range(3)])  # which speeds up as t^2
    for n, speed in ((3, 0.02), (2, 0.019)):
        velocity = full.observe(history, n, 0.1, None, None, targets)[Layout().hub_velocity]
        np.testing.assert_allclose(VELOCITY_SCALE * velocity, [speed, 0.0], atol=1e-8)


@needs_compiler
def test_the_program_of_the_page_runs(tmp_path):
    (main,) = re.findall(r"```c\n(.*?)```", (ROOT / "docs" / "controllers.md").read_text(encoding="utf-8"), re.S)
    program = built(tmp_path, to_c(policy_of("timed-0.2s"), "timed-0.2s", 3), main)
    done = subprocess.run([program], check=True, capture_output=True, text=True)
    commands = [float(word) for word in done.stdout.split()]
    assert len(commands) == 5 and set(commands) <= {-1.0, 0.0, 1.0}


def test_every_policy_in_the_box_is_exported_to_c_that_allocates_and_keeps_nothing():
    for name in learned.by_name():
        assert "seastar_act" in to_c(load_policy(name), name)
    text = to_c(policy_of("timed-0.2s"), "*/ int x; /*\nname")
    assert "alloc(" not in text and "*/ int x" not in text
    kept = [line for line in text.splitlines() if line.startswith("static") and "(" not in line]
    assert kept and all(line.startswith("static const") for line in kept)
    assert all("(" in line for line in CODE.read_text(encoding="utf-8").splitlines() if "static" in line)
    with assert_refused("cannot be exported to C, only to ONNX"):
        to_c(random_policy(ON_A_BODY), "body")
    for points in (1, 1001, 2.5):
        with assert_refused("points per limb must be a whole number from 2 to 1000"):
            to_c(policy_of("learned"), "learned", points)


@pytest.mark.parametrize("name", [*TASKS, *OWN])
def test_onnx_decides_as_numpy_does(name):
    """Over 10,000 random observations, and some on the boundaries of sectors."""
    pytest.importorskip("onnx", reason="onnx is not installed (extra export)")
    runtime = pytest.importorskip("onnxruntime", reason="onnxruntime is not installed (extra export)")
    policy = policy_of(name)
    session = runtime.InferenceSession(to_onnx(policy, name), providers=["CPUExecutionProvider"])
    names, close = [output.name for output in session.get_outputs()], 0
    for seed in range(10):
        observations = random_observations(policy, 1000, seed)
        past, state = random_past(policy, observations, seed)
        given = {"observation": observations} | ({} if past is None else {"past": past})
        found = dict(zip(names, session.run(None, given), strict=True))
        chosen, later = policy.predict(observations, state, deterministic=True)
        near = require_rounding(policy, input_of(policy, observations, past), found["logits"])
        np.testing.assert_array_equal(found["action"][~near], chosen[~near])
        close += int(near.sum())
        n_limbs = policy.scene.robot.n_limbs
        np.testing.assert_array_equal(found["commands"], to_commands(policy.actions, n_limbs, found["action"], 1000))
        if past is not None:
            np.testing.assert_array_equal(found["later"], later[0])
    assert close < 20 and len(to_onnx(random_policy(ON_A_BODY), "body")) > 1000
    observations, past = odd_observations(policy, 2000)
    commands, sure = commands_and_margins(policy, observations, past)
    found = session.run(["commands"], {"observation": observations} | ({} if past is None else {"past": past}))[0]
    np.testing.assert_array_equal(found[sure], commands[sure])
