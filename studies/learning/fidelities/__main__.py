from seastar_gym.command import run_command
from studies.learning.fidelities.study import main

run_command(main)
