"""Films: pictures one after another into a file, MP4 by ffmpeg or animated GIF by Pillow."""

import os
import zlib
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.files import beside, require_extra, require_place
from seastar_gym.scene.checks import require_file, require_number, shown

Picture = NDArray[np.uint8]
"""Red, green and blue, shape (height, width, 3)."""

CLOSING_SECONDS = 1.5
"""How long a film rests on its last picture."""
SHORTEST = 2
"""Hundredths of a second that a picture of a GIF lasts at least: viewers slow down what is shorter."""
SLOWEST, FASTEST = 0.01, 1000.0
"""Fewest and most pictures per second."""
SCALE = 2
"""Pixels of a picture that become one of a GIF, each way."""
COLOURS = 64
"""Colours of a GIF. Half of them are the most frequent ones: flat areas, small ones too, keep their colour."""
SAMPLE = 32
"""Number of pictures, at equal intervals, from which the colours of a GIF are taken."""


def film_format(file: Path) -> str:
    """Format that a file's ending asks for, ".mp4" or ".gif", once what writes it is known to be there."""
    ending = file.suffix.lower()
    if ending not in (".mp4", ".gif"):
        raise ValueError(f"A film is an .mp4 or a .gif, not {file.name}.")
    require_extra("Films", "render", *(("imageio", "imageio_ffmpeg") if ending == ".mp4" else ("PIL",)))
    return ending


@contextmanager
def film(file: str | os.PathLike[str], fps: float) -> Iterator[Callable[[Picture], None]]:
    """Context that gives a function to add pictures with; the film rests on its last one. Without any, none is written.

    fps: Pictures per second. A picture of a GIF lasts two hundredths of a second or more: of more than 50, some are
    left out.
    """
    require_file("file", file)
    require_number("fps", fps, "1/s")
    if not SLOWEST <= fps <= FASTEST:
        raise ValueError(f"fps must be from {SLOWEST:g} to {FASTEST:g} pictures per second, not {shown(fps)}.")
    file = Path(file)
    require_place(file)
    write = _mp4 if film_format(file) == ".mp4" else _gif
    with write(file, fps) as add:
        last: list[Picture] = []

        def keep(picture: Picture) -> None:
            is_array = isinstance(picture, np.ndarray) and picture.dtype == np.uint8
            if not is_array or picture.ndim != 3 or picture.shape[2] != 3 or not picture.size:
                raise ValueError(
                    "A picture must be an array of red, green and blue from 0 to 255, shape (height, width, 3)."
                )
            last[:] = [picture]
            add(picture)

        yield keep
        for picture in last * round(CLOSING_SECONDS * fps):
            add(picture)


@contextmanager
def _mp4(file: Path, fps: float) -> Iterator[Callable[[Picture], None]]:
    import imageio.v2 as imageio

    fast = ["-preset", "veryfast"]
    with ExitStack() as files:
        movies: list[Any] = []

        def add(picture: Picture) -> None:
            if not movies:
                part = files.enter_context(beside(file, ".mp4"))
                movies.append(imageio.get_writer(
                    part, format="FFMPEG", mode="I", fps=fps, codec="libx264", quality=7, output_params=fast
                ))  # fmt: skip
                files.enter_context(movies[0])
            movies[0].append_data(picture)

        yield add


@contextmanager
def _gif(file: Path, fps: float) -> Iterator[Callable[[Picture], None]]:
    """Pictures are kept, small and compressed, until the colours of the whole film are known."""
    kept: list[tuple[bytes, tuple[int, ...]]] = []

    def add(picture: Picture) -> None:
        small = shrunk(picture)
        kept.append((zlib.compress(small.tobytes(), 1), small.shape))

    yield add
    if kept:
        write_gif([np.frombuffer(zlib.decompress(data), np.uint8).reshape(shape) for data, shape in kept], file, fps)


def shrunk(picture: Picture) -> Picture:
    """Picture of fewer pixels, each the mean of SCALE times SCALE."""
    height, width, colours = picture.shape
    blocks = picture[: height - height % SCALE, : width - width % SCALE].reshape(
        height // SCALE, SCALE, width // SCALE, SCALE, colours
    )
    return blocks.mean(axis=(1, 3)).astype(np.uint8)


def frequent_colours(picture: Picture, n: int) -> Picture:
    """The n most frequent colours of a picture, or as many as it has, shape (n, 3)."""
    numbers = picture.astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], np.uint32)
    colours, counts = np.unique(numbers, return_counts=True)
    most = colours[np.argsort(-counts, kind="stable")[:n]]
    return np.stack([most >> 16, most >> 8 & 255, most & 255], axis=1).astype(np.uint8)


def durations(number: int, fps: float) -> dict[int, int]:
    """Pictures of a GIF that are shown, of a number of them, and for how many hundredths of a second each.

    A picture begins at the hundredth next to its time; one that would not last SHORTEST is left out, unless it is the
    first.
    """
    begins, last = {0: 0}, 0
    for k in range(1, number):
        begin = round(100.0 * k / fps)
        if begin - last >= SHORTEST:
            begins[k] = last = begin
    ends = [*list(begins.values())[1:], max(round(100.0 * number / fps), last + SHORTEST)]
    return {k: end - begin for (k, begin), end in zip(begins.items(), ends, strict=True)}


def write_gif(pictures: list[Picture], file: Path, fps: float) -> None:
    """Write an animated GIF whose pictures share one palette, made of some of them."""
    from PIL import Image

    times = durations(len(pictures), fps)
    pictures = [pictures[k] for k in times]
    some = np.unique(np.linspace(0, len(pictures) - 1, SAMPLE).round().astype(int))
    sample = np.concatenate([pictures[k] for k in some], axis=0)
    blends = Image.fromarray(sample).quantize(COLOURS // 2, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    palette = Image.new("P", (1, 1))
    palette.putpalette(frequent_colours(sample, COLOURS // 2).tobytes() + bytes(blends.getpalette() or ()))
    images = [Image.fromarray(picture).quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    shown_for = [10 * time for time in times.values()]
    with beside(file) as part:
        images[0].save(part, "GIF", save_all=True, append_images=images[1:], duration=shown_for, loop=0, optimize=True)
