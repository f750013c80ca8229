"""Film of the same robot twice round the pentagon: by the chapter's gait, and by limbs heated at times of their own.

Draws both side by side, at the same simulated time, until the faster one has arrived, and writes an animated GIF.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from seastar_gym.controllers.contract import Policy
from seastar_gym.controllers.learned import in_the_box, load
from seastar_gym.controllers.scripted import scripted
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.evaluation.films import Picture, shrunk, write_gif
from studies.frame import Results, Study

BETWEEN = 0.4
"""Simulated time between two frames [s]."""
FPS = 20
"""Frames per second of the film: eight times as fast as the robot."""
REST = 20
"""Frames for which the film rests on its end."""


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


def side_by_side(left: Iterator[Picture], right: Iterator[Picture], most: int | None = None) -> list[Picture]:
    """Pictures beside each other, until the swim on the right is over."""
    film = []
    for k, (one, other) in enumerate(zip(left, right, strict=False)):
        if most is not None and k >= most:
            break
        film.append(np.concatenate([one, other], axis=1))
    return film


@dataclass(frozen=True)
class Options:
    """Film of two robots round the pentagon."""

    decision_period: float = 0.2
    """Of the policy on the right [s]."""
    frames: int | None = None
    """Largest number of frames."""
    out: Path = Path("docs/swim.gif")
    """File."""


def run(options: Options, _: Results) -> None:
    """Draw and write the film."""
    parts = round(2 * options.decision_period / BETWEEN)
    if not np.isclose(parts * BETWEEN, 2 * options.decision_period) or parts == 0:
        raise ValueError(f"decisions must take a whole number of {BETWEEN / 2:g} s, not {options.decision_period:g} s.")
    policy = load(in_the_box(options.decision_period))
    gait = scripted("pentagon", policy.actions)
    chapter = frames(gait, round(2 / BETWEEN), actions=gait.actions, fidelity="balanced")
    # As `seastar swim` shows it, and at the same fidelity as the other.
    timed = {"fidelity": "balanced", "decision_period": policy.decision_period}
    learned = frames(policy, parts, actions=policy.actions, **timed)
    film = side_by_side(chapter, learned, options.frames)
    write_gif(film + [film[-1]] * REST, options.out, FPS)
    print(f"Written: {options.out}, {len(film)} frames of {BETWEEN} s.")


STUDY = Study("scenes.film", run, Options)
