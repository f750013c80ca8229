"""Trains a swimmer with PPO, then compares it with the scripted pentagon gait.

    python train.py                        a minute or two on two cores
    python train.py --quick                the whole way in short, in under a minute
    python train.py --resume runs/FOLDER   continues a run that was stopped (Ctrl-C), or trains it for more --strokes

Everything is written to a folder of its own: the policy, the learner and its checkpoints, the options and the command,
TensorBoard logs, and the comparison with its table, pictures, videos and report.html. With --ship the policy becomes
the one in the box.
"""

import csv
import json
import os
import platform
import shlex
import shutil
import signal
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from types import FrameType
from typing import Annotated, Literal

import gymnasium
import numba
import numpy as np
import stable_baselines3
import torch
import tyro
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure
from tqdm import tqdm

import seastar_gym
from agents.evaluate import evaluate
from agents.policy import SHIPPED
from agents.policy import load as load_policy
from agents.policy import save as save_policy
from agents.ppo import Hyperparameters, make_model, make_training_env, policy_of, resume, save
from agents.report.charts import Curve, read_progress
from agents.report.page import Remarks
from agents.scripted import scripted
from agents.swim import swim
from agents.vec_env import BatchVecEnv
from seastar_gym import RewardWeights
from seastar_gym.envs.paths import PathName
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.scene.numerics import Fidelity

MAX_STROKES = 400
"""Time limit of a swim round the pentagon; the scripted gait takes 250."""


@dataclass(frozen=True)
class Options:
    """Train a swimmer with PPO and compare it with the scripted pentagon gait."""

    strokes: int = 300_000
    """Strokes to train for, of all robots together."""
    path: PathName = "random"
    """What to train on. Random paths teach every direction and every turn; the pentagon is then just one of them."""
    random_heading: bool = True
    """Turn the robots at random at the start of every episode."""
    fidelity: Fidelity = "balanced"
    """How exactly the swims are computed, in training and in the comparison."""
    seed: int = 0
    """Of the network, of the exploration and of the paths."""
    num_threads: int | None = None
    """Threads of the simulator; all processors by default. The network always uses one: more are slower."""
    device: Literal["cpu", "cuda", "auto"] = "cpu"
    """Where the network is. It is small: a GPU is no faster."""
    save_freq: int = 25_000
    """Strokes between checkpoints."""
    video: bool = True
    """Film the swims of the comparison."""
    out: Path | None = None
    """Folder of the run; runs/ and the time by default."""
    ship: bool = False
    """Make the policy the one in the box, which agents.evaluate takes by default."""
    resume: Path | None = None
    """Continue the run in this folder, with its options; only strokes, num_threads, device, save_freq, video and ship
    may be given anew."""
    quick: bool = False
    """A short form that goes all the way in under a minute, at fidelity "fast"."""
    ppo: Annotated[Hyperparameters, tyro.conf.arg(name="")] = Hyperparameters()

    def __post_init__(self) -> None:
        if self.strokes < 1 or self.save_freq < 1:
            raise ValueError("strokes and save_freq must be at least 1.")


CHANGEABLE = {"strokes", "num_threads", "device", "save_freq", "video", "ship", "out", "resume", "quick"}
"""Options that may change when a run is continued."""


# --- options and their folder ----------------------------------------------------------------------------------------


def read_options(arguments: Sequence[str]) -> Options:
    """The options of the command line; with --resume, those of the run unless given anew."""
    options = tyro.cli(Options, args=arguments)
    if options.resume is None:
        return replace(options, strokes=32_768, save_freq=16_384, fidelity="fast") if options.quick else options
    saved = replace(saved_options(options.resume), out=options.resume, resume=options.resume)
    options = tyro.cli(Options, args=arguments, default=saved)
    changed = [name for name in saved.__dict__ if getattr(options, name) != getattr(saved, name)]
    if forbidden := sorted(set(changed) - CHANGEABLE):
        raise ValueError(f"The run in {options.resume} cannot continue with another {', '.join(forbidden)}.")
    return replace(options, out=options.resume)


def saved_options(folder: Path) -> Options:
    """The options of the run in a folder."""
    file = folder / "config.json"
    if not file.is_file():
        raise FileNotFoundError(f"There is no run to continue in {folder}: it has no config.json.")
    try:
        options = json.loads(file.read_text(encoding="utf-8"))["options"]
        ppo = options.pop("ppo")
        ppo |= {"hidden": tuple(ppo["hidden"]), "reward": RewardWeights(**ppo["reward"])}
        return Options(**{**options, "out": folder, "resume": None, "ppo": Hyperparameters(**ppo)})
    except (json.JSONDecodeError, KeyError, TypeError) as damaged:
        raise ValueError(f"{file} is damaged or from another version: {damaged}.") from damaged


def write_config(options: Options, arguments: Sequence[str], folder: Path) -> None:
    """What was asked for, by which commands, with which versions and on which machine."""
    file = folder / "config.json"
    earlier = [] if options.resume is None else json.loads(file.read_text(encoding="utf-8"))["commands"]
    modules = (seastar_gym, gymnasium, numba, np, stable_baselines3, torch)
    config = {
        "commands": [*earlier, shlex.join(["python", "train.py", *arguments])],
        "options": asdict(options),
        "versions": {"python": platform.python_version(), **{one.__name__: one.__version__ for one in modules}},
        "machine": {"system": platform.platform(), "processors": os.cpu_count()},
    }
    file.write_text(json.dumps(config, indent=2, default=str) + "\n", encoding="utf-8")


def export(model: PPO, folder: Path, ship: bool) -> None:
    """policy.safetensors and policy.json: what was learned and how, without the learner; `ship` puts it in the box."""
    config = json.loads((folder / "config.json").read_text(encoding="utf-8"))
    learned = policy_of(model)
    for file in (folder / "policy.safetensors", *([SHIPPED] if ship else [])):
        save_policy(
            learned,
            file,
            strokes=model.num_timesteps,
            seed=model.seed,
            progress=read_progress(folder),
            **{name: config[name] for name in ("commands", "options", "versions")},
        )


# --- training --------------------------------------------------------------------------------------------------------


class Interruption:
    """Within it, a first Ctrl-C (or a termination) asks for an orderly stop; a second one stops at once."""

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


class Watch(BaseCallback):
    """Progress bar, logs and checkpoints; stops the training when `stop` says so."""

    def __init__(self, options: Options, folder: Path, learner: PPO, batch: BatchVecEnv, stop: Callable[[], bool]):
        super().__init__()
        self.options, self.folder, self.learner, self.batch, self.stop = options, folder, learner, batch, stop
        self.strokes = 0  # of this session
        self.seconds = {"simulator": 0.0, "policy": 0.0, "update": 0.0}
        self.pentagon = SeastarSwimEnv("pentagon", actions=options.ppo.actions, fidelity=options.fidelity)

    def _on_training_start(self) -> None:
        # On a terminal only: elsewhere, a line at every checkpoint says how far it is.
        total, done = self.options.strokes, self.learner.num_timesteps
        self.bar = tqdm(total=total, initial=done, unit=" strokes", unit_scale=True, disable=None, smoothing=0.1)
        self.next_save = done + self.options.save_freq
        self.clock = time.perf_counter()

    def _on_rollout_start(self) -> None:
        self.seconds["update"] += self._lap()
        if self.learner.num_timesteps >= self.next_save:
            self.next_save += self.options.save_freq
            self.checkpoint()
            self._lap()
        self.simulator_seconds = self.batch.seconds_in_steps

    def _on_step(self) -> bool:
        self.strokes += self.batch.num_envs
        self.bar.update(self.batch.num_envs)
        return not self.stop()

    def _on_rollout_end(self) -> None:
        simulator = self.batch.seconds_in_steps - self.simulator_seconds
        self.seconds["simulator"] += simulator
        self.seconds["policy"] += self._lap() - simulator
        for name, share in self.shares().items():
            self.logger.record(f"time/share_{name}", share)

    def _on_training_end(self) -> None:
        self.bar.close()

    def _lap(self) -> float:
        """Seconds since the last lap."""
        before, self.clock = self.clock, time.perf_counter()
        return self.clock - before

    def shares(self) -> dict[str, float]:
        """Of the training's time: in the simulator, in the policy and in the update."""
        total = sum(self.seconds.values())
        return {name: seconds / total if total else 0.0 for name, seconds in self.seconds.items()}

    def checkpoint(self) -> None:
        """Save the model, and see how it swims round the pentagon."""
        strokes = self.learner.num_timesteps
        save(self.learner, self.folder / "model.zip")
        (self.folder / "checkpoints").mkdir(exist_ok=True)
        shutil.copyfile(self.folder / "model.zip", self.folder / "checkpoints" / f"model_{strokes:09d}.zip")
        done = swim("learned", policy_of(self.learner), self.pentagon, max_strokes=MAX_STROKES)
        self.logger.record("eval/pentagon_strokes", done.strokes)
        self.logger.record("eval/pentagon_waypoints", done.waypoints_reached)
        with (self.folder / "progress.csv").open("a", newline="", encoding="utf-8") as file:
            csv.writer(file).writerow([strokes, done.strokes, done.waypoints_reached])
        reached = "" if done.finished else f" (only {done.waypoints_reached} waypoints)"
        self.bar.set_postfix_str(f"pentagon in {done.strokes}{reached}")
        if self.bar.disable:
            print(f"{strokes} strokes trained: the pentagon takes {done.strokes}{reached}.", flush=True)


def train(options: Options, folder: Path, stop: Callable[[], bool]) -> tuple[PPO, Watch]:
    """The learner after the strokes asked for, or when `stop` said so; saved as model.zip in either case."""
    env = make_training_env(
        options.ppo, options.path, options.random_heading, fidelity=options.fidelity, threads=options.num_threads
    )
    if options.resume is None:
        model = make_model(env, options.ppo, options.seed, options.device)
    else:
        model = resume(folder / "model.zip", env, options.device)
    model.set_logger(configure(str(folder / "tensorboard"), ["tensorboard"]))
    watch = Watch(options, folder, model, env, stop)
    left = options.strokes - model.num_timesteps
    if left > 0:
        model.learn(left, watch, log_interval=1, reset_num_timesteps=options.resume is None)
        watch.checkpoint()
    env.close()
    return model, watch


# --- comparison and report -------------------------------------------------------------------------------------------


def compare(options: Options, folder: Path, remarks: Remarks) -> None:
    """The learned policy and the scripted gait round the pentagon: table, CSV, picture, videos and report."""
    evaluate(
        {"learned": load_policy(folder / "policy.safetensors"), "script": scripted("pentagon")},
        "pentagon",
        max_strokes=MAX_STROKES,
        fidelity=options.fidelity,
        video=options.video,
        report=remarks,
        out=folder / "evaluation",
    )


def describe(options: Options, folder: Path, trained: int, watch: Watch) -> Remarks:
    """What the report says about the training. trained: Strokes in all."""
    sentences = [
        f'Swum at fidelity "{options.fidelity}".',
        f"Trained for {trained} strokes, seed {options.seed}, by the first of these commands; the last three show the "
        "logs, compare again, and train on.",
    ]
    if seconds := sum(watch.seconds.values()):
        shares = ", ".join(f"{name} {share:.0%}" for name, share in watch.shares().items())
        sentences.append(
            f"The last session took {seconds:.0f} s, {watch.strokes / seconds:.0f} strokes per second: {shares}."
        )
    policy = shlex.quote(str(folder / "policy.safetensors"))
    return Remarks(
        title="Learned against scripted round the pentagon",
        sentences=sentences,
        commands=[
            *json.loads((folder / "config.json").read_text(encoding="utf-8"))["commands"],
            f"tensorboard --logdir {shlex.quote(str(folder))}",
            f"python -m agents.evaluate --agents {policy} pentagon --fidelity {options.fidelity} --report",
            f"{resume_command(folder)} --strokes {2 * trained}",
        ],
        curves=[Curve.of("learned", read_progress(folder))],
    )


def resume_command(folder: Path) -> str:
    """What continues the run in a folder."""
    return shlex.join(["python", "train.py", "--resume", str(folder)])


# --- the experiment --------------------------------------------------------------------------------------------------


def run(options: Options, arguments: Sequence[str]) -> int:
    """Train, compare, report; returns the exit code."""
    torch.set_num_threads(1)  # two threads are slower on so small a network, and the simulator has the processors
    folder = options.out or Path("runs") / time.strftime("%Y-%m-%d_%H-%M-%S")
    if folder.exists() and options.resume is None:
        raise ValueError(f"{folder} exists already: give another --out, or continue the run in it with --resume.")
    folder.mkdir(parents=True, exist_ok=True)
    write_config(options, arguments, folder)
    print(f"The run is in {folder}.", flush=True)
    with Interruption() as interruption:
        model, watch = train(options, folder, lambda: interruption.requested)
    export(model, folder, options.ship and not interruption.requested)
    if interruption.requested:
        print(
            f"Stopped after {model.num_timesteps} strokes; {folder / 'model.zip'} is the policy so far. Continue with"
        )
        print(f"    {resume_command(folder)}")
        return 130
    compare(options, folder, describe(options, folder, model.num_timesteps, watch))
    print(f"Report:  {folder / 'evaluation' / 'report.html'}\nPolicy:  {folder / 'policy.safetensors'}")
    print(f"Logs:    tensorboard --logdir {folder}")
    return 0


def main(arguments: Sequence[str]) -> int:
    """The command line; returns the exit code."""
    try:
        return run(read_options(arguments), arguments)
    except (ValueError, FileNotFoundError) as wrong:
        print(wrong, file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("Stopped at once: what was written until then is in the run's folder.", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
