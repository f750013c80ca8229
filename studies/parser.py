"""The command line that the studies share."""

import argparse
import shutil
import textwrap


def study_parser(command: str, doc: str | None) -> argparse.ArgumentParser:
    """Parser of a study that runs as `python -m COMMAND`; its help begins with the study's docstring."""
    width = shutil.get_terminal_size().columns - 2
    paragraphs = [textwrap.fill(" ".join(paragraph.split()), width) for paragraph in (doc or "").split("\n\n")]
    return argparse.ArgumentParser(
        prog=f"python -m {command}",
        description="\n\n".join(paragraphs),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
