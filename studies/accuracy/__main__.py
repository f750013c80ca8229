from seastar_gym.command import run_command
from studies.accuracy.study import main

run_command(main)
