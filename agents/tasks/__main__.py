"""`python -m agents.tasks`."""

from agents.tasks.command import main
from seastar_gym.command import run_command

run_command(main)
