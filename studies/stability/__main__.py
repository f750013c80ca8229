from seastar_gym.command import run_command
from studies.stability.study import main

run_command(main)
