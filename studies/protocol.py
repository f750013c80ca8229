"""From a robot in a tank to a policy that swims in it: bench, pulses, fits, forecasts, training, runs.

    python -m studies.protocol

The robot is a simulated plant: strips in place of discs, another drag, other wires, limbs that are not alike, a late
camera. `truth` alone knows them. Every other step sees what a laboratory sees: the angles of single limbs on a bench,
and the logs of `PlantSwim`.
"""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import gymnasium as gym
import numpy as np
import torch
from gymnasium.vector import AutoresetMode
from scipy.optimize import curve_fit
from scipy.stats import t as student

from agents.distillation import distil
from agents.hyperparameters import Hyperparameters
from agents.ppo import make_model, make_training_env, policy_of
from agents.tasks.learning import ENOUGH, PAST
from seastar_gym import DomainRandomization, Limb, Scene, Seastar, Sight, Simulator, SmaWires, Strip, Uniform, Water
from seastar_gym.controllers.contract import Policy
from seastar_gym.controllers.learned import LearnedPolicy, bundled_file, load
from seastar_gym.controllers.scripted import GAITS as SCRIPTED
from seastar_gym.controllers.scripted import scripted
from seastar_gym.envs.symmetry import VectorFrameStack
from seastar_gym.evaluation.rollout import rollout
from seastar_gym.evaluation.swim import TIME_LIMIT
from seastar_gym.gaits import pair_gait
from seastar_gym.identify import Measurement, identify
from seastar_gym.plant.guard import Limits
from seastar_gym.plant.simulated import SimulatedPlant
from seastar_gym.plant.swim import PlantSwim
from seastar_gym.scene.per_robot import with_numbers
from studies.frame import Floats, Results, Study
from studies.pages import markdown

PERIOD = 0.2
"""Time between decisions [s]."""
BENCH_RATE, BENCH_TIME, BENCH_NOISE = 50.0, 1.5, 0.02
"""Pictures of a limb on the bench [Hz], their time [s], and error of an angle [rad]."""
SWIMS, PULSES = 15, 100
"""Swims by random pulses, each from rest, and decisions of each: five minutes in all. One swim of five minutes says
less: limbs that are not alike turn the robot away from where the simulated one goes."""
FITTED = ("robot.youngs_modulus", "fluid.drag_coefficient", "fluid.tangential_drag_coefficient")
GAITS = ("straight", "lagged", "1+,3-", "2+,5-", "4+,1-")
"""Gaits that are forecast."""
SECONDS, SETTLED = 20.0, 5.0
"""Length of a swim by a gait [s], and time after which its speed counts."""
DRAWS = 128
"""Robots of a forecast."""
NOISE = 1e-3
"""Error of a seen place [m]."""
DECISIONS = 300_000
"""Length of the teacher's training [decisions]."""
LIMITS = Limits(patience=0.25)
"""Of the guard: this camera loses 3 % of its pictures, and two in a row once in a minute."""
PATHS, RUNS = ("pentagon", "square", "figure-eight"), 5
LIMBS = Uniform(0.9, 1.0)
"""Strengths of limbs that are drawn in a training, since no two limbs are alike."""


# The robot in the tank, of which the other steps know nothing


def truth() -> Scene:
    """The robot as it is."""
    rng = np.random.default_rng(7)
    limbs = tuple(Limb(section=Strip(2.7e-3, 3.6e-3 * (1.0 + 0.03 * each))) for each in rng.standard_normal(5))
    strengths = tuple((1.0 - 0.05 * rng.random(5)).tolist())
    wires = SmaWires(peak_angle=0.58, heating_time=0.1, cooling_time=1.05, period=PERIOD)
    water = Water(drag_coefficient=1.25, tangential_drag_coefficient=0.7)
    return Scene(Seastar(limbs=limbs), water, wires, limb_strengths=strengths).at("balanced")


def plant(seed: int) -> SimulatedPlant:
    """A day in the tank."""
    sight = Sight(30.0, 0.085, jitter=0.015, dropout=0.03, noise=NOISE, turn_noise=0.01)
    return SimulatedPlant(Simulator(truth(), 1, 1), sight, seed)


def bench() -> Floats:
    """Angles of every limb after a full pulse [rad], shape (n_limbs, n), seen by a camera."""
    rng, scene = np.random.default_rng(3), truth()
    angles = np.multiply.outer(np.array(scene.limb_strengths), scene.actuator.delta_psi(_bench_times()))
    return np.asarray(angles + BENCH_NOISE * rng.standard_normal(angles.shape))


def _bench_times() -> Floats:
    return np.arange(0.0, BENCH_TIME, 1.0 / BENCH_RATE)


# What the laboratory does


def wires() -> dict[str, Any]:
    """Peak angle [rad] and cooling time [s] of the wires, from the curves on the bench."""

    def curve(t: Floats, peak: float, cooling: float) -> Floats:
        return SmaWires(peak, cooling_time=cooling, period=BENCH_TIME).delta_psi(t)

    each = np.array([curve_fit(curve, _bench_times(), angles, (0.6, 0.9))[0] for angles in bench()])
    return {"peak_angle": each[:, 0].tolist(), "cooling_time": each[:, 1].tolist()}


def written_down(results: Mapping[str, Any]) -> Scene:
    """The robot as the laboratory writes it down before it swims: discs of the limbs' thickness, and the bench."""
    peak, cooling = (float(np.mean(results["bench"][name])) for name in ("peak_angle", "cooling_time"))
    actuator = SmaWires(peak, cooling_time=cooling, period=PERIOD)
    return Scene(Seastar(rod_radius=1.5e-3), Water(tangential_drag_coefficient=0.5), actuator).at("fast")


def environment(scene: Scene, seed: int, path: str = "pentagon", logs: Path | None = None) -> PlantSwim:
    """The tank on a day, as policies see it."""
    return PlantSwim(plant(seed), LIMITS, scene=scene, decision_period=PERIOD, actions="pairs", path=path, logs=logs)


def track(scene: Scene, folder: Path, seed: int) -> Measurement:
    """What a swim by random pulses leaves in a folder."""
    env, rng = environment(scene, seed, logs=folder), np.random.default_rng(seed)
    env.reset(seed=0)
    for _ in range(PULSES):
        action = int(rng.integers(21)) if rng.random() < 0.5 else 0
        _, _, ended, stopped, info = env.step(action)
        if ended or stopped:
            raise RuntimeError(f"The pulses ended early: {info['plant_message'] or 'the path is over'}")
    env.close()
    return Measurement.from_csv(folder / "tracking.csv", folder / "commands.csv")


def fit(results: Mapping[str, Any]) -> dict[str, Any]:
    """Numbers of every swim by random pulses, residuals [m], and how late the camera was [s]."""
    scene, values, residuals, late = written_down(results), [], [], list[float]()
    for seed in range(SWIMS):
        with TemporaryDirectory() as folder:
            measurement = track(scene, Path(folder), seed)
            poses = np.loadtxt(Path(folder) / "poses.csv", delimiter=",", skiprows=1)
        estimate = identify(scene, FITTED, measurement)
        print(estimate.report(), flush=True)
        values.append(estimate.values.tolist())
        residuals.append(estimate.root_mean_square)
        late += (poses[5:, 1] - poses[5:, 0]).tolist()
    return {"values": values, "residuals_m": residuals, "late": np.percentile(late, [5.0, 50.0, 95.0]).tolist()}


def intervals(results: Mapping[str, Any]) -> tuple[Floats, Floats, Floats]:
    """Means of the fitted numbers over the swims, and the ends of their 95 % intervals, by Student's t of logarithms,
    shape (n_fitted,) each."""
    logs = np.log(results["fit"]["values"])
    centre, error = logs.mean(axis=0), logs.std(axis=0, ddof=1) / np.sqrt(len(logs))
    half = error * student.ppf(0.975, len(logs) - 1)
    return np.exp(centre), np.exp(centre - half), np.exp(centre + half)


def fitted(results: Mapping[str, Any]) -> Scene:
    """The robot as the swims say."""
    return with_numbers(written_down(results), dict(zip(FITTED, intervals(results)[0].tolist(), strict=True)))


def gait_commands(name: str) -> Floats:
    """Commands of a gait for SECONDS, shape (n, 5)."""
    if "," in name:
        plus, minus = (int(limb[0]) for limb in name.split(","))
        gait = np.vstack([pair_gait(plus, minus), np.zeros((4, 5))])
    else:
        gait = SCRIPTED[name](5, PERIOD)
    n = round(SECONDS / PERIOD)
    return np.asarray(np.tile(gait, (-(-n // len(gait)), 1))[:n])


def speed(times: Floats, places: Floats) -> Floats:
    """Speed from the first to the last place after SETTLED [mm/s]; places: Shape (..., n, 2)."""
    first = int(np.argmax(times >= SETTLED))
    way = np.hypot(*np.moveaxis(places[..., -1, :] - places[..., first, :], -1, 0))
    return np.asarray(1e3 * way / (times[-1] - times[first]))


def drawn(results: Mapping[str, Any]) -> dict[str, Floats]:
    """Numbers of DRAWS robots that the swims allow, shape (DRAWS,) each: means of swims that are drawn again."""
    logs, rng = np.log(results["fit"]["values"]), np.random.default_rng(11)
    again = logs[rng.integers(len(logs), size=(DRAWS, len(logs)))].mean(axis=1)
    return dict(zip(FITTED, np.exp(again).T, strict=True))


def forecast(results: Mapping[str, Any]) -> dict[str, Any]:
    """Speeds by held-out gaits [mm/s]: in the tank, of the fitted robot with its 95 % interval, as written down."""
    scene, numbers, rng = fitted(results), drawn(results), np.random.default_rng(13)
    blur = 1e3 * NOISE * np.sqrt(2.0) / (SECONDS - SETTLED)
    found = {}
    for seed, name in enumerate(GAITS, start=100):
        spread = simulated(with_numbers(scene, numbers), name, DRAWS) + blur * rng.standard_normal(DRAWS)
        found[name] = {
            "measured": swum(name, written_down(results), seed),
            "forecast": float(simulated(scene, name, 1)[0]),
            "interval": np.percentile(spread, [2.5, 97.5]).tolist(),
            "written": float(simulated(written_down(results), name, 1)[0]),
        }
    return found


def simulated(scene: Scene, name: str, n: int) -> Floats:
    """Speeds of n simulated robots by a gait [mm/s], shape (n,)."""
    simulator, rows, times = Simulator(scene, n), [], []
    for command in gait_commands(name):
        simulator.advance(PERIOD, np.tile(command, (n, 1)))
        rows.append(simulator.hub_position().copy())
        times.append(float(simulator.time[0]))
    return speed(np.array(times), np.stack(rows, axis=1))


def swum(name: str, scene: Scene, seed: int) -> float:
    """Speed of the robot in the tank by a gait [mm/s], from its log."""
    with TemporaryDirectory() as folder:
        env = environment(scene, seed, logs=Path(folder))
        env.reset(seed=0)
        for command in gait_commands(name):
            *_, stopped, info = env.step(int(np.argmax((env.command_table == command).all(axis=1))))
            if stopped:
                raise RuntimeError(f"The gait ended early: {info['plant_message']}")
        env.close()
        rows = np.genfromtxt(Path(folder) / "tracking.csv", delimiter=",", skip_header=1)
    return float(speed(rows[:, 0], rows[:, 1:3]))


# Training, and runs


def teach(results: Mapping[str, Any]) -> LearnedPolicy:
    """Policy for the camera, which has learned in the fitted robots from one that sees everything."""
    torch.set_num_threads(1)
    _, low, high = intervals(results)
    ends = zip(FITTED, low.tolist(), high.tolist(), strict=True)
    draws = DomainRandomization({**{name: Uniform(*each) for name, *each in ends}, "limb_strengths": LIMBS})
    scene, ppo = fitted(results), Hyperparameters(decision_period=PERIOD, coasting=True, discount=0.3, gae_lambda=0.95)
    env = make_training_env(ppo, "random", random_heading=True, scene=scene, threads=1)
    teacher = make_model(env, ppo, 0)
    teacher.learn(DECISIONS)
    early, _, late = results["fit"]["late"]
    sight = Sight(30.0, Uniform(early, late), dropout=0.03, noise=NOISE, turn_noise=0.01)
    batch = gym.make_vec(
        "SeastarSwim-v0", ppo.num_envs, "vector_entry_point", scene=scene, decision_period=PERIOD, actions="pairs",
        path="random", random_heading=True, sight=sight, randomization=draws, threads=1,
        autoreset_mode=AutoresetMode.SAME_STEP, max_episode_steps=ppo.max_episode_steps,
    )  # fmt: skip
    return distil(policy_of(teacher), VectorFrameStack(batch, PAST), ENOUGH, 0)


def run_to_the_end(policy: Policy, scene: Scene, path: str, seed: int) -> float:
    """Time of a swim in the tank [s], TIME_LIMIT if it does not arrive."""
    env = environment(scene, seed, path)
    swum = rollout(env, policy, seeds=0, record=["time"], on_step=lambda info: bool(info["time"] >= TIME_LIMIT))
    if env.stopped:
        raise RuntimeError(f"The run ended early: {env.stopped}")
    return float(swum.last("time")[0]) if swum.success[0] else TIME_LIMIT


def runs(results: Mapping[str, Any]) -> dict[str, Any]:
    """Times [s] of RUNS swims along every path by the policies, and by the script, which knows the pentagon alone."""
    scene, found = written_down(results), dict[str, Any]()
    policies: dict[str, Policy] = {
        "trained on the fit": teach(results), "bundled": load(bundled_file(PERIOD, task="sim-to-real")),
        "script": scripted("lagged-pentagon", "pairs", decision_period=PERIOD),
    }  # fmt: skip
    for name, policy in policies.items():
        paths = PATHS if name != "script" else PATHS[:1]
        found[name] = {
            path: [run_to_the_end(policy, scene, path, 200 + seed) for seed in range(RUNS)] for path in paths
        }
        print(name, found[name], flush=True)
    return found


# What the page says


def numbers_table(results: Mapping[str, Any]) -> str:
    """What was written down, fitted, and true in the tank."""
    centre, low, high = intervals(results)
    units = dict(zip(FITTED, ((1e-6, "MPa"), (1.0, "1"), (1.0, "1")), strict=True))
    lines = [
        [f"`{name}` [{unit}]", f"{factor * value:.3g}", f"{factor * one:.3g} to {factor * other:.3g}"]
        for (name, (factor, unit)), value, one, other in zip(units.items(), centre, low, high, strict=True)
    ]
    late = [1e3 * each for each in results["fit"]["late"]]
    peaks, cooling = (np.array(results["bench"][name]) for name in ("peak_angle", "cooling_time"))
    lines += [
        ["peak angle, bench [rad]", f"{peaks.mean():.3f}", f"{peaks.min():.3f} to {peaks.max():.3f} by limb"],
        ["cooling time, bench [s]", f"{cooling.mean():.2f}", f"{cooling.min():.2f} to {cooling.max():.2f} by limb"],
        ["age of a picture when it is known [ms]", f"{late[1]:.0f}", f"{late[0]:.0f} to {late[2]:.0f} (5 to 95 %)"],
        ["residuals [mm]", f"{1e3 * np.median(results['fit']['residuals_m']):.1f}", "median of the swims"],
    ]
    return markdown(["", "found", "95 % interval, or range"], lines)


def forecasts(results: Mapping[str, Any]) -> str:
    """Forecasts beside what was measured."""
    lines, inside = [], 0
    for name, one in results["forecast"].items():
        low, high = one["interval"]
        inside += low <= one["measured"] <= high
        cells = [one["measured"], one["forecast"], one["forecast"] - one["measured"], one["written"] - one["measured"]]
        lines.append([name, *(f"{cell:.2f}" for cell in cells), f"{low:.2f} to {high:.2f}"])
    lines.append([f"inside: {inside} of {len(lines)}", "", "", "", "", ""])
    return markdown(["gait", "measured [mm/s]", "forecast", "error", "error as written down", "95 % interval"], lines)


def times(results: Mapping[str, Any]) -> str:
    """Times of the runs: mean, smallest and largest."""
    lines = []
    for name, paths in results["runs"].items():
        cells = [_span(paths[path]) if path in paths else "–" for path in PATHS]
        lines.append([name, *cells])
    return markdown(["", *(f"{path} [s]" for path in PATHS)], lines)


def _span(found: list[float]) -> str:
    return f"{np.mean(found):.1f} ({min(found):.1f} to {max(found):.1f})"


def run(results: Results) -> None:
    """Take the steps that are missing."""
    results.read()
    results.fill({("bench",): wires}, lambda found: f"{np.mean(found['peak_angle']):.3f} rad")
    results.fill({("fit",): partial(fit, results)}, lambda found: f"{found['late'][1]:.3f} s late")
    results.fill({("forecast",): partial(forecast, results)}, lambda found: f"{len(found)} gaits")
    results.fill({("runs",): partial(runs, results)}, lambda found: ", ".join(found))
    print(numbers_table(results), forecasts(results), times(results), sep="\n\n")


STUDY = Study(
    "protocol", run, file="plant/protocol.json", packages=("torch", "stable_baselines3"),
    tables={"protocol numbers": numbers_table, "protocol forecasts": forecasts, "protocol runs": times},
)  # fmt: skip
