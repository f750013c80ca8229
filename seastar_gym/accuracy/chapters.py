"""Certificates of the chapter's robot in the chapter's water, which come with the package.

`python -m studies.accuracy --store` measures that of strokes, and those of wires that are commanded several times a
second. Classes of commands are those of commands.py, and

chapter's               of strokes: the straight swim, the four pairs of Fig. 13.8 and the pentagon
repeated command        every command of -1, 0 and +1, all the time, in strokes, too ("repeated ternary")
policies                of decisions: what bundled policies, the planner and the greedy rule do

Speeds are of `Certificate.machine`. Errors and speed that `info` tells are of the package's own certificates, or of a
user's: `path_error` and `gait_error` are promises, `typical_error` and `typical_gait_error` medians.
"""

import math
import warnings
from dataclasses import replace
from functools import cache
from os import PathLike
from pathlib import Path

import numpy as np

from seastar_gym.accuracy.certificate import CLASSES_VERSION, Certificate, as_certificate, physics
from seastar_gym.scene import Scene, Seastar
from seastar_gym.scene.checks import require_flag, require_kind, require_number, require_period, shown
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.version import __version__

FOLDER = Path(__file__).with_name("shipped")
STROKES = FOLDER / "strokes.json"
SHORT_STEP = 5e-4
"""Steps [s] that are short enough for the resonances of undamped limbs."""


IN_TIME = tuple(FOLDER / name for name in ("wires.json", "undamped.json"))
"""Files of wires that are commanded several times a second: of limbs of silicone, as environments have them, and of the
chapter's, which damp nothing."""


@cache
def _load(file: Path) -> Certificate:
    """Certificate of a file, which is of this version because it comes with it."""
    return replace(Certificate.load(file), version=__version__, classes=CLASSES_VERSION)


def chapters_certificate() -> Certificate:
    """Errors and speeds of the chapter's robot in strokes."""
    return _load(STROKES)


def scene_for(
    error: float,
    any_gait: bool = False,
    robot: Seastar | None = None,
    certificate: Certificate | str | PathLike[str] | None = None,
    decision_period: float | None = None,
) -> Scene:
    """Scene at the fastest measured setting that promises a path error of at most `error`.

    The error is that of the hub's path against infinitely many nodes and infinitely short steps, as a fraction of the
    path's length. ValueError if no measured setting keeps it, or if the robot was not measured.

    any_gait: Require it for the repetition of any command, too, which is harder.
    robot: The robot. Nodes per limb and a discretisation that it names are kept, others are chosen.
    certificate: `Certificate` of the scene, or the file of one, whose errors are those of any gait. It lapses where the
        robot or the version of the package differs. None means the package's own, which is of the chapter's robot and
        water.
    decision_period: Time between decisions [s] that are shorter than a stroke. None means strokes, or what a
        certificate has.

    >>> scene_for(0.005).robot.nodes_per_limb
    14
    >>> scene_for(0.001, any_gait=True, decision_period=0.2).robot.nodes_per_limb
    25
    >>> scene_for(1e-6)
    Traceback (most recent call last):
    ValueError: No measured setting keeps the path error below 0.0001 %: the best, ...
    """
    require_flag("any_gait", any_gait)
    known = _of_period(decision_period) if certificate is None else as_certificate(certificate)
    repeated = known.repeated(known.promised) if certificate is None and not any_gait else ()
    return known.for_error(error, tuple(each for each in known.promised if each not in repeated), robot)


def _of_period(decision_period: float | None) -> Certificate:
    """The package's certificate for a time between decisions [s]; ValueError where it has none."""
    require_period(decision_period)
    stroke = Scene().actuator.period
    if decision_period is None or decision_period == stroke:
        return chapters_certificate()
    known = timed_certificate(decision_period)
    if known is None:
        raise ValueError(f"No errors of decisions every {decision_period:g} s were measured: seastar certify does.")
    return known


def timed_certificate(decision_period: float, scene: Scene | None = None) -> Certificate | None:
    """Errors of the chapter's robot with wires, the largest of all measured times between decisions.

    Resonances of limbs lie so near to each other that a time between two measured ones may err more than both.

    decision_period: Time between decisions [s]. scene: The scene, whose limbs have the material damping of silicone, or
    none. None means the first, as environments have it. Returns None for times and scenes that were not measured.
    """
    require_number("decision_period", decision_period, "s")
    require_kind("scene", scene, Scene | None, "a Scene or None")
    for known in map(_load, IN_TIME):
        periods = known.measured_over["periods"]
        if scene is None or known.scene == physics(scene):
            measured = min(periods) * (1.0 - 1e-9) <= decision_period <= max(periods) * (1.0 + 1e-9)
            return replace(known, decision_period=decision_period) if measured else None
    return None


ERRORS = ("path_error", "gait_error", "typical_error", "typical_gait_error", "space_error", "time_error")
"""Entries of `info` where decisions are no strokes."""
NAMES = (*ERRORS, "batch_real_time_factor")
"""Entries of `info` where they are strokes: errors, and the speed of a batch."""


def errors_in_info(
    scene: Scene, certificate: Certificate | None = None, decision_period: float | None = None
) -> dict[str, float]:
    """Measured errors and speed of a scene by their names in `info`; NaN for scenes not measured.

    certificate: Where they stand, the package's own if None. decision_period: Time between decisions [s]. None means
    strokes.
    """
    known = _certificate(certificate, scene, decision_period)
    setting = None if known is None else known.of(scene)
    if known is None or setting is None:
        return dict.fromkeys(NAMES if decision_period is None else ERRORS, math.nan)
    gaits = known.repeated(known.promised)
    others = [name for name in known.promised if name not in gaits]
    found = {
        "path_error": setting.promise(others), "gait_error": setting.promise(gaits),
        "typical_error": setting.typical_error(others), "typical_gait_error": setting.typical_error(gaits),
        "space_error": setting.space_error, "time_error": setting.time_error,
    }  # fmt: skip
    return found if known.decision_period is not None else found | {"batch_real_time_factor": setting.speed}


def _certificate(certificate: Certificate | None, scene: Scene, decision_period: float | None) -> Certificate | None:
    if certificate is not None:
        return certificate
    return chapters_certificate() if decision_period is None else timed_certificate(decision_period, scene)


def read_certificate(
    certificate: Certificate | str | PathLike[str] | None, scene: Scene, decision_period: float | None
) -> Certificate | None:
    """Certificate of an object or a file; ValueError where it has lapsed for the scene, or decisions are no strokes.

    decision_period: Time between decisions [s]. None means strokes.
    """
    if certificate is None:
        return None
    certificate = as_certificate(certificate)
    certificate.require_valid(scene)
    if decision_period != certificate.decision_period:
        stroke = scene.actuator.period
        own, asked = (
            f"strokes of {stroke:g} s" if each is None else f"decisions every {each:g} s"
            for each in (certificate.decision_period, decision_period)
        )
        raise ValueError(
            f"The certificate has errors of {own}, none of {asked}: leave it out, and use error_bars=True, which "
            "estimates errors of any swim."
        )
    return certificate


def warn_undamped(scene: Scene, decision_period: float | None) -> None:
    """Warn of limbs that damp nothing where decisions are shorter than strokes: they resonate with decisions.

    Called two calls below where an environment is made, which the warning names.
    """
    relaxation_time, stroke = scene.robot.relaxation_time, scene.actuator.period
    damped = relaxation_time is not None and bool(np.min(relaxation_time) > 0.0)
    if decision_period is None or decision_period >= stroke or damped or scene.numerics.step <= SHORT_STEP:
        return
    errors = errors_in_info(scene, None, decision_period)["gait_error"]
    of_chapters = "" if math.isnan(errors) else f", by up to {100 * errors:.2g} % of the hub's path"
    warnings.warn(
        f"The limbs of this scene damp nothing, so that decisions drive their resonances, which steps of "
        f"{1e3 * scene.numerics.step:g} ms misplace{of_chapters}: Seastar(relaxation_time=relaxation_time(0.1, 10.0)) "
        "damps them as soft silicone does. seastar_gym.accuracy.resonance.resonances(scene, "
        f"{decision_period:g}) has their frequencies.",
        stacklevel=4,
    )


def warn_uncertified(
    scene: Scene, fidelity: Fidelity | None, certificate: Certificate | None, decision_period: float | None
) -> None:
    """Warn where a certificate or a fidelity is given, but no errors of the scene were measured.

    Called two calls below where an environment is made, which the warning names.

    fidelity: None asks for none. decision_period: Time between decisions [s]. None means strokes.
    """
    known = _certificate(certificate, scene, decision_period)
    if (certificate is None and fidelity is None) or (known is not None and known.of(scene) is not None):
        return
    if certificate is not None:
        told = (
            f"The certificate has no errors of {scene.robot.nodes_per_limb} nodes per limb with "
            f"{shown(scene.numerics)}, so errors in info are NaN: Certificate.for_error chooses what it has."
        )
    else:
        remedy = "error_bars=True estimates them as the robot swims"
        if decision_period is None:
            remedy = "seastar certify measures them"
        told = (
            f'Errors of this scene were not measured: fidelity="{fidelity}" promises nothing for it, and errors in '
            f"info are NaN: {remedy}."
        )
    warnings.warn(told, stacklevel=4)


def warn_of_task(name: str) -> None:
    """Warn of a certificate for a task that draws its robot or its water, which none is of.

    Called two calls below where an environment is made, which the warning names.
    """
    warnings.warn(
        f"{name} draws its robot or its water, so info has none of the certificate's errors: error_bars=True estimates "
        "them.",
        stacklevel=4,
    )
