"""Trainings of known processor time, and swims of the trained policies."""

import time
from typing import NamedTuple

from agents.hyperparameters import Hyperparameters
from agents.ppo import make_model, make_training_env, policy_of
from seastar_gym.controllers.learned import LearnedPolicy
from seastar_gym.evaluation.many import HELD_OUT_SEED, swim_many
from seastar_gym.scene import Scene

MAX_STROKES = 400
"""Largest number of strokes of a swim, which is also the score of a robot that does not arrive."""


class Trained(NamedTuple):
    """A policy. seconds: Processor time of its training [s]. strokes: Length of the training [strokes]."""

    policy: LearnedPolicy
    seconds: float
    strokes: int


def train(stages: list[tuple[Scene, int]], seed: int, hyperparameters: Hyperparameters) -> Trained:
    """Train on random paths with random headings, one thread, on every scene for so many strokes in turn.

    The learning rate falls to zero within the first stage, and in each later one from the share of the training that
    is left.
    """
    model, seconds = None, 0.0
    for scene, strokes in stages:
        env = make_training_env(hyperparameters, "random", True, scene=scene, threads=1)
        if model is None:
            model = make_model(env, hyperparameters, seed)
        env.reset()  # compiles, which is no part of the training
        begin = time.process_time()
        first = model.num_timesteps == 0
        model.set_env(env)
        model.learn(strokes, reset_num_timesteps=first)
        seconds += time.process_time() - begin
        policy = policy_of(model)
        env.close()
    assert model is not None
    return Trained(policy, seconds, model.num_timesteps)


def rounded(strokes: float, hyperparameters: Hyperparameters) -> int:
    """Whole number of rollouts, at least one, that has about so many strokes."""
    rollout = hyperparameters.num_envs * hyperparameters.rollout
    return max(1, round(strokes / rollout)) * rollout


def strokes_to_finish(policy: LearnedPolicy, scene: Scene, path: str, swims: int) -> list[int]:
    """Strokes to the last waypoint of so many swims, one thread; path: "random" means the held-out paths."""
    done = swim_many("learned", policy, path, swims, scene, max_strokes=MAX_STROKES, seed=HELD_OUT_SEED, threads=1)
    return [each.strokes for each in done]
