"""Swims of the accuracy study: command sequences, the simulated swim, and its error against another."""

import itertools
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.paths import path_length
from seastar_gym.gaits import PAIRS, STRAIGHT, pentagon_gait
from seastar_gym.scene import Scene
from seastar_gym.scene.numerics import Setting
from seastar_gym.simulator import Simulator, SolverStatus

Floats = NDArray[np.float64]
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


class Swim(NamedTuple):
    """Paths of robots, and the solver's work on them.

    hub: Hub positions after every stroke [m], shape (n_strokes, n_robots, 2).
    heading: Headings after every stroke [rad], shape (n_strokes, n_robots).
    iterations, steps: Newton iterations and time steps per stroke, averaged over strokes and robots.
    rejections: Number of time steps rejected because of their estimated error, over all strokes and robots.
    halvings: Number of time steps halved because Newton did not converge, over all strokes and robots.
    failed: Number of robots that the solver failed on.
    """

    hub: Floats
    heading: Floats
    iterations: float
    steps: float
    rejections: int
    halvings: int
    failed: int


class Errors(NamedTuple):
    """Errors of every robot against another swim of the same commands, shape (n_robots,).

    path, end: Largest and last distance of the hub from the other path, as fractions of a path's length.
    heading: Largest difference of the heading [rad].
    """

    path: Floats
    heading: Floats
    end: Floats


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


def scene_of(setting: Setting, physics: Scene = Scene()) -> Scene:
    """Scene of a robot, a fluid and an actuator, by default the chapter's, at a setting."""
    discretisation, nodes_per_limb, numerics = setting
    robot = replace(physics.robot, discretisation=discretisation, nodes_per_limb=nodes_per_limb)
    return replace(physics, robot=robot, numerics=numerics)


def swim(cases: Cases, scene: Scene, threads: int | None = 1) -> Swim:
    """Simulate all robots from rest through their commands."""
    simulator = Simulator(scene, len(cases), threads)
    hub, heading, reports = [], [], []
    for commands in cases.commands:
        reports.append(simulator.stroke(commands))
        hub.append(simulator.hub_position())
        heading.append(simulator.heading())
    return Swim(
        np.array(hub),
        np.array(heading),
        iterations=float(np.mean([report.newton_iterations for report in reports])),
        steps=float(np.mean([report.steps for report in reports])),
        rejections=int(np.sum([report.rejections for report in reports])),
        halvings=int(np.sum([report.halvings for report in reports])),
        failed=int(np.count_nonzero(reports[-1].status != SolverStatus.CONVERGED)),
    )


def hub_path_lengths(hub: Floats) -> Floats:
    """Lengths of the hubs' paths from the origin, measured at the ends of strokes [m], shape (n_robots,)."""
    return path_length(np.zeros(2), np.moveaxis(hub, 0, 1))


def errors(swum: Swim, exact: Swim, lengths: Floats | None = None) -> Errors:
    """Errors of a swim against another; infinite for all robots if one failed.

    lengths: Lengths of paths [m], shape (n_robots,), of which the errors are fractions. None means those of `exact`.
    """
    if swum.failed:
        return Errors(*np.full((3, swum.hub.shape[1]), np.inf))
    distance = np.linalg.norm(swum.hub - exact.hub, axis=-1)
    turn = np.angle(np.exp(1j * (swum.heading - exact.heading)))
    length = hub_path_lengths(exact.hub) if lengths is None else lengths
    return Errors(distance.max(axis=0) / length, np.abs(turn).max(axis=0), distance[-1] / length)
