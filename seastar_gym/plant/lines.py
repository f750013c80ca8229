"""Lines of text between a driver and a plant, over whatever carries bytes: a serial port, a pipe, a socket.

A serial port has 115200 baud. A line is ASCII: words with single spaces, "*", two upper-case hexadecimal digits
(exclusive or of all bytes before "*", the checksum of NMEA), line feed; for example "heat 80 +00-0*26".

    hello 1           from the driver: version 1. Stops all wires; nothing is heated before it
    hello 1 5         from the plant, the answer: version, number of limbs. Unasked: it has restarted, the driver stops
    beat              from the driver, at least every 0.1 s: it lives. Any other line says so, too
    heat 80 +00-0     from the driver: heat + of limb 1 and - of limb 4 for 80 ms from now on; other wires go on
    stop              from the driver: heat no wire
    sight 12.345678 0.100 0.020 1.571      from the tracker: time of the picture [s], x and y of the hub [m], heading of
                                           limb 1 [rad]
    sight 12.345678 0.100 0.020 1.571 0.2 ..   the same with markers: x, y [m], limb after limb, from hub to tip
    error It is too hot.                   from the plant: all wires are stopped, and why

A bad checksum, an unknown word or a refused pulse stops all wires, and the plant sends an error. A line has 4095 bytes
at most, 62 in examples/wires.ino. Pictures in which a marker is not seen are left out. Times are those of
`time.monotonic()` on the driver's computer, so the tracker runs there. The driver greets every 0.2 s for 5 s, until it
was answered twice.
"""

from __future__ import annotations

import contextlib
import errno
import math
import os
import re
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from functools import reduce
from operator import xor
from typing import Any, Protocol

import numpy as np

from seastar_gym.files import require_extra
from seastar_gym.plant.guard import Heat, Limits
from seastar_gym.plant.plant import Plant, PlantError, Sighting
from seastar_gym.scene.checks import MOST_LIMBS, require_kind, shown

VERSION = "1"
"""Version of the lines."""
SILENCE = 0.1
"""Time without a line from the driver after which a plant stops its wires [s]."""
LONGEST_LINE = 4096
"""Bytes that a line has room for: one that fills it is a bad one, up to its end."""
MOST_AT_ONCE = 16384
"""Bytes that are read at once at most, so that whoever sends without end keeps nobody."""
MOST_FORGOTTEN = 64
"""Times that are read at once at most, where all is forgotten."""
HELLO = 5.0
"""Time for which a plant is greeted [s]: boards that restart when their port is opened are deaf for 0.5 to 2 s."""
GREETING = 0.2
"""Time between greetings [s]."""
LOOKS = 20
"""Looks for an answer between greetings."""
NUMBER = re.compile(r"-?[0-9]{1,12}(\.[0-9]{0,20})?([eE][+-]?[0-9]{1,2})?")
"""A number of a sighting: all of them are floats, and finite."""
MILLISECONDS = re.compile("[0-9]{1,4}")
LONGEST_ASKED = 10.0
"""Length that pulses are shorter than [s]."""
ROUNDING = 1e-6
"""Fraction of a millisecond that is none."""
COUNT = re.compile("[0-9]{1,2}")
UNPRINTABLE = re.compile("[^ -~]")
SIGNS = {1: "+", 0: "0", -1: "-"}
OF_SIGNS = {sign: number for number, sign in SIGNS.items()}


class Channel(Protocol):
    """Anything that has a file descriptor, such as a file, a serial port, the end of a pipe or a socket."""

    def fileno(self) -> int:
        """Number of the descriptor."""


def open_serial(device: str, baud: int = 115200) -> Any:
    """Serial port of this rate that waits for nothing, a `serial.Serial` of pySerial. PlantError: there is none.

    Opening raises DTR, which restarts many boards: docs/plant.md says how to avoid it.
    """
    require_extra("Serial ports", "plant", "serial")
    import serial

    try:
        return serial.Serial(device, baud, timeout=0.0, write_timeout=0.0, exclusive=True)
    except OSError as refused:
        if refused.errno is None:
            raise PlantError(f"{device} is no serial line.") from None
        if refused.errno == errno.EWOULDBLOCK:
            raise PlantError(f"{device} is driven by another program.") from None
        raise PlantError(f"{device} cannot be opened: {os.strerror(refused.errno).lower()}.") from None


class LineError(ValueError):
    """A line that is none of this protocol."""


def sealed(line: str) -> bytes:
    """Line with its checksum and its end; what is no printable ASCII becomes "?"."""
    body = UNPRINTABLE.sub("?", line).encode("ascii")
    return body + b"*%02X\n" % reduce(xor, body, 0)


def opened(line: bytes) -> list[str]:
    """Words of a line. LineError: its checksum, or anything else of it, is wrong."""
    text = line.removesuffix(b"\r").decode("ascii", "replace")
    body, star, checksum = text.rpartition("*")
    if UNPRINTABLE.search(text) or not star or checksum != f"{reduce(xor, body.encode('ascii'), 0):02X}":
        raise LineError(f"A line was garbled: {text[:60]!r}.")
    return body.split(" ")


class Lines:
    """Lines over a file that is read without waiting."""

    def __init__(self, file: Channel):
        if not callable(getattr(file, "fileno", None)):
            raise ValueError(f"A line needs something with a descriptor, such as a socket, not {shown(file)}.")
        self._file, self._rest, self._full, self._whole = file, b"", False, deque[bytes]()
        os.set_blocking(file.fileno(), False)

    def send(self, line: str) -> None:
        """Send a line. PlantError: nobody is there to take it."""
        data = sealed(line)
        try:
            if os.write(self._file.fileno(), data) != len(data):
                raise BlockingIOError
        except BlockingIOError:
            raise PlantError("The plant takes no more lines: its other end does not read them.") from None
        except OSError as broken:
            raise PlantError(f"The line to the plant is broken: {(broken.strerror or 'unknown').lower()}.") from None

    def received(self) -> Iterator[list[str]]:
        """Words of lines since the last call, of `MOST_AT_ONCE` bytes at most; what is left is for the next calls.

        LineError: one was garbled or too long. PlantError: the other end has gone.
        """
        if not self._whole:
            chunk = self._read()
            if self._full:
                _, end, chunk = chunk.partition(b"\n")
                self._full = not end
            *whole, self._rest = (self._rest + chunk).split(b"\n")
            self._whole.extend(whole)
            if len(self._rest) >= LONGEST_LINE:
                self._whole.append(self._rest)
                self._rest, self._full = b"", True
        while self._whole:
            line = self._whole.popleft()
            if len(line) >= LONGEST_LINE:
                raise LineError(f"A line has more than {LONGEST_LINE} bytes.")
            yield opened(line)

    def forget(self) -> None:
        """Forget all that has come, and the end of a line that is under way. PlantError: the other end has gone."""
        self._whole.clear()
        self._full, self._rest = self._full or bool(self._rest), b""
        for _ in range(MOST_FORGOTTEN):
            if not (chunk := self._read()):
                return
            self._full = not chunk.endswith(b"\n")

    def _read(self) -> bytes:
        try:
            chunk = os.read(self._file.fileno(), MOST_AT_ONCE)
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
    pose, rest = words[1:5], words[5:]
    if len(pose) < 4 or not all(map(NUMBER.fullmatch, pose)):
        raise LineError("A sighting needs numbers: a time, x, y and a heading.")
    if not all(word == "nan" or NUMBER.fullmatch(word) for word in rest):
        raise LineError("Places of markers need to be numbers, or nan.")
    captured_at, x, y, heading = map(float, pose)
    if len(rest) % (2 * n_limbs):
        raise LineError(f"A sighting has {len(rest)} numbers of markers, which do not suit {n_limbs} limbs.")
    markers = np.array(rest, np.float64).reshape(n_limbs, -1, 2) if rest else None
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
        self.n_limbs, self._is_greeted = 0, False
        self._greet()

    def _greet(self) -> None:
        """Greet until there are two answers: a plant that begins to hear may say hello by itself."""
        for lines in filter(None, (self._wires, self._tracker)):
            lines.forget()
        answers = 0
        for _ in range(math.ceil(HELLO / GREETING) + 1):
            self._wires.send(f"hello {VERSION}")
            answers += self._is_answered()
            if answers == 2:
                break
        else:
            raise PlantError(f"The plant did not answer within {HELLO:g} s: is it connected, and switched on?")
        for _ in range(LOOKS // 2):  # what is left of earlier drives, and answers to other greetings
            self.wait(GREETING / LOOKS)
            self._wires.forget()
        self._is_greeted = True

    def _is_answered(self) -> bool:
        for _ in range(LOOKS):
            self.wait(GREETING / LOOKS)
            with contextlib.suppress(LineError):  # the beginning of a line that was under way
                for words in self._wires.received():
                    if words[0] == "hello":
                        self._understand(words)
                        return True
        return False

    def wait(self, seconds: float) -> None:
        """Return after so many seconds."""
        time.sleep(seconds)

    def sight(self) -> Sighting | None:
        """The newest sighting, None before there is one; says that the driver lives. PlantError: it has stopped."""
        try:
            self._wires.send("beat")
            self._take(self._wires)
            if self._tracker is not None:
                self._take(self._tracker)
        except BaseException:  # an interrupt, too: wires are cold before anybody hears of it
            self.stop()
            raise
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
            case ["hello", version, n] if version == VERSION and COUNT.fullmatch(n) and 0 < int(n) <= MOST_LIMBS:
                if self._is_greeted:
                    raise PlantError("The plant has restarted, as after a drop of its voltage: all wires are stopped.")
                self.n_limbs = int(n)
            case ["hello", version, *_]:
                raise PlantError(f"The plant speaks version {version[:20]} of the lines, this is version {VERSION}.")
            case ["error", *words]:
                raise PlantError(f"The plant has stopped: {' '.join(words)}")
            case ["sight", *_]:
                self._seen = sighting_of(words, self.now(), self.n_limbs)
            case _:
                raise LineError(f"A plant says no {' '.join(words)[:60]!r}.")

    def heat(self, limbs: Sequence[int], seconds: float) -> None:
        """Heat wires, see `Plant`; for whole milliseconds. ValueError: no board is asked for 10 s or more."""
        if not 0.0 <= seconds < LONGEST_ASKED:
            raise ValueError(f"A pulse must be from 0 to {LONGEST_ASKED:g} s, not {shown(seconds)} s.")
        signs = "".join(SIGNS[sign] for sign in limbs)
        self._wires.send(f"heat {int(1000.0 * seconds + ROUNDING)} {signs}")

    def stop(self) -> None:
        """Heat no wire any more, if the plant still hears; if not, it stops by itself."""
        try:
            self._wires.send("stop")
        except PlantError:
            return


class Server:
    """Other end of a `LinePlant`: does to a plant what the lines say within limits, and stops it when there are none.

    plant: What is driven. wires: File of the driver. tracker: File that sightings go to; None: the same.
    limits: Of pulses, rests and heat, a `Limits`; None: those by default.
    """

    def __init__(self, plant: Plant, wires: Channel, tracker: Channel | None = None, limits: Limits | None = None):
        limits = Limits() if limits is None else limits
        require_kind("limits", limits, Limits, "Limits")
        self.plant, self._wires = plant, Lines(wires)
        self._tracker = self._wires if tracker is None else Lines(tracker)
        self._heat = Heat(plant.n_limbs, limits)
        self._heard_at = self._turned_at = plant.now()
        self._is_late, self._greeted, self._told = False, False, -np.inf
        self._say_hello()

    def turn(self) -> None:
        """Do what was asked since the last turn, and tell of new sightings. Whatever goes wrong stops the plant."""
        try:
            self._obey()
            seen = self.plant.sight()
        except (ValueError, PlantError) as bad:
            self.stop()
            self._refuse(bad)
        except BaseException:  # what ends the loop stops the wires first
            self.stop()
            raise
        else:
            if self._greeted and seen is not None and seen.captured_at > self._told:
                self._told = seen.captured_at
                self._tell(self._tracker, line_of(seen))

    def stop(self) -> None:
        """Heat no wire any more."""
        self.plant.stop()
        self._heat.stop()

    def _tick(self) -> float:
        now = self.plant.now()
        self._heat.tick(now)
        return now

    def _obey(self) -> None:
        now = self._tick()
        self._is_late = not 0.0 <= now - self._turned_at <= SILENCE
        self._turned_at = now
        for words in self._wires.received():
            self._heard_at = self._tick()
            self._do(words)
        if not 0.0 <= self._tick() - self._heard_at <= SILENCE:
            self.stop()  # as often as asked: it costs nothing where no wire is heated

    def _refuse(self, why: Exception) -> None:
        """Tell why the plant was stopped, and forget what was asked for besides."""
        with contextlib.suppress(PlantError):
            self._wires.forget()
        self._tell(self._wires, f"error {why}"[: LONGEST_LINE // 2])

    def _say_hello(self) -> None:
        self._tell(self._wires, f"hello {VERSION} {self.plant.n_limbs}")

    def _tell(self, lines: Lines, line: str) -> None:
        try:
            lines.send(line)
        except PlantError:
            self.stop()

    def _do(self, words: list[str]) -> None:
        match words:
            case ["hello", version]:
                self.stop()
                self._greeted = version == VERSION
                self._say_hello()
            case ["beat"]:
                pass
            case ["stop"]:
                self.stop()
            case ["heat", milliseconds, signs] if self._is_pulse(milliseconds, signs):
                self._pulse([OF_SIGNS[sign] for sign in signs], int(milliseconds) / 1000.0)
            case _:
                raise LineError(f"There is no {' '.join(words)[:60]!r} to do.")

    def _is_pulse(self, milliseconds: str, signs: str) -> bool:
        says_all = MILLISECONDS.fullmatch(milliseconds) and len(signs) == self.plant.n_limbs
        return self._greeted and bool(says_all) and set(signs) <= set(OF_SIGNS)

    def _pulse(self, limbs: list[int], seconds: float) -> None:
        if self._is_late:
            raise LineError("The plant was busy: pulses that were asked for meanwhile are not heated.")
        wires = np.array([[limb > 0, limb < 0] for limb in limbs])
        if why := self._heat.refusal(wires, seconds):
            raise LineError(f"{why}.")
        self._heat.heat(wires, seconds)
        self.plant.heat(limbs, seconds)


def serve(
    plant: Plant,
    wires: Channel,
    tracker: Channel | None = None,
    seconds: float = np.inf,
    limits: Limits | None = None,
) -> None:
    """Be the other end of a `LinePlant` for so many seconds; whatever ends it, the wires are stopped."""
    server, until = Server(plant, wires, tracker, limits), plant.now() + seconds
    try:
        while plant.now() < until:
            server.turn()
            plant.wait(0.004)
    finally:
        server.stop()
