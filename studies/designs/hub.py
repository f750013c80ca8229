"""Mass in the hub or in the limbs: how fast robots of equal mass swim, by the share of it that their hub has.

A body of that mass stands for the hub: a point, where limbs meet as the chapter's do, or a disc of 5 mm radius with
limbs at its rim. Limbs keep their shape and stiffness, and lose in density what the hub gains. All pairs of limbs are
four gaits up to turns, {1-, 2+} to {1-, 5+}. Writes hub.json and hub.png.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow.parquet

from seastar_gym.executors import Executor
from seastar_gym.executors.processes import Processes
from seastar_gym.scene import Numerics, Scene
from seastar_gym.scene.body import Body
from seastar_gym.sweep.cells import Cell
from seastar_gym.sweep.frames import Swim, frame_with
from seastar_gym.sweep.parts import Parts
from seastar_gym.sweep.run import run
from studies.frame import Results, Study
from studies.style import DPI, MM, subplots

Table = dict[str, Any]
GAITS = ("1-,2+", "1-,3+", "1-,4+", "1-,5+")
"""{1-, 3+} is the chapter's straight swim, turned."""
FACTORS = (1.0, 2.0, 4.0)
"""Whole mass over that of the chapter's robot."""
NEARLY_NONE = 1e-6
SHARES = (NEARLY_NONE, *np.linspace(0.1, 0.9, 9).round(1).tolist())
"""Shares of the mass in the hub."""
RADII = {"point": 0.0, "disc": 5e-3}
"""Radii of the hub [m]."""
GYRATION = 5e-3
"""Radius of the uniform disc whose moment of inertia the hub has, with a size or without [m]."""
SWIM = Swim(settling=8, measured=8)
FINE = Numerics("sdirk3", 1e-3, 1e-8)
"""Numerics of the figures, with the nodes of `reference`, whose midpoint rule gathers energy in robots of heavy limbs
whose hub weighs next to nothing."""
SETTINGS = ("fast", "fine")


TOP = 10.5
"""Largest speed of the axes [mm/s]."""


class Curve(NamedTuple):
    """Robots of all shares. hub: Name of a radius. gait: Pair of limbs. factor: Of the whole mass."""

    hub: str
    gait: str
    factor: float

    def cell(self, setting: str, shares: tuple[float, ...] = SHARES) -> Cell:
        """The robots, side by side."""
        scene, share = with_hub(RADII[self.hub], setting), np.array(shares)
        hub = share * self.factor * limbs_mass()
        numbers = {
            "robot.density": (1.0 - share) * self.factor * scene.robot.density,
            "robot.body.mass": hub,
            "robot.body.inertia": 0.5 * hub * GYRATION**2,
        }
        return Cell(frame_with(scene, self.gait, SWIM, {}), numbers, len(share))


CURVES = tuple(Curve(hub, gait, factor) for hub in RADII for gait in GAITS for factor in FACTORS)


def limbs_mass() -> float:
    """Mass of the chapter's robot [kg]."""
    robot = Scene.preset("fast").robot
    return float(robot.n_limbs * robot.density * np.pi * robot.rod_radius**2 * robot.limb_length)


def with_hub(radius: float, setting: str) -> Scene:
    """The chapter's robot with a body of this radius [m], as high as its limbs are thick."""
    scene = Scene.preset("fast") if setting == "fast" else replace(Scene.preset("reference"), numerics=FINE)
    body = Body(radius, height=2.0 * scene.robot.rod_radius, mass=limbs_mass(), inertia=1.0)
    return replace(scene, robot=replace(scene.robot, body=body))


def study(folder: Path, executor: Executor) -> Table:
    """Swim all curves; returns speeds [mm/s] by setting, hub, gait and factor, one for each share."""
    cells = {(setting, curve): curve.cell(setting) for setting in SETTINGS for curve in CURVES}
    tally = run(iter(cells.values()), folder, executor)
    if tally.problems:
        raise ValueError(f"{len(tally.problems)} cells have no results: run the command again.")
    found: Table = {"shares": [round(share, 3) for share in SHARES], "mass_kg": limbs_mass(), "mm_per_s": {}}
    for (setting, curve), cell in cells.items():
        table = pyarrow.parquet.read_table(Parts(folder).file(cell.name))
        by_hub = found["mm_per_s"].setdefault(setting, {}).setdefault(curve.hub, {})
        speeds = [round(MM * speed, 3) for speed in table.column("speed").to_pylist()]
        by_hub.setdefault(curve.gait, {})[f"{curve.factor:g}"] = speeds
    return found


def draw(found: Table, file: Path) -> None:
    """Picture: speed over the share of mass in the hub, a panel for each gait."""
    figure, axes = subplots(2, 2, figsize=(7.6, 6.4), sharex=True, sharey=True)
    shares = 100.0 * np.array(found["shares"])
    for ax, gait in zip(axes.flat, GAITS, strict=True):
        for k, factor in enumerate(FACTORS):
            for hub, style in (("point", "-"), ("disc", "--")):
                speeds = found["mm_per_s"]["fine"][hub][gait][f"{factor:g}"]
                label = f"{factor:g} x" if hub == "point" else f"{factor:g} x, disc" if k == 0 else None
                ax.plot(shares, speeds, style, color=f"C{k}", label=label)
        ax.set(title="{" + gait.replace(",", ", ") + "}", ylim=(0.0, TOP))
    for ax in axes[1]:
        ax.set_xlabel("share of the mass in the hub [%]")
    for ax in axes[:, 0]:
        ax.set_ylabel("speed [mm/s]")
    axes[0, 0].legend(fontsize=8, title="mass over the chapter's", title_fontsize=8, loc="upper left")
    figure.savefig(file, dpi=DPI)


@dataclass(frozen=True)
class Options:
    """Mass in the hub or in the limbs."""

    out: Path = Path("runs/hub")
    """Folder of the files, or the file of the numbers."""
    workers: int | None = None
    """Processes; one per processor by default."""


def swim_all(options: Options, results: Results) -> None:
    """Swim what is missing."""
    results.update(study(options.out, Processes(options.workers)))


STUDY = Study(
    "designs.hub", swim_all, Options, "hub.json", pictures={"hub.png": draw}, packages=("pyarrow",)
)
