"""train.py with an end: `python killed_training.py FATE N FOLDER ARGUMENTS..`.

FATE happens when it touches a file of FOLDER for the Nth time: "kill" ends the process at once, as `kill -9` does;
"full" says that the disk is full, then and ever after. With N = 0 nothing happens. The number of touches is printed.
"""

import errno
import os
import signal
import sys
from pathlib import Path

WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT


def main() -> int:
    fate, at, folder, *arguments = sys.argv[1:]
    sys.path.insert(0, str(Path(__file__).parents[2]))
    import train  # takes seconds, and touches no file of the folder

    touches = 0

    def watch(event: str, details: tuple[object, ...]) -> None:
        nonlocal touches
        if event not in ("open", "os.mkdir", "os.rename", "os.remove") or not str(details[0]).startswith(folder):
            return
        if fate == "full" and (event == "os.remove" or (event == "open" and not int(str(details[2])) & WRITING)):
            return
        touches += 1
        if not 0 < int(at) <= touches:
            return
        if fate == "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(details[0]))

    sys.addaudithook(watch)
    code = train.main(arguments)
    print(f"touches: {touches}")
    return code


if __name__ == "__main__":
    sys.exit(main())
