from seastar_gym.command import run_command
from studies.validation.study import main

run_command(main)
