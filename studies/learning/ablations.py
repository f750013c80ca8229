"""Ablations of the training: trainings that differ from the default one in a single choice, over several seeds.

    python -m studies.learning.ablations

Every policy is evaluated on the same held-out random paths with random headings, none of which it is trained on. The
score is the mean number of strokes to the last waypoint, during the training and at its end. Results are written after
every training, and a training whose result is already in the file is not repeated.
"""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from agents.hyperparameters import Hyperparameters
from agents.ppo import make_model, make_training_env, policy_of
from seastar_gym.controllers.contract import Policy
from seastar_gym.controllers.learned import LearnedPolicy
from seastar_gym.envs.reward import RewardWeights
from seastar_gym.envs.task import make_scene
from seastar_gym.evaluation.many import HELD_OUT_SEED, swim_many
from seastar_gym.scene.numerics import Fidelity
from studies.frame import Results, Study, require_known
from studies.style import CYCLE, FAINT, new_figure

DEFAULT = "whole commands"
"""Name of the variant without changes."""
MAX_STROKES = 400
"""Largest number of strokes of an evaluated swim, which is also the score of a robot that does not arrive."""

Curve = list[tuple[int, float]]
"""Learning curve: pairs of strokes trained and mean strokes on the held-out paths."""


@dataclass(frozen=True)
class Variant:
    """A training that differs from the default of the study.

    changes: Hyperparameters that differ from `COMMON`, as pairs of name and value.
    first_path: Path of the first third of the training, or None for random paths throughout.
    """

    changes: tuple[tuple[str, Any], ...] = ()
    first_path: str | None = None

    @property
    def hyperparameters(self) -> Hyperparameters:
        """Hyperparameters of the study with the changes of this variant."""
        return replace(COMMON, **dict(self.changes))


def _with(**changes: Any) -> Variant:
    return Variant(tuple(changes.items()))


COMMON = Hyperparameters(actions="joint")
"""Hyperparameters of the study: policies choose from all 243 commands, not only from the pairs of limbs."""
VARIANTS: dict[str, Variant] = {
    DEFAULT: Variant(),
    "no symmetry": _with(symmetry=False),
    "limb by limb": _with(actions="limbs"),
    "pairs of limbs": _with(actions="pairs"),
    "discount 0.5": _with(discount=0.5),
    "discount 0.95": _with(discount=0.95),
    "entropy 0.01": _with(entropy=0.01),
    "512 robots": _with(num_envs=512, batch_size=2048),
    "width 256": _with(hidden=(256, 256)),
    "one waypoint first": Variant(first_path="line"),
    "aim 0.4": _with(reward=RewardWeights(aim=0.4)),
    "aim 0.9": _with(reward=RewardWeights(aim=0.9)),
}
"""Trainings by the choice in which they differ."""


def mean_strokes(policy: Policy, path: str, n_swims: int, options: "Options") -> float:
    """Mean number of strokes of swims by a policy; path: "random" means the held-out paths."""
    scene, seed = make_scene(None, options.fidelity), HELD_OUT_SEED
    swims = swim_many(
        "learned", policy, path, n_swims, scene, max_strokes=MAX_STROKES, seed=seed, threads=options.num_threads
    )
    return float(np.mean([done.strokes for done in swims]))


class Measuring(BaseCallback):
    """Callback that evaluates the policy after every `options.every` strokes of the training."""

    def __init__(self, options: "Options"):
        super().__init__()
        self.options, self.curve, self._next = options, Curve(), options.every

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        if self.num_timesteps >= self._next:
            self._next += self.options.every
            self.measure()

    def measure(self) -> LearnedPolicy:
        """Evaluate the present policy, add the score to the curve, and return the policy."""
        assert isinstance(self.model, PPO)
        policy = policy_of(self.model)
        strokes = mean_strokes(policy, "random", self.options.paths, self.options)
        self.curve.append((self.model.num_timesteps, strokes))
        return policy


def learn(variant: Variant, seed: int, options: "Options") -> dict[str, Any]:
    """Run one training; returns its learning curve and the strokes of the final policy round the pentagon."""
    hyperparameters, fidelity = variant.hyperparameters, options.fidelity
    measuring, n = Measuring(options), hyperparameters.num_envs * hyperparameters.rollout
    rounds = max(1, options.strokes // n)
    first = variant.first_path or "random"
    env = make_training_env(hyperparameters, first, True, fidelity, threads=options.num_threads)
    model = make_model(env, hyperparameters, seed)
    if variant.first_path is not None:
        model.learn(rounds // 3 * n, measuring)
        rounds -= rounds // 3
        env.close()
        env = make_training_env(hyperparameters, "random", True, fidelity, threads=options.num_threads)
        model.set_env(env)
    model.learn(rounds * n, measuring, reset_num_timesteps=variant.first_path is None)
    policy = measuring.measure()
    env.close()
    return {"curve": measuring.curve, "pentagon": round(mean_strokes(policy, "pentagon", 1, options))}


COLUMNS = 3
LOW, HIGH = 165.0, 210.0
"""Strokes that the picture shows."""


def final_strokes(runs: Mapping[str, Any]) -> list[float]:
    """Mean strokes on the held-out paths at the end of the training, for every seed."""
    return [run["curve"][-1][1] for run in runs.values()]


def table(results: Mapping[str, Any]) -> str:
    """Table in Markdown: mean, best and worst strokes over seeds of every variant, and strokes round the pentagon."""
    lines = ["| training | held-out paths: mean strokes | pentagon, every seed |", "|---|---:|---|"]
    for name, runs in results["runs"].items():
        ends, pentagon = final_strokes(runs), ", ".join(str(run["pentagon"]) for run in runs.values())
        over_seeds = f" ({min(ends):.1f} to {max(ends):.1f})" if len(ends) > 1 else ""
        lines.append(f"| {name} | {np.mean(ends):.1f}{over_seeds} | {pentagon} |")
    return "\n".join(lines)


def draw(results: Mapping[str, Any], file: Path) -> None:
    """Draw the learning curve of every variant beside the default one: mean and range over seeds."""
    others = [name for name in results["runs"] if name != DEFAULT] or [DEFAULT]
    rows = -(-(len(others) + 1) // COLUMNS)
    figure = new_figure(7.0, 0.5 + 2.0 * rows)
    panels = figure.subplots(rows, COLUMNS, sharex=True, sharey=True, squeeze=False).ravel()
    for axes, name in zip(panels, others, strict=False):
        for label, colour in ((DEFAULT, FAINT), (name, CYCLE[0])):
            _draw_curves(axes, results["runs"].get(label, {}), colour)
        axes.set(ylim=(LOW, HIGH))
        axes.set_title(name)
        axes.tick_params(labelbottom=True)
        axes.grid(True)
    for axes in panels[len(others) :]:
        axes.set_axis_off()
    panels[len(others)].legend(
        panels[0].get_lines()[:2], [f"{DEFAULT}:\nnothing changed", "the change in\nthe title"],
        title="line: mean of the seeds\nband: lowest to highest", alignment="left", loc="center",
    )  # fmt: skip
    figure.supxlabel("strokes trained [thousands]")
    figure.supylabel("strokes to the last waypoint, mean of the held-out paths")
    figure.savefig(file)


def _draw_curves(axes: Any, runs: Mapping[str, Any], colour: str) -> None:
    curves = np.array([run["curve"] for run in runs.values()])
    if curves.size:
        trained, strokes = 1e-3 * curves[0, :, 0], curves[:, :, 1]
        axes.fill_between(trained, strokes.min(axis=0), strokes.max(axis=0), color=colour, alpha=0.25, lw=0)
        axes.plot(trained, strokes.mean(axis=0), color=colour)


@dataclass(frozen=True)
class Options:
    """Ablations of the training: trainings that differ from the default one in a single choice, over several seeds."""

    seeds: tuple[int, ...] = (0, 1, 2)
    """Seeds of the trainings."""
    variants: tuple[str, ...] = tuple(VARIANTS)
    """Names of the trainings to run."""
    strokes: int = 98_304
    """Length of every training [strokes]."""
    every: int = 24_576
    """Strokes of training between evaluations."""
    paths: int = 64
    """Number of held-out paths."""
    fidelity: Fidelity = "fast"
    """Fidelity of the simulated swims."""
    num_threads: int | None = None
    """Threads of the simulator; all processors by default."""
    out: Path = Path("docs/ablations.json")
    """File of the results. The picture has the same name with the suffix .png."""

    def __post_init__(self) -> None:
        require_known("variant", self.variants, VARIANTS)


def study(options: Options, results: Results) -> None:
    """Run the trainings that are missing."""
    torch.set_num_threads(1)
    cells = {
        ("runs", name, str(seed)): partial(learn, VARIANTS[name], seed, options)
        for seed, name in itertools.product(options.seeds, options.variants)
    }
    results.fill(cells, lambda found: f"{found['curve'][-1][1]:.1f} strokes on held-out paths")


STUDY = Study(
    "learning.ablations",
    study,
    Options,
    "ablations.json",
    settings=lambda options: {name: getattr(options, name) for name in ("strokes", "every", "paths", "fidelity")},
    pictures={"ablations.png": draw},
    tables={"ablations": table},
    packages=("torch", "stable_baselines3"),
)
