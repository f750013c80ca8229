from seastar_gym.command import run_command
from studies.learning.in_time.study import main

run_command(main)
