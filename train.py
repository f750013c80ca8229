"""Trains a swimmer with PPO, then compares it with the scripted pentagon gait.

    python train.py                        a minute or two on two cores
    python train.py --quick                the whole way in short, in under a minute
    python train.py --resume runs/FOLDER   continues a run that was stopped (Ctrl-C, or killed), or trains it for more
                                           --strokes

Everything is written to a folder of its own: the policy, the learner and its checkpoints, the options and the command,
TensorBoard logs, and the comparison with its table, pictures, videos and report.html. With --ship the policy becomes
the one in the box, if it is no worse.

Exit status: 0 done; 1 a file could not be written, or the policy was not put in the box; 2 wrong options; 130 stopped.
"""

import json
import os
import platform
import shlex
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from types import FrameType
from typing import Annotated, Literal

try:
    import gymnasium
    import numba
    import numpy as np
    import stable_baselines3
    import tensorboard  # noqa: F401, Stable-Baselines3 asserts that it is there when the training begins
    import torch
    import tyro
    from stable_baselines3 import PPO
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.logger import configure
    from tqdm import tqdm

    import seastar_gym
    from agents.evaluate import evaluate
    from agents.files import write_atomically
    from agents.policy import SHIPPED, LearnedPolicy
    from agents.policy import load as load_policy
    from agents.policy import save as save_policy
    from agents.ppo import Hyperparameters, make_model, make_training_env, policy_of, require_device, resume, save
    from agents.report.charts import Curve, read_progress
    from agents.report.page import Remarks
    from agents.scripted import scripted
    from agents.swim import Swim, swim
    from agents.trials import HELD_OUT_SEED, swim_many
    from agents.vec_env import BatchVecEnv
    from seastar_gym import RewardWeights
    from seastar_gym.command import refused_by_disk
    from seastar_gym.envs.seastar_swim import SeastarSwimEnv
    from seastar_gym.envs.task import make_scene
    from seastar_gym.scene.numerics import Fidelity
except ModuleNotFoundError as missing:
    sys.exit(f'train.py needs {missing.name}: pip install "seastar-gym[train]".')

MAX_STROKES = 400
"""Time limit of a swim round the pentagon; the scripted gait takes 250."""
HELD_OUT_PATHS = 64
"""Random paths on which a policy is compared with the one in the box; no training draws them."""


@dataclass(frozen=True)
class Options:
    """Train a swimmer with PPO and compare it with the scripted pentagon gait."""

    strokes: int = 300_000
    """Strokes to train for, of all robots together."""
    path: str = "random"
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
    """Make the policy the one in the box, which agents.evaluate takes by default; if it takes more strokes than that
    one on held-out random paths, or the run is --quick, only with --ship-anyway."""
    ship_anyway: bool = False
    """With --ship: replace the policy in the box even by that of a short run, or by a worse one."""
    resume: Path | None = None
    """Continue the run in this folder, with its options; only strokes, num_threads, device, save_freq, video and ship
    may be given anew. Somebody else's run is safe to continue: what is read of it is JSON and tensors, and nothing is
    unpickled. Loading its model.zip with Stable-Baselines3's own PPO.load can execute their code."""
    quick: bool = False
    """A short form that goes all the way in under a minute, at fidelity "fast"."""
    ppo: Annotated[Hyperparameters, tyro.conf.arg(name="")] = Hyperparameters()

    def __post_init__(self) -> None:
        if self.strokes < 1 or self.save_freq < 1:
            raise ValueError("strokes and save_freq must be at least 1.")


CHANGEABLE = {"strokes", "num_threads", "device", "save_freq", "video", "ship", "ship_anyway", "out", "resume", "quick"}
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
    """The options of the run in a folder; its policy goes to the box only if that is asked for anew."""
    file = folder / "config.json"
    if not file.is_file():
        raise FileNotFoundError(f"There is no run to continue in {folder}: it has no config.json.")
    try:
        options = json.loads(file.read_text(encoding="utf-8"))["options"]
        ppo = options.pop("ppo")
        ppo |= {"hidden": tuple(ppo["hidden"]), "reward": RewardWeights(**ppo["reward"])}
        here = {"out": folder, "resume": None, "ppo": Hyperparameters(**ppo), "ship": False, "ship_anyway": False}
        return Options(**{**options, **here})
    except (AttributeError, KeyError, RecursionError, TypeError, ValueError) as damaged:
        raise ValueError(f"{file} is damaged or from another version: {str(damaged).rstrip('.')}.") from damaged


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
    write_atomically(file, (json.dumps(config, indent=2, default=str) + "\n").encode())


def require_consent(options: Options) -> None:
    """ValueError where the policy in the box would be replaced by that of a short run, asked for only once."""
    if options.ship_anyway and not options.ship:
        raise ValueError("--ship-anyway confirms --ship: give both.")
    if options.ship and options.quick and not options.ship_anyway:
        raise ValueError("A --quick run replaces the policy in the box only with --ship-anyway beside --ship.")


def claim(folder: Path) -> None:
    """Make the folder of a new run; one that is there may only be empty, or hold what a kill left of its beginning."""
    if "\0" in str(folder):
        raise ValueError(f"{str(folder)!r} is no name of a folder.")
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"{folder} is no folder: give another --out.")
    folder.mkdir(parents=True, exist_ok=True)
    if any(file.name != "config.json.part" for file in folder.iterdir()):
        raise ValueError(f"{folder} exists already: give another --out, or continue the run in it with --resume.")


def export(model: PPO, folder: Path) -> None:
    """policy.safetensors and policy.json: what was learned and how, without the learner."""
    config = json.loads((folder / "config.json").read_text(encoding="utf-8"))
    save_policy(
        policy_of(model),
        folder / "policy.safetensors",
        strokes=model.num_timesteps,
        seed=model.seed,
        progress=read_progress(folder),
        **{name: config[name] for name in ("commands", "options", "versions")},
    )


# --- the policy in the box -------------------------------------------------------------------------------------------


def put_in_the_box(options: Options, folder: Path) -> int:
    """Make the run's policy the one in the box, unless that one is better and nobody insists; returns the exit code."""
    policy = load_policy(folder / "policy.safetensors")
    if not options.ship_anyway and (objection := why_not(policy, options)):
        command = f"{resume_command(folder)} --ship --ship-anyway"
        print(f"The policy in the box stays: {objection}. Replace it all the same with\n    {command}", file=sys.stderr)
        return 1
    save_policy(policy, SHIPPED)
    print(f"In the box: {SHIPPED}")
    return 0


def why_not(policy: LearnedPolicy, options: Options) -> str | None:
    """What is to be said against replacing the policy in the box by this one, if anything."""
    if not SHIPPED.exists():
        return None
    try:
        box = load_policy(SHIPPED)
    except (ValueError, FileNotFoundError) as unreadable:
        return f"there is nothing to compare with, {str(unreadable).rstrip('.')}"
    ours, theirs = (held_out_strokes(one, options) for one in (policy, box))
    if ours <= theirs:
        return None
    return f"it takes {theirs:.1f} strokes on {HELD_OUT_PATHS} held-out random paths, the new one {ours:.1f}"


def held_out_strokes(policy: LearnedPolicy, options: Options) -> float:
    """Mean strokes to the last waypoint of random paths; who does not arrive counts as the time limit."""
    scene, limit = make_scene(None, options.fidelity), MAX_STROKES
    swims = swim_many(
        "learned", policy, "random", HELD_OUT_PATHS, scene,
        max_strokes=limit, seed=HELD_OUT_SEED, threads=options.num_threads,
    )  # fmt: skip
    return float(np.mean([done.strokes for done in swims]))


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
        save(self.learner, self.folder / "model.zip")
        done = self.keep()
        strokes = self.learner.num_timesteps
        reached = "" if done.finished else f" (only {done.waypoints_reached} waypoints)"
        self.bar.set_postfix_str(f"pentagon in {done.strokes}{reached}")
        if self.bar.disable:
            print(f"{strokes} strokes trained: the pentagon takes {done.strokes}{reached}.", flush=True)


    def keep(self) -> Swim:
        """What comes after a save of the model: a copy, and how it swims round the pentagon, which is logged."""
        strokes = self.learner.num_timesteps
        copy = self.folder / "checkpoints" / f"model_{strokes:09d}.zip"
        write_atomically(copy, (self.folder / "model.zip").read_bytes())
        done = swim("learned", policy_of(self.learner), self.pentagon, max_strokes=MAX_STROKES)
        self.learner.logger.record("eval/pentagon_strokes", done.strokes)
        self.learner.logger.record("eval/pentagon_waypoints", done.waypoints_reached)
        rows = [*recorded(self.folder), [strokes, done.strokes, done.waypoints_reached]]
        text = "".join(",".join(map(str, row)) + "\n" for row in rows)
        write_atomically(self.folder / "progress.csv", text.encode())
        return done


def recorded(folder: Path) -> list[list[int]]:
    """The rows of the run's progress.csv; none before the first checkpoint."""
    return read_progress(folder) if (folder / "progress.csv").exists() else []


def is_unbegun(folder: Path) -> bool:
    """Whether a run was stopped before its first checkpoint, so that it begins anew where it is continued."""
    return not any((folder / name).exists() for name in ("model.zip", "checkpoints", "progress.csv"))


def train(options: Options, folder: Path, stop: Callable[[], bool]) -> tuple[PPO, Watch]:
    """The learner after the strokes asked for, or when `stop` said so; saved as model.zip in either case."""
    env = make_training_env(
        options.ppo, options.path, options.random_heading, fidelity=options.fidelity, threads=options.num_threads
    )
    new = options.resume is None or is_unbegun(folder)
    if new:
        model = make_model(env, options.ppo, options.seed, options.device)
    else:
        model = resume(folder / "model.zip", env, options.device)
    model.set_logger(configure(str(folder / "tensorboard"), ["tensorboard"]))
    watch = Watch(options, folder, model, env, stop)
    if not new and model.num_timesteps not in (strokes for strokes, *_ in recorded(folder)):
        watch.keep()  # a kill came between the two
    left = options.strokes - model.num_timesteps
    if left > 0:
        model.learn(left, watch, log_interval=1, reset_num_timesteps=new)
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
    require_device(options.device)
    require_consent(options)
    folder = options.out or Path("runs") / time.strftime("%Y-%m-%d_%H-%M-%S")
    if options.resume is None:
        claim(folder)
    write_config(options, arguments, folder)
    print(f"The run is in {folder}.", flush=True)
    with Interruption() as interruption:
        model, watch = train(options, folder, lambda: interruption.requested)
    export(model, folder)
    if interruption.requested:
        print(
            f"Stopped after {model.num_timesteps} strokes; {folder / 'model.zip'} is the policy so far. Continue with"
        )
        asked = ["--ship"] * options.ship + ["--ship-anyway"] * options.ship_anyway
        print(" ".join(["   ", resume_command(folder), *asked]))
        return 130
    compare(options, folder, describe(options, folder, model.num_timesteps, watch))
    print(f"Report:  {folder / 'evaluation' / 'report.html'}\nPolicy:  {folder / 'policy.safetensors'}")
    print(f"Logs:    tensorboard --logdir {folder}")
    return put_in_the_box(options, folder) if options.ship else 0


@contextmanager
def quiet_writers() -> Iterator[None]:
    """Within it, a thread that cannot write says nothing: the next who writes through it raises the same error."""
    before = threading.excepthook

    def hook(failure: threading.ExceptHookArgs) -> None:
        if not isinstance(failure.exc_value, OSError):
            before(failure)

    threading.excepthook = hook
    try:
        yield
    finally:
        threading.excepthook = before


def main(arguments: Sequence[str]) -> int:
    """The command line; returns the exit code."""
    try:
        with quiet_writers():
            return run(read_options(arguments), arguments)
    except OSError as failure:
        print(refused_by_disk(failure), file=sys.stderr)
        return 2 if failure.errno is None else 1
    except ValueError as wrong:
        print(wrong, file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("Stopped at once: what was written until then is in the run's folder.", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
