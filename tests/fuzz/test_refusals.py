"""Whatever a simulator or an environment is given, it is taken or refused in one sentence, and loses nothing."""

import pytest

from fuzz import odd
from odd_values import ODD


@pytest.mark.parametrize(
    "name, argument", [(name, argument) for name, (_, given) in odd.SIMULATOR_CALLS.items() for argument in given]
)
def test_a_simulator_refuses_in_one_sentence_and_loses_nothing(name, argument, subtests):
    for label, value in ODD.items():
        with subtests.test(label):
            odd.check_odd_call(name, argument, value)


@pytest.mark.parametrize(
    "name, argument", [(name, argument) for name, (_, given) in odd.ENV_CALLS.items() for argument in given]
)
def test_an_environment_refuses_in_one_sentence_and_goes_on(name, argument, subtests):
    for label, value in ODD.items():
        with subtests.test(label):
            odd.check_odd_env_call(name, argument, value)
