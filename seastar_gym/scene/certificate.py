"""`Certificate`: measured errors of one scene, written by `python -m seastar_gym.certify`.

A certificate is a JSON file. It lapses where the scene's physics or the version of the package differ: then it is
refused with a sentence. The file has a digest of its content, so that errors stay those of their scene.
"""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, cast

from seastar_gym.files import write_atomically
from seastar_gym.scene.certified import reads_certificates
from seastar_gym.scene.checks import is_whole_number, require_count, require_error, require_number, shown
from seastar_gym.scene.numerics import Numerics, SchemeName
from seastar_gym.scene.robot import Seastar
from seastar_gym.scene.scene import Scene
from seastar_gym.version import __version__

FORMAT = 3
"""Version of the file's form."""
CLASSES_VERSION = 1
"""Version of the classes of commands, see seastar_gym/certification/commands.py. Errors of another are of others."""
MOST_SAMPLES = 100_000
"""Most sequences of a class that can be asked for."""
LARGEST_GROWTH = 1.5
"""Growth of the kinetic energy over a long swim above which `for_error` does not choose a setting."""


@dataclass(frozen=True)
class CertifiedSetting:
    """A resolution and numerics, with the errors and the speed of one scene.

    Errors are fractions of the hub's path in the continuum, over ten strokes from rest, each the largest of all
    sequences of a class. An error is the sum of that of space and that of time, sequence by sequence. In a current, the
    path is the way through the water, and robots begin at rest in the water.

    nodes_per_limb, scheme, step [s], newton_tolerance: The setting, of the continuum's discretisation.
    errors: Sum of the errors of space and time, by class of commands, see `seastar_gym.certification.commands`.
    typical: The same, the median of all sequences of a class.
    space_error, time_error: Largest errors of all classes of full amplitude.
    speed: Simulated time over computing time, for a batch on one core.
    energy_growth: Kinetic energy late in swims of 200 strokes over that early in them, the largest of some gaits.

    A failed swim has the error inf. Anything else that is no number from 0 on is refused with a ValueError.
    """

    nodes_per_limb: int
    scheme: str
    step: float
    newton_tolerance: float
    errors: Mapping[str, float]
    typical: Mapping[str, float]
    space_error: float
    time_error: float
    speed: float
    energy_growth: float

    def __post_init__(self) -> None:
        require_count("nodes_per_limb", self.nodes_per_limb, 2, 10_000)
        require_number("speed", self.speed, "1")
        for name in ("errors", "typical"):
            _require_classes(name, getattr(self, name))
        if set(self.errors) != set(self.typical):
            raise ValueError("errors and typical must have the same classes of commands.")
        for name in ("space_error", "time_error", "energy_growth"):
            _require_error(name, getattr(self, name))
        _ = self.numerics

    @property
    def endures(self) -> bool:
        """Whether long swims gather no energy: errors of ten strokes would not show it."""
        return self.energy_growth <= LARGEST_GROWTH

    @property
    def numerics(self) -> Numerics:
        """Numerics of the setting."""
        return Numerics(cast(SchemeName, self.scheme), self.step, self.newton_tolerance)

    def error(self, classes: tuple[str, ...]) -> float:
        """Largest error over some classes."""
        return max(self.errors[name] for name in classes)

    def typical_error(self, classes: tuple[str, ...]) -> float:
        """Median error, of the class where it is largest: half of the sequences of every class have less."""
        return max(self.typical[name] for name in classes)

    def __str__(self) -> str:
        return f'"{self.scheme}" at {1e3 * self.step:g} ms with {self.nodes_per_limb} nodes per limb'


@dataclass(frozen=True)
class Certificate:
    """Errors of a handful of settings for one scene.

    scene: The scene; its nodes per limb, discretisation and numerics do not count.
    settings: Measured settings.
    promised: Classes of commands over which `for_error` promises; the others are there to be read.
    actions: Those of them that an environment's actions can make.
    samples: Sequences per class. With n of them, at most a share s of all sequences of a class errs by more than the
        largest that was measured, with the confidence 1 - (1 - s)^n.
    limit_error: Error of the swims that stand for the continuum, estimated from half as many edges; it is in all
        errors.
    classes, version, machine: Version of the classes of commands, of the package, and where speeds were measured.
    """

    scene: Scene
    settings: tuple[CertifiedSetting, ...]
    promised: tuple[str, ...]
    actions: tuple[str, ...]
    samples: int
    limit_error: float
    classes: int
    version: str
    machine: str

    def __post_init__(self) -> None:
        if not isinstance(self.scene, Scene):
            raise ValueError(f"scene must be a Scene, not {shown(self.scene)}.")
        if not self.settings or not all(isinstance(each, CertifiedSetting) for each in self.settings):
            raise ValueError(f"settings must be some CertifiedSettings, not {shown(self.settings)}.")
        known = set(self.settings[0].errors)
        if any(set(each.errors) != known for each in self.settings):
            raise ValueError("settings must have errors of the same classes of commands.")
        for name in ("promised", "actions"):
            some = getattr(self, name)
            if not some or not known.issuperset(some):
                raise ValueError(f"{name} must be some of {', '.join(sorted(known))}, not {shown(some)}.")
        require_count("samples", self.samples, 2, MOST_SAMPLES)
        _require_error("limit_error", self.limit_error)
        if not is_whole_number(self.classes) or not isinstance(self.version, str) or not isinstance(self.machine, str):
            raise ValueError("classes must be a whole number, and version and machine must be words.")

    def confidence(self, share: float = 0.05) -> float:
        """Confidence that at most this share of all sequences of a class errs by more than the error of the class."""
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
            raise ValueError(
                "The certificate is of another scene, which differs in more than numerics and nodes per limb: certify "
                "this one with python -m seastar_gym.certify."
            )

    def of(self, scene: Scene) -> CertifiedSetting | None:
        """The setting of a scene, None where it was not measured."""
        if scene.robot.discretisation != "continuum":
            return None
        wanted = scene.robot.nodes_per_limb, scene.numerics
        return next((each for each in self.settings if (each.nodes_per_limb, each.numerics) == wanted), None)

    def kept_by(self, error: float, robot: Seastar | None = None) -> Scene:
        """What `Scene.for_error` gives with this certificate; ValueError where it has lapsed.

        robot: Robot that is to be the certificate's, and to keep the nodes per limb that it names. None chooses them.
        """
        if robot is not None:
            self.require_valid(replace(self.scene, robot=robot))
        if robot is None or robot.named_resolution[1] is None:
            return self.for_error(error)
        nodes = robot.nodes_per_limb
        some = tuple(each for each in self.settings if each.nodes_per_limb == nodes)
        if robot.discretisation != "continuum" or not some:
            measured = ", ".join(str(n) for n in sorted({each.nodes_per_limb for each in self.settings}))
            raise ValueError(
                f"The certificate was measured with {measured} nodes per limb of the continuum's discretisation, not "
                f"with {nodes} of the {robot.discretisation}'s."
            )
        return replace(self, settings=some).for_error(error)

    def for_error(self, error: float, classes: tuple[str, ...] | None = None) -> Scene:
        """The scene at the fastest setting whose error is at most `error`; ValueError for none, and if it has lapsed.

        Settings that gather energy over long swims are left out.

        error: Of the hub's path, as a fraction of its length. classes: Classes of commands, `promised` if None.
        """
        self.require_version()
        require_error(error)
        asked = self.promised if classes is None else classes
        if unknown := sorted(set(asked) - set(self.settings[0].errors)):
            known = ", ".join(self.settings[0].errors)
            raise ValueError(f"Classes of commands are {known}, not {', '.join(map(str, unknown))}.")
        enduring = [each for each in self.settings if each.endures]
        if not enduring:
            raise ValueError("Every measured setting of this scene gathers energy over long swims.")
        for setting in sorted(enduring, key=lambda each: -each.speed):
            if setting.error(asked) <= error:
                return self.at(setting)
        best = min(enduring, key=lambda each: each.error(asked))
        raise ValueError(
            f"No measured setting keeps the path error of this scene below {100 * error:g} %: the best, {best}, keeps "
            f"{100 * best.error(asked):.2g} %."
        )

    def at(self, setting: CertifiedSetting) -> Scene:
        """The scene at a setting."""
        return resolved(self.scene, setting.nodes_per_limb, setting.numerics)

    def save(self, file: Path | str) -> None:
        """Write the certificate as JSON, all at once."""
        data = {
            "format": FORMAT, **{name: getattr(self, name) for name in self.__dataclass_fields__},
            "scene": self.scene.to_dict(), "settings": [asdict(each) for each in self.settings],
        }  # fmt: skip
        signed = {"digest": _digest(data), **data}
        write_atomically(file, (json.dumps(signed, indent=1) + "\n").encode())

    @classmethod
    def load(cls, file: Path | str) -> "Certificate":
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


reads_certificates(Certificate.load)


def _read(data: dict[str, Any]) -> dict[str, Any]:
    """Arguments of a certificate from its file's content. ValueError where that was changed."""
    if data.get("format") != FORMAT:
        raise ValueError(f"its form is {shown(data.get('format'))}, not {FORMAT}: certify the scene again")
    if data.pop("digest") != _digest(data):
        raise ValueError("its content was changed since it was measured, as its digest tells: certify the scene again")
    del data["format"]
    found: dict[str, Any] = {"scene": Scene.from_dict(data.pop("scene"))}
    found |= {name: tuple(data.pop(name)) for name in ("promised", "actions")}
    return {**found, "settings": tuple(CertifiedSetting(**each) for each in data.pop("settings")), **data}


def _digest(data: dict[str, Any]) -> str:
    """Digest of the content of a file, whatever the order of its entries."""
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()


def _require_classes(name: str, errors: object) -> None:
    """Refuse what is no error by class of commands."""
    if not isinstance(errors, Mapping) or not errors:
        raise ValueError(f"{name} must be numbers by class of commands, not {shown(errors)}.")
    for each in errors.values():
        _require_error(name, each)


def _require_error(name: str, error: float) -> None:
    """Refuse what is no measured error: a number from 0 on, or inf for a swim that failed."""
    if error != math.inf:
        require_number(name, error, "1", zero_allowed=True)


def resolved(scene: Scene, nodes_per_limb: int, numerics: Numerics) -> Scene:
    """The scene with a resolution of the continuum's discretisation and numerics."""
    robot = replace(scene.robot, nodes_per_limb=nodes_per_limb, discretisation="continuum", hub_hinge="opening")
    return replace(scene, robot=robot, numerics=numerics)


def physics(scene: Scene) -> Scene:
    """The scene with one resolution and numerics for all: what a certificate is about."""
    return resolved(scene, 10, Numerics())
