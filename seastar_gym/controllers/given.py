"""What `predict` is given, checked: observations, and where episodes start."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene.checks import as_array, shown


def as_floating(name: str, value: object) -> NDArray[np.floating[Any]]:
    """Value as an array of floats of its own precision, of whatever shape."""
    array = as_array(name, value)
    if array.dtype.kind not in "iuf":
        raise ValueError(f"{name} must be numbers, not {array.dtype} values.")
    return array


def observed(observation: object, smallest: int) -> NDArray[np.floating[Any]]:
    """Observations of one robot, shape (size,), or several, shape (n, size). smallest: Least numbers of each."""
    array = as_floating("observation", observation)
    if array.ndim not in (1, 2) or array.shape[-1] < smallest:
        raise ValueError(
            f"An observation must have shape (size,) or (n, size), with {smallest} numbers or more, not {array.shape}."
        )
    return array


def starts(episode_start: object, n: int) -> NDArray[np.bool_]:
    """Which of n robots begin an episode; none if it is not said."""
    if episode_start is None:
        return np.zeros(n, bool)
    flags = as_array("episode_start", episode_start)
    if flags.dtype.kind not in "biu" or flags.shape not in ((), (1,), (n,)):
        raise ValueError(f"episode_start must be flags of shape ({n},), not {shown(episode_start)}.")
    return np.broadcast_to(flags.astype(bool), (n,))
