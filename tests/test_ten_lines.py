"""The first ten lines that a user reads run, show the shipped policy, and say what to do without a display."""

import runpy
from pathlib import Path

import gymnasium as gym
import pygame
import pytest

import seastar_gym
from seastar_gym.envs.seastar_swim import SeastarSwimEnv

FILE = Path(seastar_gym.__file__).parents[1] / "examples" / "ten_lines.py"


@pytest.fixture
def short(monkeypatch):
    """The same lines with a waypoint that is near."""
    pygame.display.quit()
    make = gym.make
    monkeypatch.setattr(gym, "make", lambda id, **arguments: make(id, path=[[0.03, 0.0]], fidelity="fast", **arguments))
    yield
    pygame.display.quit()


def test_they_are_ten_and_show_the_policy_that_arrives(short, monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    shown = []
    monkeypatch.setattr(SeastarSwimEnv, "_draw_frame", lambda env: shown.append(env.render_mode))
    assert sum(bool(line.strip()) for line in FILE.read_text(encoding="utf-8").splitlines()[4:]) <= 11
    left = runpy.run_path(str(FILE))
    assert left["terminated"] and left["info"]["is_success"]
    assert set(shown) == {"human"} and len(shown) > 10


def test_without_a_display_they_say_what_to_do(short, monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "no-such-driver")
    with pytest.warns(UserWarning, match=r"No window can be opened .* or write a film, seastar swim --film swim.mp4"):
        runpy.run_path(str(FILE))
