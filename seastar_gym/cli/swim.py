"""Lets an agent swim, in a window or into a film.

The window needs a display; a film, --film swim.mp4 or swim.gif, does not. With --task the agent swims in a registered
environment, as that has been made; otherwise it swims along --path. Without options, the learned policy decides every
0.2 s which limbs to heat, as in the picture of README.md. A policy of a file swims the robot that it was trained on, as
often as it decides, where options name none.

Where pictures go: into a window, or into the file of a film.
"""

import argparse
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import gymnasium as gym

from seastar_gym.command import DEFAULT, answered, command_parser
from seastar_gym.controllers.contract import Policy
from seastar_gym.controllers.registry import HELP, is_file, learned_policy, load_agent
from seastar_gym.envs.canvas import INK, WATER, Canvas, Window, import_pygame
from seastar_gym.envs.commands import decisions_in
from seastar_gym.envs.sight import Camera, Sight, read_camera
from seastar_gym.evaluation.films import Picture, film, film_format
from seastar_gym.evaluation.rollout import make_task, require_seen, rollout
from seastar_gym.evaluation.swim import PATH_HELP, TIME_LIMIT, load_path
from seastar_gym.scene.checks import require_number
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.scene.scene_file import load_scene

if TYPE_CHECKING:
    import gymnasium as gym

SIZE = (960, 720)
"""Width and height of a window [px]."""
FPS, GIF_FPS = 30, 20
"""Pictures per second of a window or an MP4, and of a GIF."""

Show = Callable[[Picture], bool]
"""Function that shows a picture; False once nobody looks any more."""


def rate(file: Path | None, decision_period: float, speed: float) -> tuple[int, float]:
    """Number of pictures of a decision, and pictures per second, at a speed in multiples of real time."""
    wanted = FPS if file is None or film_format(file) == ".mp4" else GIF_FPS
    number = max(1, round(wanted * decision_period / speed))
    return number, number * speed / decision_period


@contextmanager
def screen(file: Path | None, fps: float) -> Iterator[Show]:
    """Context that gives a function to show pictures with: in a film, or in a window if there is no file.

    ValueError, with what to do instead, where no window can be opened.
    """
    if file is None:
        with _window(fps) as show:
            yield show
        return
    with film(file, fps) as add:

        def keep(picture: Picture) -> bool:
            add(picture)
            return True

        yield keep


@contextmanager
def _window(fps: float) -> Iterator[Show]:
    pygame, window = import_pygame(), Window()
    with warnings.catch_warnings(action="ignore"):
        window.is_wanted(SIZE)
    if not window.is_seen:
        raise ValueError("No window can be opened here: write a film, --film swim.mp4 or swim.gif.")

    def show(picture: Picture) -> bool:
        if not window.is_wanted(SIZE):
            return False
        height, width, _ = picture.shape
        window.show(pygame.image.frombuffer(picture.tobytes(), (width, height), "RGB"), fps)
        return True

    yield show
    window.close()


def wait(show: Show) -> None:
    """Show that something begins: machine code of the simulator takes a while to load, and longer to be made."""
    canvas = Canvas(SIZE, 24)
    canvas.begin(WATER)
    for line, text in enumerate(("Starting ...", "The first start on a machine compiles the simulator.")):
        canvas.write(text, (SIZE[0] / 2, SIZE[1] / 2 + 40 * line), INK, (0.5, 0.5))
    canvas.finish()
    show(canvas.pixels())


def show_all(env: "gym.Env[Any, Any]", show: Show) -> bool:
    """Show the pictures since the last call; False once nobody looks any more."""
    pictures: Any = env.render()
    return all(show(picture) for picture in pictures or ())


def outcome(env: Any, info: dict[str, Any]) -> str:
    """How an episode went, in words: waypoints, or whether a task without them was done."""
    if "waypoint_index" in info:
        how = f"{info['waypoint_index']} of {len(env.waypoints)} waypoints"
    else:
        how = "done" if info["is_success"] else "not done"
    return f"{how} in {info['time']:.1f} s"


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
    found.add_argument("--fidelity", choices=get_args(Fidelity), help="accuracy of the simulation")
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


def sight(text: str | None) -> Sight | None:
    """Sight of which a word says what it sees, or that a file of a camera has; None for none."""
    camera = camera_of(text)
    return None if camera is None else camera.sight


def camera_of(text: str | None) -> Camera | None:
    """Camera of which a word says what it sees, or that a JSON file has, see `read_camera`; None for none."""
    if text is None:
        return None
    if text.endswith(".json"):
        return read_camera(text)
    return Camera(Sight(sees=int(text) if text.isdigit() else text))  # type: ignore[arg-type]  # which it checks


def trained_for(options: argparse.Namespace) -> dict[str, Any]:
    """Arguments of the environment that a policy was trained for, its robot's where it is a file, unless options name a
    task or a scene."""
    if options.task is not None or options.scene is not None:
        return {}
    if options.agent == "learned":
        return {"decision_period": LEARNED_PERIOD}
    policy = learned_policy(options.agent)
    if policy is None:
        return {}
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
    if options.path is not None:
        asked["path"] = load_path(options.path)
    if options.scene is not None:
        asked["scene"] = load_scene(options.scene)
    if options.random_heading:
        asked["random_heading"] = True
    asked = trained_for(options) | {name: value for name, value in asked.items() if value is not None}
    return {name: value for name, value in asked.items() if value is not None}


def make(options: argparse.Namespace, **more: Any) -> gym.Env[Any, Any]:
    """Environment that the options ask for."""
    task = "SeastarSwim-v0" if options.task is None else options.task
    arguments = {**arguments_of(options), **more}
    if (period := arguments.get("decision_period")) is not None:
        arguments["max_episode_steps"] = decisions_in(TIME_LIMIT, period)
    return make_task(task, **arguments)


def watch(options: argparse.Namespace) -> str:
    """Let the agent swim and show it; returns a sentence on how it went."""
    plain: Any = make(options).unwrapped
    policy = load_agent(options.agent, plain, options.seed)
    actions = require_seen(policy, plain)
    period = plain.decision_period
    number, fps = rate(options.film, period, options.speed)
    env = make(options, actions=actions, render_mode="rgb_array_list", frames_per_stroke=number)
    limit = None if options.seconds is None else decisions_in(options.seconds, period, plain.scene)
    with screen(options.film, fps) as show:
        info = show_episode(env, policy, show, options.seed, limit)
    env.close()
    written = "" if options.film is None else f" Written: {options.film}."
    return f"{options.agent}: {outcome(env.unwrapped, info)}.{written}"


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


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; returns the exit code."""
    options = parser().parse_args(arguments)
    return answered(lambda: print(watch(options)))
