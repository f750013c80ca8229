"""Trainings on what is believed of the robot, and swims on the robot as it was built."""

import time
from typing import Any, NamedTuple

import numpy as np

from agents.hyperparameters import Hyperparameters
from agents.ppo import make_model, make_training_env, policy_of
from seastar_gym import DomainRandomization, Numerics, Scene
from seastar_gym.controllers.learned import LearnedPolicy
from seastar_gym.evaluation.many import HELD_OUT_SEED, swim_many
from studies.worked_example.robots import built

LEARNER = Hyperparameters()
"""Hyperparameters of all trainings."""
MAX_STROKES = 400
"""Strokes after which a swim ends; its time is that of a robot that does not arrive."""
SWUM_WITH = 13, Numerics("implicit-midpoint", 2e-3, 1e-7)
"""Nodes per limb and numerics of the swims on the robot as it was built."""


class Belief(NamedTuple):
    """What a training takes the robot for. draws: Numbers that every episode draws anew; None for none."""

    scene: Scene
    draws: DomainRandomization | None = None


def train(belief: Belief, seed: int, strokes: int) -> tuple[LearnedPolicy, float]:
    """Policy after so many strokes on random paths with random headings, and the processor time [s]; one thread."""
    env = make_training_env(LEARNER, "random", True, scene=belief.scene, threads=1, randomization=belief.draws)
    model = make_model(env, LEARNER, seed)
    env.reset()  # compiles, which is no part of the training
    began = time.process_time()
    model.learn(strokes)
    seconds = time.process_time() - began
    policy = policy_of(model)
    env.close()
    return policy, seconds


def seconds_to_finish(policy: LearnedPolicy, scene: Scene, path: str, swims: int) -> list[float]:
    """Times to the last waypoint [s], of MAX_STROKES strokes for who does not arrive; "random": held-out paths."""
    done = swim_many("learned", policy, path, swims, scene, max_strokes=MAX_STROKES, seed=HELD_OUT_SEED, threads=1)
    return [float(each.time[-1]) for each in done]


def scores(policy: LearnedPolicy, belief: Belief, paths: int) -> dict[str, Any]:
    """Times of a policy [s] on the robot as it was built, and those expected by the scene that it was trained on."""
    robot = built(*SWUM_WITH)
    return {
        "random": np.round(seconds_to_finish(policy, robot, "random", paths), 6).tolist(),
        "pentagon": seconds_to_finish(policy, robot, "pentagon", 1)[0],
        "expected": np.round(seconds_to_finish(policy, belief.scene, "random", paths), 6).tolist(),
        "expected_pentagon": seconds_to_finish(policy, belief.scene, "pentagon", 1)[0],
    }
