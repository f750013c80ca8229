"""What turning is worth: one waypoint at 0.2 m, where the robot has to look another way than at the start.

    python -m studies.learning.heading

Robots swim it for several demanded turns: by the chapter's strokes and by wires every 0.2 s, which turn by a gait and
then swim by the policy in the box, and by wires every 0.5 s with the planner, or with a policy that was trained on
random paths with random headings. All do the mirror image of it to the other side. Writes `heading.json` and
`heading.png`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3 import PPO

from agents.hyperparameters import Hyperparameters
from agents.ppo import make_model
from seastar_gym.adapters.stable_baselines3 import BatchVecEnv
from seastar_gym.controllers import learned
from seastar_gym.controllers.contract import Policy
from seastar_gym.controllers.planner import Planner
from seastar_gym.controllers.turning import TurnThenSwim
from seastar_gym.envs.headings import Headings
from seastar_gym.envs.layout import HEADINGS, Layout
from seastar_gym.envs.options import make_scene
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.symmetry import Symmetry, VectorSymmetryReduction, memory_mirror
from seastar_gym.evaluation.swim import Swim, decisions_in, swim
from seastar_gym.gaits import turning_wave
from seastar_gym.scene import Scene
from seastar_gym.scene.numerics import Fidelity
from studies.frame import Study
from studies.learning.reduced import ReducedPolicy
from studies.style import CYCLE, DPI, FAINT, subplots

Floats = NDArray[np.float64]

DISTANCE = 0.2
"""Distance of the waypoint [m]."""
TURNS = (0.0, 36.0, 72.0, 108.0, 144.0, 180.0)
"""Demanded turns [deg]."""
LIMIT = 600.0
"""Time after which a swim ends [s]."""
STROKES_THAT_TURN = np.array([[-1.0, 1.0, -1.0, -1.0, -1.0], [-1.0, -1.0, 1.0, -1.0, -1.0]])
"""The chapter's strokes, two in turn, that turn the robot most: clockwise, by 1.7 degrees a second."""


class Swimmer(NamedTuple):
    """A robot with its controller. make: From the scene and the headings. decision_period: [s], None means strokes."""

    what: str
    decision_period: float | None
    make: Callable[[Scene, Headings], Policy]


def reduced(model: PPO, scene: Scene) -> ReducedPolicy:
    """Learner that sees the reduced observations of a scene with headings, as an agent of an environment."""
    layout, mirror = Layout.of(scene, entries=HEADINGS), memory_mirror(scene.actuator)
    return ReducedPolicy(model, Symmetry(scene.robot.n_limbs, mirror, layout, "pairs"))


COLOURS = {"strokes": FAINT, "wires": CYCLE[0], "planner": CYCLE[2], "learned": CYCLE[1]}


def table(results: Mapping[str, Any]) -> str:
    """Table of the results in Markdown. The last column is what the largest turn costs beyond none."""
    turns = results["turns_deg"]
    more = f"{turns[-1]:g}° less {turns[0]:g}°"
    lines = [f"| | {' | '.join(f'{turn:g}°' for turn in turns)} | {more} |", f"| --- |{' ---: |' * (len(turns) + 1)}"]
    for each in results["swims"].values():
        for what, unit in (("seconds", "s"), ("joules", "J")):
            first, last = each[what][0], each[what][-1]
            numbers = [*each[what], None if first is None or last is None else last - first]
            cells = ["-" if one is None else f"{one:.0f}" for one in numbers]
            lines.append(f"| {each['what']} [{unit}] | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def draw(results: Mapping[str, Any], file: Path) -> None:
    """Time and energy over the demanded turn."""
    figure, panels = subplots(1, 2, figsize=(8.0, 4.2))
    for axes, what, label in zip(panels, ("seconds", "joules"), ("time [s]", "electric energy [J]"), strict=True):
        for name, each in results["swims"].items():
            numbers = [np.nan if one is None else one for one in each[what]]
            axes.plot(results["turns_deg"], numbers, "o-", color=COLOURS[name], label=each["what"])
        axes.set(xlabel="demanded turn [degrees]", ylabel=f"{label} to arrive", xticks=results["turns_deg"])
        axes.set_ylim(bottom=0.0)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper left", ncols=2)
    figure.savefig(file, dpi=DPI)


@dataclass(frozen=True)
class Options:
    """Swim to a waypoint with a demanded turn, by strokes, by wires and by a policy that learned it."""

    decisions: int = 400_000
    """Length of the training [decisions]."""
    seed: int = 0
    """Seed of the training."""
    fidelity: Fidelity = "fast"
    """Accuracy of the swims; trainings are at "fast"."""
    swimmers: tuple[str, ...] = ("strokes", "wires", "planner", "learned")
    """Who swims; "learned" only after a training."""
    turns: tuple[float, ...] = TURNS
    """Demanded turns [deg]."""
    out: Path = Path("runs/heading")
    """Folder of heading.json, heading.png and the learner."""


def train(options: Options) -> PPO:
    """Learner on random paths with random headings, decisions every 0.5 s by pairs of limbs."""
    hyperparameters = Hyperparameters(decision_period=0.5)
    env: Any = gym.make_vec(
        "SeastarSwimHeading-v0", hyperparameters.num_envs, "vector_entry_point", path="random", fidelity="fast",
        headings=Headings("random"), autoreset_mode=AutoresetMode.SAME_STEP, max_episode_steps=800,
    )  # fmt: skip
    model = make_model(BatchVecEnv(VectorSymmetryReduction(env)), hyperparameters, options.seed)
    model.learn(options.decisions)
    return model


def swimmers(model: PPO | None) -> dict[str, Swimmer]:
    """The robots by name; the learner is left out if there is none."""

    def strokes(scene: Scene, headings: Headings) -> Policy:
        return TurnThenSwim(STROKES_THAT_TURN, learned.load(), "pairs", scene, headings, None)

    def wires(scene: Scene, headings: Headings) -> Policy:
        swims = learned.load(learned.in_the_box(0.2))
        return TurnThenSwim(turning_wave(0.2), swims, swims.actions, scene, headings, 0.2)

    found = {
        "strokes": Swimmer("the chapter's strokes: turn, then swim", None, strokes),
        "wires": Swimmer("wires every 0.2 s: turning wave, then swim", 0.2, wires),
        "planner": Swimmer("wires every 0.5 s: planner", 0.5, lambda _, headings: Planner(
            decision_period=0.5, headings=headings)),
    }  # fmt: skip
    if model is not None:
        found["learned"] = Swimmer("wires every 0.5 s: learned", 0.5, lambda scene, _: reduced(model, scene))
    return found


def swum(swimmer: Swimmer, turn: float, fidelity: Fidelity) -> Swim:
    """Swim of a robot with a demanded turn [deg]."""
    scene, headings = make_scene(None, fidelity, swimmer.decision_period), Headings(float(np.radians(turn)))
    policy: Any = swimmer.make(scene, headings)
    env = SeastarSwimEnv(
        [[DISTANCE, 0.0]], policy.actions, fidelity, decision_period=swimmer.decision_period, headings=headings
    )
    return swim(swimmer.what, policy, env, max_strokes=decisions_in(LIMIT, swimmer.decision_period), seed=0)


def measured(swimmer: Swimmer, options: Options) -> dict[str, Any]:
    """Times [s] and energies [J] over demanded turns, None where it did not arrive."""
    swims = [swum(swimmer, turn, options.fidelity) for turn in options.turns]
    return {
        "what": swimmer.what,
        "seconds": [round(float(one.time[-1]), 6) if one.finished else None for one in swims],
        "joules": [round(float(one.energy.sum()), 3) if one.finished else None for one in swims],
    }


def study(options: Options) -> dict[str, Any]:
    """Run the study; returns its results as plain data."""
    options.out.mkdir(parents=True, exist_ok=True)
    model = train(options) if options.decisions else None
    if model is not None:
        model.save(options.out / "model.zip")
    return {
        "distance_m": DISTANCE,
        "fidelity": options.fidelity,
        "tolerance_deg": round(float(np.degrees(Headings().tolerance)), 6),
        "training": {"decisions": options.decisions, "seed": options.seed},
        "turns_deg": list(options.turns),
        "swims": {
            name: measured(swimmer, options) for name, swimmer in swimmers(model).items() if name in options.swimmers
        },
    }


STUDY = Study(
    "learning.heading",
    lambda options, results: results.update(study(options)),
    Options,
    "heading.json",
    pictures={"heading.png": draw},
    tables={"heading": table},
    packages=("torch", "stable_baselines3"),
)
