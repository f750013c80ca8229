"""The terms of rewards: `reward_terms`, by their names, with the weights of `RewardWeights`.

Tasks on waypoints make their reward of them, other tasks have terms of their own in `score`; `Robots` in robots.py adds
them up.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.envs.paths import shortest_way
from seastar_gym.scene.number import check_numbers, not_negative, within
from seastar_gym.scene.serial import register_part

PULSE = 0.1
"""Heating time of one wire [s] that `RewardWeights.effort` is the price of."""


@register_part
@dataclass(frozen=True)
class RewardWeights:
    """Weights of the reward's terms, none negative, and `aim`, the shape of the rewarded route.

    progress: Reward per metre by which the rewarded route to the last waypoint became shorter [1/m].
    waypoint: Reward per waypoint reached.
    effort: Price of heating one wire for PULSE = 0.1 s.
    aim: Distance from a waypoint's centre, as a fraction of its radius, at which the rewarded route passes it, 0 to 1.
    heading: Reward per radian by which there is less left to turn [1/rad], where headings are asked for.
    time: Price of a second [1/s].
    """

    progress: Annotated[float, not_negative("1")] = 200.0
    """Reward per metre by which the rewarded route to the last waypoint became shorter [1/m]. One stroke of the best
    gaits, about 5 mm, earns about 1."""
    waypoint: Annotated[float, not_negative("1")] = 1.0
    """Reward per waypoint reached."""
    effort: Annotated[float, not_negative("1")] = 0.01
    """Price of heating one wire for PULSE = 0.1 s, as a stroke of the chapter does; shorter heating costs its share."""
    aim: Annotated[float, within(0.0, 1.0)] = 0.7
    """Distance from a waypoint's centre, as a fraction of its radius, at which the rewarded route passes it, 0 to 1. A
    route at 1 only touches the circle, so that no stroke need ever end within it."""
    heading: Annotated[float, not_negative("1")] = 8.0
    """Reward per radian by which there is less left to turn [1/rad], where headings are asked for. A second of the
    turning wave, 0.19 rad, earns about as much as a second of the lagged pairs, 7.3 mm."""
    time: Annotated[float, not_negative("1/s")] = 0.0
    """Price of a second [1/s]. Without it, an episode pays its route, however long that takes: returns and times of
    `docs/benchmark.md` correlate by -0.6 to -0.9 over all episodes, and by -0.3 to 0.1 over solved ones."""

    def __post_init__(self) -> None:
        check_numbers(self, "RewardWeights.")

    def way_to_next(
        self, hub: ArrayLike, current: ArrayLike, following: ArrayLike, waypoint_radius: float
    ) -> NDArray[np.float64]:
        """Length [m], shape (...), of the rewarded route from the hub past the current waypoint to the following one.

        hub, current, following: Positions [m], shape (..., 2), in any one frame. On the last leg `following` equals
        `current`, as in an observation, and the route ends in its centre. waypoint_radius: [m].
        """
        return shortest_way(hub, current, following, self.aim * waypoint_radius)


class Weights(NamedTuple):
    """The numbers of the `RewardWeights` of every robot, shape (n_robots,) each, in their order."""

    progress: NDArray[np.float64]
    waypoint: NDArray[np.float64]
    effort: NDArray[np.float64]
    aim: NDArray[np.float64]
    heading: NDArray[np.float64]
    time: NDArray[np.float64]


def reward_terms(
    weights: RewardWeights | Weights,
    progress: NDArray[np.float64],
    waypoints_reached: NDArray[np.int64],
    pulses: NDArray[np.float64],
    seconds: float,
    turned: NDArray[np.float64] | None = None,
) -> dict[str, NDArray[np.float64]]:
    """Terms of the reward by their names in `info`, each of shape (n_robots,).

    progress: Decrease of the way to go [m]. waypoints_reached: Their number. pulses: Heat, see `pulses_of`.
    seconds: Duration of the decision [s]. turned: Decrease of what is left to turn [rad], None where no headings are
    asked for. All others are of this decision, shapes (n_robots,).
    """
    return {
        "reward_progress": weights.progress * progress,
        "reward_waypoint": np.asarray(weights.waypoint * waypoints_reached, np.float64),
        "reward_effort": -weights.effort * pulses,
        "reward_time": np.zeros(len(progress)) - weights.time * seconds,
        **({} if turned is None else {"reward_heading": weights.heading * turned}),
    }


def pulses_of(heating_time: NDArray[np.float64], commands: NDArray[np.float64]) -> NDArray[np.float64]:
    """Heat as a number of pulses of 0.1 s, shape (n_robots,).

    heating_time: Time for which wires were heated, summed over limbs [s], shape (n_robots,). NaN where the actuator
        does not say it: a command then counts as its share of a pulse.
    commands: Shape (n_robots, n_limbs).
    """
    whole = np.rint(heating_time / PULSE * 1e12) / 1e12  # sums of tenths of a second are whole pulses again
    unknown = np.isnan(whole)
    return np.where(unknown, np.abs(commands).sum(axis=1), whole) if any(unknown.tolist()) else whole
