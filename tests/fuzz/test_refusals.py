"""Whatever a simulator or an environment is given, it is taken or refused in one sentence, and loses nothing."""

import pytest

from fuzz import odd
from odd_values import ODD

CHECKS = (odd.check_odd_call, odd.SIMULATOR_CALLS), (odd.check_odd_env_call, odd.ENV_CALLS)


@pytest.mark.parametrize(
    "check, name, argument",
    [(check, name, argument) for check, calls in CHECKS for name, (_, given) in calls.items() for argument in given],
)
def test_what_has_a_state_refuses_in_one_sentence_and_loses_nothing(check, name, argument):
    odd.begin()
    for value in ODD.values():
        check(name, argument, value)
