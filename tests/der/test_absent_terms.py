"""A kernel asks a bundle whether a term is there, and what it does with one that is not need not compile."""

from typing import Any, NamedTuple

import numpy as np
import pytest

from seastar_gym.simd.compilation import entry_point, kernel
from seastar_gym.simd.lanes import N_LANES, borrow, load, splat, store


class Part(NamedTuple):
    weight: Any


class Whole(NamedTuple):
    drag: Any
    part: Any


@kernel
def asked(whole):
    """Every way to ask."""
    total = splat(1.0) if whole.drag is None else load(whole.drag, 0)
    part = whole.part
    if part is None or part.weight is None:
        return total
    if whole.drag is not None and whole.part is not None:
        total = total + load(whole.drag, 1)
    return total + load(part.weight, 0)


@kernel
def handed_on(whole):
    return asked(whole)


@entry_point
def ask(whole, out):
    store(borrow(out), 0, handed_on(borrow(whole)))


TWO, ONE = np.full((2, N_LANES), 3.0), np.full((1, N_LANES), 7.0)


@pytest.mark.parametrize(
    "whole, answer",
    [
        (Whole(None, None), 1.0),
        (Whole(TWO, None), 3.0),
        (Whole(None, Part(None)), 1.0),
        (Whole(None, Part(ONE)), 8.0),
        (Whole(TWO, Part(ONE)), 13.0),
    ],
)
def test_kernels_see_what_a_bundle_has_and_what_it_has_not(whole, answer):
    out = np.zeros((1, N_LANES))
    ask(whole, out)
    np.testing.assert_array_equal(out, answer)
