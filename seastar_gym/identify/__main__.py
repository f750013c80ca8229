from seastar_gym.command import run_command
from seastar_gym.identify.identify import main

run_command(main)
