"""The command line that the studies share."""

import argparse

from seastar_gym.command import command_parser


def study_parser(command: str, doc: str | None) -> argparse.ArgumentParser:
    """Parser of a study that runs as `python -m COMMAND`; its help begins with the study's docstring."""
    return command_parser(f"python -m {command}", doc)
