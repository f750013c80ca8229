"""A student that sees little learns what a teacher that sees all would do, each in its own frame."""

import numpy as np
import pytest
import torch
from gymnasium.vector import AutoresetMode

from agents.distillation import Teacher, distil
from agents.tasks.learning import imitate
from refusals import assert_refused
from seastar_gym.controllers.learned import pretrained
from seastar_gym.envs.symmetry import VectorFrameStack
from seastar_gym.evaluation.tasks import make_batch

ID = "SeastarSwimSimToReal-v0"


def batch(n=16, id=ID, past=8):
    arguments = {"split": "train", "fidelity": "fast", "threads": 1, "autoreset_mode": AutoresetMode.SAME_STEP}
    return VectorFrameStack(make_batch(id, n, **arguments), past)


@pytest.fixture(scope="module")
def teacher():
    return pretrained("timed-0.2s")


def test_advice_is_the_teachers_own_action_whatever_the_student_turns(teacher):
    robots = batch()
    robots.reset(seed=0)
    guide = Teacher(teacher, robots.frame_stack.symmetry)
    for _ in range(8):
        state = robots.unwrapped.privileged_observations()
        theirs, _ = teacher.predict(state, deterministic=True)  # in the world
        advice = np.argmax(guide.logits(state, robots.elements), axis=1)  # as the student sees it
        np.testing.assert_array_equal(robots.frame_stack.symmetry.restore(advice, robots.elements), theirs)
        robots.step(advice)
    assert len(set(robots.elements.tolist())) > 4


def test_a_student_learns_and_the_same_seed_learns_the_same(teacher):
    """After six rounds it agrees with its teacher far more often than by chance, from the camera's pictures alone."""
    torch.set_num_threads(1)
    first, again = (distil(teacher, batch(64), 12_288, seed=1, hidden=(64,)) for _ in range(2))
    for name, values in first.weights.items():
        np.testing.assert_array_equal(again.weights[name], values)
    about = first.description
    assert about.past == 8 and about.task == "sim-to-real" and not about.shows_limbs and about.hidden == (64,)
    robots = batch(64)
    observations, _ = robots.reset(seed=7)
    symmetry, agreed = robots.frame_stack.symmetry, []
    guide = Teacher(teacher, symmetry)
    for _ in range(20):
        chosen = first.logits(observations)[:, 0].argmax(axis=1)
        advice = guide.logits(robots.unwrapped.privileged_observations(), robots.elements)
        agreed.append(advice.argmax(axis=1) == chosen)
        observations, *_ = robots.step(chosen)
    assert np.mean(agreed) > 0.2  # by chance 1 of 21


def test_who_cannot_teach_is_refused(teacher):
    pose = imitate(ID, 0, 4_096, "fast", 1)
    with assert_refused("A teacher is a policy with symmetry, without memory"):
        distil(pose, batch(), 100, 0)
    with assert_refused("The teacher does not see what this batch's robots would show"):
        distil(pretrained("strokes"), batch(), 100, 0)
    with assert_refused("batch must be a VectorFrameStack"):
        distil(teacher, batch().env, 100, 0)
    with assert_refused("decisions must be a whole number"):
        distil(teacher, batch(), 0, 0)
