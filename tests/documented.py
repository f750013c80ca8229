"""What the reference documents outside the top level, each with arguments that it accepts."""

# ruff: noqa: C408 - what is given reads as a call
import re
import tempfile
from collections.abc import Callable, Iterator
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from seastar_gym import Numerics, Scene, Sight, Simulator, SmaWires
from seastar_gym.controllers.learned import bundled_file
from symmetries import symmetry_for

PAGE = Path(__file__).parents[1] / "docs" / "reference.md"
NAMES = re.compile(r"^<!-- site: names (\S+) (.*) -->$", re.MULTILINE)

FAST = Scene(numerics=Numerics.preset("fast"))
WIRES = Scene(actuator=SmaWires(), numerics=Numerics.preset("fast"))
PATH = np.array([[0.03, 0.0]])
MOTIVE = (
    "Format Version,1.23,Length Units,Meters\n,Type,Marker,Marker,Marker\n,Name,a,a,a\n,,Position,Position,Position\n"
    "Frame,Time (Seconds),X,Y,Z\n0,0,1,2,3\n"
)
MADE_BY_THE_PACKAGE = {
    "Setting", "Episode", "Episodes", "Estimate", "Outcome", "Score", "Swim", "Progress",
    "Actuator", "ActuatorBase", "Executor", "Policy", "Challenge", "Numbered", "Swimming",
    "Plant", "PlantError", "Sighting", "Derivatives", "Motion", "Gradient", "Record",
}  # fmt: skip
"""Records that functions return, protocols, and bases of classes of one's own."""
UNCALLED = {*MADE_BY_THE_PACKAGE, "Here", "RayTasks", "SlurmArrays", "chapters_certificate",
            "LinePlant", "open_serial", "serve"}  # fmt: skip
"""What takes no arguments, or needs Ray, submitit or a serial line, is not called either."""


def documented() -> dict[str, str]:
    """Modules of the documented names."""
    return {name: module for module, names in NAMES.findall(PAGE.read_text("utf-8")) for name in names.split()}


def named(name: str) -> Any:
    """What is documented by this name."""
    return getattr(import_module(documented()[name]), name)


def of_work(swim: Any) -> Any:
    """Work of a swim, and its slopes."""
    return swim.work.sum(), {"work": np.ones_like(swim.work)}


@cache
def env() -> Any:
    return gym.make("SeastarSwim-v0", scene=FAST, path=PATH, actions="pairs").unwrapped


def batch(mode: str = "NextStep", **more: Any) -> Any:
    return gym.make_vec("SeastarSwim-v0", 2, vectorization_mode="vector_entry_point", scene=FAST, path=PATH,
                        autoreset_mode=mode, threads=1, **more)  # fmt: skip


@cache
def observations() -> Any:
    return batch().reset(seed=0)[0]


@cache
def straight() -> Any:
    return named("scripted")("straight")


@cache
def learned() -> Any:
    return named("load")()


@cache
def measurement() -> Any:
    return named("synthetic")(FAST, {}, 1)


@cache
def training() -> Any:
    return named("Hyperparameters")(num_envs=2, rollout=2, batch_size=4, hidden=(4,))


@cache
def training_env() -> Any:
    return named("make_training_env")(training(), PATH, False, scene=FAST, threads=1)


@cache
def of_batch(name: str, mode: str = "NextStep") -> Any:
    """A wrapper of a batch after its reset."""
    more = {"past": 1} if name == "VectorFrameStack" else {}
    made = named(name)(batch(mode, actions="pairs"), **more)
    made.reset()
    return made


@cache
def goal_form() -> Any:
    made = named("GoalForm")(env())
    made.reset()
    return made


def folder() -> Path:
    return Path(tempfile.mkdtemp())


def tracked(text: str) -> Path:
    """File of a tracker."""
    file = folder() / "track.csv"
    file.write_text(text)
    return file


def filmed(file: Any, fps: Any) -> None:
    with named("film")(file, fps) as add:
        add(np.zeros((4, 4, 3), np.uint8))


def film_of(picture: Any) -> None:
    with named("film")(folder() / "swim.gif", 10.0) as add:
        add(picture)


def registered(make: Any) -> None:
    """A path of one's own is checked when it is made."""
    from seastar_gym.envs.paths import PATHS

    try:
        named("register_path")("odd")(make)
        named("make_path")("odd", np.random.default_rng(0))
    finally:
        PATHS.pop("odd", None)


def name_of_path(name: Any) -> None:
    from seastar_gym.envs.paths import PATHS

    before = dict(PATHS)
    try:
        named("register_path")(name)(lambda rng: PATH)
    finally:
        PATHS.clear()
        PATHS.update(before)


def ran(cells: Any, folder: Any, executor: Any, progress: Any) -> None:
    named("run")(cells, folder, executor, progress)


@cache
def calls() -> list[tuple[str, Callable[..., Any], dict[str, Any]]]:
    """Name, function and arguments of what is called with odd values."""
    return list(_calls())


def _calls() -> Iterator[tuple[str, Callable[..., Any], dict[str, Any]]]:
    rng = np.random.default_rng
    gaits = {"n_limbs": 5}
    for name, arguments in {
        "decisions_per_second": dict(decision_period=0.5),
        "timed": dict(strokes=np.zeros((2, 5)), decision_period=0.5),
        "lagged_gait": dict(decision_period=0.1, n_limbs=5, lag=0.6, level=1.0),
        "lagged_pentagon": dict(decision_period=0.1),
        "pair_gait": dict(plus=1, minus=2, n_limbs=5),
        "pentagon_gait": dict(swimming=45, resting=5),
        "straight_gait": gaits,
        "thrifty_gait": dict(decision_period=0.1, n_limbs=5),
        "turning_wave": dict(decision_period=0.1),
        "load_scene": dict(file=None),
        "timed_certificate": dict(decision_period=0.2),
        "make_path": dict(path="random", rng=rng(0)),
        "Layout": dict(n_limbs=5, of_limb=0, entries=(), shows_limbs=True, stations=9),
        "Limits": dict(longest_pulse=0.12, shortest_rest=0.1, patience=0.12, oldest=0.5),
        "SimulatedPlant": dict(simulator=Simulator(WIRES), sight=Sight(), seed=0, paced=False),
        "PlantSwim": dict(plant=named("SimulatedPlant")(Simulator(WIRES)), limits=named("Limits")(), logs=None,
                          render_mode=None, frames_per_stroke=None, decision_period=0.5, scene=WIRES),
        "FrameStack": dict(symmetry=symmetry_for(5), past=1),
        "Symmetry": dict(group=5, mirror=(), layout=named("Layout")(5), actions="limbs"),
        "VectorFrameStack": dict(env=batch(), past=1),
        "memory_mirror": dict(actuator=FAST.actuator),
        "symmetry_of": dict(scene=FAST),
        "GoalForm": dict(env=env()),
        "GreedyPolicy": dict(scene=FAST, waypoint_radius=0.01, decision_period=None),
        "LearnedPolicy": dict(description=learned().description, weights=learned().weights, training=None, rng=None),
        "Planner": dict(scene=FAST, waypoint_radius=0.01, budget=None, threads=1, decision_period=None, headings=None),
        "pretrained": dict(name="strokes"),
        "load": dict(path=bundled_file(None)),
        "load_agent": dict(name="straight", env=env(), seed=0),
        "load_agents": dict(names=["straight"], seed=0, fidelity="fast", decision_period=None, scene=FAST),
        "scripted": dict(name="straight", actions=None, n_limbs=5, rng=None, decision_period=None),
        "save": dict(policy=learned(), path=folder() / "policy.safetensors"),
        "Budget": dict(depth=2, beam=2, coasting=0.0),
        "OpenLoopPolicy": dict(commands=np.zeros((1, 5)), actions="limbs", decision_period=None),
        "RandomPolicy": dict(rng=rng(0), actions="limbs", n_limbs=5),
        "rollout": dict(env=env(), policy=straight(), seeds=0, options=None, until=1, record=["time"], on_step=None),
        "swim": dict(agent="a", policy=straight(), env=gym.make("SeastarSwim-v0", scene=FAST, path=PATH).unwrapped,
                     max_strokes=1, seed=0, reset_options=None, watch=None),
        "swim_many": dict(agent="a", policy=straight(), path=PATH, n_swims=1, scene=FAST, max_strokes=1,
                          waypoint_radius=0.01, seed=0, threads=1, decision_period=None),
        "Measurement": dict(time=np.zeros(1), positions=np.zeros((1, 1, 2)), nodes=(0,), commands=np.zeros((1, 5)),
                            command_times=None),
        "get_parameter": dict(scene=FAST, name="fluid.density"),
        "synthetic": dict(scene=FAST, truth={}, n_strokes=1, rate=2.0, noise=1e-3, seed=0, delay=0.0),
        "trajectory": dict(time=np.zeros(1), nodes=(0,), commands=np.zeros((1, 5)), scene=FAST, command_times=None),
        "with_parameters": dict(scene=FAST, names=["fluid.density"], values=[900.0]),
        "Choices": dict(name="robot.n_limbs", values=(3, 4), labels=()),
        "Range": dict(name="robot.limb_length", low=0.1, high=0.2, is_log=False),
        "Route": dict(path=PATH, seconds=1.0, decision_period=None),
        "Sweep": dict(scene=FAST, axes=(), gait="straight", settling=0, measured=1, samples=0, seed=0, robots=1),
        "read_results": dict(folder=folder()),
        "Processes": dict(workers=1),
        "Recorder": dict(env=batch()),
        "BatchVecEnv": dict(env=batch("SameStep")),
        "native_batch": dict(context=dict(num_envs=2, scene=FAST)),
        "Hyperparameters": dict(vars(training())),
        "make_model": dict(env=training_env(), hyperparameters=training(), seed=0, device="cpu"),
        "make_training_env": dict(hyperparameters=training(), path=PATH, random_heading=False, fidelity=None,
                                  scene=FAST, threads=1, actions="pairs", randomization=None),
        "read_deeplabcut": dict(file=tracked("scorer,s,s,s\nbodyparts,a,a,a\ncoords,x,y,likelihood\n0,1,2,1\n"),
                                rate=30.0, individual=None, likelihood=0.6),
        "read_motive": dict(file=tracked(MOTIVE), up="y"),
        "read_pose": dict(file=tracked("time,x,y\n0,1,2\n")),
        "read_sleap": dict(file=tracked("track,frame_idx,instance.score,a.x,a.y\n,0,1,2,3\n"), rate=30.0,
                           individual=None),
        "to_c": dict(policy=learned(), name="a", points_per_limb=None),
        "policy_of": dict(model=named("make_model")(training_env(), training(), 0)),
    }.items():  # fmt: skip
        yield name, named(name), arguments
    about = learned().description
    yield "Description", lambda **entries: named("Description")(**entries).check(), {**about._asdict(), "scene": FAST}
    yield "Description", about.from_json, dict(text=about.to_json())
    yield "identify", partial(named("identify"), FAST), dict(
        parameters=["x"], measurement=measurement(), confidence=0.9, largest_delay=None)  # fmt: skip
    yield "identify", lambda scene: named("identify")(scene, ["x"], measurement()), dict(scene=FAST)
    yield "differentiate", named("differentiate"), dict(
        scene=FAST, commands=np.zeros((1, 5)), by=["commands"], state=None, duration=0.1)  # fmt: skip
    yield "gradient", lambda **others: named("gradient")(objective=of_work, **others), dict(
        scene=FAST, commands=np.zeros((1, 5)), by=["commands"], state=None, duration=0.1)  # fmt: skip
    yield "record", named("record"), dict(scene=FAST, commands=np.zeros((1, 5)), state=None, duration=0.1)
    yield "Measurement", named("Measurement").from_csv, dict(trajectory="a.csv", commands="b.csv")
    yield "Measurement", measurement().to_csv, dict(trajectory=folder() / "a.csv", commands=folder() / "b.csv")
    yield "film", filmed, dict(file=folder() / "swim.gif", fps=10.0)
    yield "film", film_of, dict(picture=np.zeros((4, 4, 3), np.uint8))
    yield "register_path", name_of_path, dict(name="odd")
    yield "register_path", registered, dict(make=lambda rng: PATH)
    yield "run", ran, dict(cells=[], folder=folder(), executor=named("Here")(), progress=None)
    for policy in (straight(), learned(), named("RandomPolicy")(rng(0))):
        yield type(policy).__name__, policy.predict, dict(
            observation=observations(), state=None, episode_start=None, deterministic=True)  # fmt: skip
    yield "GreedyPolicy", named("GreedyPolicy")(FAST).choose, dict(observations=observations())
    budget = named("Budget")(1, 1)
    yield "Planner", named("Planner")(FAST, budget=budget, threads=1).choose, dict(observations=observations())
    yield "Range", named("Range")("a", 0.0, 1.0).spaced, dict(n=3)
    yield "Range", named("Range")("a", 0.0, 1.0).at, dict(share=0.5)
    yield "Buffers", lambda out: batch_to_step().step(np.zeros((2, 5), int), out=out), dict(out=None)
    for name in ("VectorFrameStack", "Recorder"):
        yield name, of_batch(name).reset, dict(seed=0, options=None)
        yield name, of_batch(name).step, dict(actions=np.zeros(2, int))
    yield "BatchVecEnv", of_batch("BatchVecEnv", "SameStep").step, dict(actions=np.zeros(2, int))
    yield "Symmetry", symmetry_for(5).reduce, dict(observations=observations())
    yield "Symmetry", symmetry_for(5).restore, dict(actions=np.zeros((2, 5), int), elements=np.zeros(2, int))
    yield "GoalForm", goal_form().reset, dict(seed=0, options=None)
    yield "GoalForm", goal_form().step, dict(action=0)
    yield "GoalForm", goal_form().compute_reward, dict(
        achieved_goal=np.zeros(2), desired_goal=np.zeros(2), info={})  # fmt: skip


@cache
def batch_to_step() -> Any:
    made = batch()
    made.reset()
    return made
