"""Lines of text between a driver and a plant, over whatever carries bytes: a serial port, a pipe, a socket.

docs/plant.md has the table of all lines. Every line ends with the checksum of NMEA: * and two hexadecimal digits.
"""

import errno
import os
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from functools import reduce
from io import FileIO
from operator import xor
from typing import Protocol

import numpy as np

from seastar_gym.plant.plant import Plant, PlantError, Sighting
from seastar_gym.scene.checks import shown

VERSION = "1"
"""Version of the lines."""
SILENCE = 0.1
"""Time without a line from the driver after which a plant stops its wires [s]."""
LONGEST_LINE = 4096
"""Bytes after which a line without an end is a bad one."""
HELLO = 2.0
"""Time within which a plant answers the first line [s]."""


class Channel(Protocol):
    """Anything that has a file descriptor, such as a file, a serial port, the end of a pipe or a socket."""

    def fileno(self) -> int:
        """Number of the descriptor."""


def open_serial(device: str, baud: int = 115200) -> FileIO:
    """Serial line of this rate, without echo and without waiting. PlantError: there is none."""
    import termios
    import tty

    try:
        line = FileIO(os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK), "r+")
    except OSError as refused:
        raise PlantError(f"{device} cannot be opened: {(refused.strerror or 'unknown error').lower()}.") from None
    try:
        tty.setraw(line.fileno())
        settings = termios.tcgetattr(line)
        settings[4] = settings[5] = getattr(termios, f"B{baud}")
        termios.tcsetattr(line, termios.TCSANOW, settings)
    except termios.error:
        line.close()
        raise PlantError(f"{device} is no serial line.") from None
    return line


class LineError(ValueError):
    """A line that is none of this protocol."""


def sealed(line: str) -> bytes:
    """Line with its checksum and its end."""
    return f"{line}*{_checksum(line):02X}\n".encode("ascii", "replace")


def opened(line: bytes) -> list[str]:
    """Words of a line. LineError: its checksum, or anything else of it, is wrong."""
    text = line.decode("ascii", "replace").rstrip("\r")
    body, star, checksum = text.rpartition("*")
    if not star or checksum != f"{_checksum(body):02X}":
        raise LineError(f"A line was garbled: {text[:60]!r}.")
    return body.split(" ")


def _checksum(line: str) -> int:
    return reduce(xor, line.encode("ascii", "replace"), 0)


class Lines:
    """Lines over a file that is read without waiting."""

    def __init__(self, file: Channel):
        if not callable(getattr(file, "fileno", None)):
            raise ValueError(f"A line needs something with a descriptor, such as a socket, not {shown(file)}.")
        self._file, self._rest, self._whole = file, b"", deque[bytes]()
        os.set_blocking(file.fileno(), False)

    def send(self, line: str) -> None:
        """Send a line. PlantError: nobody is there to take it."""
        data = sealed(line)
        try:
            if os.write(self._file.fileno(), data) != len(data):
                raise PlantError("The plant takes no more lines: its other end does not read them.")
        except BlockingIOError:
            raise PlantError("The plant takes no more lines: its other end does not read them.") from None
        except OSError as broken:
            raise PlantError(f"The line to the plant is broken: {(broken.strerror or 'unknown').lower()}.") from None

    def received(self) -> Iterator[list[str]]:
        """Words of every line since the last call. LineError: one was garbled. PlantError: the other end has gone."""
        while chunk := self._read():
            self._rest += chunk
        *whole, self._rest = self._rest.split(b"\n")
        if len(self._rest) > LONGEST_LINE:
            self._rest = b""
            raise LineError(f"A line has more than {LONGEST_LINE} bytes.")
        self._whole.extend(whole)
        while self._whole:
            yield opened(self._whole.popleft())

    def _read(self) -> bytes:
        try:
            chunk = os.read(self._file.fileno(), 65536)
        except BlockingIOError:
            return b""
        except OSError as broken:
            if broken.errno == errno.EIO:  # a pseudo-terminal whose other end is closed
                raise PlantError("The plant has gone: its line was closed.") from None
            raise PlantError(f"The line to the plant is broken: {(broken.strerror or 'unknown').lower()}.") from None
        if not chunk and not os.isatty(self._file.fileno()):
            raise PlantError("The plant has gone: its line was closed.")
        return chunk


def sighting_of(words: list[str], seen_at: float, n_limbs: int) -> Sighting:
    """Sighting of the words "sight", time, x, y, heading and places of markers. LineError: they are none."""
    try:
        captured_at, x, y, heading, *rest = map(float, words[1:])
    except ValueError:
        raise LineError("A sighting needs numbers: a time, x, y and a heading.") from None
    if len(rest) % (2 * n_limbs):
        raise LineError(f"A sighting has {len(rest)} numbers of markers, which do not suit {n_limbs} limbs.")
    markers = np.array(rest).reshape(n_limbs, -1, 2) if rest else None
    return Sighting(captured_at, seen_at, (x, y, heading), markers)


def line_of(seen: Sighting) -> str:
    """Line of a sighting, with digits that tell a hub that hardly moves from a tracker that is frozen."""
    numbers = [*seen.pose, *([] if seen.markers is None else seen.markers.ravel().tolist())]
    return " ".join(["sight", f"{seen.captured_at:.6f}", *(f"{number:.9g}" for number in numbers)])


class LinePlant:
    """Plant at the other end of a line.

    wires: File of whoever heats the wires. tracker: File of whoever sends sightings; None: the same.
    clock: Of the sightings [s]; that of this computer by default.
    PlantError: nobody answers, or in another version.
    """

    def __init__(self, wires: Channel, tracker: Channel | None = None, clock: Callable[[], float] = time.monotonic):
        self._wires, self.now = Lines(wires), clock
        self._tracker = None if tracker is None else Lines(tracker)
        self._seen: Sighting | None = None
        self.n_limbs = 0
        self._wires.send(f"hello {VERSION}")
        until = clock() + HELLO
        while not self.n_limbs:
            if clock() > until:
                raise PlantError(f"The plant did not answer within {HELLO:g} s: is it connected, and switched on?")
            time.sleep(0.005)
            self._listen()

    def _listen(self) -> None:
        """Hear the answer among what is left of earlier drives."""
        try:
            for words in self._wires.received():
                if words[0] == "hello":
                    self._understand(words)
        except LineError:
            return  # the beginning of a line that was under way

    def wait(self, seconds: float) -> None:
        """Return after so many seconds."""
        time.sleep(seconds)

    def sight(self) -> Sighting | None:
        """The newest sighting, None before there is one; says that the driver lives. PlantError: it has stopped."""
        self._wires.send("beat")
        self._take(self._wires)
        if self._tracker is not None:
            self._take(self._tracker)
        return self._seen

    def _take(self, lines: Lines) -> None:
        try:
            for words in lines.received():
                self._understand(words)
        except LineError as bad:
            if self._seen is not None or lines is self._wires:  # before, it is the beginning of a line under way
                raise PlantError(str(bad)) from None

    def _understand(self, words: list[str]) -> None:
        match words:
            case ["hello", version, n_limbs] if version == VERSION and n_limbs.isdigit() and 0 < int(n_limbs) <= 12:
                self.n_limbs = int(n_limbs)
            case ["hello", version, *_]:
                raise PlantError(f"The plant speaks version {version[:20]} of the lines, this is version {VERSION}.")
            case ["error", *words]:
                raise PlantError(f"The plant has stopped: {' '.join(words)}")
            case ["sight", *_]:
                self._seen = sighting_of(words, self.now(), self.n_limbs)
            case _:
                raise LineError(f"A plant says no {' '.join(words)[:60]!r}.")

    def heat(self, limbs: Sequence[int], seconds: float) -> None:
        """Heat wires, see `Plant`."""
        signs = "".join("-0+"[sign + 1] for sign in limbs)
        self._wires.send(f"heat {round(1000.0 * seconds)} {signs}")

    def stop(self) -> None:
        """Heat no wire any more, if the plant still hears; if not, it stops by itself."""
        try:
            self._wires.send("stop")
        except PlantError:
            return


class Server:
    """Other end of a `LinePlant`: does to a plant what the lines say, and stops it when there are none.

    plant: What is driven. wires: File of the driver. tracker: File that sightings go to; None: the same.
    """

    def __init__(self, plant: Plant, wires: Channel, tracker: Channel | None = None):
        self.plant, self._wires = plant, Lines(wires)
        self._tracker = self._wires if tracker is None else Lines(tracker)
        self._heard_at = plant.now()
        self._greeted, self._told = False, -np.inf

    def turn(self) -> None:
        """Do what was asked since the last turn, and tell of new sightings."""
        try:
            for words in self._wires.received():
                self._heard_at = self.plant.now()
                self._do(words)
        except ValueError as bad:
            self.plant.stop()
            self._tell(self._wires, f"error {bad}")
        except PlantError:
            self.plant.stop()
        if self.plant.now() - self._heard_at > SILENCE:
            self.plant.stop()  # as often as asked: it costs nothing where no wire is heated
        seen = self.plant.sight()
        if self._greeted and seen is not None and seen.captured_at > self._told:
            self._told = seen.captured_at
            self._tell(self._tracker, line_of(seen))

    def _tell(self, lines: Lines, line: str) -> None:
        try:
            lines.send(line)
        except PlantError:
            self.plant.stop()

    def _do(self, words: list[str]) -> None:
        match words:
            case ["hello", version]:
                self._greeted = version == VERSION
                self._wires.send(f"hello {VERSION} {self.plant.n_limbs}")
            case ["beat"]:
                pass
            case ["stop"]:
                self.plant.stop()
            case ["heat", milliseconds, signs] if self._is_pulse(milliseconds, signs):
                self.plant.heat(["-0+".index(sign) - 1 for sign in signs], int(milliseconds) / 1000.0)
            case _:
                raise LineError(f"There is no {' '.join(words)[:60]!r} to do.")

    def _is_pulse(self, milliseconds: str, signs: str) -> bool:
        says_all = milliseconds.isdigit() and len(signs) == self.plant.n_limbs
        return self._greeted and says_all and set(signs) <= set("-0+")


def serve(plant: Plant, wires: Channel, tracker: Channel | None = None, seconds: float = np.inf) -> None:
    """Be the other end of a `LinePlant` for so many seconds."""
    server, until = Server(plant, wires, tracker), plant.now() + seconds
    while plant.now() < until:
        server.turn()
        plant.wait(0.004)
