"""`Guard`: what stands between a policy and wires that burn."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from seastar_gym.plant.plant import Plant, PlantError, Sighting
from seastar_gym.plant.plausibility import Motion, Plausibility
from seastar_gym.scene import Seastar
from seastar_gym.scene.number import not_negative, positive

POLL = 0.01
"""Time between looks at a plant [s]."""
FIRST = 2.0
"""Time within which a robot has to be seen at first [s]."""
ROUNDING = 1e-9


@dataclass(frozen=True)
class Limits(Motion):
    """What a guard allows, besides the `Motion` that it takes for possible.

    longest_pulse: Longest pulse [s].
    shortest_rest: Shortest time between the end of a wire's pulse and its next [s].
    patience: Time without a new sighting after which sight is lost and wires are stopped [s].
    oldest: Age of a picture beyond which sight is lost, too [s].
    """

    longest_pulse: Annotated[float, positive("s")] = 0.12
    shortest_rest: Annotated[float, not_negative("s")] = 0.1
    patience: Annotated[float, positive("s")] = 0.12
    oldest: Annotated[float, positive("s")] = 0.5


class Guard:
    """Watches a plant: every pulse and every sighting goes through it, and whatever is wrong stops all wires.

    span: Distance of the farthest point of the robot from its hub, at rest [m].
    """

    def __init__(self, plant: Plant, limits: Limits, span: float = Seastar().limb_length):
        self.plant, self.limits, self.n_limbs = plant, limits, plant.n_limbs
        self.held_back: str | None = None
        """Why the plant was stopped, in one sentence; None while it may be heated."""
        self.newest: Sighting | None = None
        self.plausibility = Plausibility(limits, self.n_limbs, span)
        self._judged_at = -np.inf  # when the last picture was taken that was looked at [s]
        self._clock, self._changed_at = plant.now(), plant.now()
        self._hot_until = np.full((self.n_limbs, 2), -np.inf)

    def now(self) -> float:
        """Time on the plant's clock [s]. PlantError, and stopped wires, where it has jumped."""
        time = self.plant.now()
        if not self._clock <= time:
            raise self.refuse(f"The plant's clock has jumped by {time - self._clock:.3g} s: all wires are stopped.")
        self._clock = time
        return time

    def refuse(self, sentence: str) -> PlantError:
        """Stop all wires; returns the error to raise."""
        self.held_back = self.held_back or sentence
        self.plant.stop()
        return PlantError(self.held_back)

    def begin(self) -> Sighting:
        """Forget what was, and wait for the robot to be seen. PlantError: it is not."""
        self.held_back = self.newest = None
        self._judged_at = -np.inf
        self.plausibility.begin()
        self.plant.stop()
        self._clock = self.plant.now()
        until = self._clock + FIRST
        while True:
            seen, now = self._ask()
            if seen is not None and not now - seen.captured_at > self.limits.oldest:
                self._take(seen, now)
            if self.newest is not None:
                return self.newest
            if now > until:
                raise self.refuse(f"The tracker has not seen the robot for {FIRST:g} s: all wires are stopped.")
            self.plant.wait(POLL)

    def _ask(self) -> tuple[Sighting | None, float]:
        """The newest sighting, and the time now [s]."""
        try:
            return self.plant.sight(), self.now()
        except PlantError as broken:
            raise self.refuse(str(broken)) from None

    def look(self) -> Sighting | None:
        """The newest sighting; PlantError, and stopped wires, if sight is lost or cannot be."""
        if self.held_back is not None:
            raise PlantError(self.held_back)
        seen, now = self._ask()
        if seen is not None:
            self._take(seen, now)
        if self.newest is not None and now - self._changed_at > self.limits.patience:
            raise self.refuse(f"No new picture for {self.limits.patience:g} s: all wires are stopped.")
        return self.newest

    def _take(self, seen: Sighting, now: float) -> None:
        """Take a new sighting; drop or refuse one that cannot be."""
        if seen.captured_at == self._judged_at:
            return
        if seen.captured_at < self._judged_at:
            raise self.refuse("The tracker's clock has gone back: all wires are stopped.")
        if seen.captured_at > now + POLL:
            raise self.refuse("A picture was taken in the future: the tracker's clock is not that of the plant.")
        if now - seen.captured_at > self.limits.oldest:
            age = now - seen.captured_at
            raise self.refuse(f"The newest picture is {age:.3g} s old: all wires are stopped.")
        self._judged_at = seen.captured_at
        try:
            can_be = self.plausibility.take(seen)
        except PlantError as why:
            raise self.refuse(str(why)) from None
        if can_be:
            self.newest = seen
        if can_be or self.plausibility.is_first_dropped:
            self._changed_at = now

    def wait_until(self, time: float) -> None:
        """Wait until a time [s], looking all the while."""
        self.look()
        while (left := time - self.now()) > ROUNDING:
            self.plant.wait(min(POLL, left))
            self.look()

    def resting(self) -> NDArray[np.bool_]:
        """Wires that may not be heated yet, for + and -, shape (n_limbs, 2)."""
        return np.asarray(self.plant.now() < self._hot_until + self.limits.shortest_rest - ROUNDING)

    def heat(self, limbs: Sequence[int], seconds: float) -> None:
        """Heat wires as `Plant.heat`. PlantError, and stopped wires, for a pulse that is too long or comes too soon."""
        self.look()
        longest = self.limits.longest_pulse
        if not 0.0 <= seconds <= longest * (1.0 + ROUNDING):
            raise self.refuse(f"A pulse must be from 0 to {longest:g} s, not {seconds:.3g} s: all wires are stopped.")
        wires = np.array([[sign > 0, sign < 0] for sign in limbs])
        if (wires & self.resting()).any():
            rest = self.limits.shortest_rest
            raise self.refuse(f"A wire was to be heated within {rest:g} s of its last pulse: all wires are stopped.")
        self.plant.heat(limbs, seconds)
        self.plausibility.heated(limbs, seconds, self.plant.now())
        self._hot_until[wires] = self.plant.now() + seconds
