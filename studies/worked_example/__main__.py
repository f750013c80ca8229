"""`python -m studies.worked_example`."""

from seastar_gym.command import run_command
from studies.worked_example.study import main

run_command(main)
