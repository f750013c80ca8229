"""Film of the same robot twice round the pentagon: by the chapter's gait, and by limbs heated at times of their own.

Draws both side by side, at the same simulated time, until the faster one has arrived, and writes an animated GIF.
"""

from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from seastar_gym.controllers.contract import Policy
from seastar_gym.controllers.learned import bundled_file, load
from seastar_gym.controllers.open_loop import scripted
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.evaluation.films import Picture, shrunk, write_gif
from seastar_gym.evaluation.rollout import rollout
from studies.frame import Results, Study

LOOKS, BETWEEN = 0.2, 1.2
"""Simulated time between two looks, and between two frames [s]: strokes of 1 s are seen at other phases in turn."""
FPS = 7
"""Frames per second of the film: eight times as fast as the robot."""
NAME_AT, NAME_SIZE = 0.1, 16.0
"""Place of a name, as a share of the height, and its size [px]."""
REST = 7
"""Frames for which the film rests on its end."""


def frames(policy: Policy, per_decision: int, **arguments: Any) -> list[Picture]:
    """Pictures of a swim round the pentagon every BETWEEN seconds, and that of its end.

    per_decision: Number of looks in a decision.
    """
    each = round(BETWEEN / LOOKS)
    env = SeastarSwimEnv(render_mode="rgb_array_list", frames_per_stroke=per_decision, **arguments)
    drawn = list[Picture]()
    rollout(env, policy, seeds=0, on_step=lambda info: drawn.extend(map(shrunk, env.render() or [])))
    env.close()
    return [*drawn[each::each], drawn[-1]]  # the first picture is of the robot at rest


def named(picture: Picture, name: str) -> Picture:
    """The picture with a name at its top."""
    image = Image.fromarray(picture)
    place = (image.width // 2, NAME_AT * image.height)
    ImageDraw.Draw(image).text(place, name, (40, 48, 60), ImageFont.load_default(NAME_SIZE), anchor="mm")
    return np.asarray(image)


def run(results: Results) -> None:
    """Draw and write the film."""
    policy = load(bundled_file(0.2))
    gait = scripted("pentagon", policy.actions)
    # As `seastar swim` shows it, and at the same fidelity as the other.
    period = policy.decision_period
    learned = frames(policy, 1, actions=policy.actions, fidelity="balanced", decision_period=period)
    chapter = frames(gait, round(1.0 / LOOKS), actions=gait.actions, fidelity="balanced")
    left = [named(picture, "scripted gait, every second") for picture in chapter]
    right = [named(picture, "PPO policy, every 0.2 s") for picture in learned]
    film = [np.concatenate(both, axis=1) for both in zip(left, right, strict=False)]  # until one swim is over
    write_gif(film + [film[-1]] * REST, results.out, FPS)
    print(f"Written: {results.out}, {len(film)} frames of {BETWEEN} s.")


STUDY = Study("film", run, out=Path("docs/swim.gif"))
