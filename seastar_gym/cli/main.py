"""Swim, play and measure with the seastar robot. `seastar COMMAND --help` tells the options of a command."""

import importlib
import sys
from collections.abc import Sequence

from seastar_gym.command import command_parser, run_command
from seastar_gym.files import MissingExtra
from seastar_gym.version import __version__

COMMANDS = {
    "swim": ("seastar_gym.cli.swim", "watch an agent on a path or a task, in a window or as a film"),
    "play": ("seastar_gym.cli.play", "steer the robot with the keyboard"),
    "drive": ("seastar_gym.cli.drive", "let a policy drive a robot in a tank, or a simulated one in its place"),
    "evaluate": ("seastar_gym.cli.evaluate", "compare agents on paths or registered tasks: a table, a file, a picture"),
    "train": ("seastar_gym.cli.train", "train a policy, in a checkout of the repository"),
    "export": ("seastar_gym.cli.export", "write a learned policy as a file of C or ONNX"),
    "certify": ("seastar_gym.accuracy.command", "measure what speed costs a scene in accuracy"),
    "sweep": ("seastar_gym.sweep.command", "simulate thousands of designs, here or on a cluster"),
    "compile": ("seastar_gym.cli.compile", "compile the simulator before it is needed, as for a container"),
    "track2csv": ("seastar_gym.identify.tracks.command", "make what identify reads from a tracker's file"),
    "identify": ("seastar_gym.identify.command", "fit numbers of a scene to measured trajectories"),
}
"""Modules of subcommands, with `main(arguments)`, which returns the exit code; and what each does, in a line."""


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; returns the exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    parser = command_parser("seastar", __doc__)
    parser.add_argument("--version", action="version", version=f"seastar-gym {__version__}")
    commands = parser.add_subparsers(title="commands", dest="command", metavar="COMMAND", required=True)
    for name, (_, help) in COMMANDS.items():
        commands.add_parser(name, help=help, add_help=False)
    module, _ = COMMANDS[parser.parse_args(given[:1]).command]
    try:
        answer: int = importlib.import_module(module).main(given[1:])
    except MissingExtra as missing:
        print(missing, file=sys.stderr)
        return 2
    return answer


def run() -> None:
    """Entry point of the installed command."""
    run_command(main)
