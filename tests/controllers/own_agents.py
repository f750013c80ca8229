"""Agents of a user's own, for `module:function`."""

import numpy as np


class Towards:
    """Swims straight on, in the action mode "pairs"."""

    actions = "pairs"
    batched = True

    def __init__(self, env):
        self.scene = env.scene
        self.action = 8 if env.scene.robot.n_limbs == 5 else 1  # {2+, 5-}

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        return np.full(np.shape(observation)[:-1], self.action), state


def nothing(env):
    """No policy."""
    return 3


def of_nothing():
    """A function that takes no environment."""


class OfOneArgument(Towards):
    """Takes the observation alone."""

    def predict(self, observation):
        return self.action, None


class Failing(Towards):
    """Divides by zero."""

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        return 1 / 0, state


class FailingRobot(Failing):
    """Divides by zero, for one robot."""

    batched = False


def unborn(env):
    """Fails before there is a policy."""
    raise KeyError("no weights")


class Stateless(Towards):
    """Returns the action alone."""

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        return self.action


class StatelessRobot(Stateless):
    """The same for one robot at a time."""

    batched = False


number = 3
