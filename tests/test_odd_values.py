"""Whatever is given as an argument is accepted, or refused with a ValueError of one sentence."""

import inspect
import traceback
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

import documented
from fuzz import odd
from fuzz.sentences import INNER, LONGEST
from odd_values import ODD

ROOT = Path(__file__).parents[1]
FUNCTIONS = ("watch", "on_step", "make", "function")
"""Arguments that are functions of the caller's: what they raise is theirs."""
UNUSED = ("state", "episode_start", "deterministic", "info")
"""Arguments that are there for the form alone, at most of the calls."""
SHAPES = ((), (2,), (5,), (2, 2), (2, 5), (2, 2, 2), (1, 2), (1, 1, 2))


TOP_LEVEL = odd.PARTS | odd.SIMULATOR_CALLS | odd.ENV_CALLS
DOCUMENTED = sorted(documented.documented().keys() - documented.UNCALLED)


def calls_of(name):
    """Functions to call with odd values, and arguments that each accepts. Those of the top level have no other ones."""
    if name not in TOP_LEVEL:
        return [(call, arguments) for known, call, arguments in documented.calls() if known == name]
    call, arguments = TOP_LEVEL[name]
    others = [each for each in inspect.signature(call).parameters.values() if each.kind is not each.VAR_KEYWORD]
    return [(call, {each.name: each.default for each in others} | arguments)]


def is_our_own(refusal):
    """Whether a statement `raise` of this repository refused, rather than a library or an operation deep inside."""
    frame = traceback.extract_tb(refusal.__traceback__)[-1]
    return Path(frame.filename).is_relative_to(ROOT) and (frame.line or "").startswith("raise")


def outcome(call, arguments):
    """None where the arguments are accepted or refused as they should be, else what was raised."""
    try:
        call(**arguments)
    except (ValueError, FileNotFoundError, gym.error.Error) as refused:
        text = str(refused)
        if isinstance(refused, OSError) and refused.errno is not None:
            return None  # of which commands make a sentence
        if not text.endswith(".") or "\n" in text or len(text) >= LONGEST or any(word in text for word in INNER):
            return f"no sentence: {text!r}"
        return None if is_our_own(refused) else f"deep inside: {text!r}"
    except OSError as refused:
        return None if refused.errno is not None else f"no sentence: {refused!r}"
    except Exception as other:
        return f"{type(other).__name__}: {other}"
    return None


def wrong_outcomes(call, arguments):
    return [
        f"{parameter}={name}: {found}"
        for parameter in arguments
        for name, make in ODD.items()
        if not (parameter in FUNCTIONS and callable(make()))
        if (found := outcome(call, {**arguments, parameter: make()})) is not None
    ]


@pytest.fixture(autouse=True)
def folder_of_ones_own(tmp_path, monkeypatch):
    """Odd names of files are names of files."""
    monkeypatch.chdir(tmp_path)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", [*TOP_LEVEL, *DOCUMENTED])
def test_odd_values_are_accepted_or_refused_in_a_sentence(name):
    wrong = [each for call, arguments in calls_of(name) for each in wrong_outcomes(call, arguments)]
    assert calls_of(name) and not wrong, "\n".join([f"{len(wrong)}", *wrong])


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", [*TOP_LEVEL, *DOCUMENTED])
def test_masked_entries_are_refused(name):
    """What a mask hides is no value of the caller's."""
    assert not [each for call, arguments in calls_of(name) for each in taken_masked(call, arguments)]


def taken_masked(call, arguments):
    return [
        f"{parameter}: {shape}"
        for parameter in arguments
        if parameter not in UNUSED
        for shape in SHAPES
        if outcome_of_masked(call, {**arguments, parameter: masked(shape)})
    ]


def masked(shape):
    """Numbers of which the first is masked."""
    numbers = np.ma.array(np.zeros(shape), mask=np.zeros(shape, bool))
    numbers.ravel()[:1] = np.ma.masked
    return numbers


def outcome_of_masked(call, arguments):
    """Whether it was taken, or refused by something deep inside."""
    try:
        call(**arguments)
    except (ValueError, gym.error.Error) as refused:
        return not is_our_own(refused)
    return True


# Whatever a simulator or an environment is given, it is taken or refused in one sentence, and loses nothing.


CHECKS = (odd.check_odd_call, odd.SIMULATOR_CALLS), (odd.check_odd_env_call, odd.ENV_CALLS)


@pytest.mark.parametrize(
    "check, name, argument",
    [(check, name, argument) for check, calls in CHECKS for name, (_, given) in calls.items() for argument in given],
)
def test_what_has_a_state_refuses_in_one_sentence_and_loses_nothing(check, name, argument):
    odd.begin()
    for value in ODD.values():
        check(name, argument, value)
