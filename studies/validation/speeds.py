"""Measured speeds of the swimmer, see README.md in this folder."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

FILE = Path(__file__).with_name("swimmer_speeds.csv")
TRAINED_MATERIALS = (0, 10, 30, 50)
"""Materials [% of liquid metal] with a speed that the model is fitted to. That of 40 % is predicted only."""


class Condition(NamedTuple):
    """Run of the swimmer.

    liquid_metal: Volume fraction in the elastomer of its limbs [%].
    frequency: Frequency of heating [Hz].
    speed: Measured mean speed [m/s].
    """

    liquid_metal: int
    frequency: float
    speed: float

    @property
    def name(self) -> str:
        return f"{self.liquid_metal}-{self.frequency:.1f}"


def read_speeds() -> list[Condition]:
    """All runs, by material and frequency."""
    rows = np.loadtxt(FILE, delimiter=",")
    return [Condition(int(material), float(f), 1e-3 * float(speed)) for material, f, speed in rows]


def training(conditions: list[Condition]) -> list[int]:
    """Indices of the four runs that the model is fitted to: the middle frequency of four materials.

    The lower middle one of an even number. The rule was set before any speed was predicted.
    """
    chosen = []
    for material in TRAINED_MATERIALS:
        of_one = [k for k, condition in enumerate(conditions) if condition.liquid_metal == material]
        chosen.append(of_one[(len(of_one) - 1) // 2])
    return chosen
