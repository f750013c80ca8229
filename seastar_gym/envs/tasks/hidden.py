"""Swims along waypoints by robots of which something is hidden, or that are seen badly.

`SeastarMiswired-v0`: limbs whose two wires may have been swapped. `SeastarFailBlind-v0`: limbs that are dead, for a
robot that does not see its limbs. `SeastarSwimSimToReal-v0`: a robot that a late camera sees, and whose stiffness and
drag nobody has measured.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.headings import wrapped
from seastar_gym.envs.layout import VELOCITY_SCALE
from seastar_gym.envs.randomization import LIMB_STRENGTHS, DomainRandomization, LogUniform, Uniform
from seastar_gym.envs.rewards import RewardWeights
from seastar_gym.envs.robots import Flags, Floats, Robots, Score
from seastar_gym.envs.scenery import Scenery
from seastar_gym.envs.sight import Sight
from seastar_gym.envs.waypoints import Waypoints
from seastar_gym.scene import Scene
from seastar_gym.scene.number import whole, within
from seastar_gym.scene.serial import register_part


@register_part
@dataclass(frozen=True)
class Miswired(Waypoints):
    """Waypoints for a robot whose wires may be swapped, limb by limb, which it has to find out.

    At the start of an episode, each limb's two wires are swapped with probability `swap_probability`, and stay so: a
    command + then turns that limb clockwise, and - anti-clockwise. Nothing tells the robot, but what its limbs do. A
    controller that remembers what followed from which command knows all wires after a few decisions; one observation
    tells of the limbs at most that were heated last.

    ## Starting state
    The robot rests with a random heading at the start of a random path of five legs of 0.1 to 0.2 m, as `path="random"`
    of `SeastarSwim-v0`. Every draw can be solved: a robot that knows its wires swims as any other.

    ## Episode end
    `terminated`: the last waypoint is reached.

    ## Observation
    That of `SeastarSwim-v0`, with the command of the last decision among the numbers of every limb, after those of its
    actuator; places for strokes, and for decisions every 0.5 s:

    | strokes  | timed    | meaning                                                    | unit | range |
    |----------|----------|------------------------------------------------------------|------|-------|
    | 0..181   | 0..181   | stations of limbs and the hub, as in `SeastarSwim-v0`      | -    | -     |
    | 182..186 | 182..196 | limb after limb: contractions of its wires, if timed, in   | 1    | -1..1 |
    |          |          | the names of the commands; its last command                |      |       |
    | 187..190 | 197..200 | current and next waypoint, as in `SeastarSwim-v0`          | -    | -     |

    ## Reward
    | term              | meaning                                                      | default weight |
    |-------------------|--------------------------------------------------------------|----------------|
    | `reward_progress` | decrease of the length of the route to the last waypoint [m] | 200 per metre  |
    | `reward_waypoint` | waypoints reached in the decision                            | 1 per waypoint |
    | `reward_effort`   | minus the time for which wires were heated, in pulses        | 0.01 per pulse |
    | `reward_time`     | minus the duration of the decision [s]                       | 0 per second   |

    The return says how far the robot got. Robots that arrive are compared by their time, the task's measure.

    ## Info
    That of `SeastarSwim-v0`, and

    | name       | type       | unit | meaning                                              |
    |------------|------------|------|------------------------------------------------------|
    | `instance` | int        | -    | number of the episode in its split                   |
    | `wiring`   | array (5,) | 1    | limb by limb: 1, or -1 where the wires are swapped   |

    `wiring` is what the robot is not told: only for judges, and for controllers that are to know everything.

    ## Arguments
    swap_probability: Probability that a limb's wires are swapped, 0 to 1.
    reward: Weights of the reward's terms.
    """

    swap_probability: Annotated[float, within(0.0, 1.0)] = 0.5
    reward: RewardWeights = RewardWeights()

    observes_commands = True

    def draw(self, rng: np.random.Generator, scene: Scene) -> dict[str, Any]:
        """A path, and which wires are swapped."""
        path = super().draw(rng, scene)
        swapped = rng.random(scene.robot.n_limbs) < self.swap_probability
        return {**path, "wiring": np.where(swapped, -1.0, 1.0)}

    def begin(self, robots: Robots, begun: Flags) -> None:
        """Swap the wires, and swim to the first waypoint."""
        robots.wiring = robots.episode.wiring
        super().begin(robots, begun)

    def info(self, robots: Robots, hub: Floats) -> dict[str, NDArray[Any]]:
        """Where robots are on their paths, and their wires."""
        return {**super().info(robots, hub), "wiring": robots.episode.wiring.copy()}

    def scenery(self, robots: Robots, robot: int) -> Scenery:
        """Which wires are swapped."""
        swapped = np.flatnonzero(robots.episode.wiring[robot] < 0.0) + 1
        return Scenery(note="wires swapped: " + (", ".join(map(str, swapped)) or "none"))


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

    ## Starting state
    The robot rests with a random heading at the start of a random path of five legs of 0.1 to 0.2 m, as `path="random"`
    of `SeastarSwim-v0`. Every draw can be solved: three live limbs swim any way.

    ## Episode end
    `terminated`: the last waypoint is reached.

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
    | `reward_time`     | minus the duration of the decision [s]                       | 0 per second   |

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


MODULUS, DELAY = "robot.youngs_modulus", "sight.delay"
"""Names of the drawn numbers that pictures show."""


@register_part
@dataclass(frozen=True)
class SimToReal(Waypoints):
    """Waypoints for a robot as a laboratory has it: seen by a camera, late, and not known exactly.

    A camera sees the hub and the heading, 30 times a second. Its delay differs from episode to episode, and so do the
    modulus, the drag coefficient and the strength of every limb. A controller that remembers its commands and what
    followed from them can tell fast robots from slow ones, and foresee where the robot is by now.

    ## Starting state
    The robot rests with a random heading at the start of a random path of five legs of 0.1 to 0.2 m, as `path="random"`
    of `SeastarSwim-v0`.

    | drawn                     | range                          |
    |---------------------------|--------------------------------|
    | delay of the camera       | 0.05 to 0.15 s                 |
    | Young's modulus           | 0.6 to 1.3 MPa, log-uniform    |
    | drag coefficient          | 0.7 to 1.4, log-uniform        |
    | strength of every limb    | 0.8 to 1                       |

    The camera has 10 ms of jitter, loses 5 % of its pictures, and errs by 1 mm and 0.01 rad (standard deviations).

    ## Episode end
    `terminated`: the last waypoint is reached.

    ## Observation
    | index  | meaning                                                                    | unit      | range |
    |--------|----------------------------------------------------------------------------|-----------|-------|
    | 0..9   | contractions of the wires of limbs 1 to 5, + and -, which follow from the  | 1         | 0..1  |
    |        | commands                                                                   |           |       |
    | 10..11 | mean velocity of the hub between the last two pictures, x and y            | 0.025 m/s | -     |
    | 12     | mean rate of turn between them                                             | rad/s     | -     |
    | 13     | age of the last picture                                                    | s         | -     |
    | 14..17 | current and next waypoint, as in `SeastarSwim-v0`, from the place that was | 0.1 m     | -     |
    |        | seen                                                                       |           |       |

    ## Reward
    | term              | meaning                                                      | default weight |
    |-------------------|--------------------------------------------------------------|----------------|
    | `reward_progress` | decrease of the length of the route to the last waypoint [m] | 200 per metre  |
    | `reward_waypoint` | waypoints reached in the decision                            | 1 per waypoint |
    | `reward_effort`   | minus the time for which wires were heated, in pulses        | 0.01 per pulse |
    | `reward_time`     | minus the duration of the decision [s]                       | 0 per second   |

    Robots that arrive are compared by their time, the task's measure.

    ## Info
    That of `SeastarSwim-v0` without the measured errors, which are those of robots with equally strong limbs; besides,

    | name                     | type       | unit | meaning                                |
    |--------------------------|------------|------|----------------------------------------|
    | `instance`               | int        | -    | number of the episode in its split     |
    | `robot.youngs_modulus`   | float      | Pa   | drawn Young's modulus                  |
    | `fluid.drag_coefficient` | float      | 1    | drawn drag coefficient                 |
    | `limb_strengths`         | array (5,) | 1    | drawn strengths of the limbs           |
    | `sight.delay`            | float      | s    | drawn delay of the camera              |
    | `sight_age`              | float      | s    | age of the last picture                |

    The drawn numbers are what the robot is not told.

    ## Arguments
    sight: Camera through which the robot is seen, unless the environment is given another.
    randomization: What is drawn for every episode.
    reward: Weights of the reward's terms.
    """

    sight: Sight = Sight(30.0, Uniform(0.05, 0.15), jitter=0.01, dropout=0.05, noise=1e-3, turn_noise=0.01)
    randomization: DomainRandomization = DomainRandomization(
        {
            MODULUS: LogUniform(0.6e6, 1.3e6),
            "fluid.drag_coefficient": LogUniform(0.7, 1.4),
            LIMB_STRENGTHS: Uniform(0.8, 1.0),
        }
    )
    reward: RewardWeights = RewardWeights()

    tells_errors = False  # errors were measured of equally strong limbs

    def scenery(self, robots: Robots, robot: int) -> Scenery:
        """What is hidden of the robot and of the camera."""
        hidden = robots.hidden
        notes = [f"modulus {hidden[MODULUS][robot] / 1e6:.2f} MPa"] if MODULUS in hidden else []
        notes += [f"seen {1e3 * hidden[DELAY][robot]:.0f} ms late"] if DELAY in hidden else []
        return Scenery(note=", ".join(notes))
