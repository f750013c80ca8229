"""Many swims side by side, nominal or disturbed."""

from __future__ import annotations

import numpy as np

from seastar_gym.controllers.contract import Policy, actions_of, require_fit, require_policy
from seastar_gym.envs.commands import decisions_in
from seastar_gym.envs.options import SwimOptions
from seastar_gym.envs.paths import WAYPOINT_RADIUS
from seastar_gym.envs.sight import Drawn, Sight
from seastar_gym.envs.vector import ManyRobotsEnv
from seastar_gym.envs.waypoints import AlongPath
from seastar_gym.envs.waypoints import Path as SwimPath
from seastar_gym.evaluation.disturbances import Disturbance, DisturbedRobots
from seastar_gym.evaluation.rollout import MOST_DECISIONS, rollout
from seastar_gym.evaluation.swim import RECORDED, TIME_LIMIT, Swim, swims_of
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import require_count, require_kind

HELD_OUT_SEED = 1_000
"""Seed of the paths that policies are measured on; trainings draw theirs from small seeds."""
MOST_SWIMS, LARGEST_SEED = 1_000_000, 2**63
"""Most swims side by side, and the largest seed of their paths."""


def swim_many(
    agent: str,
    policy: Policy,
    path: SwimPath,
    n_swims: int,
    scene: Scene,
    disturbance: Disturbance = Disturbance(),
    *,
    max_strokes: int | None = None,
    waypoint_radius: float = WAYPOINT_RADIUS,
    seed: int = 0,
    threads: int | None = None,
    decision_period: float | None = None,
    sight: Sight | None = None,
    action_delay: Drawn = 0.0,
) -> list[Swim]:
    """Swims of `n_swims` robots side by side, each to its last waypoint or for `max_strokes` strokes, or decisions.

    The path "random" has random headings. max_strokes: None means the decisions of 400 s. waypoint_radius:
    Radius of the waypoints [m]. decision_period: Time between decisions [s]. None means a stroke. sight,
    action_delay: As of the environments.
    """
    require_kind("agent", agent, str, "a text")
    require_policy(policy)
    require_kind("scene", scene, Scene, "a Scene")
    require_kind("disturbance", disturbance, Disturbance, "a Disturbance")
    require_count("n_swims", n_swims, 1, MOST_SWIMS)
    if max_strokes is not None:
        require_count("max_strokes", max_strokes, 1, MOST_DECISIONS)
    require_count("seed", seed, 0, LARGEST_SEED)
    actions = actions_of(policy, scene.robot.n_limbs)
    with_heading = isinstance(path, str) and path == "random"
    task = AlongPath(path, waypoint_radius=waypoint_radius, random_heading=with_heading)
    options = SwimOptions(
        actions, scene=scene, decision_period=decision_period, sight=sight, action_delay=action_delay
    )  # fmt: skip
    robots = DisturbedRobots(disturbance, np.random.default_rng([seed, n_swims]), task, options, n_swims, threads)
    require_fit(policy, scene, actions, decision_period, robots.layout.size, sight=sight)
    batch, limit = ManyRobotsEnv(robots), max_strokes or decisions_in(TIME_LIMIT, decision_period, scene)
    batch.np_random = tuple(np.random.default_rng([seed, swim]) for swim in range(n_swims))
    swims = swims_of(agent, rollout(batch, policy, until=limit, record=RECORDED))
    batch.close()
    return swims
