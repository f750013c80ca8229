"""A story for every test of a way. The first of its parameters are the page's; --slow runs the others, too."""

from pathlib import Path

import pytest

from ways.story import Story


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    for item in items:
        others = getattr(item, "callspec", None) and any(item.callspec.indices.values())
        if others and item.path.parent == Path(__file__).parent:
            item.add_marker(pytest.mark.slow)


@pytest.fixture
def story(tmp_path):
    folder = tmp_path / "empty folder"
    folder.mkdir()
    return Story(folder)
