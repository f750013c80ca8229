"""`seastar evaluate`, with videos of every agent in runs/evaluate unless options say otherwise."""

import sys
from collections.abc import Sequence

from seastar_gym.cli.evaluate import main as seastar_evaluate
from seastar_gym.command import run_command
from seastar_gym.evaluation.comparison import evaluate

__all__ = ["evaluate", "main"]


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; returns the exit code."""
    given = sys.argv[1:] if arguments is None else arguments
    return seastar_evaluate(["--video", "--out", "runs/evaluate", *given])


if __name__ == "__main__":
    run_command(main)
