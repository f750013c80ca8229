"""`seastar evaluate` with all --sets and the results in runs/trials.csv unless options say otherwise."""

import sys
from collections.abc import Sequence

from seastar_gym.cli.evaluate import main as seastar_evaluate
from seastar_gym.command import run_command
from seastar_gym.evaluation.trials import SETS


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; returns the exit code."""
    given = sys.argv[1:] if arguments is None else arguments
    return seastar_evaluate(["--sets", *SETS, "--out", "runs/trials.csv", *given])


if __name__ == "__main__":
    run_command(main)
