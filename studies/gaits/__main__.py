from seastar_gym.command import run_command
from studies.gaits.study import main

run_command(main)
