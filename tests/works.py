"""What executors do with cells in tests: functions that other processes can import."""

import os
import signal
import tempfile
import time
from pathlib import Path


def part(cell, text=""):
    """A part of a cell without results, but with a text that is written as it is."""
    import pyarrow.parquet  # here: processes that are killed before import it for nothing

    table = pyarrow.table({"text": [text]}).replace_schema_metadata({"cell": cell.name})
    sink = pyarrow.BufferOutputStream()
    pyarrow.parquet.write_table(table, sink, compression="none", use_dictionary=False, write_statistics=False)
    return sink.getvalue().to_pybytes()


def named(cell):
    """A part of the cell's name."""
    return part(cell)


def numbered(cell):
    """The number of the process."""
    return str(os.getpid()).encode()


def deadly_once(cell):
    """Kills its worker at the first attempt at every cell named in DEADLY; a file tells later attempts."""
    folder = Path(os.environ["DEADLY"])
    if (folder / cell.name).exists() and not (folder / f"{cell.name}.died").exists():
        (folder / f"{cell.name}.died").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return part(cell)


def always_deadly(cell):
    """Kills its worker."""
    os.kill(os.getpid(), signal.SIGKILL)


def refusing(cell):
    """A disk that is full where the cell is run."""
    raise OSError(28, "No space left on device")


def meet():
    """Waits until every node of a cluster is at work: processes of as many as the file in MEETING says. One that begins
    later than others would otherwise have nothing to do in a short sweep."""
    folder, end = Path(os.environ["MEETING"]), time.monotonic() + 120.0
    (folder / f"{os.getppid()}.node").touch()
    while len(list(folder.glob("*.node"))) < int((folder / "nodes").read_text()) and time.monotonic() < end:
        time.sleep(0.05)


def slow(cell):
    """Takes half a second; says on which node of a cluster it was, by the number of its Ray daemon."""
    meet()
    time.sleep(0.5)
    return part(cell, str(os.getppid()))


def sized(cell):
    """A file of twelve kilobytes."""
    return part(cell, cell.name * 270)


def swollen(cell):
    """A megabyte for the cell named in SWOLLEN, its name for others."""
    return part(cell, cell.name * (25_000 if cell.name == os.environ["SWOLLEN"] else 1))


def scratching(cell):
    """Needs a little of the disk where the cell is run."""
    meet()
    time.sleep(0.3)
    folder = os.environ.get("TMPDIR")  # said outright: on a full disk, tempfile by itself would look for another
    with tempfile.NamedTemporaryFile(dir=folder) as file:
        file.write(bytes(10_000))
        file.flush()
    return part(cell)
