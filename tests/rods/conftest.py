"""Settings of the tests of kernels."""

import numpy as np
import pytest


@pytest.fixture(autouse=True)
def _quiet_divisions():
    """Kernels divide by zero where the result is not taken; their machine code says nothing about it."""
    with np.errstate(all="ignore"):
        yield
