"""Swim, play and measure with the seastar robot. `seastar COMMAND --help` tells the options of a command."""

import importlib
import runpy
import sys
from collections.abc import Sequence
from pathlib import Path

from seastar_gym.command import command_parser, run_command
from seastar_gym.files import MissingExtra
from seastar_gym.version import __version__

COMMANDS = {
    "swim": ("seastar_gym.cli.swim:main", "watch an agent on a path or a task, in a window or as a film"),
    "play": ("seastar_gym.cli.play:main", "steer the robot with the keyboard"),
    "drive": ("seastar_gym.cli.drive:main", "let a policy drive a robot in a tank, or a simulated one in its place"),
    "evaluate": (
        "seastar_gym.cli.evaluate:main",
        "compare agents on paths or registered tasks: a table, a file, a picture",
    ),
    "train": ("seastar_gym.cli.main:train", "train a policy, in a checkout of the repository"),
    "export": ("seastar_gym.cli.export:main", "write a learned policy as a file of C or ONNX"),
    "certify": ("seastar_gym.accuracy.command:main", "measure what speed costs a scene in accuracy"),
    "sweep": ("seastar_gym.sweep.command:main", "simulate thousands of designs, here or on a cluster"),
    "compile": ("seastar_gym.cli.compile:main", "compile the simulator before it is needed, as for a container"),
    "track2csv": ("seastar_gym.identify.tracks.command:main", "make what identify reads from a tracker's file"),
    "identify": ("seastar_gym.identify.command:main", "fit numbers of a scene to measured trajectories"),
}
"""Functions of subcommands, "module:function", from words to the exit code; and what each does, in a line."""


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; returns the exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    parser = command_parser("seastar", __doc__)
    parser.add_argument("--version", action="version", version=f"seastar-gym {__version__}")
    commands = parser.add_subparsers(title="commands", dest="command", metavar="COMMAND", required=True)
    for name, (_, help) in COMMANDS.items():
        commands.add_parser(name, help=help, add_help=False)
    function, _ = COMMANDS[parser.parse_args(given[:1]).command]
    try:
        module, name = function.split(":")
        answer: int = getattr(importlib.import_module(module), name)(given[1:])
    except MissingExtra as missing:
        print(missing, file=sys.stderr)
        return 2
    return answer


def train(arguments: Sequence[str]) -> int:
    """Run `train.py` of the checkout that this is started in, or that the package is installed from; the exit code."""
    places = (Path.cwd(), Path(__file__).resolve().parents[2])
    found = [place for place in places if (place / "train.py").is_file() and (place / "agents").is_dir()]
    if not found:
        print(
            "Training needs a checkout of the repository, with train.py and agents/: start there, after pip install -e "
            '".[train]".',
            file=sys.stderr,
        )
        return 2
    file = found[0] / "train.py"
    sys.path.insert(0, str(found[0]))
    sys.argv = [str(file), *arguments]
    try:
        runpy.run_path(str(file), run_name="__main__")
    except SystemExit as ended:
        if isinstance(ended.code, str):
            print(ended.code, file=sys.stderr)
            return 1
        return ended.code or 0
    return 0


def run() -> None:
    """Entry point of the installed command."""
    run_command(main)
