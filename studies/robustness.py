"""What policies lose to delays, noise and softer limbs, one change at a time: those that see everything, and that of
`SimToReal`, which sees what a camera sees.

The bundled policies swim held-out random paths at "fast", all in the same robots, under one condition after the other.
A swim that does not arrive within the limit counts with the limit.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from seastar_gym.controllers.learned import LearnedPolicy, bundled_file, load
from seastar_gym.envs.layout import Layout
from seastar_gym.envs.options import make_scene
from seastar_gym.envs.sight import Sees, Sight
from seastar_gym.evaluation.swim import HELD_OUT_SEED, TIME_LIMIT, swim_many
from seastar_gym.scene.numerics import Fidelity
from studies.frame import Results, Study
from studies.pages import markdown

N_PATHS = 200
FIDELITY: Fidelity = "fast"
CAMERA = "0.2 s, camera"
PERIODS: dict[str, float | None] = {"1 s": None, "0.5 s": 0.5, "0.2 s": 0.2, CAMERA: 0.2}
"""Time between decisions [s], None for strokes, by what the table calls it."""
RATE = 20.0
"""Pictures per second [Hz]: decisions and delays are whole multiples of the time between two."""


@dataclass(frozen=True)
class Condition:
    """What is otherwise than nominal.

    delay: Of all that is seen [s]. action_delay: Of commands [s], which only wires can take. noise: Of seen places [m].
    modulus: Over the nominal one. moves: Whether velocities are seen; otherwise they are zero.
    """

    delay: float = 0.0
    action_delay: float = 0.0
    noise: float = 0.0
    modulus: float = 1.0
    moves: bool = True


CONDITIONS = {
    "nominal, no delay": Condition(),
    "camera delay 50 ms": Condition(delay=0.05),
    "camera delay 100 ms": Condition(delay=0.1),
    "camera delay 150 ms": Condition(delay=0.15),
    "command delay 50 ms": Condition(action_delay=0.05),
    "position noise 5 mm": Condition(noise=5e-3),
    "velocities set to zero": Condition(moves=False),
    "modulus x 0.7": Condition(modulus=0.7),
    "modulus x 0.5": Condition(modulus=0.5),
    "camera delay 100 ms, modulus x 0.7": Condition(delay=0.1, modulus=0.7),
}


class Seeing:
    """A policy under a condition: without the age of what is seen, which it does not know. layout: That it knows."""

    def __init__(self, policy: LearnedPolicy, condition: Condition, layout: Layout):
        self.policy, self.actions, self.condition = policy, policy.actions, condition
        self.age, self.velocities = layout.waypoints.start, slice(layout.velocities.start, layout.hub_velocity.stop)

    def predict(self, observation: Any, *others: Any, **named: Any) -> tuple[Any, Any]:
        """As the policy does."""
        seen = np.delete(observation, self.age, axis=1)
        if not self.condition.moves:
            seen[:, self.velocities] = 0.0
        return self.policy.predict(seen, *others, **named)


def examine(name: str, condition: Condition) -> dict[str, Any] | None:
    """Mean time [s] of the swims of the bundled policy of a column, and how many arrive.

    None where a condition does not apply.
    """
    period = PERIODS[name]
    if (period is None and condition.action_delay) or (name == CAMERA and not condition.moves):
        return None
    sees: Sees = "pose" if name == CAMERA else "nodes"
    scene = make_scene(None, FIDELITY, period)
    scene = replace(scene, robot=replace(scene.robot, youngs_modulus=condition.modulus * scene.robot.youngs_modulus))
    policy = load(bundled_file(period, task="sim-to-real" if name == CAMERA else None))
    swims = swim_many(
        "learned", policy if name == CAMERA else Seeing(policy, condition, Layout.of(scene)), "random", N_PATHS, scene,
        seed=HELD_OUT_SEED, decision_period=period, action_delay=condition.action_delay,
        sight=Sight(RATE, condition.delay, noise=condition.noise, sees=sees),
    )  # fmt: skip
    times = [float(swim.time[-1]) if swim.finished else TIME_LIMIT for swim in swims]
    return {"mean": float(np.mean(np.round(times, 1))), "arrived": sum(swim.finished for swim in swims)}


def table(results: Mapping[str, Any]) -> str:
    """Mean times, and how many arrive where not all do."""
    lines = []
    for condition in CONDITIONS:
        cells = [condition]
        for column in PERIODS:
            found = results["policies"][column][condition]
            lost = "" if found is None or found["arrived"] == N_PATHS else f"; {found['arrived']} of {N_PATHS} arrive"
            cells.append("–" if found is None else f"{found['mean']:.1f}{lost}")
        lines.append(cells)
    return markdown(["", *(f"every {column}" for column in PERIODS)], lines)


def run(results: Results) -> None:
    """Swim what is missing."""
    cells = {
        ("policies", column, name): partial(examine, column, condition)
        for column in PERIODS
        for name, condition in CONDITIONS.items()
    }
    results.fill(cells, lambda found: "does not apply" if found is None else f"{found['mean']:.1f} s")


STUDY = Study("robustness", run, file="plant/robustness.json", tables={"robustness": table})
