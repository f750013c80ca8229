"""Policies in the `model.zip` of a training: Stable-Baselines3's own file with entries that hold no pickles.

`policy.json` is the description of the policy, `learner.safetensors` has the network. Nothing else is read here, so
neither torch nor Stable-Baselines3 is needed.
"""

import os
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import safetensors
import safetensors.numpy
from numpy.typing import NDArray

from seastar_gym.controllers.description import Description
from seastar_gym.controllers.learned import LearnedPolicy, Weights, reason_of
from seastar_gym.files import LARGEST_FILE

DESCRIPTION, LEARNER = "policy.json", "learner.safetensors"
NETWORK = "network."
"""Beginning of the names of the network's arrays."""
ACTOR = "mlp_extractor.policy_net."
"""Beginning of the names of the policy's hidden layers, as Stable-Baselines3 calls them."""


def load(path: str | os.PathLike[str]) -> LearnedPolicy:
    """Policy of a training's model.zip. FileNotFoundError or ValueError, with one sentence, if there is none."""
    with opened(path) as archive:
        description = Description.from_json(archive.read(DESCRIPTION).decode())
        arrays = safetensors.numpy.load(archive.read(LEARNER))
        network = {name.removeprefix(NETWORK): one for name, one in arrays.items() if name.startswith(NETWORK)}
        return LearnedPolicy(description, actor(network))


def actor(network: Mapping[str, NDArray[Any]]) -> Weights:
    """Weights of the policy in Stable-Baselines3's network, under the names of `LearnedPolicy`."""
    hidden = sorted({int(name.split(".")[2]) for name in network if name.startswith(ACTOR)})
    layers = [*(f"{ACTOR}{number}" for number in hidden), "action_net"]
    return {
        f"{layer}.{kind}": network[f"{name}.{kind}"] for layer, name in enumerate(layers) for kind in ("weight", "bias")
    }


@contextmanager
def opened(path: str | os.PathLike[str]) -> Iterator[zipfile.ZipFile]:
    """The archive, whose faults are said in one sentence."""
    if not os.path.isfile(path):
        raise FileNotFoundError(f"There is no trained policy at {os.fspath(path)}.")
    with one_sentence(path), zipfile.ZipFile(path) as archive:
        if sum(member.file_size for member in archive.infolist()) > LARGEST_FILE:
            raise ValueError(f"It unpacks to more than {LARGEST_FILE:,} bytes")
        yield archive


@contextmanager
def one_sentence(path: str | os.PathLike[str]) -> Iterator[None]:
    """Context in which any fault of the file's contents becomes a ValueError with one sentence."""
    try:
        yield
    except (zipfile.BadZipFile, EOFError, zlib.error, KeyError, safetensors.SafetensorError) as damaged:
        reason = str(damaged.args[0]).rstrip(".")
        raise ValueError(f"{os.fspath(path)} is damaged, or no policy saved by this project: {reason}.") from damaged
    except (AttributeError, IndexError, OverflowError, RuntimeError, TypeError, ValueError) as mismatch:
        raise ValueError(f"{os.fspath(path)} does not fit: {reason_of(mismatch)}.") from mismatch
