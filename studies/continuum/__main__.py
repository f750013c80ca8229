from seastar_gym.command import run_command
from studies.continuum.study import main

run_command(main)
