"""Folders whose files run as code: only this user, or root, may have put them there.

A folder must belong to one of the two, and neither group nor others may write in it; nor in a folder above it, through
which it could be replaced, but for sticky ones such as /tmp. Windows has no such bits, and is not asked.
"""

import os
import stat
from pathlib import Path

WRITABLE = stat.S_IWGRP | stat.S_IWOTH
FOLDER, FILE = 0o755, 0o644
"""Rights of what is made here, whatever the umask adds."""


class ForeignFolderError(Exception):
    """A folder whose files others may have written; says why, to end a sentence with."""


def own_folder(folder: Path) -> Path:
    """The folder without links, made if it is not there. ForeignFolderError, or OSError where it cannot be made."""
    folder = folder.resolve()
    missing = [place for place in (folder, *folder.parents) if not place.exists()]
    require_own(folder)
    for place in reversed(missing):
        place.mkdir(FOLDER, exist_ok=True)
    require_own(folder)  # another may have been faster in a sticky folder
    return folder


def require_own(folder: Path) -> None:
    """ForeignFolderError unless only this user, or root, can write into a folder without links, as far as it exists."""
    for place in filter(Path.exists, (folder, *folder.parents)):
        found, is_above = place.stat(), place != folder
        of_system = is_above and found.st_uid == Path(place.anchor).stat().st_uid  # in some containers root is nobody
        if _is_foreign(found) and not of_system:
            raise ForeignFolderError(f"{place} belongs to another user")
        if _is_writable(found) and not (is_above and found.st_mode & stat.S_ISVTX):
            raise ForeignFolderError(f"others than its owner may write in {place}")


def is_own(found: os.stat_result) -> bool:
    """Whether only this user, or root, can have written a file."""
    return not (_is_foreign(found) or _is_writable(found))


def _is_foreign(found: os.stat_result) -> bool:
    return hasattr(os, "geteuid") and found.st_uid not in (0, os.geteuid())


def _is_writable(found: os.stat_result) -> bool:
    return hasattr(os, "geteuid") and bool(found.st_mode & WRITABLE)


def opened_by_owner(file: str, flags: int) -> int:
    """Opener of a new file into which no other user can write."""
    return os.open(file, flags, FILE)
