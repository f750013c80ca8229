"""Command line of trainings on several machines."""

from agents.rllib.command import main
from seastar_gym.command import run_command

if __name__ == "__main__":
    run_command(main)
