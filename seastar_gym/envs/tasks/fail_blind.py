"""`SeastarFailBlind-v0`: limbs that are dead, for a robot that does not see its limbs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from seastar_gym.envs.headings import wrapped
from seastar_gym.envs.layout import VELOCITY_SCALE, Entry
from seastar_gym.envs.options import SwimOptions
from seastar_gym.envs.randomization import LIMB_STRENGTHS
from seastar_gym.envs.reward import RewardWeights
from seastar_gym.envs.scenery import Scenery
from seastar_gym.envs.swimming import Flags, Floats, Score
from seastar_gym.envs.task import SwimTask
from seastar_gym.envs.tasks.challenge import Challenge
from seastar_gym.envs.tasks.numbered import Numbered, Split
from seastar_gym.scene import Scene
from seastar_gym.scene.number import whole
from seastar_gym.scene.serial import register_part

MOST_DEAD = 2


@register_part
@dataclass(frozen=True)
class FailBlind(Challenge):
    """Waypoints for a robot of which some limbs are dead, and which sees its way, but not its limbs.

    `dead` limbs never move in an episode, whatever they are commanded. Nothing tells the robot which. Where its best
    command is one of dead limbs, a controller that remembers nothing stays for ever. One that compares what happened
    with what it meant knows the dead limbs after a few decisions, and swims with the others.

    ## Episode
    A random path of five legs of 0.1 to 0.2 m, as `path="random"` of `SeastarSwim-v0`, from a random heading. It ends
    when the last waypoint is reached. Every draw can be solved: three live limbs swim any way.

    ## Observation
    No stations, no velocity of the hub and no wires, which would tell. Odometry instead, and the waypoints:

    | index | meaning                                                                     | unit      | range |
    |-------|-----------------------------------------------------------------------------|-----------|-------|
    | 0..4  | last command of limbs 1 to 5                                                | 1         | -1..1 |
    | 5..7  | mean velocity of the hub over the last decision, x and y in the body frame  | 0.025 m/s | -     |
    |       | in which it began; turn in it                                               | rad       | -     |
    | 8..11 | current and next waypoint, as in `SeastarSwim-v0`                           | 0.1 m     | -     |

    ## Reward
    | term              | meaning                                                      | default weight |
    |-------------------|--------------------------------------------------------------|----------------|
    | `reward_progress` | decrease of the length of the route to the last waypoint [m] | 200 per metre  |
    | `reward_waypoint` | waypoints reached in the decision                            | 1 per waypoint |
    | `reward_effort`   | minus the time for which wires were heated, in pulses        | 0.01 per pulse |

    Robots that arrive are compared by their time, the task's measure.

    ## Info
    That of `SeastarSwim-v0` without the measured errors, which are those of whole robots; besides,

    | name             | type       | unit | meaning                                       |
    |------------------|------------|------|-----------------------------------------------|
    | `instance`       | int        | -    | number of the episode in its split            |
    | `limb_strengths` | array (5,) | 1    | limb by limb: 1, or 0 where the limb is dead  |

    `limb_strengths` is what the robot is not told.

    ## Arguments
    dead: Number of dead limbs, 0 to 2.
    reward: Weights of the reward's terms.
    """

    dead: Annotated[int, whole(0, MOST_DEAD)] = 2
    reward: RewardWeights = RewardWeights()

    def swimming(self, options: SwimOptions, n_robots: int, threads: int | None, split: Split) -> FailBlindTask:
        """The task of so many robots."""
        return FailBlindTask(self, options, n_robots, threads, split)


@dataclass(frozen=True)
class AnyLimbs:
    """Draws of dead limbs, all sets of so many with the same probability."""

    dead: int

    def first_values(self, scene: Scene, n_robots: int) -> dict[str, Floats]:
        """Whole robots."""
        return {LIMB_STRENGTHS: np.ones((n_robots, scene.robot.n_limbs))}

    def draw(self, values: dict[str, Floats], robot: int, rng: np.random.Generator) -> None:
        """Draw a robot's dead limbs, in place."""
        strengths = values[LIMB_STRENGTHS]
        strengths[robot] = 1.0
        strengths[robot, rng.permutation(strengths.shape[1])[: self.dead]] = 0.0


class FailBlindTask(Numbered, SwimTask):
    """Task of robots with dead limbs that see their way alone."""

    observes_commands = True
    entries: tuple[Entry, ...] = ("vector", "pseudoscalar")
    shows_limbs = False
    goals_are_waypoints = False

    def __init__(self, config: FailBlind, options: SwimOptions, n_robots: int, threads: int | None, split: Split):
        self.config = config
        self._hub, self._before = np.zeros((n_robots, 2)), np.zeros(n_robots)  # hub and heading at the last look
        self._way, self._turn = np.zeros((n_robots, 2)), np.zeros(n_robots)  # of the last decision
        options = replace(options, path="random", random_heading=True, reward=config.reward)
        blind = replace(options, observe_actuators=False)  # wires of dead limbs stay cold
        SwimTask.__init__(self, blind, n_robots, threads)
        self._tells_errors = False  # errors were measured of whole robots
        self._draws = AnyLimbs(config.dead)
        self.drawn = self._draws.first_values(self.scene, n_robots)
        self._number(split)

    def _begin(self, robots: Flags) -> None:
        super()._begin(robots)
        self._hub[robots] = self.seen_hub()[robots]
        self._before[robots] = self.seen_heading()[robots]
        self._way[robots], self._turn[robots] = 0.0, 0.0

    def _reward_terms(self, hub: Floats, pulses: Floats) -> Score:
        place, heading, c, s = self.seen_hub(), self.seen_heading(), np.cos(self._before), np.sin(self._before)
        x, y = (place - self._hub).T
        self._way = np.stack([c * x + s * y, c * y - s * x], axis=1)
        self._turn = wrapped(heading - self._before)
        self._hub, self._before = place, heading
        return super()._reward_terms(hub, pulses)

    def _task_observation(self) -> Floats:
        velocity = self._way / (VELOCITY_SCALE * self.decision_period)
        return np.column_stack([velocity, self._turn])

    def scenery(self, robot: int) -> Scenery:
        """What pictures of a robot show besides its waypoints."""
        dead = np.flatnonzero(self.drawn[LIMB_STRENGTHS][robot] == 0.0) + 1
        return Scenery(note="dead limbs: " + (", ".join(map(str, dead)) or "none"))
