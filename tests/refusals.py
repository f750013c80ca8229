"""What every refusal has to be: a ValueError whose text is one sentence, and one sentence on the command line."""

from contextlib import contextmanager

import pytest


@contextmanager
def assert_refused(*words: str):
    """Assert a ValueError whose text is one sentence with these words in it."""
    with pytest.raises(ValueError, match=r"\.$") as caught:
        yield
    text = str(caught.value)
    assert "\n" not in text and len(text) < 300, text
    for word in words:
        assert word in text, text


def assert_told(capsys: pytest.CaptureFixture[str], *words: str) -> None:
    """Assert that one sentence with these words in it was written as an error, on one line."""
    told = capsys.readouterr().err
    assert told.count("\n") == 1 and told.endswith(".\n"), told
    for word in words:
        assert word in told, told
