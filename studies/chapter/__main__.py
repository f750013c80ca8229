from seastar_gym.command import run_command
from studies.chapter.study import main

run_command(main)
