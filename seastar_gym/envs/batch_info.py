"""Info of a batch in Gymnasium's form: an array per name, and a mask of the robots for which it is valid."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Info = dict[str, Any]


def of_some(values: NDArray[Any], mask: NDArray[np.bool_]) -> NDArray[Any]:
    """Values of the robots in a mask, shape (n_robots,); zero or None, as in Gymnasium, for the others."""
    values = values.copy()
    values[~mask] = None if values.dtype == object else 0
    return values


def with_masks(values: dict[str, NDArray[Any]], mask: NDArray[np.bool_]) -> Info:
    """Info of a batch in Gymnasium's form: a copy of every array, and a mask of the robots for which it is valid."""
    return {name: array.copy() for name, array in values.items()} | {f"_{name}": mask.copy() for name in values}
