"""`python -m seastar_gym.certify`, see accuracy/command.py. In Python, `seastar_gym.certify` is a function."""

if __name__ != "__main__":
    raise ImportError("seastar_gym.certify is a function and a command; modules are in seastar_gym.accuracy.")

from seastar_gym.accuracy.command import main
from seastar_gym.command import run_command

run_command(main)
