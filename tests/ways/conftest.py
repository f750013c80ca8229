"""A story for every test of a way."""

import pytest

from ways.story import Story


@pytest.fixture
def story(tmp_path):
    folder = tmp_path / "empty folder"
    folder.mkdir()
    return Story(folder)
