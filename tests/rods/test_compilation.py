"""Machine code kept on disk is found again as long as nothing changed, and never once something did."""

import errno
import io
import os
import pickle
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import ModuleType

import numba
import numpy as np
import pytest

from seastar_gym import Numerics, Scene, Simulator
from seastar_gym.cli.shipped import keep
from seastar_gym.lanes import compile as compilation
from seastar_gym.lanes.compile import PACKAGE, entry_point, kernel_sources, source_digest

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")

ENERGY = """
import numpy as np
from seastar_gym import Scene, Simulator
from seastar_gym.rods.potential import energies
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

    def start(self, code: str = ENERGY, **environment: str) -> subprocess.Popen[str]:
        path = {"PYTHONPATH": str(self.folder), "PYTHONDONTWRITEBYTECODE": "1", "NUMBA_CACHE_DIR": str(self.cache)}
        env, told = {**os.environ, **path, **environment}, dict.fromkeys(("stdout", "stderr"), subprocess.PIPE)
        return subprocess.Popen([sys.executable, "-c", code], cwd=self.folder, env=env, **told, text=True)

    def run(self, code: str = ENERGY, **environment: str) -> list[float]:
        return numbers(self.start(code, **environment))

    def edit(self, file: str, old: str, new: str) -> None:
        """Replace text in a file without a change of its size or time, so that only its content tells."""
        path = self.folder / file
        text, times = path.read_text(encoding="utf-8"), path.stat()
        assert text.count(old) == 1 and len(old) == len(new)
        path.write_text(text.replace(old, new), encoding="utf-8")
        os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))


def numbers(process: subprocess.Popen[str]) -> list[float]:
    """What a process prints before it ends."""
    out, err = process.communicate()
    assert process.returncode == 0, err
    return [float(word) for word in out.split()]


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
    # stretching.py is called by potential.py, whose own file stays as it was.
    copy.edit("seastar_gym/rods/terms/stretching.py", "return 0.5 * load", "return 3.5 * load")
    assert copy.run() == [pytest.approx(7.0 * energy), 0, 1]
    copy.edit("seastar_gym/rods/terms/stretching.py", "return 3.5 * load", "return 0.5 * load")
    assert copy.run() == [energy, 1, 0]


def test_processes_that_want_the_same_code_at_once_compile_it_once(copy):
    answers = [numbers(process) for process in [copy.start() for _ in range(3)]]
    assert sorted(answer[1:] for answer in answers) == [[0, 1], [1, 0], [1, 0]]
    assert len({answer[0] for answer in answers}) == 1


KEPT = """
import time
from seastar_gym.lanes.compile import kept_code
def make():
    print("makes", flush=True)
    time.sleep({})
    return b"code"
print(kept_code("name", make))
"""


def test_a_process_that_is_killed_while_it_compiles_lets_the_others_go_on(copy):
    first = copy.start(KEPT.format(600.0))
    assert first.stdout.readline() == "makes\n"
    second = copy.start(KEPT.format(0.0))
    first.kill()
    first.communicate()
    assert second.communicate()[0].split() == ["makes", "b'code'"]


NUMBER = """
from seastar_gym.lanes.compile import entry_point


@entry_point
def number(x):
    return x + 1.5
"""


class Cached:
    """A tiny entry point outside the package, with a cache of its own; every call as if in a new process."""

    def __init__(self, folder: Path):
        self.cache, self.module = folder / "cache", ModuleType("mine")
        file = folder / "mine.py"
        file.write_text(NUMBER, encoding="utf-8")
        exec(compile(NUMBER, str(file), "exec"), self.module.__dict__)

    def call(self, x: complex = 1.0) -> tuple[complex, int, int]:
        """(result, cache hits, cache misses)."""
        number = entry_point(self.module.number.py_func)
        result = number(x)
        return result, sum(number.stats.cache_hits.values()), sum(number.stats.cache_misses.values())

    def file(self, suffix: str) -> Path:
        """The only one."""
        (found,) = self.cache.rglob(f"*{suffix}")
        return found


FOUND, COMPILED = (2.5, 1, 0), (2.5, 0, 1)


@pytest.fixture
def fresh(tmp_path, monkeypatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "cache"))
    cached = Cached(tmp_path)
    monkeypatch.setitem(sys.modules, "mine", cached.module)  # where code that is found looks for its module
    return cached


@pytest.fixture
def cached(fresh):
    assert [fresh.call(), fresh.call()] == [COMPILED, FOUND]
    return fresh


def flip(file: Path) -> None:
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 0x10
    file.write_bytes(content)


DAMAGE = {
    "empty": lambda file: file.write_bytes(b""),
    "cut off": lambda file: file.write_bytes(file.read_bytes()[: file.stat().st_size // 2]),
    "one byte short": lambda file: file.write_bytes(file.read_bytes()[:-1]),
    "one bit": flip,
    "zeros": lambda file: file.write_bytes(bytes(file.stat().st_size)),
    "garbage": lambda file: file.write_bytes(np.random.default_rng(0).bytes(5000)),
    "text": lambda file: file.write_text("No space left on device\n", encoding="utf-8"),
    "another pickle": lambda file: file.write_bytes(pickle.dumps(["something", "else"])),
    "missing": Path.unlink,
}


@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
@pytest.mark.parametrize("damage", DAMAGE.values(), ids=DAMAGE)
def test_a_damaged_file_is_compiled_anew_and_then_found_again(cached, suffix, damage):
    damage(cached.file(suffix))
    assert [cached.call(), cached.call()] == [COMPILED, FOUND]


@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
def test_a_folder_in_the_place_of_a_file_does_no_harm(cached, suffix):
    file = cached.file(suffix)
    file.unlink()
    file.mkdir()
    assert cached.call() == COMPILED


def test_code_in_the_file_of_another_signature_never_runs(cached):
    """As where an index was lost, and made anew with the same file for another signature."""
    of_floats = cached.file(".nbc").read_bytes()
    cached.file(".nbi").unlink()
    assert cached.call(3) == (4.5, 0, 1)
    cached.file(".nbc").write_bytes(of_floats)
    assert cached.call(3) == (4.5, 0, 1)


class FullDisk(io.FileIO):
    """Takes a hundred bytes."""

    def write(self, data):
        super().write(bytes(data)[:100])
        raise OSError(errno.ENOSPC, "No space left on device")


def full(file: Path, mode: str) -> io.IOBase:
    return FullDisk(file, mode) if mode == "xb" else open(file, mode)


def test_on_a_full_disk_kernels_are_compiled_and_what_is_there_is_found(fresh, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(compilation, "open", lambda file, mode, **_: full(file, mode), raising=False)
        assert [fresh.call(), fresh.call()] == [COMPILED, COMPILED]
        assert not [file for file in fresh.cache.rglob("*") if file.is_file() and file.suffix != ".lock"]
    assert fresh.call() == COMPILED
    monkeypatch.setattr(compilation, "open", lambda file, mode, **_: full(file, mode), raising=False)
    assert fresh.call() == FOUND
    assert fresh.call(3) == (4.5, 0, 1)


@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
def test_files_that_may_not_be_read_or_written_do_no_harm(cached, monkeypatch, suffix):
    """A folder that has become read-only, or another user's; to root nothing is, so it is only said to be."""

    def forbidden(file: Path, mode: str, **_):
        if str(file).endswith(suffix) or mode == "xb":
            raise PermissionError(errno.EACCES, "Permission denied")
        return open(file, mode)

    monkeypatch.setattr(compilation, "open", forbidden, raising=False)
    assert [cached.call(), cached.call()] == [COMPILED, COMPILED]


def test_a_folder_that_is_lost_within_a_process_does_no_harm(fresh):
    number = entry_point(fresh.module.number.py_func)
    shutil.rmtree(fresh.cache)
    fresh.cache.write_text("a file where the folder was", encoding="utf-8")
    assert number(1.0) == 2.5


# What others may have written is not run


def let_everyone_write(place: Path, patch: pytest.MonkeyPatch) -> None:
    place.chmod(0o757)


def let_the_group_write(place: Path, patch: pytest.MonkeyPatch) -> None:
    place.chmod(0o775)


def give_away(place: Path, patch: pytest.MonkeyPatch) -> None:
    if os.geteuid() == 0:
        os.chown(place, 12345, -1)
    else:
        patch.setattr(os, "geteuid", lambda: 12345)


SPOIL = [let_everyone_write, let_the_group_write, give_away]


@pytest.fixture
def told(caplog):
    """Sentences that this process says from now on, as if it began."""
    for say in (compilation._say_that_it_compiles, compilation._say_that_some_are_foreign):
        say.cache_clear()
    caplog.clear()
    return lambda: [record.getMessage() for record in caplog.records]


posix = pytest.mark.skipif(os.name == "nt", reason="Windows has no such bits")


@posix
@pytest.mark.parametrize("spoil", SPOIL)
@pytest.mark.parametrize("above", [0, 1, 2])
def test_code_from_a_folder_that_others_can_write_or_exchange_never_runs(cached, told, monkeypatch, spoil, above):
    """Nor is any written there: both kinds of code are compiled in memory, and one sentence says why."""
    assert compilation.kept_code("name", lambda: b"code") == b"code"
    folder = cached.file(".nbc").parent
    place, before = (folder, *folder.parents)[above], {file: file.stat().st_mtime_ns for file in folder.iterdir()}
    assert len(told()) == 1
    spoil(place, monkeypatch)
    assert [cached.call(), cached.call(3)] == [COMPILED, (4.5, 0, 1)]
    assert compilation.kept_code("name", lambda: b"other") == b"other"
    assert {file: file.stat().st_mtime_ns for file in folder.iterdir()} == before
    (sentence,) = told()[1:]
    assert "NUMBA_CACHE_DIR" in sentence and str(place) in sentence


@posix
@pytest.mark.parametrize("spoil", SPOIL)
def test_a_file_of_others_in_an_own_folder_never_runs_and_is_written_anew(cached, told, spoil):
    with pytest.MonkeyPatch.context() as patch:
        spoil(cached.file(".nbc"), patch)
        assert cached.call() == COMPILED
    assert len(told()) >= 1
    assert cached.call() == FOUND


@posix
def test_own_folders_keep_code_below_a_sticky_one_by_a_link_and_whatever_the_umask(fresh, tmp_path, monkeypatch):
    (tmp_path / "tmp").mkdir()
    (tmp_path / "tmp").chmod(0o1777)
    (tmp_path / "link").symlink_to(tmp_path / "tmp" / "far" / "cache")
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "link"))
    umask = os.umask(0)
    try:
        assert [fresh.call(), fresh.call()] == [COMPILED, FOUND]
    finally:
        os.umask(umask)


# Code that came with the package


@pytest.fixture
def shipped(fresh, tmp_path, monkeypatch):
    """A cache in which nothing is yet, and a package that has code for floats and for integers."""
    monkeypatch.setattr(compilation, "SHIPPED", tmp_path / "compiled")
    monkeypatch.setattr(compilation, "levels_of", lambda codegen: [(codegen.magic_tuple()[0], "x86-64-v3")])
    (compilation.SHIPPED / compilation.shipped_digest()).mkdir(parents=True)
    for x in (1.0, 3):
        keep("x86-64-v3", entry_point(fresh.module.number.py_func), x)
    return fresh


def of_package(suffix: str) -> Path:
    """A file of the code for floats that came with the package."""
    return next(file for file in sorted(compilation.SHIPPED.rglob(f"*{suffix}")))


def test_code_that_came_with_the_package_runs_without_a_trace(shipped, told):
    before = {*shipped.cache.rglob("*")}
    assert [shipped.call(), shipped.call(), shipped.call(3)] == [FOUND, FOUND, (4.5, 1, 0)]
    assert not told() and {*shipped.cache.rglob("*")} == before


def test_code_that_came_with_the_package_runs_where_no_folder_can_be_written(shipped, told, monkeypatch):
    shutil.rmtree(shipped.cache)
    shipped.cache.write_text("a file where the folder was", encoding="utf-8")
    for home in ("HOME", "XDG_CACHE_HOME"):
        monkeypatch.setenv(home, str(shipped.cache))
    assert [shipped.call(), shipped.call(1j)] == [FOUND, (2.5 - 1.0 + 1j, 0, 1)]
    (sentence,) = told()  # of the second
    assert "set NUMBA_CACHE_DIR" in sentence


@pytest.mark.parametrize("suffix", [".nbi", ".1.nbc"])
@pytest.mark.parametrize("damage", DAMAGE.values(), ids=DAMAGE)
def test_a_damaged_file_of_the_package_is_as_none(shipped, told, suffix, damage):
    damage(of_package(suffix))
    assert [shipped.call(), shipped.call()] == [COMPILED, FOUND]
    (sentence,) = told()
    assert "compiles" in sentence


def edit(shipped, patch):
    file = Path(shipped.module.number.py_func.__code__.co_filename)
    file.write_text(file.read_text(encoding="utf-8") + "\n# edited\n", encoding="utf-8")


UNFIT = {
    "an edited source": edit,
    "edited sources, or another numba": lambda _, patch: patch.setattr(compilation, "shipped_digest", lambda: "other"),
    "another level": lambda _, patch: patch.setattr(compilation, "levels_of", lambda _: [("x86_64-any", "x86-64-v4")]),
    "no level": lambda _, patch: patch.setattr(compilation, "levels_of", lambda _: []),
    "code for integers in its place": lambda *_: shutil.copy(of_package(".2.nbc"), of_package(".1.nbc")),
}


@pytest.mark.parametrize("spoil", UNFIT.values(), ids=UNFIT)
def test_code_of_the_package_that_does_not_fit_never_runs(shipped, monkeypatch, spoil):
    spoil(shipped, monkeypatch)
    assert [shipped.call(), shipped.call()] == [COMPILED, FOUND]


# The digest


def test_digest_covers_every_file_that_defines_kernels():
    sources = kernel_sources()
    assert set(sources) >= {*(PACKAGE / "rods").glob("*.py"), PACKAGE / "envs" / "observation.py"}
    texts = {path: path.read_text() for path in PACKAGE.rglob("*.py")}
    assert {path for path, text in texts.items() if "@kernel" in text or "@entry_point" in text} <= set(sources)


@pytest.mark.parametrize("change", ["content", "name", "new file", "numba", "numpy", "lanes"])
def test_digest_changes_with_whatever_machine_code_depends_on(tmp_path, monkeypatch, change):
    folder = tmp_path / "rods"
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
