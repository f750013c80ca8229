"""Lets a policy drive a robot in a tank, or a simulated one in its place, along a path.

First the policy swims in a simulation, as it would in the tank: a dry run, drawn in plan.png. Then the command asks
before any wire is heated. While the robot swims, a window shows it. Logs, a picture and a report are in the folder
--out. A guard stops all wires when a pulse is too long, when sight is lost, or when a line is bad, and says so.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, get_args

import numpy as np

from seastar_gym.cli.swim import sight
from seastar_gym.command import DEFAULT, answered, command_parser
from seastar_gym.controllers.contract import Policy
from seastar_gym.controllers.registry import HELP, load_agent
from seastar_gym.envs.commands import decisions_in
from seastar_gym.envs.options import SwimOptions, make_scene, scene_at
from seastar_gym.evaluation.path_file import PATH_HELP, load_path
from seastar_gym.evaluation.pictures import draw_traces
from seastar_gym.evaluation.swim import Swim, swim
from seastar_gym.evaluation.tasks import require_seen
from seastar_gym.extras import require_extra
from seastar_gym.files import write_atomically
from seastar_gym.plant.guard import Limits
from seastar_gym.plant.lines import LinePlant, open_serial
from seastar_gym.plant.plant import Plant, PlantError
from seastar_gym.plant.simulated import SimulatedPlant
from seastar_gym.plant.swim import PlantSwim
from seastar_gym.scene.checks import require_number
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.simulator import Simulator

SERIAL = "serial:"
RADIUS = SwimOptions().waypoint_radius
"""Radius of waypoints [m]."""
STOPPED = 1
"""Exit code of a drive that the guard has stopped."""


def parser() -> argparse.ArgumentParser:
    """Parser of the options."""
    found = command_parser("seastar drive", __doc__)
    found.add_argument("policy", help=HELP.replace("%", "%%"))
    found.add_argument("--plant", default="sim", help=f"sim, or {SERIAL}/dev/... of who heats the wires {DEFAULT}")
    found.add_argument("--tracker", help=f"{SERIAL}/dev/... of who sends sightings (default: the plant's line)")
    found.add_argument("--path", default="pentagon", help=f"{PATH_HELP} {DEFAULT}")
    found.add_argument("--sight", default="pose", help=f"what is seen: pose, 1, 3, 9, or a file of a Sight {DEFAULT}")
    found.add_argument("--decision-period", type=float, default=0.5, help=f"time between decisions [s] {DEFAULT}")
    found.add_argument("--scene", type=Path, help="file of the robot's scene, .py or .json (default: the chapter's)")
    found.add_argument("--fidelity", choices=get_args(Fidelity), default="fast", help=f"of the simulation {DEFAULT}")
    found.add_argument("--seconds", type=float, default=200.0, help=f"time after which the swim ends {DEFAULT}")
    found.add_argument("--out", type=Path, default=Path("runs/drive"), help=f"folder of all files {DEFAULT}")
    found.add_argument("--no-window", action="store_true", help="show no picture while the robot swims")
    found.add_argument("--dry", action="store_true", help="end after the dry run")
    found.add_argument("--yes", action="store_true", help="do not ask before wires are heated")
    found.add_argument("--seed", type=int, default=0, help=f"seed of what is drawn at random {DEFAULT}")
    return found


def arguments_of(options: argparse.Namespace) -> dict[str, Any]:
    """Arguments of the environment that the options ask for, but for the plant."""
    for name in ("decision_period", "seconds"):
        require_number(f"--{name.replace('_', '-')}", getattr(options, name), "s")
    given, period = scene_at(options.scene, options.fidelity), options.decision_period
    scene = make_scene(None, options.fidelity, period) if given is None else given
    return {"scene": scene, "path": load_path(options.path), "decision_period": period, "sight": sight(options.sight)}


def simulated(options: argparse.Namespace, arguments: dict[str, Any], paced: bool) -> SimulatedPlant:
    """Simulated plant that is driven with these arguments."""
    return SimulatedPlant(Simulator(arguments["scene"]), arguments["sight"], options.seed, paced)


@contextmanager
def opened(options: argparse.Namespace, arguments: dict[str, Any]) -> Iterator[Plant]:
    """Context of the plant that the options ask for; whatever ends it, the wires are stopped."""
    with ExitStack() as ports:
        if options.plant == "sim":
            plant: Plant = simulated(options, arguments, paced=True)
        else:
            plant = LinePlant(*[ports.enter_context(open_serial(device)) for device in _devices(options)])
        try:
            yield plant
        finally:
            plant.stop()


def _devices(options: argparse.Namespace) -> list[str]:
    """Serial ports of the wires and of the tracker, where it has one of its own; none of a simulated plant."""
    if options.plant == "sim":
        return []
    ports = [options.plant] if options.tracker is None else [options.plant, options.tracker]
    for port in ports:
        if not port.startswith(SERIAL) or port == SERIAL:
            raise ValueError(f"A plant is sim, or {SERIAL}/dev/... of a serial line, not {port}.")
    return [port.removeprefix(SERIAL) for port in ports]


def plan(options: argparse.Namespace) -> tuple[Policy, Swim, dict[str, Any]]:
    """The policy, its swim in simulation, and the arguments of the environment in which it drives."""
    arguments = arguments_of(options)
    env = PlantSwim(simulated(options, arguments, paced=False), **arguments)
    policy = load_agent(options.policy, env, options.seed)
    arguments["actions"] = require_seen(policy, env)
    env = PlantSwim(simulated(options, arguments, paced=False), **arguments)
    swum = _swim("plan", policy, env, options)
    if env.stopped:
        raise PlantError(f"The dry run was stopped: {env.stopped}")
    return policy, swum, arguments


def _swim(name: str, policy: Policy, env: PlantSwim, options: argparse.Namespace) -> Swim:
    limit = decisions_in(options.seconds, options.decision_period, env.scene)
    return swim(name, policy, env, max_strokes=limit, seed=options.seed)


def drive(options: argparse.Namespace) -> int:
    """Plan, ask, drive, and write what came of it; returns the exit code."""
    if _devices(options) and not options.dry:
        require_extra("Serial ports", "plant", "serial")
    policy, planned, arguments = plan(options)
    options.out.mkdir(parents=True, exist_ok=True)
    picture = options.out / "plan.png"
    fluid = arguments["scene"].fluid
    current = None if fluid is None else fluid.current
    draw_traces([planned], RADIUS, picture, current)
    heat = planned.heating_time.sum()
    print(f"Plan: {planned.result}, {heat:.1f} s of heat in {planned.strokes} decisions, drawn in {picture}.")
    if options.dry or not (options.yes or agreed()):
        print("No wire was heated.")
        return 0
    with opened(options, arguments) as plant:
        env = PlantSwim(plant, Limits(), options.out, None if options.no_window else "human", **arguments)
        try:
            swum = _swim("driven", policy, env, options)
        finally:
            env.close()
    draw_traces([planned, swum], RADIUS, options.out / "driven.png", current)
    text = report(options, planned, swum, env)
    write_atomically(options.out / "report.md", text)
    guarded = env.stopped or "The guard had nothing to stop."
    dropped = f" {env.dropped_pictures} pictures were dropped, where no robot can be." if env.dropped_pictures else ""
    print(f"Driven: {swum.result}. {guarded}{dropped} Written: {options.out}.")
    return STOPPED if env.stopped else 0


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
        "decisions": f"{swum.strokes}, every {options.decision_period:g} s, at most {1e3 * env.latest:.0f} ms late",
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
        return answered(lambda: drive(options))
    except PlantError as why:
        print(why, file=sys.stderr)
        return STOPPED
