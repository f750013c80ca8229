"""`Certificate`: measured errors of one scene, written by `seastar certify`.

A certificate is a JSON file. It lapses where the scene's physics or the version of the package differ: then it is
refused with a sentence. The file has a digest of its content, so that errors stay those of their scene.

`Setting`: a resolution and numerics, with the errors and the speed of one scene.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any, cast, get_args

from seastar_gym.files import write_atomically
from seastar_gym.scene import Numerics, Scene, Seastar
from seastar_gym.scene.checks import (
    is_whole_number,
    require_choice,
    require_count,
    require_error,
    require_kind,
    require_number,
    require_period,
    require_texts,
    shown,
)
from seastar_gym.scene.numerics import Resolution, SchemeName
from seastar_gym.scene.robot import Discretisation
from seastar_gym.scene.serial import html_table
from seastar_gym.version import __version__

MARGIN = 1.5
"""Promised over largest measured error. Sequences that were not measured err more than the largest of those that were:
`python -m studies.accuracy --fresh 8` tells by how much."""
LARGEST_GROWTH = 1.5
"""Growth of the kinetic energy over a long swim above which `Certificate.for_error` does not choose a setting."""


@dataclass(frozen=True)
class Setting:
    """A resolution and numerics, with the errors and the speed of one scene.

    Errors are fractions of the hub's path in the continuum, over ten strokes from rest, each the largest of all
    measured sequences of a class; what is promised is `MARGIN` times that. An error is the sum of that of space, of N
    nodes per limb with very short steps, and that of time, of the steps with the same nodes. The sum is told also where
    the two cancel. In a current, the path is the way through the water, and robots begin at rest in the water.

    nodes_per_limb, scheme, step [s], newton_tolerance, damping, discretisation: See `Numerics` and `Seastar`.
    errors: Sum of the errors of space and time, by class of commands, see `Certificate`.
    typical: The same, the median of all sequences of a class. {} where medians were not measured.
    space_error, time_error: Largest errors of all classes that the certificate promises.
    speed: Simulated time over computing time, for a batch on one core.
    energy_growth: Kinetic energy late in swims of 200 strokes over that early in them, the largest of some gaits.
    heading_error, end_error: Errors of the heading [deg] and of the hub after the last stroke, over the same commands
        as `space_error`.

    NaN stands for what was not measured, where it is the default. A failed swim has the error inf. Anything else that
    is no number from 0 on is refused with a ValueError.
    """

    nodes_per_limb: int
    scheme: str
    step: float
    newton_tolerance: float
    errors: Mapping[str, float]
    typical: Mapping[str, float]
    space_error: float
    time_error: float
    speed: float = math.nan
    energy_growth: float = math.nan
    heading_error: float = math.nan
    end_error: float = math.nan
    discretisation: str = "continuum"
    damping: float = 0.0

    def __post_init__(self) -> None:
        require_choice("discretisation", self.discretisation, get_args(Discretisation))
        require_count("nodes_per_limb", self.nodes_per_limb, 2, 10_000)
        if is_measured(self.speed):
            require_number("speed", self.speed, "1")
        _require_classes("errors", self.errors)
        if self.typical != {}:
            _require_classes("typical", self.typical)
            if set(self.errors) != set(self.typical):
                raise ValueError("errors and typical must have the same classes of commands.")
        for name in ("space_error", "time_error"):
            require_measured(name, getattr(self, name))
        for name in ("energy_growth", "heading_error", "end_error"):
            if is_measured(getattr(self, name)):
                require_measured(name, getattr(self, name))
        _ = self.resolution

    @cached_property
    def resolution(self) -> Resolution:
        """Discretisation, nodes per limb and numerics."""
        numerics = Numerics(cast(SchemeName, self.scheme), self.step, self.newton_tolerance, damping=self.damping)
        return Resolution(cast(Discretisation, self.discretisation), self.nodes_per_limb, numerics)

    @property
    def numerics(self) -> Numerics:
        """Numerics of the setting."""
        return self.resolution.numerics

    @property
    def is_energy_stable(self) -> bool:
        """Whether long swims gather no energy, as far as was measured: errors of ten strokes would not show it."""
        return not self.energy_growth > LARGEST_GROWTH

    def error(self, classes: Iterable[str]) -> float:
        """Largest measured error over some classes; NaN of none."""
        return _largest(self.errors, classes)

    def promise(self, classes: Iterable[str]) -> float:
        """Error that is promised over some classes, `MARGIN` times the largest measured one; NaN of none."""
        return float(f"{MARGIN * self.error(classes):.3g}")

    def typical_error(self, classes: Iterable[str]) -> float:
        """Median error, of the class where it is largest: half of the sequences of every class have less.

        NaN of no classes, and where medians were not measured.
        """
        return _largest(self.typical, classes)

    def __str__(self) -> str:
        damped = "" if self.damping == 0.0 else f", damping {self.damping:g},"
        return f'"{self.scheme}" at {1e3 * self.step:.4g} ms{damped} with {self.nodes_per_limb} nodes per limb'


def is_measured(number: object) -> bool:
    """Whether a number is not the NaN that stands for what was not measured."""
    return not isinstance(number, float) or not math.isnan(number)


def _largest(errors: Mapping[str, float], classes: Iterable[str]) -> float:
    asked = set(classes)
    return max(errors[name] for name in asked) if asked and asked.issubset(errors) else math.nan


def _require_classes(name: str, errors: Any) -> None:
    """Refuse what is no error by class of commands."""
    if not isinstance(errors, Mapping) or not errors:
        raise ValueError(f"{name} must be numbers by class of commands, not {shown(errors)}.")
    for each in errors.values():
        require_measured(name, each)


def require_measured(name: str, error: float) -> None:
    """Refuse what is no measured error: a number from 0 on, or inf for a swim that failed."""
    if not (isinstance(error, float) and error == math.inf):
        require_number(name, error, "1", zero_allowed=True)


def at(scene: Scene, resolution: Resolution) -> Scene:
    """The scene with a discretisation, nodes per limb and numerics."""
    discretisation, nodes_per_limb, numerics = resolution
    robot = replace(scene.robot, nodes_per_limb=nodes_per_limb, discretisation=discretisation, hub_hinge="opening")
    return replace(scene, robot=robot, numerics=numerics)


def resolved(scene: Scene, nodes_per_limb: int, numerics: Numerics) -> Scene:
    """The scene with nodes per limb of the continuum's discretisation, and numerics."""
    return at(scene, Resolution("continuum", nodes_per_limb, numerics))


def physics(scene: Scene) -> Scene:
    """The scene with one resolution and numerics for all: what a certificate is about."""
    return resolved(scene, 10, Numerics())


FORMAT = 4
"""Version of the file's form."""
CLASSES_VERSION = 3
"""Version of the classes of commands, see commands.py. Errors of another are of others: certificates lapse."""
MOST_SAMPLES = 100_000
"""Most sequences of a class that can be asked for."""
LEVELS = (0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001)
"""Errors for which a summary names the fastest setting."""
REPEATED = ("repeated", "alternating", "held", "on-off", "policies", "chapter's")
"""Beginnings of the names of classes whose commands are repeated."""

HEADS = ("error", "speed", "fastest setting")


@dataclass(frozen=True)
class Certificate:
    """Errors of some settings for one scene.

    scene: The scene; its nodes per limb, discretisation and numerics do not count.
    settings: Measured settings.
    promised: Classes of commands over which `for_error` and `info` promise; the others are there to be read.
    samples: Sequences per class. With n of them, at most a share s of all sequences of a class errs by more than the
        largest that was measured, with the confidence 1 - (1 - s)^n, and fewer by more than is promised.
    limit_error: Largest error of the swims that stand for the continuum, estimated from half as many edges. All errors
        have it.
    classes, version, machine: Version of the classes of commands, of the package, and where speeds were measured.
    decision_period: Time between decisions [s] of wires (`SmaWires`). Errors are then of decisions in place of strokes,
        over paths that are seen at whole seconds. None means strokes.
    measured_over: What else there is to tell of the commands, as plain data.
    """

    scene: Scene
    settings: tuple[Setting, ...]
    promised: tuple[str, ...]
    samples: int
    limit_error: float
    classes: int
    version: str
    machine: str
    decision_period: float | None = None
    measured_over: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not isinstance(self.scene, Scene):
            raise ValueError(f"scene must be a Scene, not {shown(self.scene)}.")
        settings = self.settings if isinstance(self.settings, tuple | list) else ()
        if not settings or not all(isinstance(each, Setting) for each in settings):
            raise ValueError(f"settings must be some Settings, not {shown(self.settings)}.")
        known = set(self.settings[0].errors)
        if any(set(each.errors) != known for each in self.settings):
            raise ValueError("settings must have errors of the same classes of commands.")
        some = self.promised
        classes = [each for each in some if isinstance(each, str)] if isinstance(some, tuple | list) else []
        if not classes or len(classes) != len(some) or not known.issuperset(classes):
            raise ValueError(f"promised must be some of {', '.join(sorted(known))}, not {shown(some)}.")
        require_count("samples", self.samples, 2, MOST_SAMPLES)
        require_measured("limit_error", self.limit_error)
        require_period(self.decision_period)
        if not is_whole_number(self.classes) or not isinstance(self.version, str) or not isinstance(self.machine, str):
            raise ValueError("classes must be a whole number, and version and machine must be words.")

    def __repr__(self) -> str:
        lines = [f"{error:>8} {speed:>9}  {setting}" for error, speed, setting in (HEADS, *self._fastest())]
        return "\n".join([f"<{self._title}>", *lines])

    def _repr_html_(self) -> str:
        return html_table(self._title, HEADS, self._fastest())

    @property
    def _title(self) -> str:
        own = "the chapter's robot and water" if self.scene.is_chapters else shown(self.scene)
        return f"Certificate of {own}, version {self.version}: {len(self.settings)} settings, {self.samples} swims each"

    def _fastest(self) -> list[tuple[str, str, str]]:
        """Error [%], speed [times real time] and name of the fastest setting within each of LEVELS, none twice."""
        enduring = [each for each in self.settings if each.is_energy_stable]
        within = [[each for each in enduring if each.promise(self.promised) <= level] for level in LEVELS]
        fastest = dict.fromkeys(id(max(some, key=lambda each: each.speed)) for some in within if some)
        known = {id(each): each for each in enduring}
        chosen = [known[number] for number in fastest]
        return [(f"{100.0 * each.promise(self.promised):.2g} %", f"{each.speed:,.0f} x", str(each)) for each in chosen]

    def confidence(self, share: float = 0.05) -> float:
        """Confidence that at most this share of all sequences of a class errs more than all that were measured."""
        return 1.0 - (1.0 - share) ** self.samples

    def require_version(self) -> None:
        """ValueError where the certificate has lapsed with the version of the package or of the classes of commands."""
        if self.version != __version__:
            raise ValueError(
                f"The certificate is of version {self.version} of seastar_gym, not of this one, {__version__}: certify "
                "the scene again."
            )
        if self.classes != CLASSES_VERSION:
            raise ValueError(
                f"The certificate is of version {self.classes} of the classes of commands, not of this one, "
                f"{CLASSES_VERSION}: certify the scene again."
            )

    def require_valid(self, scene: Scene) -> None:
        """ValueError where the certificate has lapsed: for another scene or version of the package."""
        self.require_version()
        if physics(scene) != physics(self.scene):
            own = "the chapter's robot in the chapter's water" if self.scene.is_chapters else "another scene"
            raise ValueError(
                f"The certificate is of {own}, which differs in more than numerics and nodes per limb: certify this "
                "one with seastar certify."
            )

    def of(self, scene: Scene) -> Setting | None:
        """The setting of a scene, None where it was not measured."""
        require_kind("scene", scene, Scene, "a Scene")
        numerics = replace(scene.numerics, max_iterations=Numerics.max_iterations)  # no error depends on the limit
        wanted = scene.robot.discretisation, scene.robot.nodes_per_limb, numerics
        known = next((each for each in self.settings if each.resolution == wanted), None)
        return known if known is not None and self.at(known) == replace(scene, numerics=numerics) else None

    def at(self, setting: Setting) -> Scene:
        """The scene at a setting."""
        return at(self.scene, setting.resolution)

    def repeated(self, classes: tuple[str, ...]) -> tuple[str, ...]:
        """Those of some classes whose commands are repeated."""
        return tuple(name for name in classes if name.startswith(REPEATED))

    def for_error(self, error: float, classes: tuple[str, ...] | None = None, robot: Seastar | None = None) -> Scene:
        """The scene at the fastest setting that promises at most `error`; ValueError for none, and if it has lapsed.

        Settings that gather energy over long swims are left out.

        error: Of the hub's path, as a fraction of its length. classes: Classes of commands, `promised` if None.
        robot: Robot that is to be the certificate's, and to keep the resolution that it names. None chooses it.
        """
        self.require_version()
        require_error(error)
        require_kind("robot", robot, Seastar | None, "a Seastar or None")
        asked = self.promised if classes is None else classes
        require_texts("classes", asked)
        if unknown := sorted(set(asked) - set(self.settings[0].errors)):
            known = ", ".join(self.settings[0].errors)
            raise ValueError(f"Classes of commands are {known}, not {', '.join(map(str, unknown))}.")
        enduring = [each for each in self._of_resolution(robot) if each.is_energy_stable]
        if not enduring:
            raise ValueError("Every measured setting of this scene gathers energy over long swims.")
        for setting in sorted(enduring, key=lambda each: -each.speed):
            if setting.promise(asked) <= error:
                return self.at(setting)
        best = min(enduring, key=lambda each: each.promise(asked))
        raise ValueError(
            f"No measured setting keeps the path error below {100 * error:g} %: the best, {best}, keeps "
            f"{100 * best.promise(asked):g} %, so ask for {best.promise(asked):g} or more."
        )

    def _of_resolution(self, robot: Seastar | None) -> tuple[Setting, ...]:
        """Settings with the resolution that a robot names; ValueError for another robot, and if there are none."""
        if robot is None:
            return self.settings
        self.require_valid(replace(self.scene, robot=robot))
        discretisation, nodes = robot.named_resolution
        alike = [each for each in self.settings if discretisation in (None, each.discretisation)]
        found = tuple(each for each in alike if nodes in (None, each.nodes_per_limb))
        if not found or robot.hub_hinge != "opening":
            measured = ", ".join(str(n) for n in sorted({each.nodes_per_limb for each in alike}))
            raise ValueError(
                f"Errors were measured with {measured or 'no'} nodes per limb for "
                f'discretisation={shown(robot.discretisation)} and hub_hinge="opening", not with {shown(nodes)}.'
            )
        return found

    def save(self, file: Path | str) -> None:
        """Write the certificate as JSON, all at once."""
        settings = map(asdict, self.settings)
        data = {
            "format": FORMAT, **{name: getattr(self, name) for name in self.__dataclass_fields__},
            "scene": self.scene.to_dict(),
            "settings": [{name: one for name, one in each.items() if is_measured(one)} for each in settings],
        }  # fmt: skip
        signed = {"digest": _digest(data), **data}
        write_atomically(file, (json.dumps(signed, indent=1) + "\n").encode())

    @classmethod
    def load(cls, file: Path | str) -> Certificate:
        """Read a certificate. ValueError for a file that is none, and for one that was changed since it was written."""
        try:
            text = Path(file).read_text(encoding="utf-8")
        except (OSError, ValueError) as unread:
            raise ValueError(f"A certificate cannot be read from {shown(str(file))}.") from unread
        try:
            return cls(**_read(json.loads(text)))
        except RecursionError as deep:
            raise ValueError(f"{file} is no certificate: it is nested too deeply.") from deep
        except (AttributeError, KeyError, TypeError, ValueError) as damaged:
            raise ValueError(f"{file} is no certificate: {str(damaged).rstrip('.')}.") from damaged


def as_certificate(certificate: Certificate | str | PathLike[str]) -> Certificate:
    """Certificate of an object or a file; ValueError for anything else."""
    if isinstance(certificate, str | PathLike):
        return Certificate.load(Path(certificate))
    if not isinstance(certificate, Certificate):
        raise ValueError(f"certificate must be a Certificate or a file of one, not {shown(certificate)}.")
    return certificate


def _read(data: dict[str, Any]) -> dict[str, Any]:
    """Arguments of a certificate from its file's content. ValueError where that was changed."""
    if data.get("format") != FORMAT:
        raise ValueError(f"its form is {shown(data.get('format'))}, not {FORMAT}: certify the scene again")
    if data.pop("digest") != _digest(data):
        raise ValueError("its content was changed since it was measured, as its digest tells: certify the scene again")
    del data["format"]
    found: dict[str, Any] = {"scene": Scene.from_dict(data.pop("scene")), "promised": tuple(data.pop("promised"))}
    return {**found, "settings": tuple(Setting(**each) for each in data.pop("settings")), **data}


def _digest(data: dict[str, Any]) -> str:
    """Digest of the content of a file, whatever the order of its entries."""
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()
