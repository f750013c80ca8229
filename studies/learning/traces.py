"""Ways of the bundled policy and of the chapter's script round the pentagon.

Writes `pentagon.json` and `pentagon.png`.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from seastar_gym.controllers.registry import load_agents
from seastar_gym.evaluation.comparison import evaluate
from seastar_gym.evaluation.pictures import draw_traces
from seastar_gym.evaluation.swim import Swim
from studies.frame import Results, Study
from studies.style import apply_style

AGENTS = ("learned", "pentagon")
RADIUS = 0.01
"""Radius of the waypoints [m]."""
MOST_STROKES = 400
UNIT = 1e-5
"""Length that counts as one in the data [m]."""


def swims(max_strokes: int = MOST_STROKES) -> list[Swim]:
    """The agents' swims at `balanced`."""
    return evaluate(load_agents(AGENTS), max_strokes=max_strokes, waypoint_radius=RADIUS, say=lambda text: None)


def as_data(found: list[Swim]) -> dict[str, Any]:
    """Swims as plain data."""
    return {
        "unit_m": UNIT,
        "waypoints_m": found[0].waypoints.round(6).tolist(),
        "swims": {
            each.agent: {
                "hub": np.rint(each.hub.T / UNIT).astype(int).tolist(),
                "waypoints_reached": each.waypoint_index.tolist(),
            }
            for each in found
        },
    }


def from_data(results: Mapping[str, Any]) -> list[Swim]:
    """Swims of which the way is known, not the heat."""
    waypoints = np.array(results["waypoints_m"])
    found = []
    for agent, each in results["swims"].items():
        hub, reached = UNIT * np.transpose(each["hub"]), np.array(each["waypoints_reached"])
        strokes = len(reached) - 1
        none = np.full(strokes, np.nan)
        unheated = np.zeros(strokes, int)
        found.append(Swim(agent, waypoints, hub, reached, np.arange(strokes + 1.0), unheated, none, none, None))
    return found


def draw(results: Mapping[str, Any], file: Path) -> None:
    """Write the picture."""
    apply_style()
    draw_traces(from_data(results), RADIUS, file)


def run(results: Results) -> None:
    """Swim."""
    results.update(as_data(swims()))
    print(", ".join(f"{each.agent}: {each.result}" for each in from_data(results)))


STUDY = Study("learning.traces", run, file="learning/pentagon.json", pictures={"pentagon.png": draw})
