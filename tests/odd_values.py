"""Values that nobody should give as an argument, each made anew: what is odd at one place may be right at another; and
which of them a call takes."""

import math
import traceback
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from seastar_gym import Contact, Limb, Numerics, Scene, Seastar, SmaPulse, Uniform, Water

LONGEST = 1000
INNER = (
    "Traceback", "object is not", "unsupported operand", "could not convert", "ufunc", "setting an array", "ambiguous",
    "inhomogeneous", "has no attribute", "unexpected keyword", "too large to convert", "not supported between",
    "invalid literal", "cannot be interpreted",
)  # fmt: skip
"""Words of libraries within, which no sentence of ours has."""
ROOT = Path(__file__).parents[1]
HUGE = 10**400
"""An integer that no float can hold."""

NUMBERS: dict[str, Callable[[], Any]] = {
    "True": lambda: True, "False": lambda: False, "np.True_": lambda: np.bool_(True), "0": lambda: 0, "1": lambda: 1,
    "-1": lambda: -1, "3": lambda: 3, "2**63": lambda: 2**63, "10**400": lambda: HUGE, "-10**400": lambda: -HUGE,
    "0.0": lambda: 0.0, "-0.0": lambda: -0.0, "0.5": lambda: 0.5, "1.5": lambda: 1.5, "-1.5": lambda: -1.5,
    "nan": lambda: math.nan, "inf": lambda: math.inf, "-inf": lambda: -math.inf, "1e308": lambda: 1e308,
    "1e200": lambda: 1e200, "1e-200": lambda: 1e-200, "1e-320": lambda: 1e-320, "5e-324": lambda: 5e-324,
    "1j": lambda: 1j, "1+2j": lambda: 1 + 2j, "complex64": lambda: np.complex64(1j), "Decimal": lambda: Decimal("0.5"),
    "Decimal(sNaN)": lambda: Decimal("sNaN"), "Fraction": lambda: Fraction(1, 3),
    "huge Fraction": lambda: Fraction(HUGE), "float32": lambda: np.float32(0.1), "int8": lambda: np.int8(1),
    "int64": lambda: np.int64(2), "uint64": lambda: np.uint64(2**64 - 1),
    "longdouble": lambda: np.longdouble("1e4000"), "timedelta": lambda: np.timedelta64(1, "s"),
    "datetime": lambda: np.datetime64("2020-01-01"),
}  # fmt: skip
THINGS: dict[str, Callable[[], Any]] = {
    "None": lambda: None, "''": lambda: "", "'abc'": lambda: "abc", "'1'": lambda: "1", "'1.0'": lambda: "1.0",
    "two lines": lambda: "two\nlines", "b'1'": lambda: b"1", "object": object, "class": lambda: float,
    "function": lambda: abs, "...": lambda: ..., "{}": dict, "{'a': 1}": lambda: {"a": 1}, "set()": set,
    "{1}": lambda: {1}, "range": lambda: range(3), "iterator": lambda: iter([1.0]),
    "generator": lambda: (x for x in "ab"), "Seastar class": lambda: Seastar, "Seastar": Seastar,
    "Seastars": lambda: Seastar(youngs_modulus=np.array([1e6, 2e6])), "Water": Water, "SmaPulse": SmaPulse,
    "Numerics": Numerics, "Scene": Scene, "Contact": Contact, "Limbs": lambda: (Limb(),) * 2,
    "Limb and None": lambda: (Limb(), None), "Uniform": lambda: Uniform(0.0, 1.0),
}  # fmt: skip
ARRAYS: dict[str, Callable[[], Any]] = {
    "()": tuple, "[]": list, "[1]": lambda: [1], "(1.0, 2.0)": lambda: (1.0, 2.0), "[1, 'a']": lambda: [1, "a"],
    "(1, None)": lambda: (1, None), "(None,)": lambda: (None,), "('a',)": lambda: ("a",),
    "ragged": lambda: [[1.0], [1.0, 2.0]], "(10**400,)": lambda: (HUGE,), "[10**400]": lambda: [HUGE],
    "((10**400,) * 3,)": lambda: ((HUGE,) * 3,), "((0, 1.0),)": lambda: ((0, 1.0),),
    "((0, nan),)": lambda: ((0, math.nan),), "((0, 1.0, nan),)": lambda: ((0, 1.0, math.nan),),
    "array([])": lambda: np.array([]), "0-d array": lambda: np.array(0.5), "array([1, 2])": lambda: np.array([1, 2]),
    "array([1, -1])": lambda: np.array([1.0, -1.0]), "array with nan": lambda: np.array([np.nan, 1.0]),
    "array([[1]])": lambda: np.array([[1.0]]), "ones(2, 2)": lambda: np.ones((2, 2)),
    "ones(3, 3, 2)": lambda: np.ones((3, 3, 2)), "array of 1e308": lambda: np.full(5, 1e308),
    "array of objects": lambda: np.array([None, 1.0], object), "array of strings": lambda: np.array(["a", "b"]),
    "array of complex": lambda: np.ones(2, complex), "records": lambda: np.zeros(2, "i,f"),
}  # fmt: skip


def masked(shape: tuple[int, ...]) -> Any:
    """Numbers of which the first is masked: what a mask hides is no value of the caller's."""
    numbers = np.ma.array(np.zeros(shape), mask=np.zeros(shape, bool))
    numbers.ravel()[:1] = np.ma.masked
    return numbers


SHAPES = (), (2,), (5,), (2, 2), (2, 5), (2, 2, 2), (1, 2), (1, 1, 2)
ODD = {**NUMBERS, **THINGS, **ARRAYS, **{f"masked {shape}": partial(masked, shape) for shape in SHAPES}}
"""All of them by name."""


TAKEN, REFUSED = "taken", "refused"


def is_our_own(refusal):
    """Whether a statement `raise` of this repository refused, rather than a library or an operation deep inside."""
    frame = traceback.extract_tb(refusal.__traceback__)[-1]
    return Path(frame.filename).is_relative_to(ROOT) and (frame.line or "").startswith("raise")


def outcome(call, arguments):
    """Whether the arguments are taken, or refused as they should be; else what was raised."""
    try:
        call(**arguments)
    except (ValueError, FileNotFoundError, gym.error.Error) as refused:
        text = str(refused)
        if isinstance(refused, OSError) and refused.errno is not None:
            return REFUSED  # commands make a sentence of it
        if not text.endswith(".") or "\n" in text or len(text) >= LONGEST or any(word in text for word in INNER):
            return f"no sentence: {text!r}"
        return REFUSED if is_our_own(refused) else f"deep inside: {text!r}"
    except OSError as refused:
        return REFUSED if refused.errno is not None else f"no sentence: {refused!r}"
    except Exception as other:  # what is no refusal is told, so that it fails its test
        return f"{type(other).__name__}: {other}"
    return TAKEN


def taken(call, arguments, functions=()):
    """Lines of the odd values that are taken in place of every argument. All others are refused in a sentence.

    functions: Arguments that are functions of the caller's: what they raise is theirs.
    """
    lines, wrong = [], []
    for parameter in arguments:
        odd = {name: make for name, make in ODD.items() if not (parameter in functions and callable(make()))}
        found = {name: outcome(call, {**arguments, parameter: make()}) for name, make in odd.items()}
        wrong += [f"{parameter}={name}: {each}" for name, each in found.items() if each not in (TAKEN, REFUSED)]
        lines.append(f"{parameter}: {', '.join(name for name, each in found.items() if each == TAKEN) or 'none'}")
    assert not wrong, "\n".join([f"{len(wrong)}", *wrong])
    return sorted(lines)
