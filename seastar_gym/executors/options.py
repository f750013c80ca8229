"""Options of commands whose tasks run on an executor."""

import argparse

from seastar_gym.command import DEFAULT
from seastar_gym.executors import Executor
from seastar_gym.executors.here import Here
from seastar_gym.executors.processes import Processes
from seastar_gym.extras import require_extra
from seastar_gym.files import within
from seastar_gym.scene.checks import require_count


def add_options(parser: argparse.ArgumentParser, what: str, default: str) -> None:
    """Add --executor, --workers, --address and --partition to a parser.

    what: What is run, in the plural: "cells". default: Name of the executor that is taken without the option.
    """
    parser.add_argument(
        "--executor", choices=("processes", "here", "ray", "slurm", "local"), default=default,
        help=f"where {what} run: processes of this machine, this process, Ray, SLURM arrays, or submitit's stand-in "
        f"for SLURM on this machine {DEFAULT}",
    )  # fmt: skip
    parser.add_argument("--workers", type=int, help=f"{what} at a time (default: one per processor)")
    parser.add_argument("--address", help="Ray: address of the head, HOST:6379 (default: a cluster of this machine)")
    parser.add_argument("--partition", help="SLURM: partition")


def executor_of(options: argparse.Namespace) -> Executor:
    """Executor that the options name. It says at once what is missing. Jobs of SLURM have their files in OUT/slurm."""
    if options.workers is not None:
        require_count("--workers", options.workers, 1, 1_000_000)
    match options.executor:
        case "here":
            return Here()
        case "ray":
            require_extra("Runs on Ray", "ray", "ray")
            from seastar_gym.executors.on_ray import RayTasks

            return RayTasks(options.address, options.workers)
        case "slurm" | "local":
            require_extra("Runs on SLURM", "slurm", "submitit")
            from seastar_gym.executors.slurm import SlurmArrays

            return SlurmArrays(
                within(options.out, "slurm"), options.executor, options.workers, partition=options.partition
            )
    return Processes(options.workers)
