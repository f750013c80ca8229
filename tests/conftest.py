"""Options and settings that every test shares."""

import os
import signal

import pytest
from hypothesis import settings

# A shell that starts the tests in the background has them, and what they start, ignore Ctrl-C, which they are about.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Before anything imports matplotlib, here or in a subprocess: the tests have no display.
os.environ["MPLBACKEND"] = "Agg"

# A first example may wait for the compiler, and continuous integration shall fail for the change, not for the draw.
settings.register_profile("seastar", deadline=None, derandomize="CI" in os.environ)
settings.load_profile("seastar")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--slow", action="store_true", help="also run the tests marked slow")
    parser.addoption("--fuzz-minutes", type=float, default=0.0, help="how long tests/fuzz tries what it draws")
    parser.addoption("--fuzz-seed", type=int, default=0, help="what that long run draws")
    parser.addoption("--fuzz-case", help="one trial of that long run, as it prints it")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if config.getoption("--slow"):
        return
    for item in items:
        if item.get_closest_marker("slow"):
            item.add_marker(pytest.mark.skip(reason="slow: runs with --slow"))
