"""Certificates of the chapter's robot in the chapter's water, which come with the package.

`python -m studies.accuracy --store` measures that of strokes, and those of wires that are commanded several times a
second, whose settings are the fidelities. Their classes of commands:

random      of strokes: also the straight swim, the four pairs of Fig. 13.8 and the pentagon
repeated    repetitions of a command and alternations of two, with half as much again for those that were not measured;
            of wires: a second of commands, repeated
small       random and repeated commands of a tenth of the amplitude, whose paths are short, with half as much again
straight    the straight swim alone

Speeds are of `Certificate.machine`. An error bounds 95 % of random sequences with the confidence that `confidence`
returns, so it is no bound for all: docs/numerics.md says how many of fresh ones exceed it.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from os import PathLike
from pathlib import Path

from seastar_gym.accuracy.certificate import CLASSES_VERSION, Certificate, as_certificate
from seastar_gym.accuracy.setting import Setting
from seastar_gym.scene import Scene, Seastar
from seastar_gym.scene.checks import require_flag, require_number
from seastar_gym.version import __version__

FOLDER = Path(__file__).with_name("shipped")
STROKES = FOLDER / "strokes.json"


def file_of(decision_period: float, folder: Path = FOLDER) -> Path:
    """File of the errors for a time between decisions [s]."""
    return folder / f"wires_{decision_period:g}s.json"


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
) -> Scene:
    """Scene at the fastest measured setting whose path error is at most `error`.

    The error is that of the hub's path against infinitely many nodes and infinitely short steps, as a fraction of the
    path's length. ValueError if no measured setting keeps it, or if the robot was not measured.

    any_gait: Require it for the repetition of any command, too, which is harder.
    robot: The robot. Nodes per limb and a discretisation that it names are kept, others are chosen.
    certificate: `Certificate` of the scene, or the file of one, whose errors are those of any gait. It lapses where the
        robot or the version of the package differs. None means the package's own, which is of the chapter's robot and
        water.

    >>> scene_for(0.002).robot.nodes_per_limb
    28
    >>> scene_for(1e-6)
    Traceback (most recent call last):
    ValueError: No measured setting keeps the path error below 0.0001 %: the best, ...
    """
    require_flag("any_gait", any_gait)
    known = chapters_certificate() if certificate is None else as_certificate(certificate)
    classes = known.promised + known.repeated(tuple(known.settings[0].errors)) if any_gait else known.promised
    return known.for_error(error, classes, robot)


def timed_certificate(decision_period: float) -> Certificate | None:
    """Errors of the chapter's robot with wires: the larger ones of the measured times around a decision period [s].

    None outside of the measured times.
    """
    require_number("decision_period", decision_period, "s")
    known = {float(each.decision_period or 0.0): each for each in map(_load, FOLDER.glob("wires_*.json"))}
    shorter = [period for period in known if period <= decision_period * (1.0 + 1e-9)]
    longer = [period for period in known if period >= decision_period * (1.0 - 1e-9)]
    if not shorter or not longer:
        return None
    one, other = known[max(shorter)], known[min(longer)]
    return replace(one, settings=tuple(map(_worst, one.settings, other.settings)))


def _worst(one: Setting, other: Setting) -> Setting:
    """A setting with the larger of two errors of every kind."""

    def larger(some: Mapping[str, float], others: Mapping[str, float]) -> dict[str, float]:
        return {name: max(error, others[name]) for name, error in some.items()}

    space, in_time = max(one.space_error, other.space_error), max(one.time_error, other.time_error)
    errors = larger(one.errors, other.errors) | {"random": space + in_time}
    typical = larger(one.typical, other.typical)
    return replace(one, errors=errors, typical=typical, space_error=space, time_error=in_time)
