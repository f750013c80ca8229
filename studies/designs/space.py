"""The designs: robots of several numbers of limbs, radii and tapers, with lengths, moduli and peak angles drawn."""

import itertools
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from seastar_gym.executors import Executor
from seastar_gym.scene import Contact, Scene, Seastar, SmaPulse
from seastar_gym.scene.limb import Limb
from seastar_gym.sweep.axes import Choices, Range
from seastar_gym.sweep.batches import Batch
from seastar_gym.sweep.configurations import Swim, configuration_with
from seastar_gym.sweep.designs import Sweep
from seastar_gym.sweep.run import OnProgress, run
from seastar_gym.sweep.swimming import swim

LIMBS = (3, 4, 5, 6, 7)
RADII = (0.8e-3, 1.2e-3, 1.6e-3, 2.0e-3, 2.4e-3, 2.8e-3)
"""Mean radii [m]."""
TAPERS = (1.0, 0.75, 0.5, 0.25)
"""Radius of the tip over that of the root."""
LENGTHS, MODULI, ANGLES = (0.05, 0.15), (0.2e6, 5e6), (0.2, 1.2)
"""Limb lengths [m], Young's moduli [Pa] and peak angles [rad]."""
SAMPLES = 854
"""Designs of every combination of limbs, radius and taper: 102,480 in all."""
SETTLING, MEASURED = 3, 5
"""Strokes before and during the measurement."""
SWIM = Swim(SETTLING, MEASURED)


class Body(NamedTuple):
    """What all designs of a lane batch have in common. radius: Mean of a limb's [m]. taper: Tip's over root's."""

    n_limbs: int
    radius: float
    taper: float

    @property
    def label(self) -> str:
        """Text that stands for it in results."""
        return f"{self.n_limbs} limbs, {1e3 * self.radius:g} mm, taper {self.taper:g}"

    @property
    def profile(self) -> tuple[float, float]:
        """Radius of root and tip [m]."""
        root = 2.0 * self.radius / (1.0 + self.taper)
        return root, self.taper * root

    def robot(self) -> Seastar:
        """The robot, with the chapter's length and modulus, at the resolution of `fast`."""
        limb = Limb(radius=self.radius if self.taper == 1.0 else self.profile)
        preset = Scene.preset("fast").robot
        return Seastar(
            self.n_limbs, preset.nodes_per_limb, limbs=(limb,) * self.n_limbs, discretisation=preset.discretisation
        )


def scene_of(body: Body, length: float, modulus: float, peak_angle: float, contact: Contact | None = None) -> Scene:
    """Scene of a design. length: Of a limb [m]. modulus: Young's [Pa]. peak_angle: [rad]."""
    robot = replace(body.robot(), limb_length=length, youngs_modulus=modulus)
    return replace(Scene.preset("fast"), robot=robot, actuator=SmaPulse(peak_angle), contact=contact)


def swum(scene: Scene, **choices: str) -> dict[str, float]:
    """Columns of a robot's results, as of a sweep. choices: Such as the fidelity."""
    named = {name: (value, value) for name, value in choices.items()}
    columns = swim(Batch(configuration_with(scene, "straight", SWIM, named), {}, 1))
    return {name: float(column[0]) for name, column in columns.items()}


def run_all(cells: Iterable[Batch], folder: Path, executor: Executor, progress: OnProgress | None = None) -> None:
    """Simulate what is missing in a folder. ValueError where something has no results."""
    tally = run(cells, folder, executor, progress)
    if tally.problems:
        raise ValueError(f"{len(tally.problems)} cells have no results: run the command again.")


BODIES = {body.label: body for body in itertools.starmap(Body, itertools.product(LIMBS, RADII, TAPERS))}


def bodies() -> Choices:
    """Axis of all bodies."""
    return Choices("robot", tuple(body.robot() for body in BODIES.values()), tuple(BODIES))


def all_designs(samples: int = SAMPLES) -> Sweep:
    """Sweep over everything."""
    ranges = (
        Range("robot.limb_length", *LENGTHS), Range("robot.youngs_modulus", *MODULI, is_log=True),
        Range("actuator.peak_angle", *ANGLES),
    )  # fmt: skip
    return Sweep(
        Scene.preset("fast"), (bodies(), *ranges), settling=SETTLING, measured=MEASURED, samples=samples,
        robots=427,
    )  # fmt: skip


def at_the_chapters() -> Sweep:
    """Sweep over body and modulus, with the chapter's limb length and peak angle."""
    modulus = Range("robot.youngs_modulus", *MODULI, is_log=True)
    return Sweep(Scene.preset("fast"), (bodies(), modulus), settling=SETTLING, measured=MEASURED, samples=64)


SPREADS = (0.25, 0.5, 1.0, 2.0, 4.0)
"""Radius of the tip over that of the root, for limbs of equal mass: below 1 the mass is near the hub."""
DENSITIES = (100.0, 10_000.0)
"""Densities of the limbs [kg/m^3]."""


def spread(taper: float, points: int = 7) -> Limb:
    """Limb whose mass is the chapter's, spread by a taper, and whose bending stiffness is the chapter's all along.

    points: Points of the profile of Young's modulus.
    """
    chapter = Seastar()
    root = chapter.rod_radius * np.sqrt(3.0 / (1.0 + taper + taper**2))  # of a cone's volume
    radius = np.linspace(root, taper * root, points)
    moduli = chapter.youngs_modulus * (chapter.rod_radius / radius) ** 4
    return Limb(radius=tuple(radius.tolist()), youngs_modulus=tuple(moduli.tolist()))


def inner_half(taper: float) -> float:
    """Share of a tapered limb's mass that lies in the half at the hub."""
    middle = 0.5 * (1.0 + taper)
    return float(0.5 * (1.0 + middle + middle**2) / (1.0 + taper + taper**2))


def masses() -> Sweep:
    """Sweep over where the mass of a limb lies and over its density; all else is the chapter's."""
    preset = Scene.preset("fast").robot
    robots = tuple(
        Seastar(nodes_per_limb=preset.nodes_per_limb, limbs=(spread(taper),) * 5) for taper in SPREADS
    )  # fmt: skip
    axes = (
        Choices("robot", robots, tuple(map(str, SPREADS))),
        Range("robot.density", *DENSITIES, is_log=True).spaced(21),
    )
    return Sweep(Scene.preset("fast"), axes, settling=SETTLING, measured=MEASURED)
