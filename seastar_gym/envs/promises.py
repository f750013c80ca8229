"""Errors and speed that `info` promises: of the package's own table, or of a certificate."""

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import get_args

from seastar_gym.scene import Scene, SmaWires
from seastar_gym.scene.certificate import Certificate, physics
from seastar_gym.scene.checks import shown
from seastar_gym.scene.fidelity import measured, timed_promise
from seastar_gym.scene.numerics import Fidelity

IN_TIME = ("path_error", "gait_error", "typical_error", "typical_gait_error", "space_error", "time_error")
"""Entries of `info` where decisions are no strokes."""
NAMES = (*IN_TIME, "batch_real_time_factor")
"""Entries of `info` where they are strokes: errors, and the speed of a batch."""
REPEATED = ("repeated ternary", "alternating ternary")
"""Classes of a certificate's commands that `gait_error` is of."""


def promised(
    scene: Scene, certificate: Certificate | None = None, decision_period: float | None = None
) -> dict[str, float]:
    """Measured errors and speed of a scene by their names in `info`; NaN for scenes not measured, nothing in time.

    certificate: Where they stand, the package's own table of the chapter's robot if None. decision_period: Time
    between decisions [s]. None means strokes, which alone certificates are of.
    """
    if decision_period is not None:
        return _in_time(scene, decision_period)
    if certificate is None:
        return _by_the_table(scene)
    setting = certificate.of(scene) if physics(scene) == physics(certificate.scene) else None
    if setting is None:
        return dict.fromkeys(NAMES, math.nan)
    gaits = [name for name in certificate.actions if name in REPEATED]
    others = [name for name in certificate.actions if name not in REPEATED]
    bounds, medians = ((_largest(of, others), _largest(of, gaits)) for of in (setting.errors, setting.typical))
    return dict(zip(NAMES, (*bounds, *medians, setting.space_error, setting.time_error, setting.speed), strict=True))


def _largest(errors: Mapping[str, float], classes: Sequence[str]) -> float:
    """Largest error of some classes of commands, NaN of none."""
    return max((errors.get(name, math.nan) for name in classes), default=math.nan)


def _by_the_table(scene: Scene) -> dict[str, float]:
    known = measured(scene)
    if known is None:
        return dict.fromkeys(NAMES, math.nan)
    return {name: getattr(known, name) for name in IN_TIME} | {"batch_real_time_factor": known.speed}


def _in_time(scene: Scene, decision_period: float) -> dict[str, float]:
    """Errors of a preset with wires, nothing for other scenes; speeds were measured of strokes only."""
    wired = [name for name in get_args(Fidelity) if scene == replace(Scene.preset(name), actuator=SmaWires())]
    known = timed_promise(wired[0], decision_period) if wired else None
    if known is None:
        return {}
    return {name: getattr(known, name) for name in IN_TIME}


def read_certificate(
    certificate: Certificate | str | PathLike[str] | None, scene: Scene, decision_period: float
) -> Certificate | None:
    """Certificate of an object or a file; ValueError where it has lapsed for the scene, or decisions are no strokes.

    decision_period: Time between decisions [s].
    """
    if certificate is None:
        return None
    if isinstance(certificate, str | PathLike):
        certificate = Certificate.load(Path(certificate))
    if not isinstance(certificate, Certificate):
        raise ValueError(f"certificate must be a Certificate or a file of one, not {shown(certificate)}.")
    certificate.require_valid(scene)
    if not in_strokes(scene, decision_period):
        raise ValueError(
            f"A certificate has errors of strokes of {scene.actuator.period:g} s, none of decisions every "
            f"{decision_period:g} s: leave it out, and use error_bars=True, which estimates errors of any swim."
        )
    return certificate


def in_strokes(scene: Scene, decision_period: float | None) -> bool:
    """Whether decisions are strokes of the scene's actuator. decision_period: [s]. None means strokes."""
    return decision_period is None or decision_period == scene.actuator.period


def warn_uncertified(
    scene: Scene, fidelity: Fidelity | None, certificate: Certificate | None, decision_period: float | None
) -> None:
    """Warn where a certificate or a fidelity is given, but no errors of the scene were measured.

    fidelity: None asks for none. decision_period: Time between decisions [s]. None means strokes.
    """
    if certificate is not None:
        if certificate.of(scene) is None:
            warnings.warn(
                f"The certificate has no errors of {scene.robot.nodes_per_limb} nodes per limb with "
                f"{shown(scene.numerics)}, so errors in info are NaN: Certificate.for_error chooses what it has.",
                stacklevel=3,
            )
    elif fidelity is not None and not _has_promise(scene, decision_period):
        remedy = "info has no errors: error_bars=True estimates them as the robot swims"
        if in_strokes(scene, decision_period):
            remedy = "errors in info are NaN: python -m seastar_gym.certify measures them"
        warnings.warn(
            f'Errors of this scene were not measured, so fidelity="{fidelity}" promises nothing for it, and {remedy}.',
            stacklevel=3,
        )


def _has_promise(scene: Scene, decision_period: float | None) -> bool:
    """Whether the package's own tables have errors of a scene."""
    if in_strokes(scene, decision_period):
        return measured(scene) is not None
    return bool(promised(scene, None, decision_period))
