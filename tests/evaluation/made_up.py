"""Swims that nobody swam: their numbers are the same on every machine."""

from typing import Any

import numpy as np

from seastar_gym.evaluation.swim import Swim

MARKUP = '</script><b>"stray" & co$</b>'
"""Name of an agent that is no markup."""
CORNER = ((0.1, 0.0), (0.1, 0.1))


def made_up_swim(
    hub: Any, waypoint_index: Any, waypoints: Any = CORNER, agent: str = "made up", **changes: Any
) -> Swim:
    """A swim of one stroke a second, of which two limbs are heated for 0.1 s each, with 1.5 J."""
    hub = np.array(hub, float)
    n_strokes = len(hub) - 1
    entries = {
        "time": np.arange(n_strokes + 1.0), "limbs_heated": np.full(n_strokes, 2),
        "heating_time": np.full(n_strokes, 0.2), "energy": np.full(n_strokes, 1.5), "solver_message": None,
    }  # fmt: skip
    return Swim(agent, np.array(waypoints), hub, np.array(waypoint_index), **entries | changes)


def swims() -> list[Swim]:
    """One that finishes after twelve strokes, one that goes astray, and one that ends where it began, in decisions."""
    along = np.linspace(0.0, 0.2, 13)
    round_the_corner = np.stack([np.minimum(along, 0.1), np.maximum(along - 0.1, 0.0)], axis=1)
    astray = np.stack([np.linspace(0.0, -0.2, 6), np.linspace(0.0, 0.3, 6) ** 2], axis=1)
    unknown = {"heating_time": np.full(2, np.nan), "energy": np.full(2, np.nan), "time": np.arange(3) * 0.5}
    return [
        made_up_swim(round_the_corner, [0] * 6 + [1] * 6 + [2], agent="straight"),
        made_up_swim(astray, [0, 0, 0, 1, 1, 1], agent=MARKUP, limbs_heated=np.arange(5)),
        made_up_swim([(0.0, 0.0), (0.03, 0.04), (0.0, 0.0)], [0, 1, 2], [(0.03, 0.04), (0.0, 0.0)], "back", **unknown),
    ]
