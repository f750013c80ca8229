"""`SeastarSwimSimToReal-v0`: a robot that a late camera sees, and whose stiffness and drag nobody has measured."""

from __future__ import annotations

from dataclasses import dataclass

from seastar_gym.envs.options import RewardWeights
from seastar_gym.envs.randomization import LIMB_STRENGTHS, DomainRandomization, LogUniform, Uniform
from seastar_gym.envs.robots import Robots
from seastar_gym.envs.scenery import Scenery
from seastar_gym.envs.sight import Sight
from seastar_gym.envs.waypoints import Waypoints
from seastar_gym.scene.serial import register_part

MODULUS, DELAY = "robot.youngs_modulus", "sight.delay"
"""Names of the drawn numbers that pictures show."""


@register_part
@dataclass(frozen=True)
class SimToReal(Waypoints):
    """Waypoints for a robot as a laboratory has it: seen by a camera, late, and not known exactly.

    A camera sees the hub and the heading, 30 times a second. Its delay differs from episode to episode, and so do the
    modulus, the drag coefficient and the strength of every limb. A controller that remembers its commands and what
    followed from them can tell fast robots from slow ones, and foresee where the robot is by now.

    ## Episode
    A random path of five legs of 0.1 to 0.2 m, as `path="random"` of `SeastarSwim-v0`, from a random heading. It ends
    when the last waypoint is reached.

    | drawn                     | range                          |
    |---------------------------|--------------------------------|
    | delay of the camera       | 0.05 to 0.15 s                 |
    | Young's modulus           | 0.6 to 1.3 MPa, log-uniform    |
    | drag coefficient          | 0.7 to 1.4, log-uniform        |
    | strength of every limb    | 0.8 to 1                       |

    The camera has 10 ms of jitter, loses 5 % of its pictures, and errs by 1 mm and 0.01 rad (standard deviations).

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
