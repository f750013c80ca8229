"""A picture of every registered id: its robot half a minute into an episode, limbs numbered; writes PNGs."""

import io
from pathlib import Path
from typing import Any

import gymnasium as gym

from seastar_gym import TASKS
from seastar_gym.controllers.contract import Policy
from seastar_gym.controllers.learned import bundled_file, load
from seastar_gym.controllers.registry import load_agent
from seastar_gym.envs import IDS
from seastar_gym.evaluation.films import Picture, shrunk
from seastar_gym.evaluation.rollout import rollout
from seastar_gym.files import write_atomically
from studies.frame import Results, Study

SECONDS = 30.0
"""Simulated time of a picture [s]."""
INSTANCE = 0
"""Held-out episode of a task."""


def agent(id: str) -> Policy:
    """The bundled policy of an id; where there is none, the gait round a pentagon."""
    env: Any = gym.make(id, fidelity="fast").unwrapped
    file = bundled_file(None if env.timed is None else env.decision_period, task=IDS[id].task)
    is_made_for = file.is_file() and IDS[id].actions != "continuous" and not IDS[id].more
    return load(file) if is_made_for else load_agent("pentagon", env)


def picture(id: str) -> Picture:
    """The robot of an id after SECONDS, with the way that it has swum, shape (360, 480, 3)."""
    policy = agent(id)
    own = {"split": "test"} if id in TASKS else {}
    env: Any = gym.make(id, fidelity="fast", actions=policy.actions, render_mode="rgb_array", **own)
    options = {"instance": INSTANCE} if id in TASKS else None
    rollout(env, policy, seeds=0, until=round(SECONDS / IDS[id].decision_period), options=options)
    drawn = shrunk(env.render())
    env.close()
    return drawn


def png(shown: Picture) -> bytes:
    """PNG of a picture in 256 colours."""
    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(shown).quantize(dither=Image.Dither.NONE).save(file, "PNG", optimize=True)
    return file.getvalue()


def run(results: Results) -> None:
    """Draw a picture of every id."""
    for id in IDS:
        write_atomically(results.folder / f"{id}.png", png(picture(id)))
        print(f"Written: {results.out / f'{id}.png'}", flush=True)


STUDY = Study("ids", run, out=Path("docs/ids"))
