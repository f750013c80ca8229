"""Command line of the fit."""

from seastar_gym.command import run_command
from seastar_gym.identify.command import main

run_command(main)
