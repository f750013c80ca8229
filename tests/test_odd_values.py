"""Whatever is given as an argument is taken, as a file says, or refused with a ValueError of one sentence."""

import inspect

import numpy as np
import pytest

import documented
from fuzz import odd
from odd_values import ODD, REFUSED, outcome, taken

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


@pytest.fixture(autouse=True)
def folder_of_ones_own(tmp_path, monkeypatch):
    """Odd names of files are names of files."""
    monkeypatch.chdir(tmp_path)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", [*TOP_LEVEL, *DOCUMENTED])
def test_odd_values_are_taken_as_before_or_refused_in_a_sentence(name, golden):
    found = [line for call, arguments in calls_of(name) for line in taken(call, arguments, FUNCTIONS)]
    assert found
    golden(f"{name}.txt", "\n".join(found))


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
        if outcome(call, {**arguments, parameter: masked(shape)}) is not REFUSED
    ]


def masked(shape):
    """Numbers of which the first is masked."""
    numbers = np.ma.array(np.zeros(shape), mask=np.zeros(shape, bool))
    numbers.ravel()[:1] = np.ma.masked
    return numbers


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
