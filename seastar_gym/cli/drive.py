"""Lets a policy drive a robot in a tank, or a simulated one in its place, along a path.

First the policy swims in a simulation, as it would in the tank: a dry run, drawn in plan.png. Then the command asks
before any wire is heated. While the robot swims, a window shows it. Logs, a picture and a report are in the folder
--out, where logs of another drive are never written over. A guard stops all wires when a pulse is too long, when sight
is lost, or when a line is bad, and says so.

Decision period, camera, scene and path are those of the policy, as `train.py --for-camera` writes it, unless options
say otherwise. Policies that see all nodes cannot drive.
"""

import argparse
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, get_args

import numpy as np

from seastar_gym.cli.swim import camera_of
from seastar_gym.command import DEFAULT, answered, command_parser
from seastar_gym.controllers.contract import Policy
from seastar_gym.controllers.description import Description
from seastar_gym.controllers.registry import HELP, learned_policy, load_agent, period_of
from seastar_gym.envs.commands import Actions, decisions_in
from seastar_gym.envs.options import make_scene, own_scene, scene_at
from seastar_gym.envs.paths import PATH_HELP, WAYPOINT_RADIUS, load_path
from seastar_gym.envs.seastar_swim import RenderMode
from seastar_gym.envs.sight import FOR_CAMERA, Sight, told
from seastar_gym.evaluation.pictures import draw_traces
from seastar_gym.evaluation.rollout import require_seen
from seastar_gym.evaluation.swim import Swim, swim
from seastar_gym.files import require_place, write_atomically
from seastar_gym.plant.guard import Limits
from seastar_gym.plant.lines import LinePlant, open_serial
from seastar_gym.plant.plant import Plant, PlantError, SimulatedPlant, with_wires
from seastar_gym.plant.swim import LOGS, PlantSwim, require_limbs
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import require_number, require_period
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.simulator import Simulator

SIM, SERIAL = "sim", "serial:"
STOPPED = 1
"""Exit code of a drive that the guard has stopped."""


def parser() -> argparse.ArgumentParser:
    """Parser of the options."""
    found = command_parser("seastar drive", __doc__)
    found.add_argument("policy", help=HELP.replace("%", "%%"))
    found.add_argument(
        "--plant", default=SIM,
        help=f"{SIM}, {SIM}:FILE for a simulated robot of another scene than the plan's, or {SERIAL}/dev/... of who "
        f"heats the wires {DEFAULT}",
    )  # fmt: skip
    found.add_argument("--tracker", help=f"{SERIAL}/dev/... of who sends sightings (default: the plant's line)")
    own = "default: the policy's own, otherwise"
    found.add_argument("--path", help=f"{PATH_HELP} ({own} pentagon)")
    found.add_argument("--sight", help=f"what is seen: pose, 1, 3, 9, or a file of a camera ({own} pose)")
    found.add_argument("--decision-period", type=float, help=f"time between decisions [s] ({own} 0.5)")
    found.add_argument("--scene", type=Path, help=f"file of the robot's scene, .py or .json ({own} the chapter's)")
    found.add_argument("--fidelity", choices=get_args(Fidelity), help=f"of the simulation ({own} fast)")
    found.add_argument("--seconds", type=float, default=200.0, help=f"time after which the swim ends {DEFAULT}")
    found.add_argument("--out", type=Path, help="folder of all files (default: a folder in runs/ named by the time)")
    found.add_argument("--no-window", action="store_true", help="show no picture while the robot swims")
    found.add_argument("--dry", action="store_true", help="end after the dry run")
    found.add_argument("--unpaced", action="store_true", help="have a simulated plant not keep to real time")
    found.add_argument("--yes", action="store_true", help="do not ask before wires are heated")
    found.add_argument("--seed", type=int, default=0, help=f"seed of what is drawn at random {DEFAULT}")
    return found


def arguments_of(options: argparse.Namespace) -> dict[str, Any]:
    """Arguments of the environment that the options, or else the policy, ask for, but for the plant."""
    require_number("--seconds", options.seconds, "s")
    require_period(options.decision_period, "--decision-period")
    named = own_scene(options.scene)
    policy = learned_policy(options.policy, options.decision_period)
    fidelity: Fidelity = options.fidelity or "fast"
    own: dict[str, Any] = {"decision_period": period_of(options.policy) or 0.5, "sight": Sight(), "path": "pentagon"}
    if policy is not None:
        about = policy.description
        require_camera(options.policy, about)
        path = "pentagon" if about.path in (None, "random") else about.path
        own = {"decision_period": policy.decision_period, "sight": about.sight, "path": path}
    camera = camera_of(options.sight)
    asked = {
        "decision_period": options.decision_period, "sight": None if camera is None else camera.sight,
        "path": None if options.path is None else load_path(options.path),
    }  # fmt: skip
    arguments = own | {name: value for name, value in asked.items() if value is not None}
    scene = scene_at(named or (None if policy is None else policy.scene), options.fidelity, fidelity)
    return arguments | {"scene": scene or make_scene(None, fidelity, arguments["decision_period"])}


def require_camera(name: str, about: Description) -> None:
    """ValueError, with what to do, for a policy that sees more than a camera. name: Its name or file."""
    if about.sight is None or about.sight.sees == "nodes":
        folder = Path(name).parent
        run = str(folder) if (folder / "config.json").is_file() else "RUN"
        raise ValueError(
            f"{name} was trained for {told(about.sight)}, which no plant gives: {FOR_CAMERA.replace('RUN', run)}."
        )


def simulated(
    options: argparse.Namespace, arguments: dict[str, Any], paced: bool, scene: Scene | None = None
) -> SimulatedPlant:
    """Simulated plant that is driven with these arguments. scene: Of its robot. None means that of the arguments."""
    simulator = Simulator(with_wires(scene or arguments["scene"]))
    return SimulatedPlant(simulator, arguments["sight"], options.seed, paced)


@contextmanager
def opened(options: argparse.Namespace, arguments: dict[str, Any], scene: Scene | None) -> Iterator[Plant]:
    """Context of the plant that the options ask for; whatever ends it, wires are stopped. scene: See `simulated`."""
    with ExitStack() as ports:
        if _is_simulated(options):
            plant: Plant = simulated(options, arguments, not options.unpaced, scene)
        else:
            plant = LinePlant(*[ports.enter_context(open_serial(device)) for device in _devices(options)])
        try:
            yield plant
        finally:
            plant.stop()


def _devices(options: argparse.Namespace) -> list[str]:
    """Serial ports of the wires and of the tracker, where it has one of its own; none of a simulated plant."""
    if _is_simulated(options):
        if options.tracker is not None:
            raise ValueError(f"A simulated plant has a tracker of its own: leave out --tracker {options.tracker}.")
        return []
    ports = [options.plant] if options.tracker is None else [options.plant, options.tracker]
    for port in ports:
        if not port.startswith(SERIAL) or port == SERIAL:
            raise ValueError(f"A plant is {SIM}, {SIM}:FILE, or {SERIAL}/dev/... of a serial line, not {port}.")
    return [port.removeprefix(SERIAL) for port in ports]


def _is_simulated(options: argparse.Namespace) -> bool:
    return options.plant == SIM or _scene_of_plant(options) is not None


def _scene_of_plant(options: argparse.Namespace) -> Path | None:
    """File of the scene of a simulated plant, None where it is no other than the plan's."""
    file = options.plant.removeprefix(f"{SIM}:")
    return None if file == options.plant else Path(file)


@contextmanager
def progress(what: str) -> Iterator[None]:
    """Context that says what is done and, at a terminal, for how many seconds."""
    begun, ended = time.monotonic(), threading.Event()

    def tick() -> None:
        while not ended.wait(1.0):
            print(f"\r{time.monotonic() - begun:.0f} s ", end="", flush=True)

    print(what, flush=True)
    ticker = threading.Thread(target=tick, daemon=True)
    if sys.stdout.isatty():
        ticker.start()
    try:
        yield
    finally:
        ended.set()
        if ticker.ident is not None:
            ticker.join()
            print("\r", end="")


def plan(options: argparse.Namespace, arguments: dict[str, Any]) -> tuple[Policy, Swim, Actions]:
    """The policy, its swim in simulation, and its action mode. arguments: Of the environment in which it drives."""
    env = PlantSwim(simulated(options, arguments, paced=False), **arguments)
    policy = load_agent(options.policy, env, options.seed)
    actions = require_seen(policy, env)
    env = PlantSwim(simulated(options, arguments, paced=False), actions=actions, **arguments)
    with progress("The plan is swum in simulation; a new kind of robot is compiled before, for up to a minute."):
        swum = _swim("plan", policy, env, options)
    if env.stopped:
        raise PlantError(
            f"The dry run was stopped: {env.stopped} It was seen through {arguments['sight']}; --sight names another."
        )
    return policy, swum, actions


def _swim(name: str, policy: Policy, env: PlantSwim, options: argparse.Namespace) -> Swim:
    limit = decisions_in(options.seconds, env.decision_period, env.scene)
    return swim(name, policy, env, max_strokes=limit, seed=options.seed)


def drive(options: argparse.Namespace) -> int:
    """Plan, ask, drive, and write what came of it; returns the exit code."""
    devices = _devices(options)
    options.out = options.out or Path("runs") / time.strftime("drive_%Y-%m-%d_%H-%M-%S")
    require_no_logs(options.out)
    robot = scene_at(own_scene(_scene_of_plant(options)), options.fidelity, "fast")
    arguments = arguments_of(options)
    if not options.dry and (devices or robot is not None):
        with opened(options, arguments, robot) as plant:  # which heats nothing
            require_limbs(plant, arguments["scene"])
    for name in ("plan.png", "driven.png", "report.md"):
        require_place(options.out / name)
    policy, planned, actions = plan(options, arguments)
    picture = options.out / "plan.png"
    fluid = arguments["scene"].fluid
    current = None if fluid is None else fluid.current
    draw_traces([planned], WAYPOINT_RADIUS, picture, current)
    heat = planned.heating_time.sum()
    print(f"Plan: {planned.result}, {heat:.1f} s of heat in {planned.strokes} decisions, drawn in {picture}.")
    if options.dry or not (options.yes or agreed()):
        print("No wire was heated.")
        return 0
    with opened(options, arguments, robot) as plant:
        window: RenderMode | None = None if options.no_window else "human"
        env = PlantSwim(plant, Limits(), options.out, window, actions=actions, **arguments)
        try:
            swum = _swim("driven", policy, env, options)
        finally:
            env.close()
    draw_traces([planned, swum], WAYPOINT_RADIUS, options.out / "driven.png", current)
    text = report(options, planned, swum, env)
    write_atomically(options.out / "report.md", text)
    guarded = env.stopped or "The guard had nothing to stop."
    dropped = f" {env.dropped_pictures} pictures were dropped, where no robot can be." if env.dropped_pictures else ""
    print(f"Driven: {swum.result}. {guarded}{dropped} Written: {options.out}.")
    return STOPPED if env.stopped else 0


def require_no_logs(folder: Path) -> None:
    """ValueError where a folder has the logs of a drive, or is none."""
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"{folder} is no folder: give another --out.")
    if any((folder / f"{name}.csv").exists() for name in LOGS):
        raise ValueError(f"{folder} has the logs of another drive: give another --out.")


def agreed() -> bool:
    """Whether somebody at the keyboard wants wires to be heated."""
    print("Heat the wires? [y/N] ", end="", flush=True)
    return sys.stdin.readline().strip().lower() in ("y", "yes")


def report(options: argparse.Namespace, planned: Swim, swum: Swim, env: PlantSwim) -> str:
    """What came of a drive, as Markdown."""
    poses = np.loadtxt(options.out / "poses.csv", delimiter=",", skiprows=1, ndmin=2)
    gaps, delays = np.diff(poses[:, 0]), poses[:, 1] - poses[:, 0]
    rows = {
        "policy": options.policy,
        "plant": options.plant,
        "planned": planned.result,
        "driven": swum.result,
        "guard": env.stopped or "nothing to stop",
        "decisions": f"{swum.strokes}, every {env.decision_period:g} s, at most {1e3 * env.latest:.0f} ms late",
        "heat": f"{swum.heating_time.sum():.2f} s, summed over wires",
        "sightings": f"{len(poses)}, at most {1e3 * gaps.max(initial=0.0):.0f} ms apart",
        "pictures dropped": f"{env.dropped_pictures}, where no robot can be",
        "delay of sight": f"{1e3 * np.median(delays):.0f} ms, median; at most {1e3 * delays.max():.0f} ms",
    }
    table = "".join(f"| {name} | {value} |\n" for name, value in rows.items())
    files = "tracking.csv and commands.csv are for `seastar identify`, poses.csv has sightings as they came."
    return f"# Drive\n\n| | |\n|---|---|\n{table}\n![Plan and swim](driven.png)\n\n{files}\n"


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; returns the exit code."""
    options = parser().parse_args(arguments)
    try:
        return answered(lambda: drive(options), options)
    except PlantError as why:
        print(why, file=sys.stderr)
        return STOPPED
