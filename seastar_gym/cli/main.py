"""Swim, play and measure with the seastar robot. `seastar COMMAND --help` tells the options of a command."""

import importlib
import sys
from collections.abc import Sequence
from typing import NamedTuple

from seastar_gym.command import command_parser, run_command
from seastar_gym.files import MissingExtra
from seastar_gym.version import __version__


class Command(NamedTuple):
    """A subcommand. module: Has `main(arguments)`, which returns the exit code. help: What it does, in a line."""

    module: str
    help: str


COMMANDS = {
    "swim": Command("seastar_gym.cli.swim", "watch an agent on a path or a task, in a window or as a film"),
    "play": Command("seastar_gym.cli.play", "steer the robot with the keyboard"),
    "drive": Command("seastar_gym.cli.drive", "let a policy drive a robot in a tank, or a simulated one in its place"),
    "evaluate": Command(
        "seastar_gym.cli.evaluate",
        "compare agents on paths or registered tasks: a table, a file, a picture",
    ),
    "train": Command("seastar_gym.cli.train", "train a policy, in a checkout of the repository"),
    "export": Command("seastar_gym.cli.export", "write a learned policy as a file of C or ONNX"),
    "certify": Command("seastar_gym.accuracy.command", "measure what speed costs a scene in accuracy"),
    "sweep": Command("seastar_gym.sweep.command", "simulate thousands of designs, here or on a cluster"),
    "compile": Command("seastar_gym.cli.compile", "compile the simulator before it is needed, as for a container"),
    "track2csv": Command("seastar_gym.identify.tracks.command", "make what identify reads from a tracker's file"),
    "identify": Command("seastar_gym.identify.command", "fit numbers of a scene to measured trajectories"),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; returns the exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    parser = command_parser("seastar", __doc__)
    parser.add_argument("--version", action="version", version=f"seastar-gym {__version__}")
    commands = parser.add_subparsers(title="commands", dest="command", metavar="COMMAND", required=True)
    for name, command in COMMANDS.items():
        commands.add_parser(name, help=command.help, add_help=False)
    name = parser.parse_args(given[:1]).command
    try:
        answer: int = importlib.import_module(COMMANDS[name].module).main(given[1:])
    except MissingExtra as missing:
        print(missing, file=sys.stderr)
        return 2
    return answer


def run() -> None:
    """Entry point of the installed command."""
    run_command(main)
