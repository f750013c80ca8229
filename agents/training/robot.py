"""The robot of a run: the chapter's, or that of a file, with numbers that may be drawn anew for every episode."""

from pathlib import Path
from typing import NamedTuple

from agents.training.folder import OWN_SCENE
from agents.training.options import Options
from seastar_gym.envs.options import scene_at
from seastar_gym.envs.randomization import DomainRandomization, Uniform
from seastar_gym.files import read_json, write_atomically, write_json
from seastar_gym.identify.fit import DOUBT
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import shown
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.scene.scene_file import load_scene, search
from seastar_gym.scene.serial import has_own_kinds

SCENE, INTERVALS = "scene.json", "intervals.json"
"""Files in a run's folder, so that a run that is continued has the robot that it began with."""


class Robot(NamedTuple):
    """Robot of a run.

    scene: Robot with its fluid and numerics. None means the chapter's at the run's fidelity.
    draws: Numbers of the scene that are drawn anew for every episode of the training. None means none.
    """

    scene: Scene | None = None
    draws: DomainRandomization | None = None

    def fidelity(self, options: Options) -> Fidelity | None:
        """Fidelity that an environment of this robot is made with; a scene has its numerics."""
        return options.fidelity if self.scene is None else None


def asked_for(options: Options) -> Robot:
    """Robot that the options of a new run name. ValueError where it could not be kept in the run's folder."""
    scene = scene_at(options.scene, options.fidelity)
    if scene is not None:
        scene.to_dict()
    file = options.intervals
    return Robot(scene, None if file is None else read_intervals(file, options.intervals_anyway))


def read_intervals(file: Path, anyway: bool = False) -> DomainRandomization:
    """Uniform draws from intervals by name, a JSON file such as `seastar identify --intervals` writes.

    anyway: Whether those of a fit are taken, too, that is doubted.
    """
    if not file.is_file():
        raise ValueError(f"{file} is no file.")
    try:
        found = read_json(file)
        doubt = found.pop(DOUBT, None)
        ends = {name: (low, high) for name, (low, high) in found.items()}
    except (AttributeError, TypeError, ValueError) as wrong:
        raise ValueError(f'{file} must be JSON such as {{"robot.youngs_modulus": [9e5, 1.1e6]}}.') from wrong
    if doubt is not None and not anyway:
        raise ValueError(
            f"{file} is of a fit whose residual is {shown(doubt)} times the noise of its track, so its intervals may "
            "not hold the robot: fit again, or give --intervals-anyway."
        )
    return DomainRandomization({name: Uniform(low, high) for name, (low, high) in ends.items()})


def keep(robot: Robot, folder: Path, file: Path | None) -> None:
    """Write the robot, whose scene is that of a file, into the folder of its run; nothing for the chapter's."""
    if robot.scene is not None and file is not None:
        write_json(folder / SCENE, robot.scene.to_dict())
        if has_own_kinds(robot.scene):
            write_atomically(folder / OWN_SCENE, file.read_text(encoding="utf-8"))
    if robot.draws is not None:
        write_json(folder / INTERVALS, {name: each.bounds for name, each in robot.draws.distributions.items()})


def physics(options: Options, folder: Path) -> list[str]:
    """Words of `seastar evaluate` for the robot and the decisions of the run with these options in a folder."""
    words = ["--fidelity", options.fidelity] if options.scene is None else ["--scene", str(scene_in(folder))]
    period = options.ppo.decision_period
    return words if period is None else [*words, "--decision-period", str(period)]


def scene_in(folder: Path) -> Path:
    """File of the scene in a run's folder."""
    return folder / OWN_SCENE if (folder / OWN_SCENE).is_file() else folder / SCENE


def robot_of(options: Options, folder: Path) -> Robot:
    """Robot of the run with these options in a folder. ValueError for code of a run that may not be executed."""
    file = None if options.scene is None else scene_in(folder)
    if options.scene is not None and file is not None and file.name == OWN_SCENE:
        if options.resume is not None and not options.run_scene:
            raise ValueError(f"{file} is Python, which --resume executes with --run-scene only: see that it is yours.")
        search(options.scene.parent)  # for modules that it imports
    return Robot(
        None if file is None else load_scene(file),
        None if options.intervals is None else read_intervals(folder / INTERVALS),
    )
