"""Where pictures go: into a window, or into the file of a film."""

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from seastar_gym.envs.canvas import INK, WATER, Canvas, Window, import_pygame
from seastar_gym.evaluation.films import Picture, film, film_format

if TYPE_CHECKING:
    import gymnasium as gym

SIZE = (960, 720)
"""Width and height of a window [px]."""
FPS, GIF_FPS = 30, 20
"""Pictures per second of a window or an MP4, and of a GIF."""

Show = Callable[[Picture], bool]
"""Function that shows a picture; False once nobody looks any more."""


def rate(file: Path | None, decision_period: float, speed: float) -> tuple[int, float]:
    """Number of pictures of a decision, and pictures per second, at a speed in multiples of real time."""
    wanted = FPS if file is None or film_format(file) == ".mp4" else GIF_FPS
    number = max(1, round(wanted * decision_period / speed))
    return number, number * speed / decision_period


@contextmanager
def screen(file: Path | None, fps: float) -> Iterator[Show]:
    """Context that gives a function to show pictures with: in a film, or in a window if there is no file.

    ValueError, with what to do instead, where no window can be opened.
    """
    if file is None:
        with _window(fps) as show:
            yield show
        return
    with film(file, fps) as add:

        def keep(picture: Picture) -> bool:
            add(picture)
            return True

        yield keep


@contextmanager
def _window(fps: float) -> Iterator[Show]:
    pygame, window = import_pygame(), Window()
    with warnings.catch_warnings(action="ignore"):
        window.is_wanted(SIZE)
    if not window.is_seen:
        raise ValueError("No window can be opened here: write a film, --film swim.mp4 or swim.gif.")

    def show(picture: Picture) -> bool:
        if not window.is_wanted(SIZE):
            return False
        height, width, _ = picture.shape
        window.show(pygame.image.frombuffer(picture.tobytes(), (width, height), "RGB"), fps)
        return True

    yield show
    window.close()


def wait(show: Show) -> None:
    """Show that something begins: machine code of the simulator takes a while to load, and longer to be made."""
    canvas = Canvas(SIZE, 24)
    canvas.begin(WATER)
    for line, text in enumerate(("Starting ...", "The first start on a machine compiles the simulator.")):
        canvas.write(text, (SIZE[0] / 2, SIZE[1] / 2 + 40 * line), INK, (0.5, 0.5))
    canvas.finish()
    show(canvas.pixels())


def show_all(env: "gym.Env[Any, Any]", show: Show) -> bool:
    """Show the pictures since the last call; False once nobody looks any more."""
    pictures: Any = env.render()
    return all(show(picture) for picture in pictures or ())


def outcome(env: Any, info: dict[str, Any]) -> str:
    """How an episode went, in words: waypoints, or whether a task without them was done."""
    if "waypoint_index" in info:
        how = f"{info['waypoint_index']} of {len(env.waypoints)} waypoints"
    else:
        how = "done" if info["is_success"] else "not done"
    return f"{how} in {info['time']:.1f} s"
