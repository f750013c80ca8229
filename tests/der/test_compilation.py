"""Machine code kept on disk is found again as long as nothing changed, and never once something did."""

import os
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path

import numba
import numpy as np
import pytest

from seastar_gym import Numerics, Scene, Simulator
from seastar_gym.der import compilation
from seastar_gym.der.compilation import PACKAGE, kernel_sources, source_digest

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")

ENERGY = """
import numpy as np
from seastar_gym import Scene, Simulator
from seastar_gym.der.energy import energies
simulator = Simulator(Scene())
q = 1.1 * simulator.positions
simulator.set_state((q, 0.0 * q, np.zeros(1)))
energy = simulator.elastic_energy()[0]
stats = energies.stats
print(energy, sum(stats.cache_hits.values()), sum(stats.cache_misses.values()))
"""


class Copy:
    """A copy of the package with a cache of its own, to be edited and run in fresh processes."""

    def __init__(self, folder: Path):
        self.folder, self.cache = folder / "copy", folder / "cache"
        shutil.copytree(PACKAGE, self.folder / "seastar_gym", ignore=shutil.ignore_patterns("__pycache__"))

    def run(self, code: str = ENERGY, **environment: str) -> list[float]:
        path = {"PYTHONPATH": str(self.folder), "PYTHONDONTWRITEBYTECODE": "1", "NUMBA_CACHE_DIR": str(self.cache)}
        answer = subprocess.run(
            [sys.executable, "-c", code],
            cwd=self.folder, env={**os.environ, **path, **environment}, capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert answer.returncode == 0, answer.stderr
        return [float(word) for word in answer.stdout.split()]

    def edit(self, file: str, old: str, new: str) -> None:
        """Replace text in a file without a change of its size or time, so that only its content tells."""
        path = self.folder / file
        text, times = path.read_text(encoding="utf-8"), path.stat()
        assert text.count(old) == 1 and len(old) == len(new)
        path.write_text(text.replace(old, new), encoding="utf-8")
        os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))


@pytest.fixture
def copy(tmp_path):
    return Copy(tmp_path)


STRETCHED = 5 * 0.5 * 1e6 * 3.141592653589793 * 1.6e-3**2 * 0.1**2 * 0.1
"""Energy [J] of five limbs stretched by a tenth (13.2)."""


def test_an_edited_kernel_never_runs_from_the_cache_and_an_unchanged_one_always_does(copy):
    energy, hits, misses = copy.run()
    assert energy == pytest.approx(STRETCHED, rel=1e-9)
    assert (hits, misses) == (0, 1)
    assert copy.run() == [energy, 1, 0]
    # stretching.py is called by energy.py, whose own file stays as it was.
    copy.edit("seastar_gym/der/stretching.py", "return 0.5 * load", "return 3.5 * load")
    assert copy.run() == [pytest.approx(7.0 * energy), 0, 1]
    copy.edit("seastar_gym/der/stretching.py", "return 3.5 * load", "return 0.5 * load")
    assert copy.run() == [energy, 1, 0]


def test_code_of_another_lane_width_is_another_code(copy):
    results = [copy.run(SEASTAR_LANES=width) for width in ("2", "4")]
    assert [misses for _, _, misses in results] == [1, 1]
    assert len({energy for energy, _, _ in results}) == 1


def test_without_a_folder_to_write_to_the_kernels_are_compiled_anew(copy):
    copy.cache.write_text("a file where the folder should be")
    home = copy.folder / "home"
    home.write_text("and another one")
    assert copy.run(HOME=str(home), XDG_CACHE_HOME=str(home))[0] == pytest.approx(STRETCHED, rel=1e-9)


def test_an_edited_entry_point_outside_the_package_does_not_run_from_the_cache_either(copy):
    module = copy.folder / "mine.py"
    body = "from seastar_gym.der.compilation import entry_point\n\n\n@entry_point\ndef number():\n    return {}\n"
    module.write_text(body.format(1.5), encoding="utf-8")
    assert copy.run("import mine; print(mine.number())") == [1.5]
    module.write_text(body.format(2.5), encoding="utf-8")
    assert copy.run("import mine; print(mine.number())") == [2.5]


def test_digest_covers_every_file_that_defines_kernels():
    sources = kernel_sources()
    assert set(sources) >= set((PACKAGE / "der").glob("*.py"))
    defining = {
        path for path in PACKAGE.rglob("*.py") if "@kernel" in path.read_text() or "@entry_point" in path.read_text()
    }
    assert PACKAGE / "envs" / "observation.py" in defining
    assert defining <= set(sources)


@pytest.mark.parametrize("change", ["content", "name", "new file", "numba", "numpy", "lanes"])
def test_digest_changes_with_whatever_machine_code_depends_on(tmp_path, monkeypatch, change):
    folder = tmp_path / "der"
    folder.mkdir()
    (folder / "drag.py").write_text("C_d = 1.0\n")
    before = source_digest(tmp_path)
    assert source_digest(tmp_path) == before
    match change:
        case "content":
            (folder / "drag.py").write_text("C_d = 1.1\n")
        case "name":
            (folder / "drag.py").rename(folder / "lift.py")
        case "new file":
            (folder / "lift.py").write_text("")
        case "lanes":
            monkeypatch.setattr(compilation, "N_LANES", 1)
        case package:
            monkeypatch.setattr(getattr(compilation, {"numpy": "np"}.get(package, package)), "__version__", "0")
    assert source_digest(tmp_path) != before


def test_a_stroke_releases_the_gil():
    Simulator(Scene()).stroke(np.zeros((1, 5)))  # the compiler does not count
    simulator = Simulator(Scene(numerics=Numerics(step=1e-5)), n_robots=8, threads=1)
    swimmer = threading.Thread(target=simulator.stroke, args=[np.ones((8, 5))])
    ticks = 0
    swimmer.start()
    while swimmer.is_alive():
        time.sleep(1e-3)
        ticks += 1
    assert simulator.time[0] == 1.0
    assert ticks > 20
