"""`python -m seastar_gym.cli` is `seastar`."""

from seastar_gym.cli.main import main
from seastar_gym.command import run_command

run_command(main)
