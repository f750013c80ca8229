"""train.py with an end: `python killed_training.py FATE N FOLDER ARGUMENTS..`.

FATE happens when it touches a file of FOLDER for the Nth time: "kill" ends the process at once, as `kill -9` does;
"full" says that the disk is full, then and ever after. With N = 0 nothing happens. Touches that either may come of are
counted and printed.
"""

import errno
import os
import signal
import sys
from pathlib import Path

SECONDS = 20.0
"""After which swims are given up."""
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT


def main() -> int:
    fate, at, folder, *arguments = sys.argv[1:]
    sys.path.insert(0, str(Path(__file__).parents[2]))
    import train  # takes seconds, and touches no file of the folder
    from agents import options

    options.TIME_LIMIT = SECONDS

    touches = {"kill": 0, "full": 0}

    def watch(event: str, details: tuple[object, ...]) -> None:
        if event not in ("open", "os.mkdir", "os.rename", "os.remove") or not str(details[0]).startswith(folder):
            return
        reads = event == "os.remove" or (event == "open" and not int(str(details[2])) & WRITING)
        touches["kill"] += 1
        touches["full"] += not reads
        if (fate == "full" and reads) or not 0 < int(at) <= touches[fate]:
            return
        if fate == "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(details[0]))

    sys.addaudithook(watch)
    code = train.main(arguments)
    print("touches:", *touches.values())
    return code


if __name__ == "__main__":
    sys.exit(main())
