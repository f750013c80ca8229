"""What policies lose that were trained without delays, on one robot: late pictures, late commands, noise, softer limbs.

    python -m studies.learning.robustness

The bundled policies swim the held-out random paths at "fast", all in the same robots, under one condition after the
other. A swim that does not arrive within the limit counts with the limit.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from seastar_gym.controllers.learned import LearnedPolicy, in_the_box, load
from seastar_gym.envs.layout import Layout
from seastar_gym.envs.options import make_scene
from seastar_gym.envs.sight import Sight
from seastar_gym.evaluation.many import HELD_OUT_SEED, swim_many
from seastar_gym.evaluation.statistics import mean_with_interval
from seastar_gym.evaluation.swim import TIME_LIMIT
from seastar_gym.scene.numerics import Fidelity
from studies.accuracy.page import markdown
from studies.frame import InDocs, Results, Study

N_PATHS = 64
FIDELITY: Fidelity = "fast"
PERIODS: dict[str, float | None] = {"1 s": None, "0.5 s": 0.5, "0.2 s": 0.2}
"""Time between decisions [s], None for strokes, by what the table calls it."""
RATE = 20.0
"""Pictures per second [Hz]: decisions and delays are whole multiples of the time between two."""


@dataclass(frozen=True)
class Condition:
    """What is otherwise than in the training.

    delay: Of all that is seen [s]. action_delay: Of commands [s], which only wires can take. noise: Of seen places [m].
    modulus: Over that of the training. moves: Whether velocities are seen; otherwise they are zero.
    """

    delay: float = 0.0
    action_delay: float = 0.0
    noise: float = 0.0
    modulus: float = 1.0
    moves: bool = True


CONDITIONS = {
    "as trained": Condition(),
    "seen 50 ms late": Condition(delay=0.05),
    "seen 100 ms late": Condition(delay=0.1),
    "seen 150 ms late": Condition(delay=0.15),
    "commands 50 ms late": Condition(action_delay=0.05),
    "places seen with 5 mm of noise": Condition(noise=5e-3),
    "velocities seen as zero": Condition(moves=False),
    "limbs of 0.7 of the modulus": Condition(modulus=0.7),
    "limbs of 0.5 of the modulus": Condition(modulus=0.5),
}


class Seeing:
    """A policy under a condition: without the age of what is seen, which it does not know. layout: That it knows."""

    def __init__(self, policy: LearnedPolicy, condition: Condition, layout: Layout):
        self.policy, self.actions, self.condition = policy, policy.actions, condition
        self.age, self.velocities = layout.waypoints.start, slice(layout.velocities.start, layout.hub_velocity.stop)

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = False
    ) -> tuple[Any, Any]:
        """As the policy does."""
        seen = np.delete(observation, self.age, axis=1)
        if not self.condition.moves:
            seen[:, self.velocities] = 0.0
        return self.policy.predict(seen, state, episode_start, deterministic)


def examine(name: str, condition: Condition) -> dict[str, Any] | None:
    """Times [s] of the swims of the policy of a period, and how many arrive; None where it does not apply."""
    period = PERIODS[name]
    if period is None and condition.action_delay:
        return None
    scene = make_scene(None, FIDELITY, period)
    scene = replace(scene, robot=replace(scene.robot, youngs_modulus=condition.modulus * scene.robot.youngs_modulus))
    swims = swim_many(
        "learned", Seeing(load(in_the_box(period)), condition, Layout.of(scene)), "random", N_PATHS, scene,
        seed=HELD_OUT_SEED, decision_period=period, action_delay=condition.action_delay,
        sight=Sight(RATE, condition.delay, noise=condition.noise, sees="nodes"),
    )  # fmt: skip
    times = [float(swim.time[-1]) if swim.finished else TIME_LIMIT for swim in swims]
    return {"times": np.round(times, 1).tolist(), "arrived": sum(swim.finished for swim in swims)}


def table(results: Mapping[str, Any]) -> str:
    """Mean times, their intervals over paths, and how many arrive."""
    periods = list(results["policies"])
    lines = []
    for condition in results["policies"][periods[0]]:
        cells = [condition]
        for period in periods:
            found = results["policies"][period][condition]
            cells.append("–" if found is None else _cell(found["times"], found["arrived"]))
        lines.append(cells)
    return markdown(["", *(f"decisions every {period} [s]" for period in periods)], lines)


def _cell(times: list[float], arrived: int) -> str:
    lost = "" if arrived == len(times) else f"; {arrived} of {len(times)} arrive"
    return f"{mean_with_interval(times)}{lost}"


def run(_: InDocs, results: Results) -> None:
    """Swim what is missing."""
    results.read()
    cells: dict[tuple[str, ...], Callable[[], Any]] = {
        ("policies", period, name): partial(examine, period, condition)
        for period in PERIODS
        for name, condition in CONDITIONS.items()
    }
    results.fill(cells, lambda found: "does not apply" if found is None else f"{np.mean(found['times']):.1f} s")
    print(table(results))


STUDY = Study("learning.robustness", run, file="robustness.json", tables={"robustness": table})
