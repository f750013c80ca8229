from seastar_gym.command import run_command
from studies.designs.study import main

if __name__ == "__main__":
    run_command(main)
