"""From a user's robot to a policy, all the way, by the public interface.

    python -m studies.worked_example

A robot with a body and limbs that its wires bend is tracked by a camera. The robot is a simulated one, whose numbers
are not those that its maker has written down. The fit finds its numbers with intervals, the certificate the setting to
train at. Policies are trained on the numbers written down, on the same with the fitted cooling time, on all fitted ones
and on draws from the intervals, and swim on the robot as it was built: held-out random paths and the pentagon.

The folder of the results has the two CSV files of the tracking, the certificate, results.json and results.png. Results
are written after every step, and a step whose result is already there is not repeated.
"""

import itertools
import time
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch

from seastar_gym import Certificate, DomainRandomization, Scene, Uniform, certify
from seastar_gym.identify import Measurement, get_parameter, identify, with_parameters
from seastar_gym.scene.checks import require_count, require_number
from seastar_gym.version import __version__
from studies.frame import Results, Study
from studies.worked_example.pictures import draw
from studies.worked_example.robots import FITTED, NOMINAL, built, tracked
from studies.worked_example.tables import as_markdown
from studies.worked_example.trainings import Belief, scores, train

TRACKING, COMMANDS, CERTIFICATE, RESULTS = "tracking.csv", "commands.csv", "certificate.json", "results.json"
"""Files in the folder of the results."""
COOLING = "actuator.time_constant"
"""Number that policies depend on most: some are trained on its fit alone."""


@dataclass(frozen=True)
class Options:
    """From a user's robot to a policy: tracking, fit, certificate, trainings, swims on the robot as it was built."""

    seeds: tuple[int, ...] = tuple(range(10))
    """Seeds of the trainings."""
    tracked: int = 12
    """Length of the tracking [strokes]."""
    error: float = 0.1
    """Error of the hub's path that the training's setting keeps, as a fraction of its length."""
    samples: int = 60
    """Sequences per class of commands, of the certificate."""
    strokes: int = 49_152
    """Length of every training [strokes]."""
    paths: int = 32
    """Number of held-out random paths."""
    out: Path = Path("docs/worked_example")
    """Folder of the results."""

    def __post_init__(self) -> None:
        for name, least in (("tracked", 1), ("samples", 2), ("strokes", 1), ("paths", 1)):
            require_count(name, getattr(self, name), least, 10**9)
        require_number("error", self.error, "of the path's length")

    @property
    def settings(self) -> dict[str, Any]:
        """What all results of a folder have in common."""
        names = ("tracked", "error", "samples", "strokes", "paths")
        return {**{name: getattr(self, name) for name in names}, "version": __version__}


def fit(options: Options) -> dict[str, Any]:
    """Track the robot and fit its numbers to the two files."""
    files = options.out / TRACKING, options.out / COMMANDS
    tracked(built(), options.tracked).to_csv(*files)
    began = time.process_time()
    estimate = identify(NOMINAL, FITTED, Measurement.from_csv(*files))
    print(estimate.report(), flush=True)
    return {
        "values": estimate.values.tolist(),
        "lower": estimate.lower.tolist(),
        "upper": estimate.upper.tolist(),
        "untold": estimate.untold,
        "root_mean_square_m": estimate.root_mean_square,
        "scene": estimate.scene.to_dict(),
        "processor_seconds": round(time.process_time() - began, 1),
    }


def certified(options: Options, results: dict[str, Any]) -> dict[str, Any]:
    """Certify the fitted scene, and choose the setting to train at."""
    began = time.process_time()
    certificate = certify(Scene.from_dict(results["fit"]["scene"]), options.samples)
    certificate.save(options.out / CERTIFICATE)
    chosen = certificate.of(certificate.for_error(options.error))
    assert chosen is not None
    print(f"Trained at {chosen}, with an error of {100.0 * chosen.error(certificate.promised):.2g} %.", flush=True)
    return {
        "setting": str(chosen),
        "error": chosen.error(certificate.promised),
        "times_real_time": chosen.speed,
        "limit_error": certificate.limit_error,
        "processor_seconds": round(time.process_time() - began, 1),
    }


def beliefs(options: Options, results: dict[str, Any]) -> dict[str, Belief]:
    """What policies are trained on, by name, all at the setting of the certificate."""
    fitted = Certificate.load(options.out / CERTIFICATE).for_error(options.error)
    robot = replace(NOMINAL.robot, nodes_per_limb=fitted.robot.nodes_per_limb)
    found = results["fit"]
    intervals = zip(FITTED, found["lower"], found["upper"], strict=True)
    draws = DomainRandomization({name: Uniform(low, high) for name, low, high in intervals})
    nominal = replace(NOMINAL, robot=robot, numerics=fitted.numerics)
    return {
        "nominal": Belief(nominal),
        "cooling": Belief(with_parameters(nominal, [COOLING], [get_parameter(fitted, COOLING)])),
        "fitted": Belief(fitted),
        "drawn": Belief(fitted, draws),
    }


def study(options: Options, results: Results) -> None:
    """Do the steps that are missing."""
    torch.set_num_threads(1)
    options.out.mkdir(parents=True, exist_ok=True)
    results.fill({("fit",): partial(fit, options)}, lambda found: f"{found['root_mean_square_m']:.2g} m")
    results.fill({("certificate",): partial(certified, options, results)}, lambda found: found["setting"])
    cells = {
        ("runs", name, str(seed)): partial(trained, belief, seed, options)
        for seed, (name, belief) in itertools.product(options.seeds, beliefs(options, results).items())
    }
    results.fill(cells, lambda found: f"{np.mean(found['random']):.1f} s")


def trained(belief: Belief, seed: int, options: Options) -> dict[str, Any]:
    """Train a policy, and swim with it."""
    policy, seconds = train(belief, seed, options.strokes)
    return {"processor_seconds": round(seconds, 1), **scores(policy, belief, options.paths)}


STUDY = Study(
    "worked_example",
    study,
    Options,
    RESULTS,
    home="worked_example",
    settings=lambda options: options.settings,
    pictures={"results.png": draw},
    tables={"worked_example": as_markdown},
)
