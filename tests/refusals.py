"""What every refusal has to be: a ValueError whose text is one sentence."""

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
