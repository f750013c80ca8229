"""Errors and speed that `info` tells: of the package's own certificates, or of a user's."""

import math
import warnings
from os import PathLike

from seastar_gym.accuracy.certificate import Certificate, as_certificate
from seastar_gym.accuracy.chapter import chapters_certificate, timed_certificate
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import shown
from seastar_gym.scene.numerics import Fidelity

IN_TIME = ("path_error", "gait_error", "typical_error", "typical_gait_error", "space_error", "time_error")
"""Entries of `info` where decisions are no strokes."""
NAMES = (*IN_TIME, "batch_real_time_factor")
"""Entries of `info` where they are strokes: errors, and the speed of a batch."""


def errors_in_info(
    scene: Scene, certificate: Certificate | None = None, decision_period: float | None = None
) -> dict[str, float]:
    """Measured errors and speed of a scene by their names in `info`; NaN for scenes not measured.

    certificate: Where they stand, the package's own if None. decision_period: Time between decisions [s]. None means
    strokes.
    """
    known = _certificate(certificate, decision_period)
    setting = None if known is None else known.of(scene)
    if known is None or setting is None:
        return dict.fromkeys(NAMES if decision_period is None else IN_TIME, math.nan)
    gaits = known.repeated(known.actions)
    others = [name for name in known.actions if name not in gaits]
    found = {
        "path_error": setting.error(others), "gait_error": setting.error(gaits),
        "typical_error": setting.typical_error(others), "typical_gait_error": setting.typical_error(gaits),
        "space_error": setting.space_error, "time_error": setting.time_error,
    }  # fmt: skip
    return found if known.decision_period is not None else found | {"batch_real_time_factor": setting.speed}


def _certificate(certificate: Certificate | None, decision_period: float | None) -> Certificate | None:
    if certificate is not None:
        return certificate
    return chapters_certificate() if decision_period is None else timed_certificate(decision_period)


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


def warn_uncertified(
    scene: Scene, fidelity: Fidelity | None, certificate: Certificate | None, decision_period: float | None
) -> None:
    """Warn where a certificate or a fidelity is given, but no errors of the scene were measured.

    fidelity: None asks for none. decision_period: Time between decisions [s]. None means strokes.
    """
    known = _certificate(certificate, decision_period)
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
    warnings.warn(told, stacklevel=3)
