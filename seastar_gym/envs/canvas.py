"""What pictures are drawn on: the part of the plane that they show, the canvas, and the window.

Lengths are in metres, y is up; pixels count from the upper left corner, y down. Without a display, windows are drawn
off screen.
"""

from __future__ import annotations

import functools
import itertools
import os
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.process import held_back

if TYPE_CHECKING:
    import pygame

FloatArray = NDArray[np.float64]


class Camera:
    """Map from metres to the pixels of a viewport, with one scale for x and y and the fitted box [m] in the middle."""

    def __init__(self, corners: FloatArray, viewport: tuple[int, int, int, int]) -> None:
        """corners: Points [m], shape (n, 2), whose bounding box is fitted; viewport: left, top, width, height [px]."""
        self.corners = np.array([corners.min(axis=0), corners.max(axis=0)])
        self.viewport = viewport
        left, top, width, height = viewport
        self.scale = float(np.min(np.array([width, height]) / np.ptp(self.corners, axis=0)))
        self._centre = self.corners.mean(axis=0)
        self._middle = np.array([left + width / 2, top + height / 2])

    def to_pixels(self, points: ArrayLike) -> FloatArray:
        """Pixels, shape (..., 2), of points [m], shape (..., 2)."""
        pixels: FloatArray = self._middle + (np.asarray(points) - self._centre) * [self.scale, -self.scale]
        return pixels

    @property
    def in_view(self) -> FloatArray:
        """Lower left and upper right corner of what the viewport shows [m], shape (2, 2)."""
        half = 0.5 * np.array(self.viewport[2:]) / self.scale
        corners: FloatArray = np.array([self._centre - half, self._centre + half])
        return corners

    def sees(self, points: FloatArray) -> bool:
        """Whether all points [m], shape (n, 2), lie in the viewport."""
        left, top, width, height = self.viewport
        pixels = self.to_pixels(points)
        return bool(np.all(pixels >= [left, top]) and np.all(pixels <= [left + width, top + height]))

    def widened(self, points: FloatArray, margin: float) -> Camera:
        """A camera that sees what this one was fitted to and points [m], shape (n, 2), with a margin [m] around."""
        return Camera(np.concatenate([self.corners, points - margin, points + margin]), self.viewport)


Colour = tuple[int, int, int]

WATER: Colour = (250, 252, 254)
INK: Colour = (58, 64, 74)
SUPERSAMPLING = 3
"""Pictures are painted this many times larger and smoothed down."""
KEPT_TEXTS = 64
"""Number of texts that are kept as they were written: most are the same from picture to picture."""


class Canvas:
    """Picture that is being painted.

    size: Width and height of the picture [px]. text_height: Height of letters [px].
    """

    def __init__(self, size: tuple[int, int], text_height: int) -> None:
        self._pygame = import_pygame()
        self.size, self.text_height = size, text_height
        self._large = self._pygame.Surface((SUPERSAMPLING * size[0], SUPERSAMPLING * size[1]), depth=32)
        self.picture: pygame.Surface = self._pygame.Surface(size, depth=32)
        self._kept = self._large
        self._shows: object = None  # what is kept shows it
        self._changed: list[pygame.Rect] = []  # where this picture differs from the last, but for what is above
        self._above: list[pygame.Rect] = []  # where something is painted above what is kept
        self._written = functools.lru_cache(KEPT_TEXTS)(lambda *text: self._font.render(*text))
        self._size_of = functools.lru_cache(KEPT_TEXTS)(lambda text: self._font.size(text))

    def begin(self, background: Colour, shows: object = None) -> bool:
        """Begin a picture; returns whether it has what was kept of the last one already.

        shows: What is kept shows. Where it is that of the last picture, what was painted above it is taken away;
            otherwise, and for None, the picture is filled with the background.
        """
        vars(self).pop("_font", None)
        stays = shows is not None and shows == self._shows
        self._changed, self._above, self._shows = self._above, [], shows
        if stays:
            for place in self._changed:
                self._large.blit(self._kept, place, place)
        else:
            self._changed = [self._large.fill(background)]
        return stays

    def keep(self) -> None:
        """Keep what is painted so far, if `begin` said what it shows."""
        if self._shows is not None:
            self._kept, self._above = self._large.copy(), []

    def finish(self) -> None:
        """Smooth down what was painted to `picture`, where it changed."""
        for place in _apart([*self._changed, *self._above]):
            left, top = place.left // SUPERSAMPLING, place.top // SUPERSAMPLING
            right, bottom = -(-place.right // SUPERSAMPLING), -(-place.bottom // SUPERSAMPLING)
            small = self._pygame.Rect(left, top, right - left, bottom - top)
            large = self._large.subsurface([SUPERSAMPLING * number for number in small])
            self._pygame.transform.smoothscale(large, small.size, self.picture.subsurface(small))

    def pixels(self) -> NDArray[np.uint8]:
        """Red, green and blue of the finished picture, shape (height, width, 3), a fresh array."""
        width, height = self.size
        pixels = np.frombuffer(self._pygame.image.tobytes(self.picture, "RGB"), dtype=np.uint8)
        return pixels.reshape(height, width, 3).copy()

    def polyline(self, points: FloatArray, colour: Colour, width: int) -> None:
        """Line through points [px], shape (n, 2), as pygame draws it."""
        corners = np.rint(SUPERSAMPLING * points - 0.5).tolist()
        self._above.append(self._pygame.draw.lines(self._large, colour, False, corners, width * SUPERSAMPLING))

    def stroke(self, points: FloatArray, colour: Colour, width: float) -> None:
        """Thick line through points [px], shape (n, 2), with round joints and ends; width [px].

        It is a row of discs: pygame's own thick lines and polygons come out up to a fifth thinner in some directions.
        """
        radius = max(1, round(0.5 * SUPERSAMPLING * width))
        corners = np.rint(SUPERSAMPLING * _along(points, 2.0 / SUPERSAMPLING)) - radius
        self._large.fblits(list(zip(itertools.repeat(_disc(colour, radius)), corners.tolist())))
        low, high = corners.min(axis=0), corners.max(axis=0) + 2 * radius + 1
        place = self._pygame.Rect(low.tolist(), (high - low).tolist())
        self._above.append(place.clip(self._large.get_rect()))

    def area(self, corners: FloatArray, colour: Colour) -> None:
        """Filled polygon of corners [px], shape (n, 2)."""
        self._above.append(self._pygame.draw.polygon(self._large, colour, np.rint(SUPERSAMPLING * corners).tolist()))

    def dot(self, centre: FloatArray, colour: Colour, radius: float) -> None:
        """Disc around a centre [px], shape (2,); radius [px]."""
        x, y = np.rint(SUPERSAMPLING * centre).tolist()
        self._above.append(self._pygame.draw.circle(self._large, colour, (x, y), round(SUPERSAMPLING * radius)))

    def text_size(self, text: str) -> FloatArray:
        """Width and height of a written text [px], shape (2,)."""
        return np.array(self._size_of(text)) / SUPERSAMPLING

    def write(self, text: str, place: ArrayLike, colour: Colour, anchor: tuple[float, float]) -> float:
        """Write a text with its anchor (0 to 1 from the upper left) at a place [px]; returns the x [px] of its end."""
        written = self._written(text, True, colour)
        corner = np.rint(SUPERSAMPLING * np.asarray(place) - np.array(anchor) * written.get_size())
        self._above.append(self._large.blit(written, corner.tolist()))
        return (float(corner[0]) + written.get_width()) / SUPERSAMPLING

    @functools.cached_property
    def _font(self) -> pygame.font.Font:
        """Font for one picture: it dies when another part of the program calls pygame.quit()."""
        self._pygame.font.init()
        name, height = self._pygame.font.get_default_font(), SUPERSAMPLING * self.text_height
        font: pygame.font.Font = self._pygame.font.Font(name, height)
        return font


@functools.lru_cache(256)
def _disc(colour: Colour, radius: int) -> pygame.Surface:
    """Disc of a radius [pixels of the larger picture], to be put down many times; what is around it is not painted."""
    library, around = import_pygame(), (0, 0, 0) if any(colour) else (1, 1, 1)
    disc: pygame.Surface = library.Surface((2 * radius + 1, 2 * radius + 1), depth=32)
    disc.fill(around)
    disc.set_colorkey(around, library.RLEACCEL)
    library.draw.circle(disc, colour, (radius, radius), radius)
    return disc


def _along(points: FloatArray, spacing: float) -> FloatArray:
    """Points [px], shape (m, 2), along the line through points [px], shape (n, 2), about a spacing [px] apart."""
    edges = np.diff(points, axis=0)
    arc_length = np.append(0.0, np.cumsum(np.hypot(edges[:, 0], edges[:, 1])))
    stations = np.linspace(0.0, arc_length[-1], 2 + int(arc_length[-1] / spacing))
    return np.column_stack([np.interp(stations, arc_length, points[:, axis]) for axis in (0, 1)])


def _apart(places: list[pygame.Rect]) -> list[pygame.Rect]:
    """Rectangles that do not overlap and cover all of these."""
    apart: list[pygame.Rect] = []
    for place in places:
        while (other := place.collidelist(apart)) >= 0:
            place = place.union(apart.pop(other))
        if place.width and place.height:
            apart.append(place)
    return apart


def mixed(colour: Colour, other: Colour, fraction: float) -> Colour:
    """Mixture of a fraction of one colour with the rest of another."""
    red, green, blue = (round(fraction * a + (1.0 - fraction) * b) for a, b in zip(colour, other, strict=True))
    return red, green, blue


def import_pygame() -> Any:
    """The module pygame; ImportError, with the command that installs it, where there is none."""
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    try:
        with held_back():
            import pygame
    except ImportError as missing:
        raise ImportError('Rendering needs pygame-ce: pip install "seastar-gym[render]".') from missing
    return pygame


class Window:
    """Window of pygame that opens with the first picture and stays closed once the user closed it.

    Where there is no display, pictures go nowhere, and a warning says so.
    """

    def __init__(self) -> None:
        self._pygame = import_pygame()
        self._surface: pygame.Surface | None = None
        self._clock = self._pygame.time.Clock()
        self._closed_by_user = False
        self.is_seen = True
        """Whether there is a display. It is not known before the first picture."""

    def is_wanted(self, size: tuple[int, int]) -> bool:
        """Whether there is a window to show a picture of this width and height [px] in; opens it where needed."""
        if self._closed_by_user:
            return False
        if not self.is_seen:
            return True
        if self._surface is None or self._surface is not self._pygame.display.get_surface():
            self._surface = self._open(size)
        if self.is_seen and any(event.type == self._pygame.QUIT for event in self._pygame.event.get()):
            self.close()
            self._closed_by_user = True
        return not self._closed_by_user

    def show(self, picture: pygame.Surface, fps: float | None) -> None:
        """Show a picture, and wait until 1/fps seconds have passed since the one before, where fps is given."""
        if self._surface is None:
            return
        self._surface.blit(picture, (0, 0))
        self._pygame.display.flip()
        if fps is not None:
            self._clock.tick(fps)

    def close(self) -> None:
        """Close the window, if one is open; may be called again."""
        if self._surface is not None:
            self._surface = None
            self._pygame.display.quit()

    def _open(self, size: tuple[int, int]) -> pygame.Surface | None:
        try:
            self._pygame.display.init()
            self._pygame.display.set_caption("SeastarSwim")
            self._require_display()
            surface: pygame.Surface = self._pygame.display.set_mode(size)
        except self._pygame.error as no_display:
            self.is_seen = False
            warnings.warn(
                f"No window can be opened here ({no_display}), so nobody sees the pictures: render with "
                'render_mode="rgb_array" instead, or write a film, seastar swim --film swim.mp4.',
                stacklevel=2,
            )
            return None
        return surface

    def _require_display(self) -> None:
        """Without a display, SDL draws where nobody looks; a pygame.error says so, unless that was asked for."""
        if self._pygame.display.get_driver() == "offscreen" and not os.environ.get("SDL_VIDEODRIVER"):
            self._pygame.display.quit()
            raise self._pygame.error("there is no display")
