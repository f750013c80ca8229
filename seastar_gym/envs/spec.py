"""Specs of environments that can be written as JSON and read back:

    spec = EnvSpec.from_json(env.spec.to_json())
    env = gym.make(spec)
"""  # fmt: skip

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from enum import Enum
from os import PathLike, fspath
from typing import Any

import numpy as np
from gymnasium.envs.registration import EnvSpec

from seastar_gym.scene.serial import KINDS, to_dict


class PlainSpec:
    """An environment whose spec holds its arguments as plain data: a scene as `Scene.to_dict` writes it, for one.

    Arguments that have no plain form, such as a scene with an actuator of one's own, stay as they are: the spec makes
    environments as any other does, but refuses to be written.
    """

    _spec: EnvSpec | None = None

    @property
    def spec(self) -> EnvSpec | None:
        """How `gym.make` made the environment, None if it did not."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = None if spec is None else _as_plain(spec)


class _UnwritableSpec(EnvSpec):
    def to_json(self) -> str:
        """Refuse, with the reason."""
        _plain(self.kwargs)
        return super().to_json()


def _as_plain(spec: EnvSpec) -> EnvSpec:
    try:
        return replace(spec, kwargs=_plain(spec.kwargs))
    except ValueError:
        return _UnwritableSpec(**{one.name: getattr(spec, one.name) for one in fields(spec) if one.init})


def _plain(value: Any) -> Any:
    """An argument, or several, as JSON has them."""
    match value:
        case _ if KINDS.get(type(value).__name__) is type(value):
            return to_dict(value)
        case Enum():
            return value.value
        case PathLike():
            return fspath(value)
        case np.ndarray() | np.generic():
            return value.tolist()
        case None | bool() | int() | float() | str():
            return value
        case Sequence() if not isinstance(value, bytes):
            return [_plain(one) for one in value]
        case Mapping():
            return {name: _plain(one) for name, one in value.items()}
    raise ValueError(f"The spec of an environment with {value!r} among its arguments cannot be written.")
