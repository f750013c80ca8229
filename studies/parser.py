"""The command line that the studies share."""

import argparse


def study_parser(command: str, doc: str | None) -> argparse.ArgumentParser:
    """Parser of a study that runs as `python -m COMMAND`; its help begins with the study's docstring."""
    return argparse.ArgumentParser(
        prog=f"python -m {command}", description=doc, formatter_class=argparse.RawDescriptionHelpFormatter
    )
