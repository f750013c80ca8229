"""Compares agents on a path: a table and, with --out, evaluation.csv and a picture of the traces.

In a checkout, `python -m agents.evaluate` adds videos and a report with playbacks.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import get_args

from seastar_gym.command import command_parser
from seastar_gym.controllers.contract import actions_of
from seastar_gym.controllers.roster import DEFAULTS, HELP, fitting_agents
from seastar_gym.envs.options import make_scene, scene_at
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.evaluation.path_file import PATH_HELP, load_path
from seastar_gym.evaluation.pictures import draw_traces
from seastar_gym.evaluation.results import as_text, write_csv
from seastar_gym.evaluation.swim import TIME_LIMIT, Swim, decisions_in, swim
from seastar_gym.extras import require_extra
from seastar_gym.scene.checks import require_number
from seastar_gym.scene.numerics import Fidelity

RADIUS = 0.01
"""Radius of the waypoints [m]."""


def parser() -> argparse.ArgumentParser:
    """Parser of the options."""
    default = "(default: %(default)s)"
    found = command_parser("seastar evaluate", __doc__)
    found.add_argument("--agents", nargs="+", help=f"{HELP} {DEFAULTS}")
    found.add_argument("--path", default="pentagon", help=f"{PATH_HELP} {default}")
    found.add_argument("--fidelity", choices=get_args(Fidelity), default="balanced", help=f"accuracy {default}")
    found.add_argument("--scene", type=Path, help="file of the robot's scene, .py or .json (default: the chapter's)")
    found.add_argument("--decision-period", type=float, help="time between decisions [s] (default: a stroke of 1 s)")
    found.add_argument("--seconds", type=float, default=TIME_LIMIT, help=f"time limit [s] {default}")
    found.add_argument("--random-heading", action="store_true", help="turn the robot at random at the start")
    found.add_argument("--seed", type=int, default=0, help=f"seed of what is drawn at random {default}")
    found.add_argument("--out", type=Path, help="folder for evaluation.csv and traces.png")
    return found


def evaluated(options: argparse.Namespace) -> list[Swim]:
    """Swims of the agents, in their order."""
    require_number("--seconds", options.seconds, "s")
    if options.decision_period is not None:
        require_number("--decision-period", options.decision_period, "s")
    if options.out is not None:
        require_extra("Pictures", "studies", "matplotlib")
    path = load_path(options.path)
    own = scene_at(options.scene, options.fidelity)
    n_limbs = (own or make_scene(None, options.fidelity, options.decision_period)).robot.n_limbs
    agents, left_out = fitting_agents(options.agents, options.seed, options.fidelity, options.decision_period, own)
    print("".join(f"{sentence}\n" for sentence in left_out), end="", file=sys.stderr)
    limit, swims = decisions_in(options.seconds, options.decision_period), []
    for name, policy in agents.items():
        env = SeastarSwimEnv(
            path=path,
            actions=actions_of(policy, n_limbs),
            fidelity=options.fidelity if own is None else None,
            scene=own,
            decision_period=options.decision_period,
            random_heading=options.random_heading,
        )
        swims.append(swim(name, policy, env, max_strokes=limit, seed=options.seed))
        env.close()
    return swims


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; returns the exit code."""
    options = parser().parse_args(arguments)
    try:
        swims = evaluated(options)
    except (ValueError, ImportError, FileNotFoundError) as bad_input:
        print(bad_input, file=sys.stderr)
        return 2
    print(as_text(swims))
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
        write_csv(swims, options.out / "evaluation.csv")
        draw_traces(swims, RADIUS, options.out / "traces.png")
        print(f"Written to {options.out}: evaluation.csv, traces.png")
    return 0
