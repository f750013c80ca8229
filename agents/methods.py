"""Methods of the benchmark, and the training of its cells: a method, a track, an id and a seed.

    python -m agents.tasks --benchmark --methods PPO --ids SeastarStation-v0 --seeds 0 1 2

A cell is a file, written when its training is over, with the test episodes of the last policy and a learning curve; the
model lies beside it. The command goes on with the cells that are missing, several at once, on any executor of a sweep,
in one thread each. The processor time of a cell is that of its training, without the points of the curve.
"""

import gc
import json
import os
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
import torch
from sb3_contrib import RecurrentPPO
from stable_baselines3 import DQN, PPO, SAC
from stable_baselines3.common.callbacks import BaseCallback

from agents import learner_file
from agents.distillation import PAST
from agents.ppo import hyperparameters, make_model
from seastar_gym import TASKS
from seastar_gym.adapters.stable_baselines3 import BatchVecEnv
from seastar_gym.envs.instances import Split
from seastar_gym.envs.symmetry import VectorFrameStack, VectorSymmetryReduction
from seastar_gym.evaluation.benchmark import (
    BUDGETS,
    CURVE,
    ENTRIES,
    EPISODES,
    SEEDS,
    TRACKS,
    Cell,
    Track,
    cells_in,
    contract,
    make,
    require_current,
    require_ids,
    write,
)
from seastar_gym.evaluation.benchmark import swum as swum_by
from seastar_gym.evaluation.rollout import Batch
from seastar_gym.files import require_writable, write_atomically
from seastar_gym.scene.checks import require_count, require_seed
from seastar_gym.sweep.executors import Where, executor_of, outcomes


class Draw(NamedTuple):
    """Numbers that are tuned, the same four of every method.

    learning_rate: At the beginning. discount: From one decision to the next. uses: Gradients that a decision enters.
    exploration: From 0 to 1, as a share: of an entropy bonus of 0.02 with PPO, of half the training for the time in
    which DQN acts more and more by its values, and with SAC of the way from -2 to -0.5 for the target entropy of each
    number of an action.
    """

    learning_rate: float
    discount: float
    uses: int
    exploration: float


Build = Callable[[BatchVecEnv, str, int, Draw | None], Any]


class Method(NamedTuple):
    """A learner. build: Makes it of environment, id, seed and what was drawn; None stands for its own numbers.

    robots: That learn side by side. continuous: Whether it gives commands. stacked: Whether it sees a frame stack.
    draw: The best of those that `studies.tuning` tries, of a method that was tuned.
    """

    build: Build
    robots: int = 64
    continuous: bool = False
    tracks: tuple[Track, ...] = TRACKS
    stacked: bool = False
    draw: Draw | None = None


def _ours(env: BatchVecEnv, id: str, seed: int, draw: Draw | None) -> Any:
    batch: Any = env.env.unwrapped
    how = hyperparameters(str(TASKS[id].task), float(batch.decision_period))
    if draw is not None:
        rate, discount, uses, exploration = draw
        discount **= 1.0 / float(batch.decision_period)
        how = replace(how, learning_rate=rate, discount=discount, epochs=uses, entropy=0.02 * exploration)
    return make_model(env, how, seed)


def _on_policy(kind: Any, policy: str, **how: Any) -> Build:
    """Learner by rollouts of 32 decisions."""

    def build(env: BatchVecEnv, id: str, seed: int, draw: Draw | None) -> Any:
        own: dict[str, Any] = {}
        if draw is not None:
            rate, discount, uses, exploration = draw
            own = {"learning_rate": rate, "gamma": discount, "n_epochs": uses, "ent_coef": 0.02 * exploration}
        return kind(policy, env, n_steps=32, seed=seed, device="cpu", **{**how, **own})

    return build


def _off_policy(kind: Any, batch_size: int, uses: int, **how: Any) -> Build:
    """Learner with a replay buffer."""

    def build(env: BatchVecEnv, id: str, seed: int, draw: Draw | None) -> Any:
        own: dict[str, Any] = {}
        if draw is not None:
            own = {"learning_rate": draw.learning_rate, "gamma": draw.discount}
            if kind is DQN:
                own["exploration_fraction"] = 0.5 * draw.exploration
            else:
                own["target_entropy"] = (1.5 * draw.exploration - 2.0) * np.prod(env.action_space.shape or 1)
        steps = max(1, round((draw.uses if draw else uses) * env.num_envs / batch_size))
        return kind(
            "MlpPolicy", env, seed=seed, device="cpu", buffer_size=200_000, learning_starts=2_000, train_freq=1,
            batch_size=batch_size, gradient_steps=steps, **{**how, **own},
        )  # fmt: skip

    return build


METHODS: dict[str, Method] = {
    "PPO": Method(_on_policy(PPO, "MlpPolicy")),
    "PPO, tuned": Method(_on_policy(PPO, "MlpPolicy"), draw=Draw(0.0017, 0.855, 7, 0.73)),
    "PPO, ours": Method(_ours, 128),
    "PPO, ours, frame stack": Method(_ours, 128, tracks=("symmetric",), stacked=True),
    "RecurrentPPO": Method(
        _on_policy(
            RecurrentPPO, "MlpLstmPolicy", batch_size=1024, n_epochs=6, learning_rate=1e-3, gae_lambda=0.9,
            policy_kwargs={"net_arch": [128, 128], "lstm_hidden_size": 64},
        ),
        128, tracks=("plain",),
    ),
    "DQN": Method(_off_policy(DQN, 32, 4, learning_rate=4e-4, exploration_fraction=0.2, target_update_interval=2_000)),
    "SAC": Method(_off_policy(SAC, 256, 16), continuous=True),
}  # fmt: skip
"""PPO and SAC as shipped by Stable-Baselines3 but for rollouts of 2,048 decisions and the ratio of gradient steps; ours
with the hyperparameters of `agents.tasks`; an LSTM of 64, in one track: frames that turn from one decision to the next
would turn its memory. DQN as shipped never arrives."""
UNTUNED = tuple(name for name, method in METHODS.items() if method.draw is None)
"""Methods with their own numbers."""


class Training(NamedTuple):
    """The training of a cell. decisions: Its length."""

    method: str
    track: Track
    id: str
    seed: int
    decisions: int

    def file(self, folder: Path) -> Path:
        """File of the cell in a folder of cells."""
        name = self.method.lower().replace(", ", "-").replace(" ", "-")
        return folder / str(self.decisions) / f"{name}-{self.track}" / f"{self.id}-{self.seed}.json"


@dataclass(frozen=True)
class BenchmarkOptions:
    """Train the cells of the benchmark that are missing: methods, tracks, ids and seeds."""

    methods: tuple[str, ...] = tuple(METHODS)
    """Methods."""
    tracks: tuple[Track, ...] = TRACKS
    """Without or with symmetry reduction; methods that have one track are trained in that."""
    ids: tuple[str, ...] = tuple(ENTRIES)
    """Environments."""
    seeds: tuple[int, ...] = SEEDS
    """Seeds of the trainings."""
    decisions: int = BUDGETS[0]
    """Length of every training [decisions]."""
    executor: Where = "processes"
    """Where cells are trained: in processes of this machine, in this process, or on a cluster."""
    workers: int | None = None
    """Cells that are trained at once; by default one for every processor, and with SLURM 64."""
    address: str | None = None
    """Ray, Dask: HOST:PORT of the head; by default a cluster of this machine."""
    partition: str | None = None
    """SLURM: partition."""
    minutes: int | None = None
    """SLURM: time limit of a cell [min]; by default 60."""
    out: Path = Path("runs/benchmark")
    """Folder of the cells."""

    def __post_init__(self) -> None:
        if unknown := set(self.methods) - set(METHODS):
            raise ValueError(f"There is no method {min(unknown)!r}: choose of {'; '.join(METHODS)}.")
        for method in self.methods if self.methods != tuple(METHODS) else ():
            if not {*METHODS[method].tracks} & {*self.tracks}:
                raise ValueError(f"{method} has no track but {METHODS[method].tracks[0]}: leave it or --tracks out.")
        if not (self.methods and self.tracks and self.ids and self.seeds):
            raise ValueError("There must be at least one method, track, id and seed.")
        require_ids(self.ids)
        for seed in self.seeds:
            require_seed(seed)
        require_count("decisions", self.decisions, 1, 10**9)

    @property
    def cells(self) -> list[Training]:
        """Cells that are missing: all ids of a seed before the next seed.

        ValueError: one that is there is of another contract.
        """
        once = dict.fromkeys
        every = product(once(self.seeds), once(self.methods), once(self.tracks), once(self.ids))
        trainings = [Training(method, track, id, seed, self.decisions) for seed, method, track, id in every]
        return [one for one in trainings if one.track in METHODS[one.method].tracks and not is_trained(one, self.out)]


def is_trained(training: Training, folder: Path) -> bool:
    """Whether the cell of a training is there. One that is damaged is not, and a note says so.

    ValueError: it is of another contract, or another training's.
    """
    file = training.file(folder)
    if not file.is_file():
        return False
    try:
        cells = cells_in(file)
    except ValueError as damaged:
        print(f"{damaged} It is trained anew.", flush=True)
        return False
    require_current(cells, str(file))
    if [(cell.agent, cell.track, cell.id, cell.seed, cell.decisions) for cell in cells] != [training]:
        raise ValueError(f"{file} has not the cell that its name says: move it away.")
    return True


def batch_of(method: Method, track: Track, id: str, n: int, split: Split, **more: Any) -> Batch:
    """Batch that a method sees. more: Of `seastar_gym.evaluation.benchmark.make`."""
    batch = make(id, n, split, 1, **more, **({"actions": "continuous"} if method.continuous else {}))
    if method.stacked:
        return VectorFrameStack(batch, PAST)
    return VectorSymmetryReduction(batch) if track == "symmetric" else batch


def new_model(name: str, track: Track, id: str, seed: int, draw: Draw | None = None) -> Any:
    """A method that has learned nothing yet, on the split "train"."""
    method = METHODS[name]
    batch = batch_of(method, track, id, method.robots, "train", autoreset_mode="SameStep")
    return method.build(BatchVecEnv(batch), id, seed, draw or method.draw)


class Curve(BaseCallback):
    """Points of a learning curve. seconds: Processor time of the training so far [s], without that of the points."""

    def __init__(self, marks: list[int], swim: Callable[[Any], dict[str, Any]]):
        super().__init__()
        self._marks, self._swim, self._began = marks, swim, time.process_time()
        self.points: list[dict[str, float]] = []

    @property
    def seconds(self) -> float:
        return round(time.process_time() - self._began, 1)

    def _on_rollout_start(self) -> None:
        if self._marks and self.num_timesteps >= self._marks[0]:
            self._marks = [mark for mark in self._marks if mark > self.num_timesteps]
            self.point()

    def _on_step(self) -> bool:
        return True

    def point(self) -> dict[str, Any]:
        """Swim the test episodes now, and note their means."""
        seconds, before = self.seconds, time.process_time()
        found = self._swim(self.model)
        means = {name: round(sum(found[name]) / EPISODES, 4) for name in ("measure", "returns")}
        self.points.append({"decisions": self.num_timesteps, "seconds": seconds, **means})
        self._began += time.process_time() - before
        return found


def train_cell(training: Training) -> dict[str, bytes]:
    """Files of a cell by their endings, once it is trained."""
    gc.collect()  # models are cycles, with replay buffers of hundreds of megabytes: the last one goes before the next
    torch.set_num_threads(1)
    method, track, id, seed, decisions = training
    learner = METHODS[method]
    model = new_model(method, track, id, seed)

    def swim(model: Any) -> dict[str, Any]:
        return swum_by(batch_of(learner, track, id, EPISODES, "test"), model)

    curve = Curve([mark for mark in CURVE if mark < decisions], swim)
    model.learn(decisions, callback=curve)
    found = curve.point()
    cost: dict[str, Any] = {
        "decisions": decisions, "seconds": float(curve.points[-1]["seconds"]), "curve": curve.points
    }  # fmt: skip
    with TemporaryDirectory() as folder:
        file = Path(folder) / "cell.json"
        if learner.stacked:  # what its frames are stands in files of our own
            learner_file.save(model, file.with_suffix(".zip"))
        else:
            model.save(file.with_suffix(".zip"))
        model.get_env().close()
        write([Cell(method, track, id, seed, contract(id), 0, **found, **cost)], file)
        return {ending: file.with_suffix(ending).read_bytes() for ending in (".zip", ".json")}


def keep(training: Training, files: dict[str, bytes], folder: Path) -> str:
    """Write the files of a cell, at last that which says that it is there; returns a line about it."""
    file = training.file(folder)
    for ending, content in files.items():
        write_atomically(file.with_suffix(ending), content)
    (cell,) = json.loads(files[".json"])["cells"]
    last = cell["curve"][-1]
    return f"{file.stem}, {training.method}, {training.track}: {last['measure']:.4g} after {cell['seconds']:.0f} s"


def train_cells(options: BenchmarkOptions) -> int:
    """Train the cells that are missing; returns the exit code, 1 where some have no result, 130 after Ctrl-C."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    require_writable(options.out)
    cells, lost = options.cells, 0
    print(f"Cells to train: {len(cells)}", flush=True)
    try:
        with executor_of(options) as executor:
            for training, files, problem in outcomes(executor, train_cell, cells, max(1, len(cells))):
                lost += files is None
                name = training.file(options.out)
                print(f"{name}: {problem}" if files is None else keep(training, files, options.out), flush=True)
    except KeyboardInterrupt:
        print("Stopped: the same command goes on with the cells that are missing.", flush=True)
        return 130
    if lost:
        print(f"Cells without a result: {lost}. The same command trains them again.", flush=True)
    return int(lost > 0)
