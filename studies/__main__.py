from seastar_gym.command import run_command
from studies.command import main

if __name__ == "__main__":
    run_command(main)
