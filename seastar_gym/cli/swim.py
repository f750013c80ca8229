"""Lets an agent swim, in a window or into a film.

The window needs a display; a film, --film swim.mp4 or swim.gif, does not. With --task the agent swims in a registered
environment, as that has been made; otherwise it swims along --path. Without options, the learned policy decides every
0.2 s which limbs to heat, as in the picture of README.md. A policy of a file swims the robot that it was trained on, as
often as it decides, where options name none.
"""

import argparse
import math
from pathlib import Path
from typing import Any, get_args

import gymnasium as gym

from seastar_gym.cli.screen import Show, outcome, rate, screen, show_all
from seastar_gym.command import DEFAULT, command_parser, main_of
from seastar_gym.controllers.contract import Policy
from seastar_gym.controllers.registry import HELP, is_file, learned_policy, load_agent, period_of
from seastar_gym.envs.commands import decisions_in
from seastar_gym.envs.options import FIDELITY_HELP, own_scene, scene_at
from seastar_gym.envs.paths import PATH_HELP, load_path
from seastar_gym.envs.sight import Camera, Sight, read_camera
from seastar_gym.evaluation.rollout import make_task, require_seen, rollout
from seastar_gym.evaluation.swim import TIME_LIMIT
from seastar_gym.scene.checks import require_number
from seastar_gym.scene.numerics import Fidelity

LEARNED_PERIOD = 0.2
"""Time between decisions of the learned policy on a path, where no option says another [s]."""


def parser() -> argparse.ArgumentParser:
    """Parser of the options."""
    found = command_parser("seastar swim", __doc__)
    found.add_argument("--agent", default="learned", help=f"{HELP} {DEFAULT}")
    found.add_argument("--path", help=f"{PATH_HELP} (default: pentagon)")
    found.add_argument("--task", help="id of a registered environment (default: SeastarSwim-v0)")
    found.add_argument("--speed", type=float, default=4.0, help=f"multiple of real time {DEFAULT}")
    found.add_argument("--film", type=Path, help="file of a film, .mp4 or .gif, instead of a window")
    found.add_argument("--fidelity", choices=get_args(Fidelity), help=FIDELITY_HELP)
    found.add_argument(
        "--scene", type=Path, help="file of the robot's scene, .py or .json (default: the policy's, or the task's)"
    )
    found.add_argument(
        "--decision-period", type=float,
        help=f"time between decisions [s] (default: that of policy or task; {LEARNED_PERIOD:g} for learned on a path)",
    )  # fmt: skip
    found.add_argument(
        "--sight", help="what a camera sees, pose, nodes or 1, 3 or 9 markers per limb, or a file of a camera"
    )
    found.add_argument("--action-delay", type=float, help="time from a decision to the heat of wires [s]")
    found.add_argument("--seconds", type=float, help="simulated time after which the swim ends")
    found.add_argument("--random-heading", action="store_true", help="turn the robot at random at the start")
    found.add_argument("--seed", type=int, default=0, help=f"seed of what is drawn at random {DEFAULT}")
    return found


def camera_of(text: str | None) -> Camera | None:
    """Camera of which a word says what it sees, or that a JSON file has, see `read_camera`; None for none."""
    if text is None:
        return None
    if text.endswith(".json"):
        return read_camera(text)
    return Camera(Sight(sees=int(text) if text.isdigit() else text))  # type: ignore[arg-type]  # which it checks


def trained_for(options: argparse.Namespace) -> dict[str, Any]:
    """Arguments of the environment that a policy was trained for, its robot's where it is a file, unless options name a
    task; a scene that they name comes later."""
    if options.task is not None:
        return {}
    if options.agent == "learned":
        return {} if options.scene is not None else {"decision_period": LEARNED_PERIOD}
    policy = learned_policy(options.agent)
    if policy is None:
        return {"decision_period": period_of(options.agent)}
    about = policy.description
    own = {"decision_period": about.decision_period, "sight": about.sight, "action_delay": about.action_delay}
    return own | ({"scene": about.scene} if is_file(options.agent) else {})


def arguments_of(options: argparse.Namespace) -> dict[str, Any]:
    """Arguments of the environment that the options ask for."""
    for name in ("speed", "decision_period", "seconds"):
        if getattr(options, name) is not None:
            require_number(f"--{name.replace('_', '-')}", getattr(options, name), "1")
    asked = {"fidelity": options.fidelity, "decision_period": options.decision_period}
    if (camera := camera_of(options.sight)) is not None:
        asked |= camera._asdict()
    if options.action_delay is not None:
        asked["action_delay"] = options.action_delay
    own = own_scene(options.scene)  # before the path, which its file may register
    if options.path is not None:
        asked["path"] = load_path(options.path)
    if options.random_heading:
        asked["random_heading"] = True
    asked = trained_for(options) | {name: value for name, value in asked.items() if value is not None}
    if (scene := scene_at(own or asked.get("scene"), options.fidelity, "balanced")) is not None:
        asked |= {"scene": scene, "fidelity": None}
    return {name: value for name, value in asked.items() if value is not None}


def make(options: argparse.Namespace, **more: Any) -> gym.Env[Any, Any]:
    """Environment that the options ask for."""
    task = "SeastarSwim-v0" if options.task is None else options.task
    arguments = {**arguments_of(options), **more}
    if (period := arguments.get("decision_period")) is not None:
        arguments.setdefault("max_episode_steps", decisions_in(TIME_LIMIT, period))
    return make_task(task, **arguments)


def watch(options: argparse.Namespace) -> str:
    """Let the agent swim and show it; returns a sentence on how it went."""
    made = make(options)
    plain: Any = made.unwrapped
    policy = load_agent(options.agent, plain, options.seed)
    actions = require_seen(policy, plain)
    period = plain.decision_period
    number, fps = rate(options.film, period, options.speed)
    limit = None if options.seconds is None else decisions_in(options.seconds, period, plain.scene)
    longer = {} if limit is None or limit <= most_of(made) else {"max_episode_steps": limit}
    env = make(options, actions=actions, render_mode="rgb_array_list", frames_per_stroke=number, **longer)
    with screen(options.film, fps) as show:
        info = show_episode(env, policy, show, options.seed, limit)
    env.close()
    written = "" if options.film is None else f" Written: {options.film}."
    return f"{options.agent}: {outcome(env.unwrapped, info)}.{written}"


def most_of(env: gym.Env[Any, Any]) -> float:
    """Most decisions of an episode."""
    most = None if env.spec is None else env.spec.max_episode_steps
    return math.inf if most is None else most


def show_episode(
    env: gym.Env[Any, Any], policy: Policy, show: Show, seed: int, limit: int | None = None
) -> dict[str, Any]:
    """Show one episode, for `limit` decisions at most; returns the last info."""
    last: dict[str, Any] = {}

    def look(info: dict[str, Any]) -> bool:
        last.update(info)
        return not show_all(env, show)

    rollout(env, policy, seeds=seed, until=limit, on_step=look)
    return last


main = main_of(parser, watch)
