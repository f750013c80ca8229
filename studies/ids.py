"""A picture and a film of every registered id, limbs numbered: 40 s at `fast`, ten times as fast as the robot."""

import io
from pathlib import Path
from typing import Any

import gymnasium as gym
from PIL import Image

from seastar_gym import TASKS
from seastar_gym.controllers.learned import bundled_for, load
from seastar_gym.controllers.registry import load_agent
from seastar_gym.envs import IDS
from seastar_gym.evaluation.films import Picture, shrunk, write_gif
from seastar_gym.evaluation.rollout import Info, env_of, rollout
from seastar_gym.files import write_atomically
from studies.frame import Results, Study

SECONDS, SHOWN = 40, 30
"""Length of a film, one frame per second, and the time of the picture [s]."""
FPS = 10
"""Frames of a film per second."""


def agent(id: str) -> Any:
    """The bundled policy of an id; where there is none, the gait round a pentagon."""
    file = bundled_for(id)
    return load(file) if file else load_agent("pentagon", env_of(id, fidelity="fast"))


def frames(id: str) -> list[Picture]:
    """Pictures of a swim by the agent of an id, one per second, shape (360, 480, 3) each."""
    policy, period = agent(id), IDS[id].decision_period
    split = "test" if id in TASKS else "train"
    env: Any = gym.make(id, fidelity="fast", actions=policy.actions, render_mode="rgb_array", split=split)
    drawn = list[Picture]()

    def look(info: Info) -> None:
        if info["time"] > len(drawn) - 0.5 * period:
            drawn.append(shrunk(env.render()))

    options = {"instance": 0} if id in TASKS else None  # the first held-out episode
    rollout(env, policy, seeds=0, until=round(SECONDS / period), options=options, on_step=look)
    env.close()
    return drawn


def png(shown: Picture) -> bytes:
    """PNG of a picture in 256 colours."""
    file = io.BytesIO()
    Image.fromarray(shown).quantize(dither=Image.Dither.NONE).save(file, "PNG", optimize=True)
    return file.getvalue()


def run(results: Results) -> None:
    """Draw a picture and a film of every id."""
    for id in IDS:
        film = frames(id)
        write_atomically(results.folder / f"{id}.png", png(film[min(SHOWN, len(film) - 1)]))
        write_gif(film, results.folder / f"{id}.gif", FPS)
        print(f"Written: {results.out / id}.png and .gif, {len(film)} frames.", flush=True)


STUDY = Study("ids", run, out=Path("docs/ids"))
