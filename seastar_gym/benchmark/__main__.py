"""`python -m seastar_gym.benchmark` is `seastar benchmark`."""

from seastar_gym.benchmark.command import main
from seastar_gym.command import run_command

run_command(main)
