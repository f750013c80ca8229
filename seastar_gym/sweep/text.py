"""Axes as text, NAME=VALUES, see command.py."""

from pathlib import Path
from typing import Any

from seastar_gym.files import read_json
from seastar_gym.scene.checks import shown
from seastar_gym.scene.serial import KINDS, from_dict
from seastar_gym.sweep.axes import PARTS, Axis, Choices, Range


def axis_of(text: str) -> Axis:
    """Axis of a text such as "robot.limb_length=0.05:0.15"."""
    name, equals, values = text.partition("=")
    if not equals or not name or not values:
        raise ValueError(f"An axis is written NAME=VALUES, such as robot.n_limbs=3,4,5, not {shown(text)}.")
    if name == "gait":
        return Choices(name, tuple(values.split("/")))
    if name == "controller":
        return Choices(name, tuple(values.split(",")))
    if ":" in values and not values.startswith("@"):
        return _spaced(name, values.split(":"))
    tokens = values.split(",")
    return Choices(name, tuple(_value(name, token) for token in tokens), tuple(map(_label, tokens)))


def _spaced(name: str, words: list[str]) -> Axis:
    """Axis from low to high, of a number of values or of all in between."""
    is_log = words[-1] == "log"
    words = words[: len(words) - is_log]
    numbers = [_number(word) for word in words]
    if not 2 <= len(numbers) <= 3 or any(isinstance(number, str) for number in numbers):
        raise ValueError(
            f"{name} is written LOW:HIGH, LOW:HIGH:COUNT or either with :log, not {shown(':'.join(words))}."
        )
    low, high, *count = numbers
    axis = Range(name, float(low), float(high), is_log)
    if not count:
        return axis
    if not isinstance(count[0], int) or not 2 <= count[0] <= 1_000_000:
        raise ValueError(f"{name} needs a count from 2 to 1000000 as its third number, not {shown(count[0])}.")
    return axis.spaced(count[0])


def _number(word: str) -> Any:
    """A whole number, a number, or the word itself."""
    for kind in (int, float):
        try:
            return kind(word)
        except ValueError:
            pass
    return word


def _value(name: str, word: str) -> Any:
    if word.startswith("@"):
        return _part_of_file(Path(word[1:]))
    if name in PARTS:
        if word == "None":
            return None
        if word not in KINDS:
            raise ValueError(f"{name} is a class of seastar_gym such as SmaPulse, or @FILE.json, not {shown(word)}.")
        return KINDS[word]()
    return None if word == "None" else _number(word)


def _label(word: str) -> Any:
    return Path(word[1:]).stem if word.startswith("@") else _number(word)


def _part_of_file(file: Path) -> Any:
    return from_dict(read_json(file), object)
