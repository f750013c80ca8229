"""Pictures of a swim, drawn with pygame: off-screen as arrays, or in a window.

pygame is imported when a Renderer is made, so that this module, and an environment that draws nothing, do without it.
Lengths are in metres, y is up; pixels count from the upper left corner, y down.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    import pygame

FloatArray = NDArray[np.float64]
Colour = tuple[int, int, int]

WATER: Colour = (250, 252, 254)
INK: Colour = (58, 64, 74)
FAINT_INK: Colour = (128, 136, 148)
LIMB: Colour = (70, 77, 88)
HEATED_PLUS: Colour = (23, 62, 196)
HEATED_MINUS: Colour = (38, 148, 240)
TRAIL: Colour = (212, 120, 130)
PLANNED: Colour = (190, 198, 208)

DONE, TO_COME, CURRENT = range(3)
"""States of a waypoint."""
STATE_COLOURS: tuple[Colour, Colour, Colour] = ((46, 157, 98), (150, 158, 170), (232, 119, 10))

SUPERSAMPLING = 3
"""Pictures are painted this many times larger and smoothed down."""
VIEW_MARGIN = 1.1
"""Room [limb lengths] around the start and the waypoints, so that a robot that rests on one of them is in view."""
REFIT_MARGIN = 0.5
"""Room [limb lengths] gained beyond a robot that left the view, so that the view moves in few steps."""


@dataclass(frozen=True, eq=False)
class Frame:
    """What one picture shows."""

    positions: FloatArray
    """Node positions [m], shape (n_nodes, 2)."""
    command: FloatArray
    """Command of the current stroke in [-1, 1], shape (n_limbs,); + is anti-clockwise."""
    trail: FloatArray
    """Where the hub has been [m], shape (k, 2), oldest first; k may be 0."""
    waypoint_index: int
    """The waypoint that the robot swims to; the number of waypoints once all are reached."""
    time: float
    """Simulated time [s]."""


def limb_nodes(n_limbs: int, nodes_per_limb: int) -> NDArray[np.int_]:
    """Node numbers of every limb from the hub to the tip, shape (n_limbs, nodes_per_limb)."""
    beyond_the_hub = 1 + np.arange(n_limbs * (nodes_per_limb - 1)).reshape(n_limbs, -1)
    return np.hstack([np.zeros((n_limbs, 1), int), beyond_the_hub])


class Camera:
    """Maps metres to pixels of a viewport: one scale for x and y, the box [m] that was fitted in the middle."""

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

    def sees(self, points: FloatArray) -> bool:
        """Whether all points [m], shape (n, 2), lie in the viewport."""
        left, top, width, height = self.viewport
        pixels = self.to_pixels(points)
        return bool(np.all(pixels >= [left, top]) and np.all(pixels <= [left + width, top + height]))

    def widened(self, points: FloatArray, margin: float) -> Camera:
        """A camera that sees what this one was fitted to and points [m], shape (n, 2), with a margin [m] around."""
        return Camera(np.concatenate([self.corners, points - margin, points + margin]), self.viewport)


class Renderer:
    """Draws a robot on its path.

    `draw` returns an array and needs no display; `show` draws into a window. The view is fitted to the path, and
    widened in steps where a robot leaves it; `reset` sets a new path and fits the view anew.
    """

    def __init__(
        self,
        limb_nodes: ArrayLike,
        waypoints: ArrayLike,
        *,
        limb_length: float,
        rod_radius: float,
        waypoint_radius: float,
        size: tuple[int, int] = (960, 720),
    ) -> None:
        """
        limb_nodes: Node numbers of every limb from the hub to the tip, shape (n_limbs, nodes_per_limb).
        waypoints: Planned path from the origin [m], shape (n, 2).
        limb_length, rod_radius, waypoint_radius: Sizes of the robot and of the waypoints [m].
        size: Width and height of the picture [px].
        """
        if size[0] < 320 or size[1] < 240:
            raise ValueError(f"A picture must be at least 320 x 240 pixels, not {size[0]} x {size[1]}.")
        self._pygame = _import_pygame()
        self._limb_nodes = np.asarray(limb_nodes)
        self._limb_length, self._rod_radius, self._waypoint_radius = limb_length, rod_radius, waypoint_radius
        self.size = size
        self._text_height = max(12, round(0.027 * min(size)))
        self._canvas = self._pygame.Surface((SUPERSAMPLING * size[0], SUPERSAMPLING * size[1]), depth=32)
        self._picture = self._pygame.Surface(size, depth=32)
        self._window: pygame.Surface | None = None
        self._window_closed = False
        self._clock = self._pygame.time.Clock()
        self.reset(waypoints)

    def reset(
        self, waypoints: ArrayLike, limb_length: float | None = None, rod_radius: float | None = None
    ) -> None:
        """Takes a new path [m], shape (n, 2), and fits the view to it; and new sizes of the robot [m], where given."""
        self._limb_length = self._limb_length if limb_length is None else limb_length
        self._rod_radius = self._rod_radius if rod_radius is None else rod_radius
        self._waypoints = np.array(waypoints, dtype=np.float64)
        self._path = np.concatenate([np.zeros((1, 2)), self._waypoints])
        self._labels = _waypoint_labels(self._path)
        width, height = self.size
        strip = round(2.0 * self._text_height)
        margin = VIEW_MARGIN * self._limb_length
        corners = np.concatenate([self._path - margin, self._path + margin])
        self.camera = Camera(corners, (0, strip, width, height - 2 * strip))

    def draw(self, frame: Frame) -> NDArray[np.uint8]:
        """The picture of a frame: red, green, blue, shape (height, width, 3), a fresh array."""
        self._paint(frame)
        width, height = self.size
        pixels = np.frombuffer(self._pygame.image.tobytes(self._picture, "RGB"), dtype=np.uint8)
        return pixels.reshape(height, width, 3).copy()

    def show(self, frame: Frame, fps: float | None = None) -> bool:
        """Draws a frame into the window, which the first call opens; False, and no drawing, once the user closed it.

        fps: Where given, the call waits until 1/fps seconds have passed since the one before.
        """
        if self._window_closed:
            return False
        if self._window is None or self._window is not self._pygame.display.get_surface():
            self._window = self._open_window()
        if any(event.type == self._pygame.QUIT for event in self._pygame.event.get()):
            self.close()
            self._window_closed = True
            return False
        self._paint(frame)
        self._window.blit(self._picture, (0, 0))
        self._pygame.display.flip()
        if fps is not None:
            self._clock.tick(fps)
        return True

    def close(self) -> None:
        """Closes the window, if one is open; may be called again."""
        if self._window is not None:
            self._window = None
            self._pygame.display.quit()

    def _open_window(self) -> pygame.Surface:
        try:
            self._pygame.display.init()
            self._pygame.display.set_caption("SeastarSwim")
            window: pygame.Surface = self._pygame.display.set_mode(self.size)
        except self._pygame.error as no_display:
            raise RuntimeError(
                f'No window can be opened here ({no_display}): render with render_mode="rgb_array" instead.'
            ) from no_display
        return window

    def _paint(self, frame: Frame) -> None:
        self._check(frame)
        self._font = self._new_font()
        if not self.camera.sees(frame.positions):
            self.camera = self.camera.widened(frame.positions, REFIT_MARGIN * self._limb_length)
        self._canvas.fill(WATER)
        self._paint_planned_path()
        self._paint_waypoints(frame.waypoint_index)
        self._paint_trail(frame.trail)
        self._number_waypoints(frame.waypoint_index)
        self._paint_robot(frame)
        self._name_heated_limbs(frame)
        self._write_header(frame)
        self._write_footer()
        self._pygame.transform.smoothscale(self._canvas, self.size, self._picture)

    def _check(self, frame: Frame) -> None:
        n_limbs, nodes_per_limb = self._limb_nodes.shape
        n_nodes = n_limbs * (nodes_per_limb - 1) + 1
        if frame.positions.shape != (n_nodes, 2) or not np.isfinite(frame.positions).all():
            raise ValueError(f"Positions to draw must be finite and of shape ({n_nodes}, 2).")
        if frame.command.shape != (n_limbs,):
            raise ValueError(f"A command to draw must have shape ({n_limbs},), not {frame.command.shape}.")
        if frame.trail.ndim != 2 or frame.trail.shape[1] != 2 or not np.isfinite(frame.trail).all():
            raise ValueError("A trail to draw must be finite and of shape (k, 2).")

    def _new_font(self) -> pygame.font.Font:
        """Made for every picture: a font dies when another part of the program calls pygame.quit()."""
        self._pygame.font.init()
        name, height = self._pygame.font.get_default_font(), SUPERSAMPLING * self._text_height
        font: pygame.font.Font = self._pygame.font.Font(name, height)
        return font

    def _paint_planned_path(self) -> None:
        for start, end in zip(self._path[:-1], self._path[1:], strict=True):
            for dash in _dashes(self.camera.to_pixels([start, end]), 0.45 * self._text_height):
                self._stroke(dash, PLANNED, width=2.0)
        self._dot(self.camera.to_pixels([0.0, 0.0]), PLANNED, radius=max(2.5, 0.16 * self._text_height))

    def _paint_waypoints(self, waypoint_index: int) -> None:
        radius = self._ring_radius()
        # Where a path passes a point twice, the current waypoint is drawn over one to come, and that over one done.
        for state, index in sorted((_state(index, waypoint_index), index) for index in range(len(self._waypoints))):
            centre = self.camera.to_pixels(self._waypoints[index])
            line = 3.0 if state == CURRENT else 2.0
            self._dot(centre, STATE_COLOURS[state], radius + line / 2)
            self._dot(centre, _mixed(STATE_COLOURS[state], WATER, 0.15), radius - line / 2)

    def _ring_radius(self) -> float:
        return max(4.0, self._waypoint_radius * self.camera.scale)

    def _paint_trail(self, trail: FloatArray) -> None:
        if len(trail) > 1:
            points = np.rint(SUPERSAMPLING * self.camera.to_pixels(trail) - 0.5)
            self._pygame.draw.lines(self._canvas, TRAIL, False, points.tolist(), 2 * SUPERSAMPLING)

    def _paint_robot(self, frame: Frame) -> None:
        limbs = self.camera.to_pixels(frame.positions[self._limb_nodes])
        width = max(0.16 * self._text_height, 2 * self._rod_radius * self.camera.scale)
        widths = width * np.where(frame.command == 0.0, 1.0, 1.6)
        for limb, limb_width in zip(limbs, widths, strict=True):
            self._stroke(limb, WATER, limb_width + 3.0)  # a rim that lifts the robot off its trail
        for limb, limb_width, command in sorted(
            zip(limbs, widths, frame.command, strict=True), key=lambda drawn: abs(drawn[2])
        ):
            self._stroke(limb, _limb_colour(command), limb_width)
        self._dot(limbs[0, 0], LIMB, radius=1.3 * width)

    def _stroke(self, points: FloatArray, colour: Colour, width: float) -> None:
        """A thick line through points [px], shape (n, 2), with round joints and ends.

        It is a row of discs: pygame's own thick lines and polygons come out up to a fifth thinner in some directions.
        """
        radius = max(1, round(0.5 * SUPERSAMPLING * width))
        for centre in np.rint(SUPERSAMPLING * _along(points, 2.0 / SUPERSAMPLING)).tolist():
            self._pygame.draw.circle(self._canvas, colour, centre, radius)

    def _dot(self, centre: FloatArray, colour: Colour, radius: float) -> None:
        x, y = np.rint(SUPERSAMPLING * centre).tolist()
        self._pygame.draw.circle(self._canvas, colour, (x, y), round(SUPERSAMPLING * radius))

    def _number_waypoints(self, waypoint_index: int) -> None:
        for label in self._labels:
            text = ", ".join(str(index + 1) for index in label.indices)
            half_extent = 0.5 * np.abs(label.direction) @ self._text_size(text)
            distance = self._ring_radius() + 0.1 * self._text_height + half_extent
            place = self.camera.to_pixels(label.place) + distance * label.direction * [1.0, -1.0]
            colour = STATE_COLOURS[max(_state(index, waypoint_index) for index in label.indices)]
            self._write(text, place, _mixed(colour, INK, 0.6), (0.5, 0.5))

    def _name_heated_limbs(self, frame: Frame) -> None:
        last_edges = frame.positions[self._limb_nodes[:, -1]] - frame.positions[self._limb_nodes[:, -2]]
        angles = np.arctan2(last_edges[:, 1], last_edges[:, 0])
        outward = np.column_stack([np.cos(angles), -np.sin(angles)])
        places = self.camera.to_pixels(frame.positions[self._limb_nodes[:, -1]]) + 1.1 * self._text_height * outward
        for limb in np.flatnonzero(frame.command):
            command = frame.command[limb]
            self._write(f"{limb + 1}{_sign(command)}", places[limb], _limb_colour(command), (0.5, 0.5))

    def _write_header(self, frame: Frame) -> None:
        width, _ = self.size
        middle = 1.1 * self._text_height
        self._write(f"t = {frame.time:.1f} s", (self._text_height, middle), INK, (0.0, 0.5))
        self._write(self._progress(frame.waypoint_index), (width - self._text_height, middle), INK, (1.0, 0.5))
        heated = [(f" {limb + 1}{_sign(c)}", _limb_colour(c)) for limb, c in enumerate(frame.command) if c != 0.0]
        words = [("heated:", INK), *(heated or [(" none", FAINT_INK)])]
        x = 0.5 * (width - sum(self._text_size(text)[0] for text, _ in words))
        for text, colour in words:
            x = self._write(text, (x, middle), colour, (0.0, 0.5))

    def _progress(self, waypoint_index: int) -> str:
        n_waypoints = len(self._waypoints)
        if waypoint_index < n_waypoints:
            return f"waypoint {waypoint_index + 1} of {n_waypoints}"
        return "path completed"

    def _write_footer(self) -> None:
        width, height = self.size
        gap, middle = self._text_height, height - 1.1 * self._text_height
        length = _round_length(0.13 * width / self.camera.scale)
        end = gap + length * self.camera.scale
        self._scale_bar(gap, end, middle)
        end = self._write(f"{1000.0 * length:g} mm", (end + 0.5 * gap, middle), INK, (0.0, 0.5))
        words = [("+ anti-clockwise", HEATED_PLUS), ("\u2212 clockwise", HEATED_MINUS)]
        x = width - sum(self._text_size(text)[0] + 2.9 * gap for text, _ in words)
        if x < end + gap:
            return  # a picture too narrow for the legend
        for text, colour in words:
            self._stroke(np.array([[x, middle], [x + 1.2 * gap, middle]]), colour, width=0.4 * gap)
            x = self._write(text, (x + 1.9 * gap, middle), INK, (0.0, 0.5)) + gap

    def _scale_bar(self, start: float, end: float, middle: float) -> None:
        tick = 0.3 * self._text_height
        self._stroke(np.array([[start, middle], [end, middle]]), INK, width=2.0)
        for x in (start, end):
            self._stroke(np.array([[x, middle - tick], [x, middle + tick]]), INK, width=2.0)

    def _text_size(self, text: str) -> FloatArray:
        return np.array(self._font.size(text)) / SUPERSAMPLING

    def _write(self, text: str, place: ArrayLike, colour: Colour, anchor: tuple[float, float]) -> float:
        """Writes text with its anchor (0 to 1 from the upper left) at a place [px]; returns where it ends in x [px]."""
        written = self._font.render(text, True, colour)
        corner = np.rint(SUPERSAMPLING * np.asarray(place) - np.array(anchor) * written.get_size())
        self._canvas.blit(written, corner.tolist())
        return (float(corner[0]) + written.get_width()) / SUPERSAMPLING


@dataclass(frozen=True, eq=False)
class _Label:
    """The number of a waypoint, or the numbers of several at one place, and where there is room to write it."""

    indices: tuple[int, ...]
    place: FloatArray
    direction: FloatArray
    """Unit vector, y up: the middle of the widest sector free of the path."""


def _waypoint_labels(path: FloatArray) -> list[_Label]:
    """Labels of a path [m], shape (n + 1, 2), that begins with its start."""
    same_place = 1e-9 + 1e-6 * float(np.ptp(path, axis=0).max())
    labels, labelled = [], set()
    for waypoint in range(1, len(path)):
        if waypoint in labelled:
            continue
        together = np.flatnonzero(np.hypot(*(path - path[waypoint]).T) <= same_place)
        labelled.update(together.tolist())
        neighbours = path[[n for node in together for n in (node - 1, node + 1) if 0 <= n < len(path)]]
        direction = _widest_free_direction(neighbours - path[waypoint])
        labels.append(_Label(tuple(int(node) - 1 for node in together if node > 0), path[waypoint], direction))
    return labels


def _widest_free_direction(legs: FloatArray) -> FloatArray:
    angles = np.sort(np.arctan2(legs[:, 1], legs[:, 0]))
    sectors = np.diff(np.append(angles, angles[0] + 2.0 * np.pi))
    # Sectors that differ only by rounding count as equal.
    widest = int(np.argmax(np.round(sectors, 6)))
    middle = angles[widest] + 0.5 * sectors[widest]
    return np.array([np.cos(middle), np.sin(middle)])


def _along(points: FloatArray, spacing: float) -> FloatArray:
    """Points [px], shape (m, 2), along the line through points [px], shape (n, 2), about a spacing [px] apart."""
    edges = np.diff(points, axis=0)
    arc_length = np.append(0.0, np.cumsum(np.hypot(edges[:, 0], edges[:, 1])))
    stations = np.linspace(0.0, arc_length[-1], 2 + int(arc_length[-1] / spacing))
    return np.column_stack([np.interp(stations, arc_length, points[:, axis]) for axis in (0, 1)])


def _dashes(ends: FloatArray, length: float) -> FloatArray:
    """Dashes of about a length [px] along a segment [px], shape (2, 2): shape (n, 2, 2); both ends begin a dash."""
    start, end = ends
    n_dashes = max(1, round((float(np.hypot(*(end - start))) / length + 1.0) / 2.0))
    fractions = np.arange(2 * n_dashes).reshape(n_dashes, 2) / (2 * n_dashes - 1)
    dashes: FloatArray = start + fractions[..., None] * (end - start)
    return dashes


def _round_length(longest: float) -> float:
    """The longest length [m] among 1, 2, 5, 10, ... that is no longer than this one."""
    decade = 10.0 ** np.floor(np.log10(longest))
    return float(decade * max(digit for digit in (1.0, 2.0, 5.0) if digit * decade <= longest))


def _state(index: int, waypoint_index: int) -> int:
    if index == waypoint_index:
        return CURRENT
    return TO_COME if index > waypoint_index else DONE


def _limb_colour(command: float) -> Colour:
    if command == 0.0:
        return LIMB
    return HEATED_PLUS if command > 0.0 else HEATED_MINUS


def _sign(command: float) -> str:
    if command == 0.0:
        return ""
    return "+" if command > 0.0 else "\u2212"


def _mixed(colour: Colour, other: Colour, fraction: float) -> Colour:
    """A fraction of a colour, the rest of the other one."""
    red, green, blue = (round(fraction * a + (1.0 - fraction) * b) for a, b in zip(colour, other, strict=True))
    return red, green, blue


def _import_pygame() -> Any:
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    try:
        import pygame
    except ImportError as missing:
        raise ImportError('Rendering needs pygame-ce: pip install "seastar-gym[render]".') from missing
    return pygame
