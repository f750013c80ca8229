"""What the reference documents outside the top level, each with arguments that it accepts."""

# ruff: noqa: C408 - what is given reads as a call
import inspect
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
DEEPLABCUT = "scorer,s,s,s\nbodyparts,a,a,a\ncoords,x,y,likelihood\n0,1,2,1\n"
MADE_BY_THE_PACKAGE = {
    "Setting", "Episodes", "Estimate", "Score", "Swim", "Progress",
    "Actuator", "ActuatorBase", "Policy", "Task", "Robots",
    "Plant", "PlantError", "Sighting", "Derivatives", "Motion", "Gradient", "Record",
    "Track",
}  # fmt: skip
"""Records that functions return, protocols, and bases of classes of one's own."""
UNCALLED = {*MADE_BY_THE_PACKAGE, "RayTasks", "SlurmJobs", "dask_client", "chapters_certificate",
            "LinePlant", "open_serial", "serve"}  # fmt: skip
"""What takes no arguments, or needs Ray, submitit or a serial line, is not called either."""
OF_TRAININGS = ("agents.ppo", "Hyperparameters make_model make_training_env policy_of")
UNCHECKED = {"route"}
"""Argument of `Sweep` that is not checked where it is given."""


def documented() -> dict[str, str]:
    """Modules of the documented names, and of those of trainings, which the reference leaves out."""
    named = [*NAMES.findall(PAGE.read_text("utf-8")), OF_TRAININGS]
    return {name: module for module, names in named for name in names.split()}


def named(name: str) -> Any:
    """What is documented by this name."""
    return getattr(import_module(documented()[name]), name)


def complete(call: Callable[..., Any], given: dict[str, Any]) -> dict[str, Any]:
    """All arguments of a function: the given ones, and the defaults of the others."""
    parameters = inspect.signature(call).parameters.values()
    return {each.name: each.default for each in parameters if each.kind is not each.VAR_KEYWORD} | given


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


NO_NUMBER = "fluid.viscosity"


def identified(**arguments: Any) -> None:
    """The checks of a fit, which take turns: the last finds that there is no such number, before anything swims."""
    try:
        named("identify")(**arguments)
    except ValueError as refused:
        if NO_NUMBER not in str(refused):
            raise


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


def ran(cells: Any, folder: Any, executor: Any, progress: Any, at_once: Any) -> None:
    named("run")(cells, folder, executor, progress, at_once=at_once)


@cache
def calls() -> list[tuple[str, Callable[..., Any], dict[str, Any]]]:
    """Name, function and arguments of what is called with odd values."""
    return list(_calls())


def _calls() -> Iterator[tuple[str, Callable[..., Any], dict[str, Any]]]:
    rng = np.random.default_rng
    for name, arguments in {
        **{name: dict(decision_period=0.1) for name in ("lagged_gait", "lagged_pentagon", "thrifty_gait")},
        **{name: {} for name in ("Layout", "Limits", "pair_gait")},
        **{name: {} for name in ("pentagon_gait", "pretrained", "straight_gait")},
        **{name: dict(scene=FAST) for name in ("GreedyPolicy", "symmetry_of")},
        "turning_wave": dict(decision_period=0.1),
        "memory_mirror": dict(actuator=FAST.actuator),
        "decisions_per_second": dict(decision_period=0.5),
        "timed": dict(strokes=np.zeros((2, 5)), decision_period=0.5),
        "load_scene": dict(file=None),
        "timed_certificate": dict(decision_period=0.2),
        "natural_frequencies": dict(scene=FAST),
        "resonances": dict(scene=FAST, decision_period=0.2),
        "make_path": dict(path="random", rng=rng(0)),
        "SimulatedPlant": dict(simulator=Simulator(WIRES), sight=Sight()),
        "PlantSwim": dict(plant=named("SimulatedPlant")(Simulator(WIRES)), limits=named("Limits")(),
                          decision_period=0.5, scene=WIRES),
        "FrameStack": dict(symmetry=symmetry_for(5)),
        "Symmetry": dict(group=5, mirror=(), layout=named("Layout")(5)),
        "VectorFrameStack": dict(env=batch(), past=1),
        "GoalForm": dict(env=env()),
        "ReducedPolicy": dict(policy=straight(), env=env()),
        "LearnedPolicy": dict(description=learned().description, weights=learned().weights),
        "Planner": dict(scene=FAST, threads=1),
        "load": dict(path=bundled_file(None)),
        "load_agent": dict(name="straight", env=env()),
        "load_agents": dict(names=["straight"], fidelity="fast", scene=FAST),
        "scripted": dict(name="straight"),
        "save": dict(policy=learned(), path=folder() / "policy.safetensors"),
        "Budget": dict(depth=2, beam=2),
        "OpenLoopPolicy": dict(commands=np.zeros((1, 5))),
        "RandomPolicy": dict(rng=rng(0)),
        "rollout": dict(env=env(), policy=straight(), seeds=0, until=1, record=["time"]),
        "swim": dict(agent="a", policy=straight(), env=gym.make("SeastarSwim-v0", scene=FAST, path=PATH).unwrapped,
                     max_strokes=1, seed=0),
        "swim_many": dict(agent="a", policy=straight(), path=PATH, n_swims=1, scene=FAST, max_strokes=1, threads=1),
        "Measurement": dict(time=np.zeros(1), positions=np.zeros((1, 1, 2)), nodes=(0,), commands=np.zeros((1, 5))),
        "get_parameter": dict(scene=FAST, name="fluid.density"),
        "synthetic": dict(scene=FAST, truth={}, n_strokes=1, rate=2.0),
        "trajectory": dict(time=np.zeros(1), nodes=(0,), commands=np.zeros((1, 5)), scene=FAST),
        "with_parameters": dict(scene=FAST, names=["fluid.density"], values=[900.0]),
        "Choices": dict(name="robot.n_limbs", values=(3, 4)),
        "Range": dict(name="robot.limb_length", low=0.1, high=0.2),
        "Route": dict(path=PATH, seconds=1.0),
        "Sweep": dict(scene=FAST, axes=(), settling=0, measured=1, robots=1),
        "read_results": dict(folder=folder()),
        "best_result": dict(folder=folder()),
        "Processes": dict(workers=1),
        "BatchVecEnv": dict(env=batch("SameStep")),
        "Hyperparameters": dict(vars(training())),
        "make_model": dict(env=training_env(), hyperparameters=training(), seed=0),
        "make_training_env": dict(hyperparameters=training(), path=PATH, random_heading=False, scene=FAST, threads=1,
                                  actions="pairs", fidelity=None, randomization=None),
        "read_deeplabcut": dict(file=tracked(DEEPLABCUT), rate=30.0),
        "read_motive": dict(file=tracked(MOTIVE)),
        "read_table": dict(file=tracked("time,x,y\n0,1,2\n")),
        "read_sleap": dict(file=tracked("track,frame_idx,a.x,a.y,a.score\n,0,1,2,3\n"), rate=30.0),
        "to_c": dict(policy=learned(), name="a"),
        "policy_of": dict(model=named("make_model")(training_env(), training(), 0)),
    }.items():  # fmt: skip
        all_of_them = complete(named(name), arguments)
        yield name, named(name), {each: all_of_them[each] for each in all_of_them.keys() - UNCHECKED}
    about = learned().description
    yield "Description", lambda **entries: named("Description")(**entries).check(), {**about._asdict(), "scene": FAST}
    yield "Description", about.from_json, dict(text=about.to_json())
    yield "identify", identified, dict(
        scene=FAST, parameters=[NO_NUMBER], measurement=measurement(), confidence=0.9, largest_delay=None)  # fmt: skip
    swum = dict(scene=FAST, commands=np.zeros((1, 5)), state=None, duration=0.1)
    yield "differentiate", named("differentiate"), swum | dict(by=["commands"])
    yield "gradient", partial(named("gradient"), objective=of_work), swum | dict(by=["commands"])
    yield "record", named("record"), swum
    yield "Measurement", named("Measurement").from_csv, dict(trajectory="a.csv", commands="b.csv")
    yield "Measurement", measurement().to_csv, dict(trajectory=folder() / "a.csv", commands=folder() / "b.csv")
    yield "film", filmed, dict(file=folder() / "swim.gif", fps=10.0)
    yield "film", film_of, dict(picture=np.zeros((4, 4, 3), np.uint8))
    yield "register_path", name_of_path, dict(name="odd")
    yield "register_path", registered, dict(make=lambda rng: PATH)
    yield "run", ran, dict(cells=[], folder=folder(), executor=None, progress=None, at_once=1)
    for policy in (straight(), learned(), named("RandomPolicy")(rng(0)), named("ReducedPolicy")(straight(), env())):
        yield type(policy).__name__, policy.predict, dict(
            observation=observations(), state=None, episode_start=None, deterministic=True)  # fmt: skip
    yield "GreedyPolicy", named("GreedyPolicy")(FAST).choose, dict(observations=observations())
    budget = named("Budget")(1, 1)
    yield "Planner", named("Planner")(FAST, budget=budget, threads=1).choose, dict(observations=observations())
    yield "Range", named("Range")("a", 0.0, 1.0).spaced, dict(n=3)
    yield "Range", named("Range")("a", 0.0, 1.0).at, dict(share=0.5)
    yield "Buffers", lambda out: batch_to_step().step(np.zeros((2, 5), int), out=out), dict(out=None)
    yield "VectorFrameStack", of_batch("VectorFrameStack").reset, dict(seed=0, options=None)
    yield "VectorFrameStack", of_batch("VectorFrameStack").step, dict(actions=np.zeros(2, int))
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
