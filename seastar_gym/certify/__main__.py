"""Command line of the certificate."""

from seastar_gym.certify.command import main
from seastar_gym.command import run_command

run_command(main)
