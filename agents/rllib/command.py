"""Trains on several machines: python -m agents.rllib --address head:6379 --env-runners 16 --out runs/cluster."""

import logging
from collections.abc import Sequence

import ray
import torch

from agents.rllib.options import Options, read_options
from agents.rllib.training import Round, Watch, train
from agents.training import efficiency
from agents.training.folder import held
from agents.training.watch import Interruption
from seastar_gym.command import answered
from seastar_gym.executors.on_ray import connect


def run(options: Options) -> int:
    """Train; returns the exit code."""
    logging.getLogger("ray.rllib").setLevel(logging.ERROR)  # it warns that its defaults are the new ones
    torch.set_num_threads(1)  # more are slower on so small a network
    with held(options.out, options.resume is None):
        connect(options.address, options.env_runners)
        options.write()
        print(f"The run is in {options.out}.", flush=True)
        with Interruption() as interruption:
            done = train(options, watch_of(interruption))
        ray.shutdown()
    if interruption.requested:
        print(f"Stopped after {done.strokes} strokes. Continue with\n    python -m agents.rllib --resume {options.out}")
        return 130
    print(f"Policy:  {options.out / 'policy.safetensors'}\n{efficiency.read(options.out)}")
    return 0


def watch_of(interruption: Interruption) -> Watch:
    """Watch that tells of lost env runners and ends the training when that is asked for."""
    told = 0

    def watch(done: Round) -> bool:
        nonlocal told
        if done.restarts > told:
            print(f"{done.strokes} strokes trained: {done.restarts - told} env runners were lost and started again.")
            told = done.restarts
        return not interruption.requested

    return watch


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    return answered(lambda: run(read_options(arguments)))
