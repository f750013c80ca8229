"""Model card of the policy of a task: what it is, how it was trained, and how it swims held-out episodes."""

import hashlib
from pathlib import Path

from agents.cards import training_facts
from seastar_gym.controllers.learned import LearnedPolicy
from seastar_gym.evaluation.many import HELD_OUT_SEED
from seastar_gym.evaluation.measures import measure_of
from seastar_gym.evaluation.statistics import mean_with_interval
from seastar_gym.evaluation.tasks import env_of, swim_episodes
from seastar_gym.files import write_atomically
from seastar_gym.scene.numerics import Fidelity

EPISODES = 64
"""Held-out episodes of a card."""
IMITATION = "imitation"
"""Learner that imitates the bundled policy of waypoints, which sees the true state, see `agents.distillation`."""
FIDELITIES: tuple[Fidelity, ...] = ("fast", "balanced")


def card(id: str, policy: LearnedPolicy, file: Path) -> str:
    """The card of the policy in a file, as Markdown."""
    about = policy.description
    layers = ", ".join(map(str, about.hidden))
    tried = policy.training.get("seeds", ())
    seeds = f"the best of seeds {', '.join(map(str, tried))}" if len(tried) > 1 else "one seed"
    told = ""
    if "told the way" in str(policy.training.get("learner")):
        told = " Its training's reward measured the way around all discs, `ObstTrap(potential=\"geodesic\")`."
    if policy.training.get("learner") == IMITATION:
        told = (
            " It imitates the bundled policy of waypoints, which sees the true state.\n`docs/plant.md` says what "
            "delays and softer limbs cost it, and what other seeds make of it."
        )
    past = f" and the most telling numbers of the last {about.past}" if about.past else ""
    env = env_of(id)
    measure = measure_of(env)
    return f"""# Model card: {file.stem}

A policy of the chapter's robot for `{id}`. What it sees and is rewarded for stands in the docstring of
`{type(env.challenge).__name__}`.{told}
It was trained in simulation, and no real robot has swum by it.

| | |
|---|---|
| file | `{file.name}`, sha256 `{hashlib.sha256(file.read_bytes()).hexdigest()}` |
| input | {about.input_size} numbers: the observation{past}, turned and mirrored into one sector |
| network | layers of {layers} neurons with tanh, which numpy runs |
| environment | `gym.make("{id}", actions="{about.actions}")` |
| learner | {policy.training.get("learner")}, {seeds} |
| licence | MIT, as the package |

## Training

{training_facts(policy.training)}

## How it swims

`python -m agents.tasks --cards-only` measures this, in {EPISODES} episodes of the split "test", where {measure.better}
is better. Other agents stand in docs/tasks.md.

| fidelity | {measure.name} [{measure.unit}]: mean (95 %) | success |
|---|---:|---:|
{chr(10).join(_row(id, policy, fidelity) for fidelity in FIDELITIES)}
"""


def _row(id: str, policy: LearnedPolicy, fidelity: Fidelity) -> str:
    swum = swim_episodes(id, policy, list(range(HELD_OUT_SEED, HELD_OUT_SEED + EPISODES)), fidelity=fidelity)
    mean, low, high = mean_with_interval(measure_of(env_of(id)).of(swum))
    return f"| `{fidelity}` | {mean:.3g} ({low:.3g} to {high:.3g}) | {swum.success.sum()} of {EPISODES} |"


def write_card(id: str, policy: LearnedPolicy, file: Path) -> Path:
    """Measure the policy in a file, and write its card beside it; returns the card's file."""
    place = file.with_suffix(".md")
    write_atomically(place, card(id, policy, file))
    return place
