"""What `Scene.for_error` asks of a certificate, without importing its class, which is made of scenes."""

from collections.abc import Callable
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from seastar_gym.scene.checks import shown


@runtime_checkable
class Certified(Protocol):
    """A certificate, see certificate.py."""

    def kept_by(self, error: float, robot: Any = None) -> Any:
        """Scene at the fastest setting whose error is at most `error`; ValueError where it has lapsed."""
        ...


Read = Callable[[Path], Certified]
_READERS: list[Read] = []


def reads_certificates(read: Read) -> Read:
    """Decorator of the function that reads a certificate's file."""
    _READERS.append(read)
    return read


def as_certificate(certificate: Certified | str | PathLike[str]) -> Certified:
    """Certificate of an object or a file; ValueError for anything else."""
    if isinstance(certificate, str | PathLike):
        import_module("seastar_gym.scene.certificate")  # which registers its reader, and is made of scenes
        return _READERS[0](Path(certificate))
    if not isinstance(certificate, Certified):
        raise ValueError(f"certificate must be a Certificate or a file of one, not {shown(certificate)}.")
    return certificate
