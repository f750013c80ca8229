"""An orderly stop: Ctrl-C asks a training to end at its next checkpoint."""

import signal
from types import FrameType


class Interruption:
    """Context in which a first Ctrl-C (or a termination) asks for an orderly stop; a second one stops at once."""

    SIGNALS = (signal.SIGINT, signal.SIGTERM)

    def __enter__(self) -> "Interruption":
        self.requested = False
        self._before = {number: signal.signal(number, self._request) for number in self.SIGNALS}
        return self

    def _request(self, number: int, frame: FrameType | None) -> None:
        self.requested = True
        self._restore()

    def _restore(self) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def __exit__(self, *exception: object) -> None:
        self._restore()
