"""Ablations of the training: trainings that differ from the default one in a single choice, over several seeds.

    python -m studies.learning.ablations

Every policy is evaluated on the same held-out random paths with random headings, none of which it is trained on. The
score is the mean number of strokes to the last waypoint, during the training and at its end. Results are written after
every training, and a training whose result is already in the file is not repeated.
"""

import itertools
import json
import shlex
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import torch
import tyro
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from agents.hyperparameters import Hyperparameters
from agents.ppo import make_model, make_training_env, policy_of
from seastar_gym.command import run_command
from seastar_gym.controllers.contract import Policy
from seastar_gym.controllers.learned import LearnedPolicy
from seastar_gym.envs.options import make_scene
from seastar_gym.envs.reward import RewardWeights
from seastar_gym.evaluation.many import HELD_OUT_SEED, swim_many
from seastar_gym.files import write_atomically
from seastar_gym.scene.numerics import Fidelity
from studies.learning.ablations_page import DEFAULT, draw, table
from studies.provenance import provenance

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
        if unknown := set(self.variants) - set(VARIANTS):
            raise ValueError(f"Unknown variant {min(unknown)!r}: choose of {', '.join(VARIANTS)}.")


def study(options: Options, results: dict[str, Any]) -> None:
    """Run the trainings that are missing in the results, and write the results after each."""
    options.out.parent.mkdir(parents=True, exist_ok=True)
    for seed, name in itertools.product(options.seeds, options.variants):
        runs = results["runs"].setdefault(name, {})
        if str(seed) in runs:
            continue
        began = time.perf_counter()
        runs[str(seed)] = learn(VARIANTS[name], seed, options)
        write_atomically(options.out, (json.dumps(results) + "\n").encode())
        strokes, seconds = runs[str(seed)]["curve"][-1][1], time.perf_counter() - began
        print(f"{name}, seed {seed}: {strokes:.1f} strokes on held-out paths ({seconds:.0f} s)", flush=True)


def read_results(options: Options, command: str) -> dict[str, Any]:
    """Results in the output file, or empty ones if there is none; ValueError if the file has other settings."""
    settings = {name: getattr(options, name) for name in ("strokes", "every", "paths", "fidelity")}
    if not options.out.is_file():
        return {**provenance(command, "torch", "stable_baselines3"), "settings": settings, "runs": {}}
    results: Any = json.loads(options.out.read_text(encoding="utf-8"))
    found = results.get("settings") if isinstance(results, dict) else None
    if found != settings:
        of = "something else" if found is None else found
        raise ValueError(f"{options.out} has results of {of}, not of {settings}: give another --out.")
    return cast(dict[str, Any], results)


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line of the study; returns the exit code."""
    torch.set_num_threads(1)
    given = sys.argv[1:] if arguments is None else arguments
    try:
        options = tyro.cli(Options, prog="python -m studies.learning.ablations", args=given)
        results = read_results(options, shlex.join(["python", "-m", "studies.learning.ablations", *given]))
    except ValueError as wrong:
        print(wrong, file=sys.stderr)
        return 2
    study(options, results)
    draw(results, options.out.with_suffix(".png"))
    print(table(results))
    return 0


if __name__ == "__main__":
    run_command(main)
