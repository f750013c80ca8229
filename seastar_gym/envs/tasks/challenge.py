"""Challenges: what a task asks for and draws, as frozen numbers. Their docstrings are the contracts that users read."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

from seastar_gym.envs.swimming import Swimming
from seastar_gym.envs.tasks.numbered import Split
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import is_finite_number, shown

Range = tuple[float, float]
"""Smallest and largest number of a uniform draw."""


@dataclass(frozen=True)
class Challenge(ABC):
    """Base of all challenges."""

    NAME: ClassVar[str] = ""
    """Name of what it is measured by in `seastar_gym.evaluation.measures`; "": the time until success."""

    @abstractmethod
    def swimming(self, scene: Scene, n_robots: int, threads: int | None, split: Split, **how: Any) -> Swimming:
        """The task of so many robots. how: Actions and decision period, see `Swimming`."""


def require_range(name: str, value: object, unit: str, zero_allowed: bool = False) -> None:
    """ValueError for what is not a smallest and a largest number above zero."""
    pair = isinstance(value, tuple) and len(value) == 2 and all(map(is_finite_number, value))
    if not pair or not (0.0 <= value[0] <= value[1]) or (value[0] == 0.0 and not zero_allowed):  # type: ignore[index]
        raise ValueError(f"{name} must be the smallest and the largest number [{unit}], not {shown(value)}.")
