"""`Guard`: what stands between a policy and wires that burn.

`Plausibility`: whether a robot can be where a tracker says that it is.

`Heat`: how hot wires can be by now, and which of them may be heated.

A wire's rise above the water tends to the steady rise while it is heated and to zero while it cools, see `ThermalSma`;
latent heat, which would keep it cooler, is left out. Where numbers differ from robot to robot, the hottest wire counts:
it heats with the smallest time constant and cools with the largest.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import KW_ONLY, dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from seastar_gym.plant.plant import Plant, PlantError, Sighting
from seastar_gym.scene import Seastar
from seastar_gym.scene.actuators.wires import ThermalSma
from seastar_gym.scene.checks import is_finite_number, require_flag, require_kind, shown
from seastar_gym.scene.number import check_numbers, finite, not_negative, positive

WINDOW = 0.5
"""Time over which a picture is compared with those before it [s]."""
SHORTEST_GAP = 5e-4
"""Shortest time between two pictures of any camera [s]."""
SEA = 100.0
"""Largest coordinate in a tank whose size nobody has said [m]."""
TOO_MANY = ((3, 6), (10, 60))
"""So many implausible pictures of the last so many stop the wires."""
STRETCH = 1.25
"""How much farther than at rest a marker may be from the hub."""
PUSH, SYMMETRIC = 0.03, 1.2
"""Heat that moves a robot [s]: what does not cancel between limbs, and the sum over wires where all of it does."""
NOISES = 8.0
"""How many standard deviations of a camera two of its pictures may differ by."""


LATENESS = 0.03
"""By how much lines to a plant may be late [s]: so much sooner may pulses follow each other there than here."""
WIRE = ThermalSma()
"""Whose numbers wires have unless somebody says others."""


@dataclass(frozen=True)
class Limits:
    """What a guard allows, and how a robot can move in pictures.

    longest_pulse: Longest pulse [s].
    shortest_rest: Shortest time between the end of a wire's pulse and its next [s].
    patience: Time without a new sighting after which sight is lost and wires are stopped [s].
    oldest: Age of a picture beyond which sight is lost, too [s].
    hottest: Temperature that no wire may pass [deg C], see `Heat`.
    antagonists: Whether the wires + and - of a limb may be heated at once.
    wire: Whose thermal numbers wires have; None: the scene's `ThermalSma`, or one of default numbers.
    fastest: Largest speed of the hub [m/s].
    fastest_turn: Largest rate at which the heading turns [rad/s].
    blur: How far apart two pictures may see a hub that lies still [m].
    turn_blur: How far apart two pictures may see a heading that stays [rad].
    reach: Largest distance of the hub from where it was seen first [m].
    tank: Two opposite corners of the tank, ((x, y), (x, y)) with the smaller numbers first [m]. None means that its
        size is not known, but below 100 m from its origin.
    still: Time within which a heated wire moves what is seen [s].
    """

    longest_pulse: Annotated[float, positive("s")] = 0.12
    shortest_rest: Annotated[float, not_negative("s")] = 0.1
    patience: Annotated[float, positive("s")] = 0.12
    oldest: Annotated[float, positive("s")] = 0.5
    hottest: Annotated[float, finite("deg C")] = 100.0
    antagonists: bool = False
    wire: ThermalSma | None = None
    _: KW_ONLY
    fastest: Annotated[float, positive("m/s")] = 0.3
    fastest_turn: Annotated[float, positive("rad/s")] = 3.0
    blur: Annotated[float, positive("m")] = 0.03
    turn_blur: Annotated[float, positive("rad")] = 0.3
    reach: Annotated[float, positive("m")] = 5.0
    tank: tuple[tuple[float, float], tuple[float, float]] | None = None
    still: Annotated[float, positive("s")] = 0.5

    def __post_init__(self) -> None:
        check_numbers(self, "Limits.")
        require_flag("Limits.antagonists", self.antagonists)
        if self.wire is not None:
            require_kind("Limits.wire", self.wire, ThermalSma, "a ThermalSma")
        water = np.max((self.wire or WIRE).water_temperature)
        if self.hottest <= water:
            raise ValueError(f"Limits.hottest must be above the water's {water:g} deg C, not {self.hottest:g}.")
        match self.tank:
            case None:
                return
            case ((x, y), (x_most, y_most)) if all(map(is_finite_number, (x, y, x_most, y_most))):
                if x < x_most and y < y_most:
                    return
        raise ValueError(f"Limits.tank must be corners, such as ((0, 0), (1.5, 1)) [m], not {shown(self.tank)}.")


class Plausibility:
    """Judges what a tracker says by what a robot can do, since an episode began.

    A picture that cannot be is dropped and counted. Too many of them are refused, and so is a tracker whose pictures
    stay the same to the last bit although wires were heated.

    span: Distance of the farthest point of the robot from its hub, at rest [m].
    """

    def __init__(self, limits: Limits, n_limbs: int, span: float):
        self._limits, self._span = limits, span
        self._directions = np.exp(2j * np.pi * np.arange(n_limbs) / n_limbs)
        self._heat = np.zeros((n_limbs, 2))  # of every wire since the pictures have changed [s]
        self.begin()

    def begin(self) -> None:
        """Forget what was."""
        self.n_dropped, self._verdicts = 0, deque[bool](maxlen=max(of for _, of in TOO_MANY))
        self._recent, self._origin = deque[Sighting](), (math.nan, math.nan)
        self._move()

    def _move(self) -> None:
        self._heat[:], self._pushed_at = 0.0, math.inf

    def heated(self, limbs: Sequence[int], seconds: float, now: float) -> None:
        """Wires are heated as by `Plant.heat`, from now on [s]."""
        self._heat += seconds * (np.asarray(limbs)[:, None] == [1, -1])
        if np.abs(self._directions @ self._heat).max() > PUSH or self._heat.sum() > SYMMETRIC:
            self._pushed_at = min(self._pushed_at, now)

    def take(self, seen: Sighting) -> bool:
        """Whether a new picture can be. PlantError: too many cannot, or nothing moves where something has to."""
        doubt = self._doubt(seen)
        self._verdicts.append(bool(doubt))
        if doubt:
            self.n_dropped += 1
            for most, of in TOO_MANY:
                if (n_bad := sum([*self._verdicts][-of:])) >= most:
                    n = min(of, len(self._verdicts))
                    raise PlantError(f"{n_bad} of {n} pictures cannot be: {doubt}: all wires are stopped.")
            return False
        if not self._recent:
            self._origin = seen.pose[:2]
        elif not _is_same(seen, self._recent[-1]):
            self._move()
        elif seen.captured_at - self._pushed_at > (still := self._limits.still):
            raise PlantError(f"No picture has changed for {still:g} s after wires were heated: all wires are stopped.")
        self._recent.append(seen)
        while seen.captured_at - self._recent[0].captured_at > WINDOW and len(self._recent) > 1:
            self._recent.popleft()
        return True

    @property
    def is_first_dropped(self) -> bool:
        """Whether the last picture was dropped, and the one before was not."""
        return [*self._verdicts][-2:] in ([True], [False, True])

    def _doubt(self, seen: Sighting) -> str:
        """Why a picture cannot be; empty if it can."""
        markers = np.zeros((0, 2)) if seen.markers is None else np.asarray(seen.markers, np.float64).reshape(-1, 2)
        if not np.isfinite([seen.captured_at, seen.seen_at, *seen.pose, *markers.ravel()]).all():
            return "it has numbers that are not finite"
        x, y, heading = map(float, seen.pose)
        if abs(heading) > 2.0 * math.pi:
            return f"a heading of {heading:.4g} rad is more than a full turn (are these degrees?)"
        return self._doubt_place(x, y, markers) or self._doubt_motion(seen.captured_at, x, y, heading)

    def _doubt_place(self, x: float, y: float, markers: NDArray[np.float64]) -> str:
        limits = self._limits
        (x_least, y_least), (x_most, y_most) = limits.tank or ((-SEA, -SEA), (SEA, SEA))
        if not (x_least <= x <= x_most and y_least <= y <= y_most):
            return f"a hub at {x:.4g}, {y:.4g} m is outside the tank (are these millimetres?)"
        if self._recent and (away := math.dist((x, y), self._origin)) > limits.reach:
            return f"the hub is {away:.3g} m from where it began, beyond its reach of {limits.reach:g} m"
        far = max((math.dist((x, y), place) for place in markers.tolist()), default=0.0)
        if far > STRETCH * self._span + limits.blur:
            return f"a marker is {far:.3g} m from the hub, limbs end at {self._span:.3g} m"
        return ""

    def _doubt_motion(self, captured_at: float, x: float, y: float, heading: float) -> str:
        limits = self._limits
        for past in reversed(self._recent):
            since, (x_past, y_past, heading_past) = captured_at - past.captured_at, past.pose
            if since < SHORTEST_GAP:
                return f"pictures {1e3 * since:.2g} ms apart come from no camera"
            moved, turned = math.dist((x, y), (x_past, y_past)), abs(math.remainder(heading - heading_past, math.tau))
            if moved > limits.blur + limits.fastest * since:
                return f"the hub has moved by {moved:.3g} m in {since:.3g} s, faster than {limits.fastest:g} m/s"
            if turned > limits.turn_blur + limits.fastest_turn * since:
                turn = f"{turned:.3g} rad in {since:.3g} s"
                return f"the robot has turned by {turn}, faster than {limits.fastest_turn:g} rad/s"
        return ""


def _is_same(seen: Sighting, other: Sighting) -> bool:
    """Whether two pictures show the same to the last bit."""
    return tuple(seen.pose) == tuple(other.pose) and np.array_equal(
        np.asarray(seen.markers, float), np.asarray(other.markers, float), equal_nan=True
    )


OVERTIME = 0.005
"""By how much a pulse may be too long before it is turned off [s]."""
LONGEST_STEP = 0.1
"""Longest time between two looks that is believed [s], unless this computer's clock says that it has passed."""
START = 0.5
"""Time that whoever heats or asks takes to start at least [s], for which wires of earlier drives have cooled."""
ROUNDING = 1e-9


class Heat:
    """Heat of the wires + and - of every limb, shape (n_limbs, 2), within limits.

    margin: By how much pulses may follow each other sooner [s] where they heat than they do here: `LATENESS` for
        whoever asks a plant. A wire is taken to cool no sooner than so long after its pulse. A plant itself demands
        `LATENESS` less of rests, so that it takes what it was asked for in time.

    The clock of heat is that of the plant, but it stands still where that goes back, or on by more than `LONGEST_STEP`
    and than this computer's clock: no jump is a rest.
    """

    def __init__(self, n_limbs: int, limits: Limits, margin: float = 0.0):
        wire = limits.wire or WIRE
        self._steady = float(np.max(wire.steady_rise))
        self._water = float(np.max(wire.water_temperature))
        self._heats, self._cools = float(np.min(wire.time_constant)), float(np.max(wire.time_constant))
        self._hottest, self._longest, self._antagonists = limits.hottest, limits.longest_pulse, limits.antagonists
        self._shortest_rest, self._margin = max(limits.shortest_rest - LATENESS, 0.0) + margin, margin
        rise = min(self._hottest - self._water, self._steady) * math.exp(-START / self._cools)
        self._rise = np.full((n_limbs, 2), rise)
        self._left, self._rested = np.zeros((n_limbs, 2)), np.full((n_limbs, 2), self._shortest_rest)
        self._clock, self._wall, self._passed = math.nan, time.monotonic(), 0.0

    def tick(self, now: float) -> None:
        """Say the time of the plant's clock [s]."""
        wall = time.monotonic()
        step = now - self._clock
        if step > LONGEST_STEP:
            step = min(step, wall - self._wall)
        self._passed += step if step > 0.0 else 0.0  # nothing, where a clock says no number
        self._clock, self._wall = now, wall

    def _settle(self) -> None:
        """Let the time pass that has gone by."""
        passed, self._passed = self._passed, 0.0
        if not passed:
            return
        heated = np.minimum(self._left, passed)
        self._rise = self._after(heated)
        before = np.where(heated > 0.0, 0.0, self._rested)
        self._left, self._rested = self._left - heated, before + passed - heated
        cooled = np.maximum(self._rested - self._margin, 0.0) - np.maximum(before - self._margin, 0.0)
        self._rise *= np.exp(-cooled / self._cools)

    def _after(self, seconds: float | NDArray[np.float64]) -> NDArray[np.float64]:
        """Rises of wires that are heated for so long from now on [K]."""
        return self._steady + (self._rise - self._steady) * np.exp(-np.asarray(seconds) / self._heats)

    def hottest_after(self, seconds: float) -> NDArray[np.float64]:
        """Temperatures that pulses of this length would reach now [deg C], shape (n_limbs, 2)."""
        self._settle()
        return self._water + self._after(seconds + OVERTIME if seconds else 0.0)

    def from_cold(self, seconds: float) -> float:
        """Temperature that a pulse of this length reaches in a cold wire [deg C]."""
        return self._water - self._steady * math.expm1(-(seconds + OVERTIME) / self._heats)

    def _within(self, seconds: float) -> NDArray[np.bool_]:
        """Wires that are heated, or were so long ago or less."""
        return (self._left > ROUNDING) | (self._rested < seconds - ROUNDING)

    def _restless(self) -> NDArray[np.bool_]:
        return self._within(self._shortest_rest)

    def _opposed(self) -> NDArray[np.bool_]:
        """Wires whose antagonist is heated, or was just now."""
        return self._within(self._margin)[:, ::-1] & (not self._antagonists)

    def resting(self, seconds: float) -> NDArray[np.bool_]:
        """Wires that may not be heated for so long now, shape (n_limbs, 2)."""
        too_hot = self.hottest_after(seconds) > self._hottest + ROUNDING
        return np.asarray(too_hot | self._restless() | self._opposed())

    def refusal(self, wires: NDArray[np.bool_], seconds: float) -> str | None:
        """Why wires in a mask of shape (n_limbs, 2) may not be heated for so long, without a stop; None if they may."""
        if not 0.0 <= seconds <= self._longest * (1.0 + ROUNDING):
            return f"A pulse must be from 0 to {self._longest:g} s, not {seconds:.3g} s"
        reached = self.hottest_after(seconds)[wires].max(initial=-np.inf)
        if (wires & self._restless()).any():
            return f"A wire was to be heated within {self._shortest_rest:g} s of its last pulse"
        if (wires & self._opposed()).any():
            return "Both wires of a limb were to be heated at once"
        if reached > self._hottest + ROUNDING:
            return f"A wire would be {reached:.0f} deg C hot, more than {self._hottest:g} deg C"
        return None

    def heat(self, wires: NDArray[np.bool_], seconds: float) -> None:
        """Wires in a mask of shape (n_limbs, 2) are heated for so long from now on."""
        if seconds > 0.0:
            self._settle()
            self._left[wires], self._rested[wires] = seconds, 0.0

    def stop(self) -> None:
        """No wire is heated any more."""
        self._settle()
        self._left[:] = 0.0


POLL = 0.01
"""Time between looks at a plant [s]."""
FIRST = 2.0
"""Time within which a robot has to be seen at first [s]."""
MOST_STOOD = 100
"""Waits after which a clock that has not moved stands still."""


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
        self._heat = Heat(plant.n_limbs, limits, LATENESS)
        self._heat.tick(self._clock)
        self._stood = 0  # waits in which the clock has not moved

    @contextmanager
    def stops(self) -> Iterator[None]:
        """Context that stops all wires, for good until `begin`, whatever ends it but its end."""
        try:
            yield
        except PlantError as why:
            raise self.refuse(str(why)) from None
        except BaseException as failure:  # wires are cold whatever it is, an interrupt, too
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
                self._judge(seen, now)
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
            self._judge(seen, now)
        if self.newest is not None and now - self._changed_at > self.limits.patience:
            raise self.refuse(f"No new picture for {self.limits.patience:g} s: all wires are stopped.")
        return self.newest

    def _judge(self, seen: Sighting, now: float) -> None:
        """Take a new sighting; drop or refuse one that cannot be."""
        if seen.captured_at == self._judged_at:
            return
        with self.stops():
            if seen.captured_at < self._judged_at:
                raise PlantError("The tracker's clock has gone back: all wires are stopped.")
            if seen.captured_at > now + POLL:
                raise PlantError("A picture was taken in the future: the tracker's clock is not that of the plant.")
            if (age := now - seen.captured_at) > self.limits.oldest:
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
