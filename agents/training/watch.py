"""Watch over a training: progress bar, logs, checkpoints, and an orderly stop."""

import signal
import time
from collections.abc import Callable
from pathlib import Path
from types import FrameType

from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from tqdm import tqdm

from agents.learner_file import save
from agents.ppo import policy_of
from agents.training import efficiency
from agents.training.folder import record
from agents.training.options import Options
from agents.training.robot import Robot
from seastar_gym.adapters.stable_baselines3 import BatchVecEnv
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.evaluation.swim import Swim, swim
from seastar_gym.files import write_atomically


class Watch(BaseCallback):
    """Callback for the progress bar, logs and checkpoints, which ends the training when `stop()` is true."""

    def __init__(
        self,
        options: Options,
        robot: Robot,
        folder: Path,
        learner: PPO,
        batch: BatchVecEnv,
        stop: Callable[[], bool],
    ):
        super().__init__()
        self.options, self.folder, self.learner, self.batch, self.stop = options, folder, learner, batch, stop
        self.strokes = 0  # of this process
        self.seconds = {"simulator": 0.0, "policy": 0.0, "update": 0.0}
        self.efficiency = self._before = efficiency.read(folder)
        self.pentagon = SeastarSwimEnv(
            "pentagon",
            actions=options.ppo.actions,
            fidelity=robot.fidelity(options),
            scene=robot.scene,
            decision_period=options.ppo.decision_period,
        )

    def _on_training_start(self) -> None:
        if self.learner.num_timesteps == 0:
            self.measure()  # the untrained policy: where the learning curve begins
        # On a terminal only: elsewhere, a line at every checkpoint says how far it is.
        total, done = self.options.length, self.learner.num_timesteps
        self.bar = tqdm(total=total, initial=done, unit=" decisions", unit_scale=True, disable=None, smoothing=0.1)
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
        """Shares of the training's time in the simulator, the policy and the update."""
        total = sum(self.seconds.values())
        return {name: seconds / total if total else 0.0 for name, seconds in self.seconds.items()}

    def checkpoint(self) -> None:
        """Save the model, and log how it swims round the pentagon."""
        save(self.learner, self.folder / "model.zip")
        done = self.keep()
        lap = f"{done.time[-1]:.0f} s of swimming" if done.finished else f"only {done.waypoints_reached} waypoints"
        self.bar.set_postfix_str(f"pentagon: {lap}")
        if self.bar.disable:
            print(f"{self.efficiency.progress}, pentagon: {lap}", flush=True)

    def keep(self) -> Swim:
        """Copy the saved model to the checkpoints, and log how it swims round the pentagon; returns that swim."""
        copy = self.folder / "checkpoints" / f"model_{self.learner.num_timesteps:09d}.zip"
        write_atomically(copy, (self.folder / "model.zip").read_bytes())
        return self.measure()

    def measure(self) -> Swim:
        """Log how the policy swims round the pentagon now; returns that swim."""
        strokes = self.learner.num_timesteps
        limit = self.options.limit(self.pentagon.scene)
        done = swim("learned", policy_of(self.learner), self.pentagon, max_strokes=limit)
        self.learner.logger.record("eval/pentagon_strokes", done.strokes)
        self.learner.logger.record("eval/pentagon_waypoints", done.waypoints_reached)
        self.efficiency = record(self.folder, strokes, self._before.seconds + sum(self.seconds.values()), done)
        return done


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
