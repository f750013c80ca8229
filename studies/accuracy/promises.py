"""Do promised errors hold on sequences of commands that no table was made with?

The chapter's robot and six others are certified (`seastar_gym.certify`), each for 60 sequences of every class of
commands. Then each swims fresh sequences of every class, drawn from another seed, at a few of its certified settings,
and those are counted whose error exceeds the certified error of their class. The chapter's robot swims them at its
fidelities, too, where they are held against the table that comes with the package.

The largest of 60 sequences bounds at least 95 % of a class with 95 % confidence. So a share of exceedances above 5 %
may be found in 5 % of all classes, robots and settings together; more would break the promise.

The error is the hub's largest distance from its path with 37 nodes per limb and the implicit midpoint rule at 0.25 ms,
over the length of that path. Sequences whose error, against steps of 1 ms instead, is below half of every bound are not
swum with the short steps. Results are written after every robot, and a robot whose result is in the file is not swum
again.
"""

import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, get_args

import numpy as np

from seastar_gym.accuracy import Certificate, chapters_certificate, measure
from seastar_gym.accuracy.certificate import CLASSES_VERSION
from seastar_gym.accuracy.command import progress_bar
from seastar_gym.accuracy.commands import CLASSES, draw_classes
from seastar_gym.accuracy.setting import resolved
from seastar_gym.scene import Numerics, Scene
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.version import __version__
from studies.accuracy.error_bars import ROBOTS
from studies.frame import Floats, Results, Study
from studies.pages import markdown

CERTIFIED = measure.SAMPLES
"""Sequences per class of a certificate."""
SAMPLES, SEED = 1000, 2_026
"""Fresh sequences per class, and their seed; certificates are made with seed 0."""
SCREEN = Numerics("implicit-midpoint", 1e-3, 1e-7)
CLOSE = 0.5
"""Sequences are swum with short steps if their error against `SCREEN` is above this share of a bound."""
SHARE = 0.05
"""Share of a class that may exceed its promised error."""
COLUMNS = ("robot", "sequences that exceed", "the most in a class at a setting", "classes and settings above 5 %")
PRESETS: tuple[Fidelity, ...] = tuple(name for name in get_args(Fidelity) if name not in ("reference", "chapter"))
"""Fidelities that are held against the package's table: a dearer one has the limit's own error."""


class Check(NamedTuple):
    """A scene, and its promised error by class of commands."""

    name: str
    scene: Scene
    errors: dict[str, float]

    def bounds(self, samples: int) -> Floats:
        """Promised errors of so many sequences of every class, shape (len(CLASSES) samples,)."""
        return np.repeat([self.errors[name] for name in CLASSES], samples)


def certified_checks(certificate: Certificate) -> list[Check]:
    """Checks of one setting for each number of nodes: longer steps for fewer nodes, as a user would choose them."""
    by_nodes: dict[int, list[Any]] = {}
    for each in sorted(certificate.settings, key=lambda each: -each.step):
        by_nodes.setdefault(each.nodes_per_limb, []).append(each)
    chosen = [some[min(k, len(some) - 1)] for k, (_, some) in enumerate(sorted(by_nodes.items()))]
    return [Check(str(each), certificate.at(each), dict(each.errors)) for each in chosen]


def table_checks() -> list[Check]:
    """Checks of fidelities of the chapter's robot: of random commands, of gaits, and of small ones, by the table."""
    checks = []
    for name in PRESETS:
        scene = Scene.preset(name)
        known = chapters_certificate().of(scene)
        assert known is not None
        path = dict.fromkeys(("random ternary", "random continuous"), known.errors["random"])
        gaits = dict.fromkeys((each for each in CLASSES if each not in path), known.error(("random", "repeated")))
        checks.append(Check(name, scene, gaits | path | {"small": known.errors["small"]}))
    return checks


def whole_errors(scene: Scene, swum: Sequence[measure.Swims], limit: measure.Swims) -> Floats:
    """Largest distances of hubs from those of the limit, as fractions of the limit's path, shape (len(swum), n)."""
    lengths = measure.path_lengths(scene, limit.hub)
    return np.array([measure.errors(each, limit, lengths).path for each in swum])


def exceedances(scene: Scene, checks: Sequence[Check], samples: int, seed: int) -> dict[str, dict[str, int]]:
    """Number of fresh sequences, by check and class, whose error exceeds the promised one."""
    drawn, nodes = draw_classes(samples, scene.robot.n_limbs, seed), measure.MANY_NODES
    screen, *swum = measure.swim_all([resolved(scene, nodes, SCREEN), *(each.scene for each in checks)], drawn)
    bounds = np.array([each.bounds(samples) for each in checks])
    errors = whole_errors(scene, swum, screen)
    near = (errors > CLOSE * bounds).any(axis=0)
    if near.any():
        (limit,) = measure.swim_all([resolved(scene, nodes, measure.SHORT)], drawn[:, near])
        few = [measure.Swims(*(array[:, near] for array in each)) for each in swum]
        errors[:, near] = whole_errors(scene, few, limit)
    beyond = (errors > bounds).reshape(len(checks), len(CLASSES), samples).sum(axis=2)
    return {
        check.name: dict(zip(CLASSES, row.tolist(), strict=True)) for check, row in zip(checks, beyond, strict=True)
    }


def kept_certificate(file: Path, scene: Scene, samples: int) -> Certificate:
    """Certificate of a scene: that of a file if it holds, or a new one, which is kept there. samples: Per class."""
    if file.is_file():
        certificate = Certificate.load(file)
        certificate.require_valid(scene)
        return certificate
    with progress_bar(file.stem) as progress:
        certificate = measure.certify(scene, samples, progress=progress)
    file.parent.mkdir(parents=True, exist_ok=True)
    certificate.save(file)
    return certificate


def examine(name: str, folder: Path, samples: int) -> dict[str, Any]:
    """Result of a robot; its certificate is read from the folder, or measured and written there."""
    scene, begin = ROBOTS[name], time.perf_counter()
    file = folder / f"{''.join(c if c.isalnum() else '_' for c in name)}.json"
    certificate = kept_certificate(file, scene, CERTIFIED)
    checks = certified_checks(certificate) + (table_checks() if scene.is_chapters else [])
    found = exceedances(scene, checks, samples, SEED)
    return {
        "certified": certificate.samples, "seconds": round(time.perf_counter() - begin),
        "promised": {each.name: each.errors for each in checks}, "exceeded": found,
    }  # fmt: skip


def table(results: dict[str, Any]) -> str:
    """Table of the results in Markdown, without the class and the setting that exceed most."""
    chosen = (0, 1, 3)
    return markdown([COLUMNS[k] for k in chosen], [[row[k] for k in chosen] for row in rows_of(results)])


def summary(results: dict[str, Any]) -> str:
    """Table and sentence of the results in Markdown."""
    certified = [_shares(results, found)[""].values() for found in results["robots"].values()]
    broken = [share > SHARE for shares in certified for share in shares]
    return (
        f"{markdown(COLUMNS, rows_of(results), (0, 2))}\n\n"
        f"{results['samples']} fresh sequences per class; certificates of {len(certified)} robots: {sum(broken)} of "
        f"{len(broken)} classes and settings exceed in more than 5 % of sequences, where {SHARE * len(broken):.0f} may."
    )


def rows_of(results: dict[str, Any]) -> list[list[str]]:
    """Rows of COLUMNS: one for every certificate, and one for the package's table."""
    rows = []
    for name, found in results["robots"].items():
        for kind, shares in _shares(results, found).items():
            (setting, of), most = max(shares.items(), key=lambda item: item[1])
            rows.append([
                f"{name}{kind}", f"{100 * np.mean(list(shares.values())):.2f} %",
                f"{100 * most:.1f} %: {of}, {setting}" if most else "none",
                f"{sum(share > SHARE for share in shares.values())} of {len(shares)}",
            ])  # fmt: skip
    return rows


def _shares(results: dict[str, Any], found: dict[str, Any]) -> dict[str, dict[tuple[str, str], float]]:
    """Shares that exceed, by setting and class: of the certificate, and of the package's table where it was held."""
    kinds: dict[str, dict[tuple[str, str], float]] = {}
    for check, row in found["exceeded"].items():
        of = kinds.setdefault(", the package's table" if check in PRESETS else "", {})
        of.update({(check, name): count / results["samples"] for name, count in row.items()})
    return kinds


def run(
    results: Results,
    samples: int = SAMPLES,
    robots: Sequence[str] = tuple(ROBOTS),
    certificates: Path = Path("runs/certificates"),
) -> None:
    """Examine the robots that are missing. ValueError where the file is of other sequences or another version.

    samples: Fresh sequences per class. certificates: Folder where they are kept.
    """
    wanted = {"samples": samples, "seed": SEED, "classes": CLASSES_VERSION, "version": __version__}
    results.read()
    if results and {key: results.get(key) for key in wanted} != wanted:
        raise ValueError(f"{results.file} has results of other sequences or another version: give another --out.")
    results.update(wanted)
    cells = {("robots", name): partial(examine, name, certificates, samples) for name in robots}
    results.fill(cells, lambda found: f"{found['seconds']} s")
    print(summary(results))


STUDY = Study("accuracy.promises", run, file="accuracy/promises.json", tables={"promises": table})
