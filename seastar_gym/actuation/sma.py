"""The shape memory alloy actuator of Fig. 13.5b: a linear ramp up while heated, a linear ramp down while cooling."""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def pulse(t: ArrayLike, heating_time: float, cooling_time: float) -> NDArray[np.float64]:
    """Share of the peak angle at time t [s] of the actuation period, in [0, 1]; t of any shape.

    Zero at t = 0, one at t = heating_time, zero again at t = heating_time + cooling_time (Fig. 13.5b).
    """
    t = np.asarray(t, dtype=float)
    rising = t / heating_time
    falling = (heating_time + cooling_time - t) / cooling_time
    return np.clip(np.minimum(rising, falling), 0.0, 1.0)
