"""Steers the robot, or that of --scene, with the keyboard. The picture says which keys there are.

Keys act at the next decision, and as long as they are held. Without a display, --keys "a a*5 1w up ." presses keys, one
word per decision, and --film writes what is seen.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.cli.screen import Show, outcome, rate, screen, show_all, wait
from seastar_gym.command import DEFAULT, command_parser, main_of
from seastar_gym.envs.canvas import import_pygame
from seastar_gym.envs.options import make_scene
from seastar_gym.envs.paths import PATH_HELP, load_path
from seastar_gym.gaits import lagged_gait, straight_gait
from seastar_gym.scene.checks import require_number
from seastar_gym.scene.scene import load_scene

if TYPE_CHECKING:
    from seastar_gym.cli.played import PlayedEnv

Floats = NDArray[np.float64]

# The row of digits turns limbs 1, 2, .. anti-clockwise (+), the row below clockwise (-). The third row swims along a
# limb for as long as it is held, by the lagged gait or, where decisions are strokes, the straight one; an arrow takes
# the limb that points most its way. Keys that are held together add up.
PLUS, MINUS, ALONG = "12345678", "qwertyui", "asdfghjk"
"""Keys of limbs 1, 2, .. by row: +, -, and swimming along the limb."""
ARROWS = {"right": (1.0, 0.0), "up": (0.0, 1.0), "left": (-1.0, 0.0), "down": (0.0, -1.0)}
"""Directions of the arrow keys in the picture."""
NOTHING = "."
"""Word for a decision without keys."""


def swimming_gait(decision_period: float, n_limbs: int) -> Floats:
    """Commands of a gait along limb 1, shape (n_decisions, n_limbs)."""
    try:
        return lagged_gait(decision_period, n_limbs)
    except ValueError:  # decisions that are no fraction of a second
        return straight_gait(n_limbs)


class Steering:
    """Commands of the keys that are held, decision by decision.

    decision_period: Time between decisions [s].
    """

    def __init__(self, decision_period: float, n_limbs: int):
        self._gait, self._n_limbs = swimming_gait(decision_period, n_limbs), n_limbs
        self._swum = 0

    def command(self, keys: Iterable[str], headings: Floats) -> NDArray[np.int64]:
        """Command, -1, 0 or 1 for every limb. headings: Directions of the limbs [rad], shape (n_limbs,)."""
        keys = sorted(keys)
        limbs = {limb for key in keys if (limb := self._along(key, headings)) is not None}
        stroke = self._gait[self._swum % len(self._gait)]
        self._swum = self._swum + 1 if limbs else 0
        command = np.zeros(self._n_limbs)
        for limb in limbs:
            command += np.roll(stroke, limb)
        for row, sign in ((PLUS, 1.0), (MINUS, -1.0)):
            command[[row.index(key) for key in keys if key in row[: self._n_limbs]]] += sign
        return np.sign(command).astype(np.int64)

    def _along(self, key: str, headings: Floats) -> int | None:
        """Limb, numbered from 0, along which a key swims; None for a key that does not."""
        if key in ARROWS:
            return int(np.argmax(np.stack([np.cos(headings), np.sin(headings)], axis=1) @ ARROWS[key]))
        return ALONG.index(key) if key in ALONG[: self._n_limbs] else None


def known_keys(n_limbs: int) -> set[str]:
    """Keys that mean a command."""
    return {*PLUS[:n_limbs], *MINUS[:n_limbs], *ALONG[:n_limbs], *ARROWS}


def typed(text: str, n_limbs: int) -> Iterator[set[str]]:
    """Keys of every decision, from words: "a", "1w" for keys held together, "up", "." for none, "a*5" for five times.

    ValueError, with one sentence, for a key that means nothing.
    """
    for word in text.split():
        keys, _, times = word.lower().partition("*")
        held = {keys} if keys in ARROWS else set(keys) - {NOTHING}
        if unknown := held - known_keys(n_limbs):
            raise ValueError(f"There is no key {min(unknown)!r}: {', '.join(sorted(known_keys(n_limbs)))} are known.")
        if times and not times.isdecimal():
            raise ValueError(f"A word such as a*5 says how often, {word!r} does not.")
        yield from [held] * (int(times) if times else 1)


def keys_help(n_limbs: int) -> list[tuple[str, str]]:
    """Keys and what they do, in lines."""
    spaced = [" ".join(row[:n_limbs].upper()) for row in (PLUS, MINUS, ALONG)]
    return [
        (spaced[0], f"limbs 1 to {n_limbs} turn +, anti-clockwise"),
        (spaced[1], f"limbs 1 to {n_limbs} turn \u2212, clockwise"),
        (spaced[2], f"swim along limb 1 to {n_limbs}"),
        ("arrows", "swim that way"),
        ("Z  F1  Esc", "begin anew, hide this, end"),
    ]


AGAIN, HELP, END = "z", "f1", "escape"
"""Keys that begin anew, show or hide the help, and end the game."""

PERIOD = 0.2
"""Time between decisions of the chapter's robot [s]."""

Held = Callable[[], set[str] | None]
"""Function that gives the keys for the next decision; None ends the game."""


def parser() -> argparse.ArgumentParser:
    """Parser of the options."""
    found = command_parser("seastar play", __doc__)
    found.add_argument("--path", default="pentagon", help=f"{PATH_HELP} {DEFAULT}")
    found.add_argument("--scene", type=Path, help="file of the robot's scene, .py or .json (default: the chapter's)")
    found.add_argument(
        "--decision-period", type=float,
        help=f"time between decisions [s] (default: {PERIOD:g}, or a stroke of the robot of --scene)",
    )  # fmt: skip
    found.add_argument("--speed", type=float, default=1.0, help=f"multiple of real time {DEFAULT}")
    found.add_argument("--keys", help="keys that are pressed, a word per decision, instead of the keyboard")
    found.add_argument("--film", type=Path, help="file of a film, .mp4 or .gif, instead of a window; needs --keys")
    found.add_argument("--seed", type=int, default=0, help=f"seed of a random path {DEFAULT}")
    return found


class Keyboard:
    """Keys that were down at any time since the last decision."""

    def __init__(self, env: PlayedEnv):
        self._pygame, self._env, self._held = import_pygame(), env, set[str]()
        self._ended = False
        names = {*known_keys(env.scene.robot.n_limbs), AGAIN, END}
        self._codes = {name: self._pygame.key.key_code(name) for name in names}
        self._help = self._pygame.key.key_code(HELP)

    def watch(self, show: Show) -> Show:
        """Function that shows a picture and looks at the keyboard after it."""

        def look(picture: Any) -> bool:
            self._ended = not show(picture) or self._ended
            if not self._ended:
                self._look()
            return not self._ended

        return look

    def _look(self) -> None:
        pressed = self._pygame.key.get_pressed()
        self._held |= {name for name, code in self._codes.items() if pressed[code]}
        self._env.help = self._env.help != bool(self._pygame.key.get_just_pressed()[self._help])
        self._ended = END in self._held

    def __call__(self) -> set[str] | None:
        """Keys for the next decision; None once the game was ended."""
        held, self._held = self._held, set()
        return None if self._ended else held


def game(env: PlayedEnv, show: Show, held: Held, seed: int) -> dict[str, Any]:
    """Play until the keys end; returns the last info. A path that is completed begins anew with its key."""
    _, info = env.reset(seed=seed)
    over, steering = False, Steering(env.decision_period, env.scene.robot.n_limbs)
    show_all(env, show)
    while (keys := held()) is not None:
        if AGAIN in keys:
            _, info = env.reset(seed=seed)
            over = False
        elif not over:
            command = steering.command(keys, env.limb_directions())
            _, _, over, _, info = env.step(np.where(command < 0, 2, command))
        elif not show(env.last_picture):
            break
        show_all(env, show)
    return info


def play(options: argparse.Namespace) -> str:
    """Play as the options say; returns a sentence on how it went."""
    for name in ("speed", "decision_period"):
        if getattr(options, name) is not None:
            require_number(f"--{name.replace('_', '-')}", getattr(options, name), "1")
    if options.film is not None and options.keys is None:
        raise ValueError('A film needs the keys that are pressed: --keys "a a*5 1w up .".')
    scene, period = None if options.scene is None else load_scene(options.scene), options.decision_period
    if period is None:
        period = PERIOD if scene is None else scene.actuator.period
    scene = make_scene(scene, None, period)
    path, (number, fps) = load_path(options.path), rate(options.film, period, options.speed)
    n_limbs = scene.robot.n_limbs
    if n_limbs > len(PLUS):
        raise ValueError(f"The keyboard has keys for {len(PLUS)} limbs, the robot of {options.scene} has {n_limbs}.")
    words = None if options.keys is None else iter(list(typed(options.keys, n_limbs)))
    with screen(options.film, fps) as show:
        if options.film is None:
            wait(show)
        from seastar_gym.cli.played import PlayedEnv  # numba, which takes a second, once there is a window

        env = PlayedEnv(keys_help(n_limbs), path=path, scene=scene, decision_period=period, frames_per_stroke=number)
        if words is None:
            keyboard = Keyboard(env)
            info = game(env, keyboard.watch(show), keyboard, options.seed)
        else:
            info = game(env, show, lambda: next(words, None), options.seed)
    said = outcome(env, info)
    env.close()
    return f"You reached {said}." if options.film is None else f"{said[0].upper()}{said[1:]}. Written: {options.film}."


main = main_of(parser, play)
