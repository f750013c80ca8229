"""Options of a training run: from the command line, or from the folder of a run that is continued."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import numpy as np
import tyro

from agents.ppo import Hyperparameters
from seastar_gym import RewardWeights
from seastar_gym.controllers.learned import reason_of
from seastar_gym.envs.commands import decisions_in
from seastar_gym.envs.paths import PATHS, make_path
from seastar_gym.evaluation.swim import TIME_LIMIT
from seastar_gym.files import read_json
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import require_choice, require_count, require_flag, shown
from seastar_gym.scene.numerics import Fidelity

CONFIG = "config.json"
PATH_HELP = (
    f"Name of the path to train on: {', '.join(PATHS)}. Random paths teach every direction and every turn, also those "
    "of the pentagon."
)


ENOUGH, ENOUGH_IN_TIME = 65_536, 300_000
"""Length of a training [strokes], after which more gain 0.3 % (docs/training.md), and of one in time [decisions]."""


@dataclass(frozen=True)
class Options:
    """Train a swimmer with PPO and compare it with the scripted pentagon gait."""

    strokes: int | None = None
    """Length of the training [strokes, or decisions], all robots together, with which the learning rate ends; by
    default 65,536 strokes, after which more gain 0.3 %, or 300,000 decisions that are not strokes."""
    path: Annotated[str, tyro.conf.arg(help=PATH_HELP)] = "random"
    random_heading: bool = True
    """Turn every robot at random at the start of an episode."""
    fidelity: Fidelity = "fast"
    """Accuracy of the simulation, in the training and in the comparison. Policies that were trained at "fast" swim as
    well at "reference" as others (docs/training.md). A scene that names its numerics is swum with those."""
    scene: Path | None = None
    """File of the robot's scene: JSON, or Python that defines `scene`, which is executed; by default the chapter's."""
    intervals: Path | None = None
    """JSON file of numbers of the scene by name, with the ends of their intervals, as seastar identify writes it: every
    episode of the training draws a robot from them."""
    intervals_anyway: bool = False
    """Confirm --intervals of a fit whose residual is well above the noise of its track."""
    seed: int = 0
    """Seed of the network, the exploration and the paths."""
    seeds: tuple[int, ...] = ()
    """Seeds of several runs, one after another, each in a folder of its own within that of --out."""
    num_threads: int | None = None
    """Number of threads of the simulator; by default one for every processor. The network always uses one."""
    device: Literal["cpu", "cuda", "auto"] = "cpu"
    """Device of the network, which is so small that a GPU is no faster."""
    save_freq: int = 8_192
    """Interval between checkpoints [strokes, or decisions]."""
    video: bool = True
    """Write videos of the swims of the comparison."""
    out: Path | None = None
    """Folder of the run; by default a folder in runs/ named after the time."""
    publish: bool = False
    """Make the trained policy the bundled one, the default of `seastar evaluate`, unless that one needs fewer
    strokes on held-out random paths."""
    publish_anyway: bool = False
    """Confirm --publish for a worse policy, or for that of a --quick run."""
    resume: Path | None = None
    """Folder of a run to continue with its own options; strokes, num_threads, device, save_freq, video and publish
    may differ. It is safe to continue a run of others: its files are read as JSON and tensors, and nothing is
    unpickled or executed without --run-scene. Stable-Baselines3's own PPO.load, however, would execute code in its
    model.zip."""
    run_scene: bool = False
    """Have --resume execute the run's scene.py, which runs of scenes with classes of their own have: for runs that are
    yours."""
    for_camera: Path | None = None
    """JSON file of a camera. With --resume: train no more, but make a policy for that camera, which `seastar drive`
    takes, by imitation of the run's policy, in a folder of the run that is named as the file (docs/plant.md)."""
    quick: bool = False
    """Train for 32,768 strokes at fidelity "fast", half of the default training, and for a third with --for-camera."""
    ppo: Annotated[Hyperparameters, tyro.conf.arg(name="")] = Hyperparameters()

    def __post_init__(self) -> None:
        require_count("strokes", self.length, 1, 2**40)
        require_count("save_freq", self.save_freq, 1, 2**40)
        require_count("seed", self.seed, 0, 2**32 - 1)
        if self.num_threads is not None:
            require_count("num_threads", self.num_threads, 1, 1_000_000)
        require_choice("fidelity", self.fidelity, get_args(Fidelity))
        require_choice("device", self.device, ("cpu", "cuda", "auto"))
        for name in ("random_heading", "video", "quick", "intervals_anyway"):
            require_flag(name, getattr(self, name))
        if self.seeds and (self.resume is not None or self.publish or len(set(self.seeds)) < len(self.seeds)):
            raise ValueError("--seeds are different ones of new runs, without --resume and --publish.")
        if self.intervals_anyway and self.intervals is None:
            raise ValueError("--intervals-anyway confirms --intervals: give both.")
        if self.for_camera is not None and (self.resume is None or self.publish):
            raise ValueError("--for-camera makes a policy from a finished run: name that with --resume, alone.")
        if self.publish and not (self.scene is None and self.intervals is None):
            raise ValueError("--publish is for policies of the chapter's robot, without --scene and --intervals.")
        if self.scene is None:  # whose file may register the path
            make_path(self.path, np.random.default_rng(0))

    @property
    def length(self) -> int:
        """Length of the training [strokes, or decisions]."""
        if self.strokes is not None:
            return self.strokes
        return ENOUGH if self.ppo.decision_period is None else ENOUGH_IN_TIME

    @property
    def seconds(self) -> float:
        """Time limit of an evaluated swim [s]."""
        return TIME_LIMIT

    def limit(self, scene: Scene | None = None) -> int:
        """Time limit of an evaluated swim [decisions]; the scripted gait takes 241 s round the pentagon.

        scene: Of the robot. None means the chapter's.
        """
        return decisions_in(self.seconds, self.ppo.decision_period, scene)


CHANGEABLE = {
    "strokes", "num_threads", "device", "save_freq", "video", "publish", "publish_anyway", "out", "resume", "quick",
    "for_camera", "run_scene",
}  # fmt: skip
"""Names of the options that may change when a run is continued."""


def read_options(arguments: Sequence[str]) -> Options:
    """Options of the command line; with --resume, those of the run where the command line has no others."""
    options = tyro.cli(Options, prog="python train.py", args=arguments)
    if options.resume is None:
        return replace(options, strokes=32_768, fidelity="fast") if options.quick else options
    saved = replace(saved_options(options.resume), out=options.resume, resume=options.resume)
    options = tyro.cli(Options, prog="python train.py", args=arguments, default=saved)
    changed = {name for name in vars(saved) if getattr(options, name) != getattr(saved, name)}
    if "quick" in changed and options.for_camera is None:
        raise ValueError("--quick is for new runs, and for --for-camera: leave it out.")
    if options.out is not None and options.resume is not None and options.out.resolve() != options.resume.resolve():
        raise ValueError(f"A run continues in its own folder, {options.resume}: leave out --out, or copy the run.")
    if forbidden := sorted(changed - CHANGEABLE | (changed & {"strokes"} if options.for_camera else set())):
        raise ValueError(f"The run in {options.resume} cannot continue with another {', '.join(forbidden)}.")
    return replace(options, out=options.resume)


def saved_options(folder: Path) -> Options:
    """Options of the run in a folder, without --publish, which has to be asked for again."""
    options = config_of(folder)["options"]
    with faults_of(folder / CONFIG):
        here: dict[str, Any] = {"out": folder, "resume": None, "ppo": hyperparameters_of(options), "seeds": ()}
        here |= {"publish": False, "publish_anyway": False, "for_camera": None, "run_scene": False}
        here |= {name: Path(options[name]) for name in ("scene", "intervals") if options[name] is not None}
        return Options(**{**options, **here})


def config_of(folder: Path) -> dict[str, Any]:
    """Entries of the config.json of a run: its options, commands, versions and machine."""
    file = folder / CONFIG
    if not file.is_file():
        runs = sorted(str(found.parent) for found in folder.glob(f"*/{CONFIG}"))
        these = f" It has those of several seeds: name one, such as {runs[0]}." if runs else ""
        raise FileNotFoundError(f"There is no run to continue in {folder}: it has no {CONFIG}.{these}")
    with faults_of(file):
        config = read_json(file)
        commands = config["commands"]
        if not isinstance(commands, list) or not all(isinstance(command, str) for command in commands):
            raise ValueError(f"its commands must be texts, not {shown(commands)}")
        for name in ("options", "versions", "machine"):
            if not isinstance(config[name], dict):
                raise ValueError(f"its {name} must be names with values, not {shown(config[name])}")
        return dict(config)


def hyperparameters_of(options: dict[str, Any]) -> Hyperparameters:
    """Hyperparameters among the options of a config.json."""
    ppo = options["ppo"]
    return Hyperparameters(**ppo | {"hidden": tuple(ppo["hidden"]), "reward": RewardWeights(**ppo["reward"])})


@contextmanager
def faults_of(file: Path) -> Iterator[None]:
    """Context in which any fault of a file's contents becomes a ValueError with one sentence."""
    try:
        yield
    except (AttributeError, KeyError, OverflowError, TypeError, ValueError) as damaged:
        raise ValueError(f"{file} is damaged or from another version: {reason_of(damaged)}.") from damaged


def require_consent(options: Options) -> None:
    """ValueError where --publish is not confirmed for the policy of a --quick run, or is confirmed without it."""
    if options.publish_anyway and not options.publish:
        raise ValueError("--publish-anyway confirms --publish: give both.")
    if options.publish and options.quick and not options.publish_anyway:
        raise ValueError("A --quick run replaces the bundled policy only with --publish-anyway beside --publish.")
