"""Command line of sweeps."""

from seastar_gym.command import run_command
from seastar_gym.sweep.command import main

if __name__ == "__main__":  # processes that run batches import this file, too
    run_command(main)
