"""Learners on disk, so that a training can be continued.

A saved learner is Stable-Baselines3's own zip file with three more entries, which hold no pickles: `policy.json` is the
description of the policy (observation layout, scene, action mode, symmetry), `learner.safetensors` has the network, the
optimiser and the random generators, `learner.json` the settings and counters. `resume` reads these three, the policy
alone is read by `seastar_gym.controllers.learned`, and neither unpickles anything. `PPO.load` of Stable-Baselines3
reads the file, too, and unpickles its own part: use it only on files of people whom you trust. Policies without their
learner are in `seastar_gym.controllers.learned`.
"""

import io
import json
import os
import random
import zipfile
from collections import deque
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
import safetensors.torch
import torch
from stable_baselines3 import PPO

from agents.ppo import Hyperparameters, actor, describe, make_model, policy_of, require_device
from seastar_gym import RewardWeights
from seastar_gym.adapters.stable_baselines3 import BatchVecEnv
from seastar_gym.controllers.description import Description
from seastar_gym.controllers.learned import DESCRIPTION, LEARNER, LearnedPolicy, one_sentence, opened
from seastar_gym.files import write_atomically
from seastar_gym.scene.checks import require_count

FACTS = "learner.json"
FORMAT = 1
"""Version of the three entries."""


def save(model: PPO, path: str | os.PathLike[str]) -> None:
    """Write a learner to `path`, whole or not at all."""
    buffer = io.BytesIO()
    model.save(buffer)
    with zipfile.ZipFile(buffer, "a") as archive:
        description = policy_of(model).description
        archive.writestr(DESCRIPTION, description.to_json(strokes_trained=model.num_timesteps))
        archive.writestr(LEARNER, safetensors.torch.save({**_tensors(model), **_generators(model)}))
        archive.writestr(FACTS, json.dumps(_facts(model)))
    write_atomically(path, buffer.getvalue())


def _tensors(model: PPO) -> dict[str, torch.Tensor]:
    """Tensors of the network, and the optimiser's moments of each, by name."""
    network = {f"network.{name}": tensor for name, tensor in model.policy.state_dict().items()}
    moments = {
        f"optimiser.{index}.{name}": tensor
        for index, state in model.policy.optimizer.state_dict()["state"].items()
        for name, tensor in state.items()
    }
    return {name: tensor.detach().cpu().contiguous() for name, tensor in (network | moments).items()}


def _generators(model: PPO) -> dict[str, torch.Tensor]:
    """Words of the global generators of torch, numpy and Python, by name; `_facts` has the rest of their state."""
    _, numpy_words, *_ = np.random.get_state(legacy=True)  # noqa: NPY002
    words = {
        "torch": torch.get_rng_state(),
        "numpy": torch.from_numpy(np.asarray(numpy_words, np.int64)),
        "python": torch.tensor(random.getstate()[1]),
    }
    if model.device.type == "cuda":
        words["cuda"] = torch.cuda.get_rng_state(model.device)
    return {f"generator.{name}": tensor for name, tensor in words.items()}


def _facts(model: PPO) -> dict[str, Any]:
    """Settings, counters and statistics of a learner, as JSON writes them."""
    _, _, *numpy_rest = np.random.get_state(legacy=True)  # noqa: NPY002
    return {
        "format": FORMAT,
        "settings": asdict(_hyperparameters(model)),
        "seed": model.seed,
        "strokes": model.num_timesteps,
        "updates": model._n_updates,
        "episodes": list(model.ep_info_buffer or ()),
        "successes": list(model.ep_success_buffer or ()),
        "numpy": numpy_rest,
        "python": random.getstate()[2],
    }


def _hyperparameters(model: PPO) -> Hyperparameters:
    """Hyperparameters of a learner; those of its environment have their defaults, so the discount is per decision."""
    assert callable(model.clip_range)
    return Hyperparameters(
        num_envs=model.n_envs,
        rollout=model.n_steps,
        batch_size=model.batch_size,
        epochs=model.n_epochs,
        learning_rate=model.lr_schedule(1.0),
        discount=model.gamma,
        gae_lambda=model.gae_lambda,
        clip_range=model.clip_range(1.0),
        entropy=model.ent_coef,
        hidden=tuple(model.policy_kwargs["net_arch"]),
    )


def resume(path: str | os.PathLike[str], env: BatchVecEnv, device: str = "cpu") -> PPO:
    """Learner in a file that `save` wrote, with its weights, optimiser, stroke count and random states.

    The environment's episodes begin anew, with seeds that were not used before. Nothing is unpickled.
    """
    with opened(path) as archive:
        description = Description.from_json(archive.read(DESCRIPTION).decode())
        tensors = safetensors.torch.load(archive.read(LEARNER))
        facts = json.loads(archive.read(FACTS))
        network = _part(tensors, "network")
        LearnedPolicy(description, actor(network))  # its widths are those of tensors that are there
    ours = describe(env, description.hidden)
    if description != ours:
        raise ValueError(f"{os.fspath(path)} was trained for {description}, not for {ours}.")
    require_device(device)
    with one_sentence(path):
        require_count("seed", facts["seed"], 0, 2**32 - 1)
        settings = facts["settings"] | {"hidden": description.hidden, "reward": RewardWeights()}
        model = make_model(env, Hyperparameters(**settings), facts["seed"], device)
        model.policy.load_state_dict(network)
        _restore_optimiser(model, _part(tensors, "optimiser"))
        _restore_counters(model, facts)
        env.seed(facts["seed"] + model.num_timesteps)
        _restore_generators(model, _part(tensors, "generator"), facts)
    return model


def _part(tensors: Mapping[str, torch.Tensor], kind: str) -> dict[str, torch.Tensor]:
    """Tensors whose names begin with a kind, under the rest of their names."""
    return {name.removeprefix(f"{kind}."): one for name, one in tensors.items() if name.startswith(f"{kind}.")}


def _restore_optimiser(model: PPO, moments: Mapping[str, torch.Tensor]) -> None:
    parameters = list(model.policy.parameters())
    state: dict[int, dict[str, torch.Tensor]] = {}
    for name, tensor in moments.items():
        index, _, moment = name.partition(".")
        if tensor.shape not in ((), parameters[int(index)].shape):
            raise ValueError(f"its optimiser has {name} of shape {tuple(tensor.shape)}")
        state.setdefault(int(index), {})[moment] = tensor
    groups = model.policy.optimizer.state_dict()["param_groups"]
    model.policy.optimizer.load_state_dict({"state": state, "param_groups": groups})


def _restore_counters(model: PPO, facts: Mapping[str, Any]) -> None:
    if facts["format"] != FORMAT:
        raise ValueError(f"the learner's format is {facts['format']}, this version knows {FORMAT}")
    for name in ("strokes", "updates"):
        require_count(name, facts[name], 0, 2**53)
    model.num_timesteps, model._n_updates = facts["strokes"], facts["updates"]
    size = model._stats_window_size
    model.ep_info_buffer = deque(({name: float(one[name]) for name in "rlt"} for one in facts["episodes"]), size)
    model.ep_success_buffer = deque(map(float, facts["successes"]), size)


def _restore_generators(model: PPO, words: Mapping[str, torch.Tensor], facts: Mapping[str, Any]) -> None:
    """Set the global generators. Numpy does not check a position beyond its words, and would read foreign memory."""
    position, has_gauss, cached_gaussian = facts["numpy"]
    require_count("the position in numpy's generator", position, 0, 624)
    numpy_words = words["numpy"].numpy().astype(np.uint32)
    np.random.set_state(("MT19937", numpy_words, position, has_gauss, cached_gaussian))  # noqa: NPY002
    random.setstate((3, tuple(words["python"].tolist()), facts["python"]))
    torch.set_rng_state(words["torch"])
    if model.device.type == "cuda" and "cuda" in words:
        torch.cuda.set_rng_state(words["cuda"], model.device)
