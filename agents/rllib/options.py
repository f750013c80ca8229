"""Options of a training on several machines: from the command line, or from the folder of a run that is continued."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro

from agents.hyperparameters import Hyperparameters
from agents.training.options import CONFIG, PATH_HELP, Lengths, config_in, hyperparameters_of, require_same
from seastar_gym.envs.paths import make_path
from seastar_gym.files import write_json
from seastar_gym.scene.checks import require_count
from seastar_gym.scene.numerics import Fidelity


@dataclass(frozen=True)
class Options(Lengths):
    """Train a swimmer with RLlib's PPO, on this machine or on a cluster of Ray.

    The robots of the hyperparameters are spread over the env runners. Nodes need this package with its extra `rllib`.
    Continue only runs of people whom you trust: RLlib unpickles its checkpoints."""

    strokes: int | None = None
    """Length of the training [strokes, or decisions], with which the learning rate ends; by default as in train.py."""
    env_runners: int = 2
    """Processes that swim, each with one processor and its share of the robots."""
    address: str | None = None
    """Address of a cluster's head, such as head:6379. By default, a cluster of this machine is started."""
    path: Annotated[str, tyro.conf.arg(help=PATH_HELP)] = "random"
    random_heading: bool = True
    """Turn every robot at random at the start of an episode."""
    fidelity: Fidelity = "fast"
    """Accuracy of the simulation."""
    seed: int = 0
    """Seed of the network, the exploration and the paths."""
    save_freq: int = 8_192
    """Interval between checkpoints [strokes]."""
    out: Path = Path("runs/rllib")
    """Folder of the run."""
    resume: Path | None = None
    """Folder of a run to continue with its own options; strokes, env_runners, address and save_freq may differ."""
    ppo: Annotated[Hyperparameters, tyro.conf.arg(name="")] = Hyperparameters()

    def __post_init__(self) -> None:
        for name in ("env_runners", "save_freq"):
            require_count(name, getattr(self, name), 1, 1_000_000)
        require_count("strokes", self.length, 1, 2**40)
        if self.ppo.num_envs % self.env_runners:
            raise ValueError(f"{self.ppo.num_envs} robots cannot be shared by {self.env_runners} env runners evenly.")
        if self.ppo.coasting:
            raise ValueError("Progress by coasting is a reward of train.py, not of trainings with RLlib.")
        make_path(self.path, np.random.default_rng(0))

    def write(self) -> None:
        """Write the options into the folder of the run."""
        write_json(self.out / CONFIG, asdict(self))


CHANGEABLE = {"strokes", "env_runners", "address", "save_freq", "out", "resume"}
"""Names of the options that may change when a run is continued."""


def read_options(arguments: Sequence[str] | None) -> Options:
    """Options of the command line; with --resume, those of the run where the command line has no others."""
    options = tyro.cli(Options, prog="python -m agents.rllib", args=arguments)
    if options.resume is None:
        return options
    saved = saved_options(options.resume)
    options = tyro.cli(Options, prog="python -m agents.rllib", args=arguments, default=saved)
    require_same(options, saved, CHANGEABLE)
    return replace(options, out=saved.out)


def saved_options(folder: Path) -> Options:
    """Options of the run in a folder."""
    with config_in(folder) as found:
        return Options(**{**found, "out": folder, "resume": folder, "ppo": hyperparameters_of(found)})
