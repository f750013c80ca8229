"""Paths that command lines ask for, by name or by the file of their waypoints."""

from pathlib import Path
from typing import Any

import numpy as np

from seastar_gym.envs.paths import MOST_WAYPOINTS, PATHS, make_path
from seastar_gym.scene.csv_rows import read_numbers

PATH_HELP = f"Name of a path ({', '.join(PATHS)}), or a text file with x and y [m] of one waypoint per line."


def load_path(name: str) -> Any:
    """Name of a path, or waypoints [m], shape (n, 2), of a text file."""
    if name in PATHS or not Path(name).is_file():
        make_path(name, np.random.default_rng(0))
        return name
    waypoints = read_numbers(name, "x and y [m] of a waypoint", 2, MOST_WAYPOINTS)
    try:
        return make_path(waypoints, np.random.default_rng(0))
    except ValueError as bad:
        raise ValueError(f"{name}: {bad}") from bad
