"""Training: runs `train.py` of the checkout that this is started in, or that the package is installed from."""

import runpy
import sys
from collections.abc import Sequence
from pathlib import Path


def main(arguments: Sequence[str]) -> int:
    """The command line; returns the exit code."""
    places = (Path.cwd(), Path(__file__).resolve().parents[2])
    found = [place for place in places if (place / "train.py").is_file() and (place / "agents").is_dir()]
    if not found:
        print(
            "Training needs a checkout of the repository, with train.py and agents/: start there, after pip install -e "
            '".[train]".',
            file=sys.stderr,
        )
        return 2
    file = found[0] / "train.py"
    sys.path.insert(0, str(found[0]))
    sys.argv = [str(file), *arguments]
    try:
        runpy.run_path(str(file), run_name="__main__")
    except SystemExit as ended:
        if isinstance(ended.code, str):
            print(ended.code, file=sys.stderr)
            return 1
        return ended.code or 0
    return 0
