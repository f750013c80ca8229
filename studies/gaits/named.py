"""Gaits with a name: the chapter's strokes, lagged pairs, and the waves that turn the robot."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from studies.gaits.periodic import timed

Floats = NDArray[np.float64]

SLOT = 0.05
"""Slot of the named gaits [s]."""
FORWARD, BEHIND = "2+,5-", "3+,4-"
"""The pairs of the fastest strokes: {2+,5-}, then {3+,4-}."""


class Named(NamedTuple):
    """A gait. what: What it is. gait: Pulses, shape (n_slots, 5), with slots of SLOT."""

    what: str
    gait: Floats


def lagged(lag: float, period: float = 1.0, level: float = 1.0) -> Floats:
    """{2+,5-}, and {3+,4-} after a lag [s]."""
    return timed({0.0: FORWARD, lag: BEHIND}, period, SLOT, level=level)


def wave(limbs: str) -> Floats:
    """One limb after the other, every 0.2 s, to +."""
    return timed({0.2 * k: f"{limb}+" for k, limb in enumerate(limbs)}, 1.0, SLOT)


GAITS = {
    "synchronous": Named("the chapter's: {3+,4-}, {2+,5-} in turn, one a second", timed(
        {0.0: BEHIND, 1.0: FORWARD}, 2.0, SLOT)),
    "one at a time": Named("3+, 1- after 0.5 s", timed({0.0: "3+", 0.5: "1-"}, 1.0, SLOT)),
    "lag 0.5": Named("{2+,5-}, {3+,4-} after 0.5 s", lagged(0.5)),
    "lag 0.6": Named("{2+,5-}, {3+,4-} after 0.6 s", lagged(0.6)),
    "lag 0.65": Named("{2+,5-}, {3+,4-} after 0.65 s", lagged(0.65)),
    "opposite": Named("{2-,5+}, {3-,4+} after 0.4 s, away from limb 1", timed(
        {0.0: "2-,5+", 0.4: "3-,4+"}, 1.0, SLOT)),
    "thrifty": Named("lag 0.5 s, pulses of 0.06 s", lagged(0.5, level=0.6)),
    "thriftier": Named("period 0.8 s, lag 0.4 s, pulses of 0.04 s", lagged(0.4, 0.8, 0.4)),
    "wave": Named("5+, 4+, 3+, 2+, 1+ every 0.2 s", wave("54321")),
    "wave back": Named("1+, 2+, 3+, 4+, 5+ every 0.2 s", wave("12345")),
}  # fmt: skip
