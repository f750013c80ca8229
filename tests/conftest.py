"""Options and settings that every test shares."""

import os
import shutil
import signal
import subprocess
from pathlib import Path

import pytest
from hypothesis import settings

import core

# A shell that starts the tests in the background has them, and what they start, ignore Ctrl-C, which they are about.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Before anything imports matplotlib, here or in a subprocess: the tests have no display.
os.environ["MPLBACKEND"] = "Agg"

# Tests share the processors, and threads of torch that wait for each other take them: a training beside other work took
# seven times the processor time. Here and in subprocesses.
os.environ.setdefault("OMP_NUM_THREADS", "1")

# What the tests compile, and so their time, does not depend on the processor; test_bits.py swims on other widths.
os.environ.setdefault("SEASTAR_LANES", "4")

# A first example may wait for the compiler, and continuous integration shall fail for the change, not for the draw.
settings.register_profile("seastar", deadline=None, derandomize="CI" in os.environ)
settings.load_profile("seastar")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--slow", action="store_true", help="also run the tests marked slow")
    parser.addoption("--all", action="store_true", help="run all tests, not only the core: see core.py")
    parser.addoption("--core", action="store_true", help="run the core of the files that are named, too")
    parser.addoption("--left", action="store_true", help="with --all, after a core: only the tests that it left")
    parser.addoption("--record", action="store_true", help="write what the tests take into times.json")
    parser.addoption("--update", action="store_true", help="write what the tests make into tests/golden")
    parser.addoption("--fuzz-minutes", type=float, default=0.0, help="how long tests/fuzz tries what it draws")
    parser.addoption("--fuzz-seed", type=int, default=0, help="what that long run draws")
    parser.addoption("--fuzz-case", help="one trial of that long run, as it prints it")


def pytest_configure(config: pytest.Config) -> None:
    core.register(config)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """Processes that run the tests: one for each processor that we may use, and eight at most, for each takes 3 GB."""
    available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min(available, 8)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if config.getoption("--slow"):
        return
    for item in items:
        if item.get_closest_marker("slow"):
            item.add_marker(pytest.mark.skip(reason="slow: runs with --slow"))


@pytest.fixture
def golden(request):
    """Function (name, text) that asserts that a text is what a file of tests/golden holds; `--update` writes it."""
    folder = Path(__file__).parent / "golden" / request.path.stem.removeprefix("test_")

    def assert_as_kept(name: str, text: str) -> None:
        file = folder / name
        if request.config.getoption("--update"):
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text, encoding="utf-8")
        assert file.is_file(), f"there is no {file}: look at what --update writes"
        assert text.splitlines() == file.read_text(encoding="utf-8").splitlines()

    return assert_as_kept


@pytest.fixture(scope="module")
def few_settings():
    """Certificates are of meshes and steps that take a second."""
    from seastar_gym.accuracy import measure
    from seastar_gym.scene import Numerics

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(measure, "NODES", (5, 9))
        patch.setattr(measure, "MANY_NODES", 17)
        patch.setattr(measure, "SHORT", Numerics("implicit-midpoint", 1e-3, 1e-8))
        patch.setattr(measure, "NUMERICS", (Numerics("sdirk2", 2e-2, 1e-6), Numerics("implicit-midpoint", 2e-3, 1e-7)))
        yield


@pytest.fixture
def no_display(monkeypatch):
    """No window can be opened."""
    pytest.importorskip("pygame").display.quit()
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("SDL_VIDEODRIVER", "no-such-driver")


@pytest.fixture
def dummy_window(monkeypatch):
    """Windows are opened where nobody sees them."""
    pygame = pytest.importorskip("pygame")
    pygame.display.quit()
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    yield
    pygame.display.quit()


@pytest.fixture
def small_disk(tmp_path):
    """Function that mounts a small disk; it returns its place, and a function that makes it larger."""
    mounted = []

    def mount(size):
        place = tmp_path / f"disk_{len(mounted)}"
        place.mkdir()
        command = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(place)]
        if subprocess.run(command, capture_output=True, check=False).returncode:
            pytest.skip("mounting a disk needs root")
        mounted.append(place)
        return place, lambda: subprocess.run(["mount", "-o", "remount,size=256m", str(place)], check=True)

    yield mount
    for place in mounted:
        subprocess.run(["umount", str(place)], check=True)


@pytest.fixture(scope="session")
def open_offline():
    """Opens a file in Debian's chromium, or whichever is installed, offline: (file, width, height, ...) -> page.

    The page's `complaints` are what it said in the console, its `requests` the addresses that it asked for.
    """
    playwright = pytest.importorskip("playwright.sync_api", reason='needs playwright: pip install -e ".[browser]"')
    program = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if program is None:
        pytest.skip("no chromium is installed: apt install chromium")

    def opened(file, width=1366, height=768, **more):
        page = browser.new_context(viewport={"width": width, "height": height}, offline=True, **more).new_page()
        page.complaints, page.requests = [], []
        page.on("console", lambda message: page.complaints.append(message.text))
        page.on("pageerror", lambda error: page.complaints.append(str(error)))
        page.on("request", lambda request: page.requests.append(request.url))
        page.goto(file.as_uri())
        return page

    with playwright.sync_playwright() as running:
        browser = running.chromium.launch(executable_path=program)
        yield opened
        browser.close()
