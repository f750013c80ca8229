"""What terms cost a scene without them: `python -m seastar_gym.studies.paired`.

Each optional term is cut out of a copy of the package (`removal`), and the default scene swims in all copies in turn,
one process each. Where a process has its numbers in memory makes some per cent, so there are many processes, and each
counts with the median of its rounds. How the compiler lays out the same arithmetic makes 3 % more or less, too, which
is of a build, not of a process: the mean over all builds is nearest to what terms cost. What is exact is compared
exactly: the bits that a stroke ends with, and the floating-point instructions of every kernel (a compiler may write a
short piece of code twice, so a few may differ where nothing else is computed). `--against FOLDER` compares with the
package in another folder instead, an older checkout for one.

Numbers of each robot are no term that could be cut out, but a type of rows: `load` makes the code for either.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from seastar_gym.checks import require_count
from seastar_gym.command import run_command
from seastar_gym.der.compilation import PACKAGE
from seastar_gym.scene import Numerics
from seastar_gym.studies import paired_worker
from seastar_gym.studies.removal import copy_without, optional_terms

Floats = NDArray[np.float64]

SETTINGS = {
    "implicit Euler, 3 ms": Numerics.preset("chapter"),
    "balanced": Numerics.preset("balanced"),
}
LABELS = {"cross_drag": "drag along limbs", "relaxation_time": "material damping", "load": "dead loads"}
"""Of terms whose field in Rods has another name."""
ALL = "all of these"


class Worker:
    """A process in which a build swims.

    about: What it says of itself, see `paired_worker`.
    """

    def __init__(self, build: Path, cache: Path, settings: Sequence[Numerics]):
        self.build = build
        environment = {**os.environ, "PYTHONPATH": str(build), "NUMBA_CACHE_DIR": str(cache)}
        command = [sys.executable, "-P", paired_worker.__file__, json.dumps([asdict(each) for each in settings])]
        self.process = subprocess.Popen(
            command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )  # fmt: skip
        self.about: dict[str, Any] = {}

    def __enter__(self) -> "Worker":
        return self

    def __exit__(self, *_: object) -> None:
        self.process.communicate()

    def wait(self) -> "Worker":
        """Until it is ready to swim. ValueError: what it found is another package than the build's."""
        self.about = json.loads(self._answer())
        found = Path(self.about["package"]).resolve().parent
        if found.parent != self.build.resolve():
            raise ValueError(f"There is no package {PACKAGE.name} in {self.build}: its process found that of {found}.")
        return self

    def seconds(self, setting: int) -> float:
        """Processor time of a stroke [s]."""
        assert self.process.stdin is not None
        self.process.stdin.write(f"{setting}\n")
        self.process.stdin.flush()
        return float(self._answer())

    def _answer(self) -> str:
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        if not line:
            raise RuntimeError("A build could not swim: see what its process wrote above.")
        return line


@dataclass(frozen=True)
class Comparison:
    """This package against another build.

    name: Of the build. same_bits: Whether strokes end alike. instructions: Of its kernels' floating-point arithmetic.
    others: How many of these differ, see `differing`. ratios: Time of this package over the build's, shape (settings,
    processes).
    """

    name: str
    same_bits: bool
    instructions: int
    others: int
    ratios: Floats


Counts = dict[str, dict[str, int]]
"""Instructions by kernel and kind."""


def differing(ours: Counts, theirs: Counts) -> int:
    """Instructions that one side has and the other has not, of any kind in any kernel."""
    return sum(
        abs(ours.get(kernel, {}).get(kind, 0) - theirs.get(kernel, {}).get(kind, 0))
        for kernel in ours.keys() | theirs.keys()
        for kind in ours.get(kernel, {}).keys() | theirs.get(kernel, {}).keys()
    )


def compare(builds: dict[str, Path], folder: Path, processes: int, rounds: int) -> list[Comparison]:
    """This package against builds, all swimming in turn."""
    require_count("processes", processes, 1, 10_000)
    require_count("rounds", rounds, 1, 10_000)
    settings = list(SETTINGS.values())
    paths = [PACKAGE.parent, *builds.values()]
    caches = [folder / f"cache-{k}" for k in range(len(paths))]
    # One after the other where nothing is compiled yet: only who compiles knows the code.
    about = []
    for path, cache in zip(paths, caches, strict=True):
        with Worker(path, cache, settings) as worker:
            about.append(worker.wait().about)
    medians = np.zeros((processes, len(paths), len(settings)))
    for process in range(processes):
        with ExitStack() as stack:
            workers = [
                stack.enter_context(Worker(path, cache, settings).wait())
                for path, cache in zip(paths, caches, strict=True)
            ]
            seconds = np.zeros((rounds, len(paths), len(settings)))
            for k in range(rounds):
                for w in np.roll(np.arange(len(paths)), k)[:: 1 if k % 2 else -1]:
                    seconds[k, w] = [workers[w].seconds(setting) for setting in range(len(settings))]
            medians[process] = np.median(seconds[:, :1] / seconds, axis=0)
    found = []
    for k, name in enumerate(builds, 1):
        ours, theirs = about[0]["arithmetic"], about[k]["arithmetic"]
        instructions = sum(sum(kinds.values()) for kinds in theirs.values())
        same_bits = about[0]["bits"] == about[k]["bits"]
        found.append(Comparison(name, same_bits, instructions, differing(ours, theirs), medians[:, k].T))
    return found


def as_table(found: Sequence[Comparison]) -> Table:
    """For a terminal."""
    table = Table(title="This package against builds of it: the default scene's time here over there")
    table.add_column("build", no_wrap=True)
    for header in ("bits", "instructions", "others here", *SETTINGS):
        table.add_column(header, justify="right")
    for one in found:
        table.add_row(
            one.name,
            "same" if one.same_bits else "others",
            str(one.instructions),
            str(one.others),
            *(
                f"{np.median(own):.3f} ({np.quantile(own, 0.25):.3f} to {np.quantile(own, 0.75):.3f})"
                for own in one.ratios
            ),
        )
    if len(found) > 1:
        medians = np.median([one.ratios for one in found], axis=2)
        table.add_row("mean of all", "", "", "", *(f"{mean:.3f}" for mean in np.exp(np.log(medians).mean(axis=0))))
    return table


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--against", type=Path, help="folder with another build, in place of builds without terms")
    parser.add_argument("--processes", type=int, default=10, help="of every build")
    parser.add_argument("--rounds", type=int, default=30, help="strokes of every process and setting")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        builds = {}
        if arguments.against is not None:
            builds[str(arguments.against)] = arguments.against.resolve()
        else:
            terms = optional_terms()
            for label, cut in [(LABELS.get(term, term.replace("_", " ")), (term,)) for term in terms] + [(ALL, terms)]:
                builds[f"without {label}"] = copy_without(cut, folder / label).parent
        try:
            found = compare(builds, folder, arguments.processes, arguments.rounds)
        except (ValueError, RuntimeError) as bad_input:
            parser.error(str(bad_input))
    Console().print(as_table(found))


if __name__ == "__main__":
    run_command(main)
