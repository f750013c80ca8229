"""Robots and waters that differ from episode to episode."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene import Scene
from seastar_gym.scene.checks import require_finite, require_number, shown
from seastar_gym.scene.number import make_floats, numbers_of, with_numbers
from seastar_gym.scene.serial import register_part

LIMB_STRENGTHS = "limb_strengths"
"""Share of its commanded rotation that a limb makes: 0 for one that has failed; drawn for every limb."""
ACTION_DELAY = "action_delay"
"""Time from a decision to when wires are heated by it [s]."""
WIDEST = 3.0
"""Standard deviations: draws of `Normal` farther out are made again."""


@register_part
@dataclass(frozen=True)
class Uniform:
    """Between `low` and `high`."""

    low: float
    high: float

    def __post_init__(self) -> None:
        make_floats(self)
        require_finite("low", self.low, "of its number")
        require_finite("high", self.high, "of its number")
        if not self.low <= self.high:
            raise ValueError(f"low must not exceed high: {shown(self.low)} is more than {shown(self.high)}.")
        if not math.isfinite(self.high - self.low):
            raise ValueError(f"high - low must be finite: {shown(self.low)} and {shown(self.high)} are too far apart.")

    @property
    def bounds(self) -> tuple[float, float]:
        """Smallest and largest number that can be drawn."""
        return self.low, self.high

    def draw(self, rng: np.random.Generator) -> float:
        """One number."""
        return float(rng.uniform(self.low, self.high))


@register_part
@dataclass(frozen=True)
class LogUniform(Uniform):
    """Between `low` and `high`, both above zero, with a uniform logarithm."""

    def __post_init__(self) -> None:
        make_floats(self)
        require_number("low", self.low, "of its number")
        super().__post_init__()

    def draw(self, rng: np.random.Generator) -> float:
        """One number."""
        drawn = math.exp(rng.uniform(math.log(self.low), math.log(self.high)))
        return min(max(drawn, self.low), self.high)


@register_part
@dataclass(frozen=True)
class Normal:
    """Around `mean` with the standard deviation `deviation`, never farther than three of them."""

    mean: float
    deviation: float

    def __post_init__(self) -> None:
        make_floats(self)
        require_finite("mean", self.mean, "of its number")
        require_number("deviation", self.deviation, "of its number", zero_allowed=True)

    @property
    def bounds(self) -> tuple[float, float]:
        """Smallest and largest number that can be drawn."""
        return self.mean - WIDEST * self.deviation, self.mean + WIDEST * self.deviation

    def draw(self, rng: np.random.Generator) -> float:
        """One number."""
        while True:
            deviations = rng.standard_normal()
            if abs(deviations) <= WIDEST:
                return float(self.mean + self.deviation * deviations)


Distribution = Uniform | LogUniform | Normal


@register_part
class DomainRandomization:
    """Distributions of a scene's numbers, drawn anew for every episode of every robot, in this order.

    distributions: By name: "limb_strengths", or a number that the scene has and that may differ from robot to robot, as
        in "robot.youngs_modulus", "robot.limb_length", "fluid.drag_coefficient", "fluid.current.u_x",
        "actuator.peak_angle". Numbers of the environment's `Sight`, as in "sight.delay", and "action_delay" are drawn
        after the others.
    """

    def __init__(self, distributions: Mapping[str, Distribution]):
        if not isinstance(distributions, Mapping) or not distributions:
            raise ValueError(f"DomainRandomization needs distributions by name, not {shown(distributions)}.")
        for name, distribution in distributions.items():
            if not isinstance(distribution, Distribution):
                raise ValueError(f"{name} needs a Uniform, LogUniform or Normal, not {shown(distribution)}.")
        strength = distributions.get(LIMB_STRENGTHS)
        if strength is not None and not (strength.bounds[0] >= 0.0 and strength.bounds[1] <= 1.0):
            raise ValueError(f"limb_strengths must be drawn from 0 to 1, not from {strength.bounds}.")
        self.distributions = dict(distributions)

    def __repr__(self) -> str:
        return f"DomainRandomization({self.distributions!r})"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, DomainRandomization) and self.distributions == other.distributions

    def __hash__(self) -> int:
        return hash(tuple(self.distributions.items()))

    @property
    def late(self) -> dict[str, Distribution]:
        """Distributions of what is no number of a scene: of a sight, and of the delay of actions."""
        drawn = self.distributions.items()
        return {name: one for name, one in drawn if name == ACTION_DELAY or str(name).startswith("sight.")}

    def first_values(self, scene: Scene, n_robots: int) -> dict[str, NDArray[np.float64]]:
        """The numbers before the first draw, shape (n_robots,), that of limbs (n_robots, n_limbs): their upper bounds.

        Refuses names that the scene does not have, and bounds that it does not allow.
        """
        numbers = [name for name in self.distributions if name != LIMB_STRENGTHS and name not in self.late]
        known = [name for name, value in numbers_of(scene).items() if value is not None]
        for name in numbers:
            if name not in known:
                raise ValueError(
                    f"The scene has no number {shown(name)} to draw{_why_not(scene, name, [*known, LIMB_STRENGTHS])}."
                )
        bounds = {name: self.distributions[name].bounds for name in numbers}
        lowest = {name: low for name, (low, _) in bounds.items()}
        # Scene checks involve one number, a pair, or all at their maxima: testing those bounds suffices.
        with_numbers(scene, {name: high for name, (_, high) in bounds.items()})
        for first, second in itertools.combinations_with_replacement(numbers, 2):
            for pair in itertools.product(bounds[first], bounds[second]):
                with_numbers(scene, {**lowest, first: pair[0], second: pair[1]})
        values = {name: np.full(n_robots, self.distributions[name].bounds[1]) for name in numbers}
        if LIMB_STRENGTHS in self.distributions:
            values[LIMB_STRENGTHS] = np.ones((n_robots, scene.robot.n_limbs))
        return values

    def draw(self, values: dict[str, NDArray[np.float64]], robot: int, rng: np.random.Generator) -> None:
        """Draw all numbers of a robot, in place."""
        for name in (name for name in self.distributions if name in values):
            for place in np.ndindex(values[name].shape[1:]):
                values[name][(robot, *place)] = self.distributions[name].draw(rng)


def _why_not(scene: Scene, name: str, known: Sequence[str]) -> str:
    """End of the sentence that refuses to draw what a name stands for. known: Names that may be drawn."""
    if name in numbers_of(scene):
        return ", since it leaves that out (None): give it a value there"
    try:
        attrgetter(str(name))(scene)
    except AttributeError:
        return f": it has {', '.join(known)}"
    return ", since it is the same for all robots of a batch"


def drawn_scene(scene: Scene, values: dict[str, Any]) -> Scene:
    """The scene with the numbers drawn for every robot."""
    return with_numbers(scene, {name: value for name, value in values.items() if name != LIMB_STRENGTHS})
