"""Model cards: what a policy is, how it was trained and how it swims, as Markdown beside its file.

    python -m agents.cards
    python -m agents.cards --policies runs/FOLDER/policy.safetensors

measures every bundled policy, or a trained one, and writes its card anew. `python train.py --publish` does so, too,
when it replaces a bundled policy by one that is no worse.
"""

import hashlib
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
import tyro

from agents import options as training
from agents.run import resume_command
from seastar_gym.command import answered, run_command
from seastar_gym.controllers.learned import BUNDLED, LearnedPolicy, bundled_file, load, save
from seastar_gym.envs.options import make_scene
from seastar_gym.evaluation.swim import HELD_OUT_SEED, TIME_LIMIT, Swim, swim_many
from seastar_gym.evaluation.trials import OWN
from seastar_gym.files import write_atomically
from seastar_gym.scene import Scene
from seastar_gym.scene.numerics import Fidelity

HELD_OUT_PATHS = 64
"""Number of random paths that a card counts, those on which `train.py --publish` compares policies."""
FIDELITIES: tuple[Fidelity, ...] = ("fast", "balanced", "reference")
CHEAP = ("fast", "balanced", OWN)
"""Fidelities at which held-out paths are swum."""
CHAPTERS = "the chapter's robot"
UNKNOWN = "not recorded"


Swims = tuple[Swim, list[Swim]]
"""Swims of a policy at a fidelity: round the pentagon, and on held-out random paths, none where that is dear."""


def scenes_of(policy: LearnedPolicy) -> dict[str, Scene]:
    """Scenes in which a policy is measured, by name: the chapter's at every fidelity, or a robot of one's own as it was
    trained.

    The chapter's robot has today's damping there, also if the policy was trained with limbs that damp nothing.
    """
    period = policy.description.decision_period
    chapters = {fidelity: make_scene(None, fidelity, period) for fidelity in get_args(Fidelity)}
    trained = [replace(scene, numerics=policy.scene.numerics) for scene in chapters.values()]
    undamped = [replace(scene, robot=replace(scene.robot, relaxation_time=None)) for scene in trained]
    if policy.scene in (*trained, *undamped):
        return {fidelity: chapters[fidelity] for fidelity in FIDELITIES}
    return {OWN: policy.scene}


def measure(policy: LearnedPolicy, threads: int | None = None) -> dict[str, Swims]:
    """Swims of a policy in every scene of `scenes_of`, with its own time between decisions."""
    found = {}
    for name, scene in scenes_of(policy).items():
        how: dict[str, Any] = {"threads": threads, "decision_period": policy.description.decision_period}
        (pentagon,) = swim_many("learned", policy, "pentagon", 1, scene, **how)
        held_out = list[Swim]()
        if name in CHEAP:
            held_out = swim_many("learned", policy, "random", HELD_OUT_PATHS, scene, seed=HELD_OUT_SEED, **how)
        found[name] = pentagon, held_out
    return found


def card(policy: LearnedPolicy, file: Path, sha256: str, swims: Mapping[str, Swims]) -> str:
    """The card, as Markdown. sha256: Of the weights, which tells what the card is about."""
    about, scene = policy.description, policy.scene
    decides = (
        "stroke by stroke, every 1 s"
        if about.decision_period == about.scene.actuator.period
        else f"every {about.decision_period:g} s"
    )
    _, inputs = about.shapes()["0.weight"]
    layers = ", ".join(map(str, about.hidden))
    many, choices = about.distributions
    choice = f"one of {choices} commands" if many == 1 else f"one of {choices} commands for each limb"
    symmetric = "In a turned or mirrored world it swims the turned or mirrored way. " * about.symmetry
    robot, licence, seen = CHAPTERS, "| licence | MIT, as the package |\n", "; docs/control.md has swims\n  with them"
    if OWN in swims:
        robot, licence, seen = f"a robot of {scene.robot.n_limbs} limbs, which {file.stem}.json describes,", "", ""
    return f"""# Model card: {file.stem}

A policy that swims {robot} along waypoints. It decides {decides}, and takes {choice}.
{symmetric}It was trained in simulation, on random paths, and no real robot has swum by it.

| | |
|---|---|
| file | `{file.name}`, sha256 `{sha256}` |
| input | {inputs} numbers: shape and velocity of the limbs, {_memory(scene)}two waypoints |
| network | layers of {layers} neurons with tanh, which numpy runs |
| environment | `actions="{about.actions}"`; {type(scene.robot).__name__} with {scene.robot.n_limbs} limbs, \
{type(scene.actuator).__name__} |
{licence}
## Training

{training_facts(policy.training)}

## How it swims

`python -m agents.cards` measures this: round the pentagon, with waypoints of 10 mm, and on {HELD_OUT_PATHS} random
paths that no training draws. A swim ends after {TIME_LIMIT:g} s. Energy is per metre of the hub's way.

| fidelity | pentagon | energy there [J/m] | held-out paths: mean time [s] | arrived |
|---|---:|---:|---:|---:|
{chr(10).join(_row(fidelity, one) for fidelity, one in swims.items())}

## Limits

* It knows this robot, with its drag, its mass and its actuators. In other physics the order of policies can be
  another one (docs/training.md).
* It sees the whole state, without noise. It was not trained on noise, currents or weak limbs{seen}.
* It sees two waypoints, 0.1 to 0.2 m apart in its training, and does not plan beyond them.
"""


def _memory(scene: Any) -> str:
    """What is observed of actuators."""
    return "" if type(scene.actuator).__name__ == "SmaPulse" else "the contraction of the wires, "


def training_facts(training: Mapping[str, Any]) -> str:
    """Facts of a training as a list."""
    commands = training.get("commands", [])
    seconds, machine = training.get("seconds"), training.get("machine")
    versions = training.get("versions", {})
    on = UNKNOWN if machine is None else f"{machine['system']}, {machine['processors']} processors"
    facts = {
        "commands, in the version of then": "".join(f"\n  * `{command}`" for command in commands) or UNKNOWN,
        "strokes, or decisions": f"{training['strokes']:,}" if "strokes" in training else UNKNOWN,
        "seed": training.get("seed", UNKNOWN),
        "fidelity": training.get("options", {}).get("fidelity", UNKNOWN),
        "time in simulator, policy and updates": UNKNOWN if seconds is None else f"{seconds:.0f} s",
        "machine": on,
        "versions": ", ".join(f"{name} {version}" for name, version in versions.items()) or UNKNOWN,
    }
    return "\n".join(f"* {name}: {value}" for name, value in facts.items()).replace(": \n", ":\n")


def _row(fidelity: str, swims: Swims) -> str:
    done, held_out = swims
    pentagon = f"{done.time[-1]:.1f} s, {done.strokes} {done.counted_in}" if done.finished else done.result
    energy = "" if done.joules_per_metre is None else f"{done.joules_per_metre:.0f}"
    arrived = [one for one in held_out if one.finished]
    mean = f"{np.mean([one.time[-1] for one in arrived]):.1f}" if arrived else ""
    share = f"{len(arrived)} of {len(held_out)}" if held_out else ""
    return f"| `{fidelity}` | {pentagon} | {energy} | {mean} | {share} |"


def write_card(file: Path, threads: int | None = None) -> Path:
    """Measure the policy in a file, and write its card beside it; returns the card's file."""
    policy, place = load(file), file.with_suffix(".md")
    text = card(policy, file, hashlib.sha256(file.read_bytes()).hexdigest(), measure(policy, threads))
    write_atomically(place, text)
    return place


def publish(options: training.Options, folder: Path) -> int:
    """Make the run's policy the bundled one, unless it is worse and not confirmed; returns the exit code."""
    policy = load(folder / "policy.safetensors")
    if not options.publish_anyway and (objection := why_not(policy, options)):
        command = f"{resume_command(folder)} --publish --publish-anyway"
        print(f"The bundled policy stays: {objection}. Replace it all the same with\n    {command}", file=sys.stderr)
        return 1
    file = bundled_file(options.ppo.decision_period, BUNDLED)
    save(policy, file)
    print(f"Bundled: {file}, with its card {write_card(file, options.num_threads).name}")
    return 0


def why_not(policy: LearnedPolicy, options: training.Options) -> str | None:
    """Reason against replacing the bundled policy by this one, None if there is none."""
    file = bundled_file(options.ppo.decision_period, BUNDLED)
    if not file.exists():
        return None
    try:
        box = load(file)
    except (ValueError, FileNotFoundError) as unreadable:
        return f"there is nothing to compare with, {str(unreadable).rstrip('.')}"
    ours, theirs = (held_out_decisions(one, options) for one in (policy, box))
    if ours <= theirs:
        return None
    decisions = "strokes" if options.ppo.decision_period is None else "decisions"
    return f"it takes {theirs:.1f} {decisions} on {HELD_OUT_PATHS} held-out random paths, the new one {ours:.1f}"


def held_out_decisions(policy: LearnedPolicy, options: training.Options) -> float:
    """Mean decisions to the last waypoint of held-out random paths; a swim that does not arrive counts as the limit."""
    scene = make_scene(None, options.fidelity, options.ppo.decision_period)
    swims = swim_many(
        "learned", policy, "random", HELD_OUT_PATHS, scene, max_strokes=options.limit(scene), seed=HELD_OUT_SEED,
        threads=options.num_threads, decision_period=options.ppo.decision_period,
    )  # fmt: skip
    return float(np.mean([done.strokes for done in swims]))


@dataclass(frozen=True)
class Options:
    """Measure policies and write their cards beside them."""

    policies: tuple[Path, ...] = ()
    """Files of policies (.safetensors); by default all bundled ones."""
    num_threads: int | None = None
    """Threads of the simulator; by default one for every processor."""


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; returns the exit code."""
    options = tyro.cli(Options, prog="python -m agents.cards", args=arguments)

    def write_all() -> None:
        for file in options.policies or sorted(BUNDLED.parent.glob("*.safetensors")):
            print(write_card(file, options.num_threads), flush=True)

    return answered(write_all)


if __name__ == "__main__":
    run_command(main)
