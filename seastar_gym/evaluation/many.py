"""Many swims side by side, nominal or disturbed, and their means with confidence intervals."""

from collections.abc import Sequence

import numpy as np

from seastar_gym.controllers.contract import Policy, actions_of, require_fit, require_policy
from seastar_gym.envs.reward import RewardWeights
from seastar_gym.envs.task import Path as SwimPath
from seastar_gym.evaluation.disturbances import Disturbance, DisturbedTask
from seastar_gym.evaluation.rollout import TaskBatch, rollout
from seastar_gym.evaluation.statistics import Estimate, mean_with_interval
from seastar_gym.evaluation.swim import MOST_DECISIONS, RECORDED, Swim, swims_of
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import require_count, require_kind

HELD_OUT_SEED = 1_000
"""Seed of the paths that policies are measured on; trainings draw theirs from small seeds."""
MOST_SWIMS, LARGEST_SEED = 1_000_000, 2**63
"""Most swims side by side, and the largest seed of their paths."""
MM = 1000.0


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
    task = DisturbedTask(
        disturbance, np.random.default_rng([seed, n_swims]), scene, n_swims, path, RewardWeights(), waypoint_radius,
        with_heading, threads, actions=actions, decision_period=decision_period,
    )  # fmt: skip
    batch = TaskBatch(task)
    batch.np_random = tuple(np.random.default_rng([seed, swim]) for swim in range(n_swims))
    swims = swims_of(agent, rollout(batch, policy, until=max_strokes, record=RECORDED))
    batch.close()
    return swims


def statistics(swims: Sequence[Swim]) -> dict[str, Estimate]:
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
