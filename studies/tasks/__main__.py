"""`python -m studies.tasks`."""

from seastar_gym.command import run_command
from studies.tasks.study import main

run_command(main)
