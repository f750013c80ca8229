"""What an error has to be: a ValueError, or one of Gymnasium's, of one sentence."""

import gymnasium as gym

LONGEST = 1000
INNER = (
    "Traceback", "object is not", "unsupported operand", "could not convert", "ufunc", "setting an array", "ambiguous",
    "inhomogeneous", "has no attribute", "unexpected keyword", "too large to convert", "not supported between",
    "invalid literal", "cannot be interpreted",
)  # fmt: skip
"""Words of libraries within."""


def assert_one_sentence(error: BaseException, where: str = "") -> None:
    """Assert a sentence of our own, not one of a library within."""
    text = str(error)
    assert isinstance(error, ValueError | gym.error.Error), f"{where}: {type(error).__name__}: {text}"
    assert text.endswith(".") and "\n" not in text, f"{where}: no sentence: {text}"
    assert len(text) < LONGEST, f"{where}: {len(text)} letters: {text}"
    assert not any(word in text for word in INNER), f"{where}: {text}"
