"""Command sequences of the accuracy study."""

import itertools
from dataclasses import dataclass
from typing import Literal

import numpy as np

from seastar_gym.gaits import PAIRS, STRAIGHT, pentagon_gait
from studies.frame import Floats

Kind = Literal["straight", "pair", "pentagon", "random", "slow", "gait"]

STROKES = 10
"""Strokes of a swim, except round the pentagon."""
SLOW = 0.1
"""Factor of the commands of slow swims."""


@dataclass(frozen=True)
class Cases:
    """Command sequences of equal length, one per robot.

    names, kinds: Name and kind of every robot's sequence.
    commands: Commands in [-1, 1], shape (n_strokes, n_robots, n_limbs).
    """

    names: tuple[str, ...]
    kinds: tuple[Kind, ...]
    commands: Floats

    def __len__(self) -> int:
        return len(self.names)

    def first(self, n: int) -> "Cases":
        """The sequences of the first n robots."""
        return Cases(self.names[:n], self.kinds[:n], self.commands[:, :n])


def repeated(names: list[str], kinds: list[Kind], commands: Floats) -> Cases:
    """Sequences in which every robot repeats one command; commands: shape (n_robots, n_limbs)."""
    return Cases(tuple(names), tuple(kinds), np.repeat(commands[None], STROKES, axis=0))


def swims() -> Cases:
    """The straight swim and the four pairs of Fig. 13.8."""
    kinds: list[Kind] = ["straight", "pair", "pair", "pair", "pair"]
    return repeated(["straight", *PAIRS], kinds, np.array([STRAIGHT, *PAIRS.values()]))


def random_sequences(n: int, rng: np.random.Generator) -> Cases:
    """Random sequences of n robots: half draw from -1, 0 and 1, as an environment's actions do, half from [-1, 1]."""
    commands = rng.uniform(-1.0, 1.0, (STROKES, n, 5))
    commands[:, ::2] = rng.integers(-1, 2, commands[:, ::2].shape)
    kinds: list[Kind] = ["random"] * n
    return Cases(tuple(f"random {k + 1}" for k in range(n)), tuple(kinds), commands)


def slow_sequences(n: int, rng: np.random.Generator) -> Cases:
    """Random sequences of n robots at a tenth of the amplitude, whose short paths feel a Newton tolerance most."""
    some = random_sequences(n, rng)
    kinds: list[Kind] = ["slow"] * n
    return Cases(tuple(f"slow {k + 1}" for k in range(n)), tuple(kinds), SLOW * some.commands)


def gaits() -> Cases:
    """Repetitions of every command of -1, 0 and +1 that is not in `swims`, once per class under the robot's symmetry.

    A turn of the robot rolls a command over the limbs; a mirror image exchanges limbs and signs. Rest and the same
    command for all limbs are left out, because the hub then stays where it is.
    """
    known = {symmetric_form(command) for command in (*PAIRS.values(), np.zeros(5), np.ones(5))}
    forms = sorted({symmetric_form(np.array(command)) for command in itertools.product((-1, 0, 1), repeat=5)} - known)
    names = ["".join("-0+"[sign + 1] for sign in form) for form in forms]
    return repeated(names, ["gait"] * len(forms), np.array(forms, float))


def random_gaits(n: int, rng: np.random.Generator) -> Cases:
    """Gaits of n robots each: a command in [-1, 1] repeated, a tenth of it repeated, and two commands in alternation.

    Half of those in alternation are drawn from -1, 0 and 1.
    """
    once, some = rng.uniform(-1.0, 1.0, (n, 5)), random_sequences(n, rng).commands[:2]
    alternating = np.tile(some, (STROKES // 2, 1, 1))
    gait: list[Kind] = ["gait"] * n
    slow: list[Kind] = ["slow"] * n

    def named(name: str) -> list[str]:
        return [f"{name} {k + 1}" for k in range(n)]

    return joined(
        repeated(named("gait"), gait, once),
        repeated(named("slow gait"), slow, SLOW * once),
        Cases(tuple(named("alternating")), tuple(gait), alternating),
    )


def symmetric_form(command: Floats) -> tuple[int, ...]:
    """Smallest of all commands that are this one turned or mirrored: equal for commands that swim alike."""
    mirrored = -command[[0, 4, 3, 2, 1]]
    return min(tuple(int(c) for c in np.roll(form, turn)) for form in (command, mirrored) for turn in range(5))


def pentagon(swimming: int, resting: int) -> Cases:
    """The pentagon of (13.15), with these numbers of strokes of swimming and of rest per side."""
    return Cases(("pentagon",), ("pentagon",), pentagon_gait(swimming, resting)[:, None])


def joined(*cases: Cases) -> Cases:
    """Cases of equal length as one batch."""
    names = tuple(name for each in cases for name in each.names)
    kinds = tuple(kind for each in cases for kind in each.kinds)
    return Cases(names, kinds, np.concatenate([each.commands for each in cases], axis=1))
