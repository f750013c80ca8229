"""`Plausibility`: whether a robot can be where a tracker says that it is."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from seastar_gym.plant.plant import PlantError, Sighting
from seastar_gym.scene.checks import is_finite_number, shown
from seastar_gym.scene.number import check_numbers, positive

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


@dataclass(frozen=True, kw_only=True)
class Motion:
    """How a robot can move in pictures.

    fastest: Largest speed of the hub [m/s].
    fastest_turn: Largest rate at which the heading turns [rad/s].
    blur: How far apart two pictures may see a hub that lies still [m].
    turn_blur: How far apart two pictures may see a heading that stays [rad].
    reach: Largest distance of the hub from where it was seen first [m].
    tank: Two opposite corners of the tank, ((x, y), (x, y)) with the smaller numbers first [m]. None means that its
        size is not known, but below 100 m from its origin.
    still: Time within which a heated wire moves what is seen [s].
    """

    fastest: Annotated[float, positive("m/s")] = 0.3
    fastest_turn: Annotated[float, positive("rad/s")] = 3.0
    blur: Annotated[float, positive("m")] = 0.03
    turn_blur: Annotated[float, positive("rad")] = 0.3
    reach: Annotated[float, positive("m")] = 5.0
    tank: tuple[tuple[float, float], tuple[float, float]] | None = None
    still: Annotated[float, positive("s")] = 0.5

    def __post_init__(self) -> None:
        check_numbers(self, "Limits.")
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

    def __init__(self, limits: Motion, n_limbs: int, span: float):
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
