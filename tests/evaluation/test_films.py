"""Films have their pictures, in their order and for their time."""

import sys

import numpy as np
import pytest
from PIL import Image

from refusals import assert_refused
from seastar_gym.evaluation.films import CLOSING_SECONDS, film, film_format, frequent_colours, shrunk, write_gif

BLUE, RED = np.array([20, 60, 200], np.uint8), np.array([200, 30, 30], np.uint8)


def picture(colour, column):
    """A picture with a bar at a column."""
    made = np.full((96, 128, 3), 250, np.uint8)
    made[:, column : column + 16] = colour
    return made


@pytest.mark.parametrize("fps", [10.0, 25.0])
def test_a_gif_shows_every_picture_and_rests_on_the_last(tmp_path, fps):
    pictures = [picture(BLUE, 0), picture(RED, 40), picture(BLUE, 80)]
    with film(tmp_path / "film.gif", fps) as add:
        for one in pictures:
            add(one)
    with Image.open(tmp_path / "film.gif") as shown:
        times = []
        for number in range(shown.n_frames):
            shown.seek(number)
            times.append(shown.info["duration"])
            if number < 3:
                np.testing.assert_allclose(np.asarray(shown.convert("RGB")), shrunk(pictures[number]), atol=12)
    assert times[:2] == [round(1000 / fps)] * 2
    assert sum(times[2:]) == pytest.approx(1000 * (1 / fps + CLOSING_SECONDS), rel=0.1)


def test_a_small_flat_area_keeps_its_colour_among_many_others(tmp_path):
    """As a waypoint does, whose pale fill is near the paper's colour, beside lines that are blended."""
    many = np.full((120, 160, 3), 250, np.uint8)
    many[20:100, 20:140] = np.random.default_rng(0).integers(0, 255, (80, 120, 3))
    pale = np.array([219, 231, 245], np.uint8)
    many[4:12, 4:12] = pale
    assert frequent_colours(many, 2).tolist() == [[250] * 3, pale.tolist()]
    write_gif([many], tmp_path / "film.gif", 10.0)
    with Image.open(tmp_path / "film.gif") as shown:
        np.testing.assert_array_equal(np.asarray(shown.convert("RGB"))[8, 8], pale)


def test_a_small_picture_is_the_mean_of_blocks():
    made = np.zeros((3, 4, 3), np.uint8)
    made[0, 0] = 100
    assert shrunk(made).tolist() == [[[25] * 3, [0] * 3]]


def test_no_picture_makes_no_gif(tmp_path):
    with film(tmp_path / "film.gif", 10.0):
        pass
    assert not (tmp_path / "film.gif").exists()


def test_other_files_and_missing_writers_are_refused(tmp_path, monkeypatch):
    with assert_refused("A film is an .mp4 or a .gif, not film.webm."):
        film_format(tmp_path / "film.webm")
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    monkeypatch.setattr("seastar_gym.extras.find_spec", lambda name: None if name == "imageio_ffmpeg" else name)
    with pytest.raises(ModuleNotFoundError, match=r"Films need imageio_ffmpeg: pip install .*\[render\]"):
        film_format(tmp_path / "film.mp4")
    assert film_format(tmp_path / "film.GIF") == ".gif"
