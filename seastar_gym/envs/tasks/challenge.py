"""Challenges: what a task asks for and draws, as frozen numbers. Their docstrings are the contracts that users read."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

from seastar_gym.envs.options import SwimOptions
from seastar_gym.envs.swimming import Swimming
from seastar_gym.envs.tasks.numbered import Split
from seastar_gym.scene.number import check_numbers


@dataclass(frozen=True)
class Challenge(ABC):
    """Base of all challenges. The annotations of its fields declare what its numbers may be."""

    def __post_init__(self) -> None:
        check_numbers(self, f"{type(self).__name__}.")

    @abstractmethod
    def swimming(self, options: SwimOptions, n_robots: int, threads: int | None, split: Split) -> Swimming:
        """The task of so many robots. options: Of the environment, as far as a task leaves them open."""
