"""`Watch`: what is told of robots beside their state, asked around every interval."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.scene import Scene
from seastar_gym.simulator.state import State

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]


class Swimmers(Protocol):
    """What watches ask of robots, and a twin does, as a `Simulator` does it."""

    scene: Scene

    def advance(self, duration: float, commands: ArrayLike | None = None) -> object: ...
    def reset(self, mask: ArrayLike | None = None, heading: ArrayLike = 0.0) -> None: ...
    def get_state(self) -> State: ...
    def set_state(self, state: State) -> None: ...
    def set_scene(self, scene: Scene, mask: ArrayLike | None = None) -> None: ...
    def set_limb_strengths(self, strengths: ArrayLike) -> None: ...
    def hub_position(self) -> Floats: ...
    @property
    def failed(self) -> Mask: ...
    def kinetic_energy(self, relative_to_water: bool = False) -> Floats: ...
    @property
    def time(self) -> Floats: ...
    def close(self) -> None: ...


class Watch:
    """Watches the robots of a simulator, and tells a number of each in every report. It moves none of them."""

    @property
    def told(self) -> Floats:
        """What it tells now, shape (n_robots,), a copy."""
        raise NotImplementedError

    def begin(self, duration: float, commands: Floats | None) -> None:
        """Begin an interval [s] with commands, shape (n_robots, n_limbs), None for none."""

    def end(self, robots: Swimmers, failed: Mask) -> None:
        """End an interval. failed: Robots whose solver has given up, shape (n_robots,)."""

    def reset(self, chosen: Mask, heading: Floats) -> None:
        """Some robots were put at rest, see `Simulator.reset`."""

    def lose(self) -> None:
        """All robots were put into a new state."""

    def checked(self, scene: Scene) -> Any:
        """What `set_scene` needs of a scene. ValueError if it cannot be watched."""

    def set_scene(self, scene: Any, chosen: Mask) -> None:
        """The chosen robots have numbers of another scene, of which `checked` returned this."""

    def set_limb_strengths(self, strengths: Floats) -> None:
        """Limbs have these strengths from now on, shape (n_robots, n_limbs)."""

    def save(self) -> Any:
        """What `restore` needs to undo an interval."""

    def restore(self, before: Any) -> None:
        """Undo an interval."""

    def close(self) -> None:
        """End what it has started."""
