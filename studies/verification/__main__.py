from seastar_gym.command import run_command
from studies.verification.study import main

run_command(main)
