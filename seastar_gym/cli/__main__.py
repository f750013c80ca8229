"""`python -m seastar_gym.cli` is `seastar` of the interpreter that runs it: processes are started so."""

from seastar_gym.cli.main import main
from seastar_gym.command import run_command

if __name__ == "__main__":  # processes that run batches of a sweep may import this file, too
    run_command(main)
