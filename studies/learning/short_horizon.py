"""Short-horizon actor-critic (SHAC, Xu et al. 2022, arXiv:2204.07137) against PPO, on one task.

    python -m studies.learning.short_horizon

The task is `SeastarSwimContinuous-v0` at `fast` on the path "line", from any heading: episodes of EPISODE strokes
towards a waypoint that is too far to be reached, so that the reward is smooth. Both learners have the same symmetry
reduction, widths of layers, discount and decay, and are scored by the mean return of their mean actions in HELD_OUT
episodes. Processor time is without compilation and without scores, which are taken SCORES times in a training, or after
every rollout. Settings were chosen by scores of seed 0.

SHAC: an actor's actions are tanh(mean + deviation * noise). It ascends the gradient of the discounted reward of a
window of decisions and of a critic's value behind them, through the swim, the observation and itself. The critic is
fitted to TD(lambda) targets of the same windows.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from types import SimpleNamespace
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
import torch
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.callbacks import BaseCallback

from agents.hyperparameters import Hyperparameters
from agents.ppo import make_model
from seastar_gym import VectorSymmetryReduction
from seastar_gym.adapters.stable_baselines3 import BatchVecEnv
from seastar_gym.controllers.contract import Policy
from seastar_gym.controllers.registry import load_agent
from seastar_gym.envs.commands import Actions
from seastar_gym.envs.layout import N_STATIONS, VELOCITY_SCALE
from seastar_gym.envs.paths import LINE_LENGTH
from seastar_gym.envs.reward import RewardWeights
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.stations import weights
from seastar_gym.envs.symmetry import Symmetry
from seastar_gym.evaluation.rollout import rollout
from seastar_gym.gaits import STRAIGHT
from seastar_gym.gradients import Record, record
from seastar_gym.scene import Scene
from studies.frame import Floats, Results, Study, rounded
from studies.pages import markdown

Tensor = torch.Tensor
Scores = list[list[float]]
"""Of a training: decisions so far, processor time [s] and return."""

EPISODE, HELD_OUT, HELD_OUT_SEED, SCORES = 24, 32, 10_000, 32
"""Decisions of an episode, number and first seed of the episodes of a score, and scores of a training."""
GOAL = torch.tensor([LINE_LENGTH, 0.0], dtype=torch.float64)
"""The waypoint [m]."""
OF_NODES = ("positions", "velocities")


def swimmers(n: int, actions: Actions = "continuous", mode: AutoresetMode = AutoresetMode.SAME_STEP) -> Any:
    """Robots of the task."""
    return gym.make_vec(
        "SeastarSwimContinuous-v0", n, vectorization_mode="vector_entry_point", fidelity="fast", path="line",
        random_heading=True, max_episode_steps=EPISODE, threads=1, actions=actions, autoreset_mode=mode,
    )  # fmt: skip


def score(policy: Policy, actions: Actions = "continuous") -> float:
    """Mean return of held-out episodes."""
    env = VectorSymmetryReduction(swimmers(HELD_OUT, actions, AutoresetMode.NEXT_STEP))
    return float(rollout(env, policy, seeds=HELD_OUT_SEED).returns.mean())


class Stopwatch:
    """Processor time of a training, and its scores."""

    def __init__(self, actions: Actions = "continuous") -> None:
        self.scores: Scores = []
        self._actions, self._paused, self._began = actions, 0.0, time.process_time()

    def score(self, decisions: int, policy: Policy) -> None:
        """Score what is learned so far."""
        began = time.process_time()
        found = score(policy, self._actions)
        self.scores.append([decisions, rounded(began - self._began - self._paused, 4), rounded(found, 4)])
        self._paused += time.process_time() - began


class Swim:
    """What the environment computes from a swim, for gradients."""

    def __init__(self, scene: Scene):
        robot = scene.robot
        rows = weights(robot.nodes_per_limb, N_STATIONS + 1)
        self._n_limbs, self._length, self._rows = robot.n_limbs, robot.limb_length, torch.from_numpy(rows.copy())
        self._rest = self._stations(torch.from_numpy(np.array(robot.nodes(0))))
        self.symmetry = Symmetry.of(scene, "continuous")
        self._carried = self._by_element(self.symmetry.carry, self.symmetry.layout.size)
        self._restored = self._by_element(self.symmetry.restore, robot.n_limbs)

    def _by_element(self, move: Callable[[Floats, NDArray[np.intp]], Any], n: int) -> Tensor:
        """What each element of the symmetry does to rows of n numbers, from the right, shape (n_elements, n, n)."""
        elements = np.arange(2 * self._n_limbs)[:, None].repeat(n, axis=1)
        return torch.from_numpy(np.array(move(np.broadcast_to(np.eye(n), (*elements.shape, n)), elements)))

    def _stations(self, rows: Tensor) -> Tensor:
        """Stations from the hub, shape (..., m, 2), of rows of nodes, shape (..., n_nodes, 2)."""
        limbs = (rows - rows[..., :1, :])[..., 1:, :].unflatten(-2, (self._n_limbs, -1))
        return (self._rows @ limbs).flatten(-3, -2)

    def observed(self, places: Tensor, velocities: Tensor) -> Tensor:
        """Observations, shape (..., size), of positions [m] and velocities [m/s] of nodes, shape (..., n_nodes, 2)."""
        stations, moving = self._stations(places), self._stations(velocities)
        along = (self._rest * stations).sum((-2, -1))
        across = (self._rest[:, 0] * stations[..., 1] - self._rest[:, 1] * stations[..., 0]).sum(-1)
        axis = torch.stack([along, across], -1)
        c, s = (axis / axis.norm(dim=-1, keepdim=True)).unbind(-1)
        frame = torch.stack([c, -s, s, c], -1).unflatten(-1, (2, 2))  # of rows, from the right
        away = ((GOAL - places[..., 0, :]) / self._length)[..., None, :]
        hub = velocities[..., :1, :] / VELOCITY_SCALE
        seen = torch.cat([stations / self._length, moving / VELOCITY_SCALE, hub, away, away], -2)
        return (seen @ frame).flatten(-2)

    def reduced(self, seen: Tensor) -> tuple[Tensor, Tensor]:
        """Observations with the waypoint in one sector, and what takes the actions back, shape (..., 5, 5)."""
        elements = torch.from_numpy(self.symmetry.sectors(seen.detach().numpy()))
        return (seen[..., None, :] @ self._carried[elements]).squeeze(-2), self._restored[elements]

    def rewards(self, places: Tensor, commands: Tensor) -> Tensor:
        """Rewards of decisions, shape (..., h), of positions, shape (..., h + 1, n_nodes, 2), and commands."""
        price, left = RewardWeights(), (GOAL - places[..., 0, :]).norm(dim=-1)
        return price.progress * (left[..., :-1] - left[..., 1:]) - price.effort * commands.abs().sum(-1)


@dataclass(frozen=True)
class Settings:
    """Numbers of a training by SHAC.

    robots: Number of robots. window: Decisions of each between updates; an episode has a whole number of windows.
    rates: Of Adam for actor and critic; they fall linearly to zero. log_deviation: Logarithm of the deviation at first.
    largest_norm: Of the actor's gradient, which is cut to it. discount, decay: Of rewards, and lambda of the critic's
    targets; as of PPO. fits: Steps of the critic in an update. kept: Share of the critic behind the targets that an
    update keeps.
    """

    robots: int = 8
    window: int = 4
    rates: tuple[float, float] = (5e-3, 2e-3)
    log_deviation: float = -1.0
    largest_norm: float = 1.0
    discount: float = Hyperparameters().discount
    decay: float = Hyperparameters().gae_lambda
    fits: int = 16
    kept: float = 0.2


SETTINGS, OF_PPO = Settings(), Hyperparameters(num_envs=16, batch_size=64, learning_rate=3e-3)
"""The best of six settings of each, on one seed."""


def network(*sizes: int, gain: float) -> torch.nn.Sequential:
    """Layers with tanh between them, begun as Stable-Baselines3 does. gain: Of the last layer."""
    layers: list[torch.nn.Module] = []
    for k, (n, m) in enumerate(pairwise(sizes), start=2):
        layer = torch.nn.Linear(n, m, dtype=torch.float64)
        torch.nn.init.orthogonal_(layer.weight, gain if k == len(sizes) else 2.0**0.5)
        torch.nn.init.zeros_(layer.bias)
        layers += [layer, torch.nn.Tanh()]
    return torch.nn.Sequential(*layers[:-1])


class Window(NamedTuple):
    """Decisions of all robots: states at the beginning, commands (n, h, 5), and noise (n, h, 5) of the actions."""

    state: Any
    commands: Floats
    noise: Tensor


class Found(NamedTuple):
    """What windows return per decision in the mean, its slopes in the actor's weights, observations and rewards."""

    value: float
    slopes: tuple[Tensor, ...]
    seen: Tensor
    rewards: Tensor


def through(swim: Record, of: Sequence[Floats], rises: Sequence[Floats]) -> Floats:
    """Slopes of a number in the actions of a closed loop, shape (h, n_limbs).

    of: Its slopes in positions, velocities and commands. rises: Slopes of commands in positions and in velocities,
    shape (h + 1, n_limbs, n_nodes, 2) each.
    """
    total = of[2].copy()

    def feedback(k: int, slope: Floats) -> tuple[Floats, Floats]:
        total[k] += slope
        of_places, of_velocities = (np.tensordot(total[k], rise[k], 1) for rise in rises)
        return of_places, of_velocities

    swim.gradient(dict(zip(OF_NODES, of, strict=False)), ["commands"], feedback)
    return total


class Shac:
    """A learner. settings: Its numbers. seed: Of networks, noise and headings."""

    def __init__(self, settings: Settings, seed: int):
        torch.manual_seed(seed)
        self.settings, self.env = settings, swimmers(settings.robots).unwrapped
        self.scene, self.swim = self.env.scene, Swim(self.env.scene)
        size, hidden = self.swim.symmetry.layout.size, Hyperparameters().hidden
        self.actor, self.critic = network(size, *hidden, 5, gain=0.01), network(size, *hidden, 1, gain=1.0)
        self.target = network(size, *hidden, 1, gain=1.0)
        self.target.load_state_dict(self.critic.state_dict())
        deviation = torch.full((5,), settings.log_deviation, dtype=torch.float64)
        self.log_deviation = torch.nn.Parameter(deviation)
        self.weights = [*self.actor.parameters(), self.log_deviation]
        self.steps = [torch.optim.Adam(each) for each in (self.weights, self.critic.parameters())]
        self.seen = self.env.reset(seed=seed)[0]

    def predict(self, observation: Any, *_: Any, **__: Any) -> tuple[NDArray[Any], None]:
        """Mean actions by reduced observations, and no state, as policies do."""
        with torch.no_grad():
            return np.asarray(torch.tanh(self.actor(torch.from_numpy(observation).double())).numpy()), None

    def commands(self, seen: Tensor, noise: Tensor) -> Tensor:
        """Commands, shape (..., 5)."""
        reduced, back = self.swim.reduced(seen)
        actions = torch.tanh(self.actor(reduced) + self.log_deviation.exp() * noise)
        return (actions[..., None, :] @ back).squeeze(-2)

    def explore(self) -> Window:
        """Decisions of the robots."""
        n, h = self.settings.robots, self.settings.window
        state, noise, found = self.env.simulator.get_state(), torch.randn(n, h, 5, dtype=torch.float64), []
        for k in range(h):
            with torch.no_grad():
                found.append(self.commands(torch.from_numpy(self.seen).double(), noise[:, k]).numpy())
            self.seen, *_ = self.env.step(found[-1])
        return Window(state, np.stack(found, axis=1), noise)

    def update(self, left: float) -> None:
        """Learn from a window. left: Share of the training that is left."""
        for optimizer, rate in zip(self.steps, self.settings.rates, strict=True):
            optimizer.param_groups[0]["lr"] = rate * left
        found = self.gradient(self.explore())
        for weight, slope in zip(self.weights, found.slopes, strict=True):
            weight.grad = -slope
        torch.nn.utils.clip_grad_norm_(self.weights, self.settings.largest_norm)
        self.steps[0].step()
        self.fit(found.seen, found.rewards)

    def gradient(self, window: Window) -> Found:
        """What windows return, and the slopes of that in the actor's weights."""
        n, h, _ = window.commands.shape
        swims = [record(self.scene, window.commands[k], window.state.of_robots(slice(k, k + 1))) for k in range(n)]
        places, velocities = (
            torch.from_numpy(np.stack([getattr(one.swim, name) for one in swims])).requires_grad_() for name in OF_NODES
        )
        given = torch.from_numpy(window.commands).requires_grad_()
        seen = self.swim.observed(places, velocities)
        rewards = self.swim.rewards(places, given)
        ahead = self.settings.discount ** torch.arange(h + 1.0, dtype=torch.float64)
        value = (rewards @ ahead[:-1] + ahead[-1] * self.value(self.target, seen[:, -1])).sum()
        of = torch.autograd.grad(value, (places, velocities, given), retain_graph=True)
        commands = self.commands(seen[:, :-1], window.noise)
        rises = zip(
            *(torch.autograd.grad(each.sum(), (places, velocities), retain_graph=True) for each in commands.unbind(-1)),
            strict=True,
        )
        of_nodes = [torch.stack(rise, dim=2).numpy() for rise in rises]  # (n, h + 1, n_limbs, n_nodes, 2)
        total = [through(swims[k], [each[k].numpy() for each in of], [each[k] for each in of_nodes]) for k in range(n)]
        slopes = torch.autograd.grad(commands, self.weights, torch.from_numpy(np.stack(total)) / (n * h))
        return Found(value.item() / (n * h), slopes, seen.detach(), rewards.detach())

    def value(self, critic: torch.nn.Module, seen: Tensor) -> Tensor:
        """A critic's values of observations."""
        return torch.as_tensor(critic(self.swim.reduced(seen)[0])).squeeze(-1)

    def fit(self, seen: Tensor, rewards: Tensor) -> None:
        """Fit the critic to windows of observations, shape (n, h + 1, size), and rewards, shape (n, h)."""
        discount, decay = self.settings.discount, self.settings.decay
        with torch.no_grad():
            values = self.value(self.target, seen)
            target, targets = values[:, -1], list[Tensor]()
            for k in range(rewards.shape[1] - 1, -1, -1):
                target = rewards[:, k] + discount * ((1.0 - decay) * values[:, k + 1] + decay * target)
                targets.insert(0, target)
            wanted, reduced = torch.stack(targets, 1), self.swim.reduced(seen[:, :-1])[0]
        for _ in range(self.settings.fits):
            loss = (self.critic(reduced).squeeze(-1) - wanted).square().mean()
            self.steps[1].zero_grad()
            loss.backward()
            self.steps[1].step()
        with torch.no_grad():
            for old, new in zip(self.target.parameters(), self.critic.parameters(), strict=True):
                old.lerp_(new, 1.0 - self.settings.kept)


def by_shac(decisions: int, seed: int, settings: Settings = SETTINGS) -> Scores:
    """Scores of a training by SHAC."""
    learner, per = Shac(settings, seed), settings.robots * settings.window
    learner.gradient(learner.explore())  # compiles
    learner, watch, updates = Shac(settings, seed), Stopwatch(), decisions // per
    for k in range(updates):
        learner.update(1.0 - k / updates)
        if (k + 1) * SCORES // updates > k * SCORES // updates:
            watch.score((k + 1) * per, learner)
    return watch.scores


class Scoring(BaseCallback):
    """Scores during a training by PPO."""

    def __init__(self, decisions: int, actions: Actions):
        super().__init__()
        self._decisions, self.watch = decisions, Stopwatch(actions)

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        done = self.num_timesteps
        if done * SCORES // self._decisions > len(self.watch.scores):
            self.watch.score(done, self.model)


def by_ppo(decisions: int, seed: int, actions: Actions = "continuous", settings: Hyperparameters = OF_PPO) -> Scores:
    """Scores of a training by PPO."""
    env = BatchVecEnv(VectorSymmetryReduction(swimmers(settings.num_envs, actions)))
    model, scoring = make_model(env, settings, seed), Scoring(decisions, actions)
    model.learn(decisions, callback=scoring)
    scoring.watch.score(model.num_timesteps, model)
    return scoring.watch.scores


def rules() -> dict[str, float]:
    """Scores of what does not learn here."""
    env, gait = SeastarSwimEnv(fidelity="fast"), np.tile(STRAIGHT, (HELD_OUT, 1))
    straight: Any = SimpleNamespace(predict=lambda *_, **__: (gait, None))
    found = {"the straight gait, steered": score(straight)}
    for name in ("greedy", "learned"):
        policy: Any = load_agent(name, env)
        found[name] = score(policy, policy.actions)
    return {name: rounded(each, 4) for name, each in found.items()}


FEW, MANY, OF_PAIRS = 3_072, 56_320, 18_432
"""Decisions of a training by SHAC, of one by PPO that takes longer, and of one over pairs, until nothing changes."""
LEARNERS: dict[str, Callable[[int], Scores]] = {
    "SHAC": partial(by_shac, FEW),
    "PPO, as many decisions": partial(by_ppo, FEW),
    "PPO, longer": partial(by_ppo, MANY),
    "PPO over pairs": partial(by_ppo, OF_PAIRS, actions="pairs"),
}
SEEDS = range(10)
REACHED = 0.8
"""Share of the straight gait's return of which the table tells when it is reached."""


def run(results: Results) -> None:
    """Train what is missing, on one thread."""
    torch.set_num_threads(1)
    cells: dict[tuple[str, ...], Callable[[], Any]] = {("rules",): rules}
    for seed in SEEDS:
        cells |= {("learners", name, str(seed)): partial(train, seed) for name, train in LEARNERS.items()}
    results.fill(cells, lambda found: str(found if isinstance(found, dict) else found[-1]))


def reached(scores: Scores, enough: float) -> tuple[float, float]:
    """After how many decisions, and how much processor time [s], a return was reached; infinite if it was not."""
    return next(((done, seconds) for done, seconds, found in scores if found >= enough), (np.inf, np.inf))


def table(results: Mapping[str, Any]) -> str:
    """Table in Markdown of the learners: medians over seeds, least and most; "<" where it was so at the first score."""
    enough = REACHED * results["rules"]["the straight gait, steered"]
    lines = []
    for name, seeds in results["learners"].items():
        done, seconds, found = np.array([scores[-1] for scores in seeds.values()]).T
        when = np.median([reached(scores, enough) for scores in seeds.values()], axis=0)
        before = "<" if when[0] <= np.median([scores[0][0] for scores in seeds.values()]) else ""
        told = f"{np.median(found):.1f} ({found.min():.1f}-{found.max():.1f})"
        to = [f"{before}{when[0]:,.0f}", f"{before}{when[1]:.2g}"]
        lines.append([name, f"{done[0]:,.0f}", f"{np.median(seconds):.2g}", told, *to])
    head = ["learner", "decisions", "time [s]", "return", f"decisions to {enough:.1f}", f"time to {enough:.1f} [s]"]
    return markdown(head, lines)


STUDY = Study(
    "learning.short_horizon", run, file="learning/short_horizon.json",
    settings=lambda: {"episode": EPISODE, "held_out": HELD_OUT, "decisions": [FEW, MANY, OF_PAIRS]},
    tables={"short horizon": table}, packages=("torch", "stable_baselines3"),
)  # fmt: skip
