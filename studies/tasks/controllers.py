"""Controllers of the study that do not learn, from rest to a bound that knows everything.

| name       | what it knows, and how it chooses                                                                     |
|------------|-------------------------------------------------------------------------------------------------------|
| `rest`     | nothing: no limb is heated                                                                            |
| `greedy`   | a map of the mean displacement of every action; it takes the one that ends nearest                    |
| `planner`  | what is observed: it simulates a decision ahead, of the robot, water and prey that it believes in     |
| `adaptive` | what is observed, with a memory; it believes in what has explained the past best                      |
| `prior`    | besides, how `ObstTrap` draws horseshoes: it believes in the most probable one                        |
| `informed` | what is hidden, too; the best that was found, which is no proof that nothing is better                |
"""

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np

from seastar_gym.controllers.contract import Policy
from seastar_gym.controllers.greedy import turned
from seastar_gym.controllers.scripted import scripted
from seastar_gym.envs.commands import command_table
from seastar_gym.envs.tasks.challenge import Challenge
from seastar_gym.envs.tasks.course import Courses, Pursuit
from seastar_gym.envs.tasks.fail_blind import FailBlind
from seastar_gym.envs.tasks.miswired import Miswired
from seastar_gym.envs.tasks.obst_trap import ObstTrap
from seastar_gym.envs.tasks.prey import LOOK_AHEAD, Prey
from seastar_gym.envs.tasks.prizes import Prizes
from seastar_gym.envs.tasks.sim_to_real import SimToReal
from seastar_gym.envs.tasks.station import Station
from seastar_gym.evaluation.rollout import Batch, Info
from seastar_gym.simulator import State
from studies.frame import Floats
from studies.tasks.ahead import Ahead, Odometer, Robots, few_commands
from studies.tasks.blind import BlindPlanner, LimbsKnown, StateKnown, failure_guess
from studies.tasks.episodes import Agent
from studies.tasks.greedy import Actions, Floats32, Greedy, GreedyOnRoute, Guess, length, route
from studies.tasks.rounds import BestRound, MostPerMetre, PlannedMostPerMetre
from studies.tasks.trap import ClearGreedy, ClearPlanner, all_discs, discs_by_the_prior, discs_so_far

CONTROLLERS = ("rest", "greedy", "planner", "adaptive", "prior", "informed")


# Miswired


class WiringPlanner:
    """Agent that simulates pairs of limbs one decision ahead. knows: Whether it is told the wiring."""

    def __init__(self, robots: Robots, knows: bool):
        self._robots, self._knows = robots, knows
        self._ahead = Ahead(robots, command_table("pairs", robots.scene.robot.n_limbs))

    def act(self, observations: Floats32, info: Info) -> Actions:
        """Actions of all robots."""
        target, after = self._robots.targets(observations)
        states, wiring = self._robots.states(observations), np.ones_like(info["wiring"])
        if self._knows:
            wiring = info["wiring"]
            states = rewired(states, wiring)
        best = self._ahead.best(states, lambda hub, _: route(hub, target, after))
        return self._robots.actions_of(self._ahead.commands[best] * wiring)


def rewired(states: State, wiring: Floats) -> State:
    """States whose wires have the names of the directions in which they turn their limbs."""
    wires = states.actuators
    if wires is None:
        return states
    pairs = wires.reshape(*wires.shape[:2], -1, 2)
    return states._replace(
        actuators=np.where(wiring[..., None, None] < 0, pairs[..., ::-1], pairs).reshape(wires.shape)
    )


def wiring_guess(robots: Robots) -> Guess:
    """Agent that believes in the wiring that has explained its displacements and turns best."""
    return Guess(robots, np.array(list(itertools.product((1.0, -1.0), repeat=robots.scene.robot.n_limbs))))


# Prey


class Interceptor:
    """Agent that simulates actions one decision ahead and takes the one from which the prey is met first.

    foresee: Function of this agent, observations and info that gives places of the prey in the body frame [m], shape
    (n, len(SINCE), 2), after times SINCE from the end of the decision.
    """

    def __init__(self, robots: Robots, foresee: Callable[["Interceptor", Floats32, Info], Floats]):
        self.robots, self._foresee = robots, foresee
        self._ahead = Ahead(robots, robots.table)
        self.later = robots.period + (0.0 if robots.in_strokes else self._ahead.coasting)
        challenge: Prey = robots.inner.challenge
        self._pursuit = Pursuit(robots.speed, 0.9 * challenge.catch_radius)
        self.velocity: Floats | None = None  # at the last decision, in the world [m/s]

    def act(self, observations: Floats32, info: Info) -> Actions:
        """Actions of all robots."""
        prey = self._foresee(self, observations, info)
        return self._ahead.best(self.robots.states(observations), lambda hub, _: self._cost(hub, prey))

    def _cost(self, hub: Floats, prey: Floats) -> Floats:
        """Time until the prey is met [s]; where it is not, the time that is lacking at least, on top of NEVER."""
        many = np.broadcast_to(prey[:, None], (*hub.shape[:2], *prey.shape[1:]))
        lacking = self._pursuit.gaps(hub, many, SINCE).min(axis=-1) / self._pursuit.speed
        return np.minimum(self._pursuit.meeting_time(hub, many, SINCE), NEVER + np.maximum(lacking, 0.0))


SINCE = np.arange(0.0, 201.0)
"""Times ahead at which the prey is foreseen [s]."""
NEVER = 1e3


def straight_on(agent: Interceptor, observations: Floats32, info: Info) -> Floats:
    """The prey swims straight on."""
    place, later = agent.robots.targets(observations)
    velocity = (later - place) / LOOK_AHEAD
    return place[:, None] + (agent.later + SINCE)[:, None] * velocity[:, None]


def on_a_circle(agent: Interceptor, observations: Floats32, info: Info) -> Floats:
    """The prey goes on turning as it has turned since the last decision."""
    place, later = agent.robots.targets(observations)
    velocity = (later - place) / LOOK_AHEAD
    in_world, before = turned(velocity, agent.robots.heading()), agent.velocity
    agent.velocity = in_world
    rate = np.zeros(len(place))
    if before is not None:
        cross = before[:, 0] * in_world[:, 1] - before[:, 1] * in_world[:, 0]
        turn = np.arctan2(cross, (before * in_world).sum(axis=1))
        rate = np.where(np.abs(turn) < LARGEST_TURN * agent.robots.period, turn / agent.robots.period, 0.0)
    angles = rate[:, None] * (agent.later + SINCE)
    swept = np.where(np.abs(angles) > 1e-9, np.expm1(1j * angles) / np.where(angles == 0.0, 1.0, 1j * angles), 1.0)
    on = (place @ [1.0, 1j])[:, None] + (velocity @ [1.0, 1j])[:, None] * (agent.later + SINCE) * swept
    return np.stack([on.real, on.imag], axis=-1)


LARGEST_TURN = 0.2
"""Turn per second of a prey [rad/s]; of more, it is another prey."""


def on_its_course(agent: Interceptor, observations: Floats32, info: Info) -> Floats:
    """The prey swims as it will swim."""
    time = info["time"][:, None] + agent.later + SINCE
    places = Courses(info["course"][:, None]).place(time) - info["hub_position"][:, None]
    back = -np.repeat(agent.robots.heading(), len(SINCE))
    return turned(places.reshape(-1, 2), back).reshape(places.shape)


# Station


class DriftGuess(Greedy):
    """Greedy agent that adds the mean of what it has drifted off its map so far."""

    def __init__(self, robots: Robots):
        super().__init__(robots)
        self._odometer, self._drift, self._decisions = Odometer(robots), np.zeros((robots.n, 2)), 0
        self._last = np.zeros(robots.n, np.int64)
        self._heading = np.zeros(robots.n)

    def act(self, observations: Floats32, info: Info) -> Actions:
        """Actions of all robots."""
        found = self._odometer.read()
        if found is not None:
            self._decisions = min(self._decisions + 1, 20)
            missed = turned(found[0] - self.hub[self._last], self._heading)
            self._drift += (missed - self._drift) / self._decisions
        self._heading = self.robots.heading()
        target, _ = self.robots.targets(observations)
        ends = self.hub[None] + turned(self._drift, -self._heading)[:, None]
        self._last = np.argmin(length(ends - target[:, None]), axis=1)
        return self._last


class StationPlanner:
    """Agent that simulates single limbs and pairs of limbs. knows: Whether it is told the current."""

    def __init__(self, robots: Robots, knows: bool):
        self._robots, self._knows = robots, knows
        self._ahead = Ahead(robots, few_commands(robots.scene.robot.n_limbs), depth=2 if knows else 1)

    def act(self, observations: Floats32, info: Info) -> Actions:
        """Actions of all robots."""
        target, _ = self._robots.targets(observations)
        states, flow = self._robots.states(observations), np.zeros((self._robots.n, 2))
        if self._knows:
            in_world = np.stack([info["fluid.current.u_x"], info["fluid.current.u_y"]], axis=1)
            flow = turned(in_world, -self._robots.heading())
            states = states._replace(velocities=states.velocities - flow[:, None])  # in the frame of the water
        ahead = self._ahead

        def cost(hub: Floats, decision: int) -> Floats:
            carried = flow * (decision * self._robots.period + ahead.coasting)
            return length(hub + carried[:, None] - target[:, None])

        return self._robots.actions_of(ahead.commands[ahead.best(states, cost)])


MAKERS: dict[type, dict[str, Callable[[Robots], Agent]]] = {
    Miswired: {
        "greedy": GreedyOnRoute,
        "planner": lambda robots: WiringPlanner(robots, knows=False),
        "adaptive": wiring_guess,
        "informed": lambda robots: WiringPlanner(robots, knows=True),
    },
    Prey: {
        "greedy": Greedy,
        "planner": lambda robots: Interceptor(robots, straight_on),
        "adaptive": lambda robots: Interceptor(robots, on_a_circle),
        "informed": lambda robots: Interceptor(robots, on_its_course),
    },
    Station: {
        "greedy": Greedy,
        "planner": lambda robots: StationPlanner(robots, knows=False),
        "adaptive": DriftGuess,
        "informed": lambda robots: StationPlanner(robots, knows=True),
    },
    FailBlind: {
        "greedy": GreedyOnRoute,
        "planner": BlindPlanner,
        "adaptive": failure_guess,
        "informed": LimbsKnown,
    },
    ObstTrap: {
        "greedy": ClearGreedy,
        "planner": ClearPlanner,
        "adaptive": lambda robots: ClearPlanner(robots, discs_so_far()),
        "prior": lambda robots: ClearPlanner(robots, discs_by_the_prior()),
        "informed": lambda robots: ClearPlanner(robots, all_discs),
    },
    Prizes: {"greedy": MostPerMetre, "planner": PlannedMostPerMetre, "informed": BestRound},
    SimToReal: {"greedy": GreedyOnRoute, "planner": BlindPlanner, "informed": StateKnown},
}
"""Functions that make controllers, by challenge and name. Of prizes nothing is hidden, so nobody adapts to it."""


def is_swum(name: str, challenge: Challenge) -> bool:
    """Whether there is a controller of a name for a challenge."""
    return name == "rest" or name in MAKERS[type(challenge)]


def make_controller(name: str, batch: Batch) -> Agent | Policy:
    """Controller of the robots of a batch."""
    robots: Any = Robots(batch)
    if name == "rest":
        return scripted("rest", robots.inner.actions)
    return MAKERS[type(robots.inner.challenge)][name](robots)
