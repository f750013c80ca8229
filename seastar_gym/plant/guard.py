"""`Guard`: what stands between a policy and wires that burn."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from seastar_gym.plant.heat import LATENESS, WIRE, Heat
from seastar_gym.plant.plant import Plant, PlantError, Sighting
from seastar_gym.plant.plausibility import Motion, Plausibility
from seastar_gym.scene import Seastar
from seastar_gym.scene.actuators.thermal import ThermalSma
from seastar_gym.scene.checks import require_flag, require_kind, shown
from seastar_gym.scene.number import finite, not_negative, positive

POLL = 0.01
"""Time between looks at a plant [s]."""
FIRST = 2.0
"""Time within which a robot has to be seen at first [s]."""
MOST_STOOD = 100
"""Waits after which a clock that has not moved stands still."""
ROUNDING = 1e-9


@dataclass(frozen=True)
class Limits(Motion):
    """What a guard allows, besides the `Motion` that it takes for possible.

    longest_pulse: Longest pulse [s].
    shortest_rest: Shortest time between the end of a wire's pulse and its next [s].
    patience: Time without a new sighting after which sight is lost and wires are stopped [s].
    oldest: Age of a picture beyond which sight is lost, too [s].
    hottest: Temperature that no wire may pass [deg C], see `Heat`.
    antagonists: Whether the wires + and - of a limb may be heated at once.
    wire: Whose thermal numbers wires have; None: the scene's `ThermalSma`, or one of default numbers.
    """

    longest_pulse: Annotated[float, positive("s")] = 0.12
    shortest_rest: Annotated[float, not_negative("s")] = 0.1
    patience: Annotated[float, positive("s")] = 0.12
    oldest: Annotated[float, positive("s")] = 0.5
    hottest: Annotated[float, finite("deg C")] = 100.0
    antagonists: bool = False
    wire: ThermalSma | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        require_flag("Limits.antagonists", self.antagonists)
        if self.wire is not None:
            require_kind("Limits.wire", self.wire, ThermalSma, "a ThermalSma")
        water = np.max((self.wire or WIRE).water_temperature)
        if self.hottest <= water:
            raise ValueError(f"Limits.hottest must be above the water's {water:g} deg C, not {self.hottest:g}.")

    def heat(self, n_limbs: int, margin: float = 0.0) -> Heat:
        """Heat of a robot's wires within these limits. margin: See `Heat`: `LATENESS` for whoever asks a plant.

        A plant itself demands `LATENESS` less of rests, so that it takes what it was asked for in time.
        """
        return Heat(
            n_limbs,
            self.wire or WIRE,
            hottest=self.hottest,
            longest_pulse=self.longest_pulse,
            shortest_rest=max(self.shortest_rest - LATENESS, 0.0) + margin,
            antagonists=self.antagonists,
            margin=margin,
        )


class Guard:
    """Watches a plant: every pulse and every sighting goes through it, and whatever is wrong stops all wires.

    pulse: Longest pulse that will be asked for [s]; None: the longest one that the limits allow.
    span: Distance of the farthest point of the robot from its hub, at rest [m].
    """

    def __init__(self, plant: Plant, limits: Limits, pulse: float | None = None, span: float = Seastar().limb_length):
        self.plant, self.limits, self.n_limbs = plant, limits, plant.n_limbs
        self._pulse = limits.longest_pulse if pulse is None else pulse
        self.held_back: str | None = None
        """Why the plant was stopped, in one sentence; None while it may be heated."""
        self.newest: Sighting | None = None
        self.plausibility = Plausibility(limits, self.n_limbs, span)
        self._judged_at = -np.inf  # when the last picture was taken that was looked at [s]
        self._clock, self._changed_at = plant.now(), plant.now()
        self._heat = limits.heat(plant.n_limbs, LATENESS)
        self._heat.tick(self._clock)
        self._stood = 0  # waits in which the clock has not moved

    @contextmanager
    def stops(self) -> Iterator[None]:
        """Context that stops all wires, for good until `begin`, whatever ends it but its end."""
        try:
            yield
        except PlantError as why:
            raise self.refuse(str(why)) from None
        except BaseException as failure:
            self.refuse(f"The drive was ended by a {type(failure).__name__}: all wires are stopped.")
            raise

    def now(self) -> float:
        """Time on the plant's clock [s]. PlantError, and stopped wires, where it has gone back."""
        with self.stops():
            time = self.plant.now()
            self._heat.tick(time)
            if not self._clock <= time:
                raise PlantError(f"The plant's clock has jumped by {time - self._clock:.3g} s: all wires are stopped.")
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
        with self.stops():
            self.plant.stop()
            self._clock = self.plant.now()
        until = self.now() + FIRST
        while True:
            seen, now = self._ask()
            if seen is not None and not now - seen.captured_at > self.limits.oldest:
                self._take(seen, now)
            if self.newest is not None:
                return self.newest
            if now > until:
                raise self.refuse(f"The tracker has not seen the robot for {FIRST:g} s: all wires are stopped.")
            self._wait(POLL)

    def _ask(self) -> tuple[Sighting | None, float]:
        """The newest sighting, and the time now [s]."""
        with self.stops():
            return self.plant.sight(), self.now()

    def _wait(self, seconds: float) -> None:
        with self.stops():
            before = self._clock
            self.plant.wait(seconds)
            self._stood = 0 if self.now() > before else self._stood + 1
            if self._stood > MOST_STOOD:
                raise PlantError("The plant's clock stands still: all wires are stopped.")

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
        with self.stops():
            self._judge(seen, now)

    def _judge(self, seen: Sighting, now: float) -> None:
        if seen.captured_at == self._judged_at:
            return
        if seen.captured_at < self._judged_at:
            raise PlantError("The tracker's clock has gone back: all wires are stopped.")
        if seen.captured_at > now + POLL:
            raise PlantError("A picture was taken in the future: the tracker's clock is not that of the plant.")
        if now - seen.captured_at > self.limits.oldest:
            age = now - seen.captured_at
            raise PlantError(f"The newest picture is {age:.3g} s old: all wires are stopped.")
        self._judged_at = seen.captured_at
        can_be = self.plausibility.take(seen)
        if can_be:
            self.newest = seen
        if can_be or self.plausibility.is_first_dropped:
            self._changed_at = now

    def wait_until(self, time: float) -> None:
        """Wait until a time [s], looking all the while."""
        self.look()
        while (left := time - self.now()) > ROUNDING:
            self._wait(min(POLL, left))
            self.look()

    def resting(self) -> NDArray[np.bool_]:
        """Wires that may not be heated by a full pulse now, for + and -, shape (n_limbs, 2)."""
        with self.stops():
            self._heat.tick(self.plant.now())
        return self._heat.resting(self._pulse)

    def heat(self, limbs: Sequence[int], seconds: float) -> None:
        """Heat wires as `Plant.heat`. PlantError, and stopped wires, for a pulse that the limits do not allow."""
        with self.stops():
            self.look()
            if len(limbs) != self.n_limbs or not {*limbs} <= {-1, 0, 1}:
                raise PlantError(f"Wires are 1, 0 or -1 for {self.n_limbs} limbs, not {shown(limbs)}.")
            signs = np.asarray(limbs)
            wires = np.stack([signs > 0, signs < 0], axis=-1)
            if why := self._heat.refusal(wires, seconds):
                raise PlantError(f"{why}: all wires are stopped.")
            try:
                self.plant.heat(limbs, seconds)
            finally:
                self._heat.tick(self.plant.now())
                self._heat.heat(wires, seconds)
                self.plausibility.heated(limbs, seconds, self.plant.now())
