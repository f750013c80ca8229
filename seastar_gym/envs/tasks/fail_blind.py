"""`SeastarFailBlind-v0`: limbs that are dead, for a robot that does not see its limbs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from seastar_gym.envs.layout import VELOCITY_SCALE
from seastar_gym.envs.options import RewardWeights, wrapped
from seastar_gym.envs.randomization import LIMB_STRENGTHS
from seastar_gym.envs.robots import Flags, Floats, Robots, Score
from seastar_gym.envs.scenery import Scenery
from seastar_gym.envs.waypoints import Waypoints
from seastar_gym.scene import Scene
from seastar_gym.scene.number import whole
from seastar_gym.scene.serial import register_part

MOST_DEAD = 2


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


@register_part
@dataclass(frozen=True)
class FailBlind(Waypoints):
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

    observes_commands = True
    observes_actuators = False  # wires of dead limbs stay cold
    entries = ("vector", "pseudoscalar")
    shows_limbs = False
    tells_errors = False  # errors were measured of whole robots
    goals_are_waypoints = False

    @property
    def randomization(self) -> AnyLimbs:  # type: ignore[override]
        """Dead limbs."""
        return AnyLimbs(self.dead)

    def draw(self, rng: np.random.Generator, scene: Scene) -> dict[str, Any]:
        """A path; hub and heading at the last look, and way and turn of the last decision."""
        still = {"hub": np.zeros(2), "heading": 0.0, "way": np.zeros(2), "turn": 0.0}
        return {**super().draw(rng, scene), **still}

    def begin(self, robots: Robots, begun: Flags) -> None:
        """Swim to the first waypoint, and know where from."""
        super().begin(robots, begun)
        robots.episode.hub[begun] = robots.seen_hub()[begun]
        robots.episode.heading[begun] = robots.seen_heading()[begun]

    def score(self, robots: Robots, hub: Floats, pulses: Floats) -> Score:
        """That of all swims along waypoints; odometry, too."""
        now, place, heading = robots.episode, robots.seen_hub(), robots.seen_heading()
        c, s = np.cos(now.heading), np.sin(now.heading)
        x, y = (place - now.hub).T
        now.way = np.stack([c * x + s * y, c * y - s * x], axis=1)
        now.turn = wrapped(heading - now.heading)
        now.hub, now.heading = place, heading
        return super().score(robots, hub, pulses)

    def observation(self, robots: Robots) -> Floats:
        """Odometry of the last decision."""
        velocity = robots.episode.way / (VELOCITY_SCALE * robots.decision_period)
        return np.column_stack([velocity, robots.episode.turn])

    def scenery(self, robots: Robots, robot: int) -> Scenery:
        """Which limbs are dead."""
        dead = np.flatnonzero(robots.drawn[LIMB_STRENGTHS][robot] == 0.0) + 1
        return Scenery(note="dead limbs: " + (", ".join(map(str, dead)) or "none"))
