"""Whatever is given, it is taken or refused in one sentence, and a refusal loses nothing."""

import pytest

from fuzz import odd
from odd_values import ODD
from seastar_gym import State


@pytest.mark.parametrize(
    "name, argument", [(name, argument) for name, (_, given) in odd.PARTS.items() for argument in given]
)
def test_a_part_is_made_or_refused_in_one_sentence(name, argument, subtests):
    for label, value in ODD.items():
        with subtests.test(label):
            odd.check_odd_part(name, argument, value)


@pytest.mark.parametrize(
    "name, argument", [(name, argument) for name, (_, given) in odd.SIMULATOR_CALLS.items() for argument in given]
)
def test_a_simulator_refuses_in_one_sentence_and_loses_nothing(name, argument, subtests):
    for label, value in ODD.items():
        with subtests.test(label):
            odd.check_odd_call(name, argument, value)


@pytest.mark.parametrize("field", State._fields)
def test_a_state_is_set_or_refused_in_one_sentence(field, subtests):
    for label, value in ODD.items():
        with subtests.test(label):
            odd.check_odd_state(field, value)


@pytest.mark.parametrize(
    "name, argument", [(name, argument) for name, (_, given) in odd.ENV_CALLS.items() for argument in given]
)
def test_an_environment_refuses_in_one_sentence_and_goes_on(name, argument, subtests):
    for label, value in ODD.items():
        with subtests.test(label):
            odd.check_odd_env_call(name, argument, value)
