"""Controllers of `FailBlind` and `SimToReal`: robots that see their way alone."""

import itertools

import numpy as np

from seastar_gym.controllers.greedy import turned, waypoints_of
from seastar_gym.controllers.planner import state_of
from seastar_gym.envs.commands import command_table
from seastar_gym.envs.layout import Layout
from seastar_gym.envs.randomization import LIMB_STRENGTHS
from seastar_gym.envs.stations import body_heading
from seastar_gym.envs.tasks.fail_blind import MOST_DEAD
from seastar_gym.evaluation.rollout import Info
from seastar_gym.simulator import Simulator, State
from studies.frame import Floats
from studies.tasks.ahead import Ahead, Robots
from studies.tasks.greedy import Actions, Floats32, Guess, route


def ends_in_world(robots: Robots, observations: Floats32, state: State) -> tuple[Floats, Floats]:
    """Both targets [m], shape (n, 2) each, in the frame of a state whose robots see them as observed."""
    heading = body_heading(state.positions, robots.scene.robot)
    target, after = (state.positions[:, 0] + turned(seen, heading) for seen in robots.targets(observations))
    return target, after


def begun(state: State) -> State:
    """State from which a decision begins."""
    return state._replace(commands=None, phase=None)


class BlindPlanner:
    """Agent that simulates pairs of limbs one decision ahead, of a whole robot that has swum what it was commanded."""

    def __init__(self, robots: Robots):
        self._robots = robots
        self._ahead = Ahead(robots, command_table("pairs", robots.scene.robot.n_limbs))
        self._believed = Simulator(robots.scene, robots.n, 1)

    def act(self, observations: Floats32, info: Info) -> Actions:
        """Actions of all robots."""
        state = begun(self._believed.get_state())
        target, after = ends_in_world(self._robots, observations, state)
        commands = self._ahead.commands[self._ahead.best(state, lambda hub, _: route(hub, target, after))]
        self._believed.advance(self._robots.period, commands)
        return self._robots.actions_of(commands)


def failure_guess(robots: Robots) -> Guess:
    """Agent that believes in the dead limbs that have explained its displacements and turns best."""
    every = np.array(list(itertools.product((1.0, 0.0), repeat=robots.scene.robot.n_limbs)))
    return Guess(robots, every[(every == 0.0).sum(axis=1) <= MOST_DEAD])


class LimbsKnown:
    """Agent that simulates all commands of its live limbs two decisions ahead, of the very robot."""

    def __init__(self, robots: Robots):
        self._robots, self._ahead = robots, Ahead(robots, robots.table, depth=2)

    def act(self, observations: Floats32, info: Info) -> Actions:
        """Actions of all robots."""
        commands = np.stack([live_commands(strengths) for strengths in info[LIMB_STRENGTHS]])
        self._ahead.commands = commands
        state = begun(self._robots.inner.simulator.get_state())
        target, after = ends_in_world(self._robots, observations, state)
        best = self._ahead.best(state, lambda hub, _: route(hub, target, after))
        return self._robots.actions_of(commands[np.arange(self._robots.n), best])


def live_commands(strengths: Floats) -> Floats:
    """All commands of the limbs that are not dead, shape (3^k, n_limbs)."""
    return np.array(list(itertools.product(*((0.0, 1.0, -1.0) if one else (0.0,) for one in strengths))))


class StateKnown:
    """Agent that simulates pairs of limbs two decisions ahead, from the true state, of a robot with nominal numbers."""

    def __init__(self, robots: Robots):
        self._robots, self._layout = robots, Layout.of(robots.scene)
        self._ahead = Ahead(robots, command_table("pairs", robots.scene.robot.n_limbs), depth=2)

    def act(self, observations: Floats32, info: Info) -> Actions:
        """Actions of all robots."""
        scene, seen = self._robots.scene, self._robots.inner.privileged_observations()
        target, after = waypoints_of(seen, scene, self._layout)
        best = self._ahead.best(state_of(seen, scene, self._layout), lambda hub, _: route(hub, target, after))
        return self._robots.actions_of(self._ahead.commands[best])
