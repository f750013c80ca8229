"""Speed of training on this machine: the loop in one file on the native batch, against Stable-Baselines3.

    python -m studies.speed.learners

Both train with the project's hyperparameters, on one thread. The time of a stroke is the difference of a long and a
short training, so that making the environment and the network does not count. Processor times, in rounds in which the
two take turns.
"""

import json
import runpy
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch

from agents.hyperparameters import Hyperparameters
from agents.ppo import make_model, make_training_env
from seastar_gym.accuracy.measure import machine
from seastar_gym.command import run_command
from studies.parser import study_parser

EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "single_file_ppo.py"
OURS = Hyperparameters()
ROLLOUT = OURS.num_envs * OURS.rollout
"""Strokes between two updates."""


def single_file() -> Callable[[int], object]:
    """Function that trains for so many strokes by the loop in one file."""
    loop = runpy.run_path(str(EXAMPLE), run_name="single_file_ppo")
    return lambda strokes: loop["train"](loop["Options"](strokes=strokes, num_threads=1), quiet=True)


def stable_baselines3(strokes: int) -> None:
    """Train for so many strokes by Stable-Baselines3."""
    env = make_training_env(OURS, "random", True, fidelity="fast", threads=1)
    make_model(env, OURS, seed=0).learn(strokes)
    env.close()


def processor_seconds(run: Callable[[int], object], updates: int) -> float:
    """Processor time per stroke [s] of a training with so many updates."""
    spent = []
    for strokes in (ROLLOUT, (1 + updates) * ROLLOUT):
        began = time.process_time()
        run(strokes)
        spent.append(time.process_time() - began)
    return (spent[1] - spent[0]) / (updates * ROLLOUT)


def measure(rounds: int, updates: int) -> dict[str, Any]:
    """Strokes per second of processor time of both, medians over rounds, and the ratio with its range."""
    torch.set_num_threads(1)
    alone = single_file()
    for run in (alone, stable_baselines3):
        run(ROLLOUT)  # compiled and loaded
    pairs = [(processor_seconds(alone, updates), processor_seconds(stable_baselines3, updates)) for _ in range(rounds)]
    ratios = [other / own for own, other in pairs]
    own, other = np.median(pairs, axis=0)
    return {
        "machine": machine(),
        "fidelity": "fast",
        "loop in one file [strokes per second]": round(float(1.0 / own)),
        "Stable-Baselines3 [strokes per second]": round(float(1.0 / other)),
        "ratio": round(float(np.median(ratios)), 2),
        "range of the ratio": [round(min(ratios), 2), round(max(ratios), 2)],
    }


def main() -> None:
    parser = study_parser("studies.speed.learners", __doc__)
    parser.add_argument("--rounds", type=int, default=5, help="rounds (default: %(default)s)")
    parser.add_argument("--updates", type=int, default=8, help="updates of a training (default: %(default)s)")
    options = parser.parse_args()
    print(json.dumps(measure(options.rounds, options.updates), indent=2))


if __name__ == "__main__":
    run_command(main)
