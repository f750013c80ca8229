"""Disturbances of the swims of a batch: a current, a weak limb, noise on observations, lost strokes.

A uniform current is a change of frame: the robots swim in still water, towards waypoints that drift the other way, and
observations and positions are carried back. So every robot of a batch has a current in a direction of its own.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.controllers.greedy import turned
from seastar_gym.envs.layout import VELOCITY_SCALE
from seastar_gym.envs.options import SwimOptions
from seastar_gym.envs.robots import Flags, Outcome, Robots
from seastar_gym.envs.stations import heading_of
from seastar_gym.envs.waypoints import AlongPath
from seastar_gym.scene.checks import require_number
from seastar_gym.scene.per_robot import column

Floats = NDArray[np.float64]

CURRENT_DIRECTIONS = 8


@dataclass(frozen=True)
class Disturbance:
    """Strengths of the disturbances of a batch; zeros disturb nothing.

    current: Speed of the current [m/s], which has the direction of i/8 of a full turn for robot i.
    weakness: Share of its strength that limb i mod n of robot i lacks.
    noise: Standard deviation of the observed position of the hub and of every station [m].
    lost: Probability that a stroke fails.
    """

    current: float = 0.0
    weakness: float = 0.0
    noise: float = 0.0
    lost: float = 0.0

    def __post_init__(self) -> None:
        for name, unit in (("current", "m/s"), ("weakness", "1"), ("noise", "m"), ("lost", "1")):
            require_number(f"Disturbance.{name}", getattr(self, name), unit, zero_allowed=True)
        if max(self.weakness, self.lost) > 1.0:
            raise ValueError("weakness and lost must be at most 1.")


DISTURBANCES = {
    "none": Disturbance(),
    "current of 0.5 mm/s": Disturbance(current=0.5e-3),
    "current of 1.5 mm/s": Disturbance(current=1.5e-3),
    "a limb at half strength": Disturbance(weakness=0.5),
    "1 mm of noise": Disturbance(noise=1e-3),
    "every tenth stroke lost": Disturbance(lost=0.1),
}


class DisturbedRobots(Robots):
    """Robots that are disturbed; positions are those in the world, where the waypoints stand still.

    rng: Draws noise and lost strokes. task, options, n_robots, threads: See `Robots`.
    """

    task: AlongPath

    def __init__(
        self,
        disturbance: Disturbance,
        rng: np.random.Generator,
        task: AlongPath,
        options: SwimOptions,
        n_robots: int,
        threads: int | None,
    ):
        super().__init__(task, options, n_robots, threads)
        self.disturbance, self._rng = disturbance, rng
        robots, n_limbs = np.arange(self.n_robots), self.scene.robot.n_limbs
        angles = 2.0 * np.pi / CURRENT_DIRECTIONS * robots
        self._current = disturbance.current * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        left = np.where(robots[:, None] % n_limbs == np.arange(n_limbs), 1.0 - disturbance.weakness, 1.0)
        self.simulator.set_limb_strengths(self.simulator.limb_strengths * left)
        self._carried = np.zeros((self.n_robots, 2))

    def reset(self, robots: Flags, generators: list[np.random.Generator], asked: Any = None) -> None:
        """Begin an episode of the robots in a mask, at rest in the world where it is that of all."""
        super().reset(robots, generators, asked)
        if robots.all():  # a state is put into all robots
            state = self.simulator.get_state()
            self.simulator.set_state(state._replace(velocities=state.velocities - self._current[:, None]))
        self._carried[robots] = 0.0

    def facts(self, hub: Floats | None = None) -> dict[str, NDArray[Any]]:
        """What is known of every robot now, with its place in the world."""
        facts = super().facts(hub)
        return facts | {"hub_position": facts["hub_position"] + self._carried}

    def observe(self) -> NDArray[np.float32]:
        """Observations of the disturbed robots, shape (n_robots, size)."""
        seen, at = super().observe(), self.layout
        if self.disturbance.current > 0.0:
            axes = heading_of(self.simulator)
            seen[:, at.hub_velocity] += turned(self._current, -axes) / VELOCITY_SCALE
        if self.disturbance.noise > 0.0:
            n_places = 1 + seen[:, at.positions].shape[1] // 2
            error = self._rng.normal(0.0, self.disturbance.noise, (len(seen), n_places, 2))
            error /= column(self.scene.robot.limb_length, 2)
            seen[:, at.positions] += (error[:, 1:] - error[:, :1]).reshape(len(seen), -1)
            seen[:, at.waypoints] -= np.tile(error[:, 0], 2)
        return seen

    def step(self, commands: Floats) -> Outcome:
        """One decision of every robot; returns its outcome, with the commands that were followed and not lost.

        Robots whose solver gave up stay where they are: their swims are as long as those of others who do not arrive.
        """
        lost = self._rng.random(len(commands)) < self.disturbance.lost
        drift = self._current * self.decision_period
        self.task.move_waypoints(self, -drift)
        self._carried += drift
        outcome = super().step(np.where(lost[:, None], 0.0, commands))
        return outcome._replace(terminated=outcome.info["is_success"])
