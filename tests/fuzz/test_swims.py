"""The chapter's robot: presets keep their promises, and environments in a batch are what they are alone."""

import pytest
from hypothesis import given, settings

from fuzz import swims
from fuzz.scenes import SEEDS


@pytest.mark.parametrize("fidelity", swims.PRESETS)
@pytest.mark.parametrize("seed", range(2))
def test_a_preset_errs_from_the_reference_by_no_more_than_is_promised(fidelity, seed):
    swims.check_preset(fidelity, seed)


@settings(max_examples=8)
@given(SEEDS)
def test_a_batch_of_environments_does_what_they_do_alone(seed):
    swims.check_environment(seed)


@settings(max_examples=5)
@given(SEEDS)
def test_info_has_the_same_keys_on_reset_and_on_every_step(seed):
    swims.check_info_keys(seed)
