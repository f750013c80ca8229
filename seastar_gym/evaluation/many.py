"""Many swims side by side, nominal or disturbed, and their means with confidence intervals."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import bootstrap

from seastar_gym.controllers.contract import Policy, actions_of, require_fit, require_policy
from seastar_gym.envs.commands import to_commands
from seastar_gym.envs.options import Path as SwimPath
from seastar_gym.envs.options import SwimOptions
from seastar_gym.envs.swimming import Outcome
from seastar_gym.envs.task import SwimTask
from seastar_gym.evaluation.disturbances import Disturbance, DisturbedTask
from seastar_gym.evaluation.swim import MOST_DECISIONS, Swim
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import require_count, require_kind

HELD_OUT_SEED = 1_000
"""Seed of the paths that policies are measured on; trainings draw theirs from small seeds."""
MOST_SWIMS, LARGEST_SEED = 1_000_000, 2**63
"""Most swims side by side, and the largest seed of their paths."""
MM = 1000.0
RESAMPLES, CONFIDENCE = 2000, 0.95

HEAT = ("limbs_heated", "heating_time", "energy")
"""Entries of info, and fields of a `Swim`, of every decision."""

Interval = tuple[float, float, float]
"""Mean, and the ends of its confidence interval."""


def swim_many(
    agent: str,
    policy: Policy,
    path: SwimPath,
    n_swims: int,
    scene: Scene,
    disturbance: Disturbance = Disturbance(),
    *,
    max_strokes: int = 400,
    waypoint_radius: float = 0.01,
    seed: int = 0,
    threads: int | None = None,
    decision_period: float | None = None,
) -> list[Swim]:
    """Swims of `n_swims` robots side by side, each to its last waypoint or for `max_strokes` strokes, or decisions.

    The path "random" has random headings. waypoint_radius: Radius of the waypoints [m]. decision_period: Time between
    decisions [s]. None means a stroke.
    """
    require_kind("agent", agent, str, "a text")
    require_policy(policy)
    require_kind("scene", scene, Scene, "a Scene")
    require_kind("disturbance", disturbance, Disturbance, "a Disturbance")
    require_count("n_swims", n_swims, 1, MOST_SWIMS)
    require_count("max_strokes", max_strokes, 1, MOST_DECISIONS)
    require_count("seed", seed, 0, LARGEST_SEED)
    actions = actions_of(policy, scene.robot.n_limbs)
    require_fit(policy, scene, actions, decision_period)
    with_heading = isinstance(path, str) and path == "random"
    options = SwimOptions(
        path, actions, scene=scene, waypoint_radius=waypoint_radius, random_heading=with_heading,
        decision_period=decision_period,
    )  # fmt: skip
    inner = SwimTask(options, n_swims, threads)
    task = DisturbedTask(inner, disturbance, np.random.default_rng([seed, n_swims]))
    task.reset([np.random.default_rng([seed, swim]) for swim in range(n_swims)])
    waypoints, counts = inner.waypoints.copy(), inner.n_waypoints
    hubs, reached = [task.hub_position()], [inner.waypoint_index.copy()]
    outcomes: list[Outcome] = []
    state, begins, n_limbs = None, np.ones(n_swims, bool), scene.robot.n_limbs
    while len(outcomes) < max_strokes and (inner.waypoint_index < counts).any():
        chosen, state = policy.predict(task.observe(), state=state, episode_start=begins, deterministic=True)
        commands = to_commands(actions, n_limbs, chosen, n_swims)
        commands[inner.waypoint_index == counts] = 0.0
        outcomes.append(task.step(commands))
        hubs.append(task.hub_position())
        reached.append(inner.waypoint_index.copy())
        begins[:] = False
    return [
        _up_to_the_last_waypoint(
            Swim(
                agent=agent,
                waypoints=waypoints[k, : counts[k]],
                hub=np.array([hub[k] for hub in hubs]),
                waypoint_index=np.array([index[k] for index in reached]),
                time=inner.decision_period * np.arange(len(hubs), dtype=np.float64),
                **{name: np.array([one.info[name][k] for one in outcomes]) for name in HEAT},
                solver_message=None,
            )
        )
        for k in range(n_swims)
    ]


def _up_to_the_last_waypoint(done: Swim) -> Swim:
    strokes = int(np.argmax(done.waypoint_index == len(done.waypoints))) if done.finished else done.strokes
    parts = {name: getattr(done, name)[: strokes + 1] for name in ("hub", "waypoint_index", "time")}
    return replace(done, **parts, **{name: getattr(done, name)[:strokes] for name in HEAT})


def mean_with_interval(values: NDArray[np.float64]) -> Interval:
    """Mean of values and the ends of its bootstrap confidence interval; NaN where there are no values."""
    if len(values) == 0:
        return np.nan, np.nan, np.nan
    if np.ptp(values) == 0.0:
        return values[0], values[0], values[0]
    found = bootstrap(
        (values,), np.mean, confidence_level=CONFIDENCE, n_resamples=RESAMPLES, method="percentile", batch=100,
        rng=np.random.default_rng(0),
    ).confidence_interval  # fmt: skip
    return float(values.mean()), float(found.low), float(found.high)


def statistics(swims: Sequence[Swim]) -> dict[str, Interval]:
    """Mean measures of a set of swims, by name, with intervals; strokes and seconds are those of finished swims."""
    finished = np.array([done.finished for done in swims], dtype=np.float64)
    strokes = np.array([done.strokes for done in swims if done.finished], dtype=np.float64)
    errors = MM * np.array([done.cross_track_errors.mean() for done in swims])
    seconds = np.array([done.time[-1] for done in swims if done.finished], dtype=np.float64)
    effort = np.array([done.heated_per_metre for done in swims if done.heated_per_metre is not None], dtype=np.float64)
    joules = np.array([done.joules_per_metre for done in swims if done.joules_per_metre is not None], dtype=np.float64)
    measures = {
        "success_rate": finished,
        "strokes_to_finish": strokes,
        "mean_cross_track_error_mm": errors,
        "limbs_heated_per_metre": effort,
        "simulated_time_s": seconds,
        "energy_per_metre_J": joules,
    }
    return {name: mean_with_interval(values) for name, values in measures.items()}
