"""Film of the same robot twice round the pentagon: by the chapter's gait, and by limbs heated at times of their own.

Draws both side by side, at the same simulated time, until the faster one has arrived, and writes an animated GIF.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.policy import in_the_box, load
from agents.scripted import scripted
from agents.swim import Policy
from seastar_gym.command import run_command
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from studies.parser import study_parser

Picture = NDArray[np.uint8]

BETWEEN = 0.4
"""Simulated time between two frames [s]."""
FPS = 20
"""Frames per second of the film: eight times as fast as the robot."""
REST = 20
"""Frames for which the film rests on its end."""
SCALE = 2
"""Pixels of a rendered picture that become one, each way."""
COLOURS = 48
"""Colours of the film."""


def frames(policy: Policy, per_decision: int, **arguments: Any) -> Iterator[Picture]:
    """Pictures of a swim round the pentagon every BETWEEN seconds, and that of its end.

    per_decision: Number of parts of BETWEEN/2 in a decision.
    """
    env = SeastarSwimEnv(render_mode="rgb_array_list", frames_per_stroke=per_decision, **arguments)
    observation, _ = env.reset(seed=0)
    env.render()  # the first picture is of the robot at rest
    state, is_over, drawn = None, False, 0
    while not is_over:
        action, state = policy.predict(observation, state, deterministic=True)
        observation, _, is_over, _, _ = env.step(action)
        for picture in env.render() or []:
            drawn += 1
            if drawn % 2 == 0:
                yield shrunk(picture)
    env.close()
    yield shrunk(picture)


def shrunk(picture: Picture) -> Picture:
    """Picture of fewer pixels, each the mean of SCALE times SCALE."""
    height, width, colours = picture.shape
    blocks = picture[: height - height % SCALE, : width - width % SCALE].reshape(
        height // SCALE, SCALE, width // SCALE, SCALE, colours
    )
    return blocks.mean(axis=(1, 3)).astype(np.uint8)


def side_by_side(left: Iterator[Picture], right: Iterator[Picture], most: int | None = None) -> list[Picture]:
    """Pictures beside each other, until the swim on the right is over."""
    film = []
    for k, (one, other) in enumerate(zip(left, right, strict=False)):
        if most is not None and k >= most:
            break
        film.append(np.concatenate([one, other], axis=1))
    return film


def write_gif(film: list[Picture], file: Path) -> None:
    """Write an animated GIF whose frames share one palette, made of the first, the middle and the last of them."""
    from PIL import Image

    sample = np.concatenate([film[0], film[len(film) // 2], film[-1]], axis=0)
    palette = Image.fromarray(sample).quantize(COLOURS, dither=Image.Dither.NONE)
    images = [Image.fromarray(picture).quantize(palette=palette, dither=Image.Dither.NONE) for picture in film]
    images += [images[-1]] * REST
    images[0].save(file, save_all=True, append_images=images[1:], duration=1000 // FPS, loop=0, optimize=True)


def main() -> None:
    """Command line: draw and write the film."""
    parser: argparse.ArgumentParser = study_parser("studies.scenes.film", __doc__)
    parser.add_argument("--decision-period", type=float, default=0.2, help="of the policy on the right [s]")
    parser.add_argument("--frames", type=int, default=None, help="largest number of frames")
    parser.add_argument("--out", type=Path, default=Path("docs/swim.gif"), help="file (default: %(default)s)")
    options = parser.parse_args()
    parts = round(2 * options.decision_period / BETWEEN)
    if not np.isclose(parts * BETWEEN, 2 * options.decision_period) or parts == 0:
        parser.error(f"decisions must take a whole number of {BETWEEN / 2:g} s, not {options.decision_period:g} s.")
    policy = load(in_the_box(options.decision_period))
    gait = scripted("pentagon", policy.actions)
    chapter = frames(gait, round(2 / BETWEEN), actions=gait.actions, fidelity="balanced")
    learned = frames(policy, parts, actions=policy.actions, scene=policy.scene, decision_period=policy.decision_period)
    film = side_by_side(chapter, learned, options.frames)
    write_gif(film, options.out)
    print(f"Written: {options.out}, {len(film)} frames of {BETWEEN} s.")


if __name__ == "__main__":
    run_command(main)
