"""Robots on a GPU: the bits of the processor, and speed over the size of the batch.

Every scene is swum on the processor and on the device with the same random commands, and compared to the last bit.
So are environments whose observations stay on the device.
With `--device scalar` the device's code swims on the processor, and nothing else is measured: for machines without.
"""

import multiprocessing
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import product
from pathlib import Path
from typing import Any, get_args

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from seastar_gym import DomainRandomization, HeadingTargets, Sight, Uniform
from seastar_gym.envs.vector import Buffers
from seastar_gym.files import save_figure
from seastar_gym.lanes import cuda
from seastar_gym.scene import (
    AlongLimb,
    Attachment,
    Body,
    Contact,
    Limb,
    Limited,
    Numerics,
    Scene,
    Seastar,
    SmaPulse,
    SmaWires,
    Stiffening,
    ThermalSma,
    relaxation_time,
)
from seastar_gym.scene.numerics import Fidelity, SchemeName
from seastar_gym.scene.water import GridCurrent, ShearCurrent, UniformCurrent, Vortex, Water
from seastar_gym.simulator import Simulator
from studies.frame import Results, Study, require_known, rounded
from studies.operations import count_operations, numbers_moved
from studies.pages import markdown
from studies.style import CYCLE, subplots

PRESETS: tuple[Fidelity, ...] = ("fast", "balanced", "reference")
BATCHES = (64, 256, 1024, 4096, 16384, 65536, 262144)
LONGEST = 4.0
"""A batch whose stroke takes longer than this [s] is the largest one, from USUAL robots on."""
USUAL, DECIDING = 4096, 65536
N_ROBOTS, N_STROKES = 64, 3
"""Robots that are compared with the processor's, and their strokes."""
EVERYTHING = "all, a body, bent along, contact"
ON_DEVICE = "cuda, observations left there"
ROBOTS_OBSERVED, EPISODE = 35, 3
"""Robots of an environment that is compared, and decisions of its episodes."""
NOT_ON_DEVICES = "energy_growth"
"""Field of a report that only the processor knows."""


def swirl(x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Velocity of a cellular current [m/s] at positions x, y [m]."""
    return 0.02 * np.sin(10.0 * x) * np.cos(10.0 * y), -0.02 * np.cos(10.0 * x) * np.sin(10.0 * y)


@cache
def scenes() -> dict[str, Scene]:
    """Scenes that are compared, by name: every term, scheme, preset and kind of actuator, and other robots."""
    contact, rectangle = Contact(), Body.rectangle(0.06, 0.03)
    chapter = Scene(Seastar(nodes_per_limb=10), numerics=Numerics())
    of, robot = partial(replace, chapter), partial(replace, chapter.robot)
    grid = GridCurrent.from_function(swirl, (-1.0, 1.0), (-1.0, 1.0), 0.02)
    water = Water(tangential_drag_coefficient=0.02, added_mass_coefficient=1.0, current=grid)
    silicone = relaxation_time(0.1, 10.0)  # of a soft one's loss factor, 0.1 at 10 Hz
    of_each = {"youngs_modulus": np.full(N_ROBOTS, 1e6), "relaxation_time": silicone}
    along: dict[str, Any] = {"along": AlongLimb(), "stiffening": Stiffening()}
    everything = of(robot=robot(**of_each, **along, body=rectangle), fluid=water, contact=contact)
    row = Body.rectangle(0.06, 0.03, attachments=(Attachment(0.02, 0.0, 0.0), Attachment(-0.02, 0.0, np.pi)))
    found = {
        "the chapter's scene": chapter,
        "no fluid": of(fluid=None),
        "drag along limbs": of(fluid=Water(tangential_drag_coefficient=0.02)),
        "uniform current": of(fluid=Water(current=UniformCurrent(0.01, 0.0))),
        "shear": of(fluid=Water(current=ShearCurrent(0.1))),
        "vortex": of(fluid=Water(current=Vortex(0.01, 0.2, 0.2))),
        "current on a grid": of(fluid=Water(current=grid)),
        "added mass": of(fluid=Water(added_mass_coefficient=1.0)),
        "material damping": of(robot=robot(relaxation_time=silicone)),
        "bent along the limbs": of(robot=robot(along=AlongLimb())),
        "bent along, stiff when hot": of(robot=robot(**along)),
        "a disc for a body": of(robot=robot(body=Body(radius=0.02))),
        "a rectangle for a body": of(robot=robot(body=rectangle)),
        "joints of the limbs": of(robot=robot(limbs=(Limb(joint_stiffness=2e-4),) * 5)),
        "contact, limbs apart": of(contact=contact),
        "a rectangle for a body, contact": of(robot=robot(body=rectangle), contact=contact),
        "numbers of each robot": of(robot=robot(youngs_modulus=np.full(N_ROBOTS, 1e6))),
        "all of these": of(robot=robot(**of_each), fluid=water),
        EVERYTHING: everything,
        "wires": of(actuator=SmaWires()),
        "thermal": of(actuator=ThermalSma()),
        "limited": of(actuator=Limited(SmaPulse(), 0.5, 3.0)),
        "pulses of each robot": of(actuator=SmaPulse(peak_angle=np.linspace(0.2, 0.5, N_ROBOTS))),
        "three limbs": Scene(robot(n_limbs=3)),
        "eight limbs in contact": Scene(robot(n_limbs=8), contact=contact),
        "unequal limbs": Scene(robot(limbs=(Limb(length=0.08), *[Limb()] * 4))),
        "hub hinges": Scene(robot(discretisation="chapter")),
        "limbs in a row on a body": Scene(robot(n_limbs=2, along=AlongLimb(), body=row)),
        "held nodes, loads": Scene(chapter.robot, fluid=None, held_nodes=(0, 1), loads=((9, 0.0, 1e-3),)),
        "weak limbs": of(limb_strengths=(1.0, 0.5, 0.0, 1.0, 0.8)),
    }
    for scheme in get_args(SchemeName):
        found[scheme] = of(numerics=Numerics(scheme, 0.005))
        found[f"{scheme}, {EVERYTHING}"] = replace(everything, numerics=Numerics(scheme, 0.005))
    for preset in (*PRESETS, "accurate", "chapter"):
        found[f"preset {preset}"] = Scene.preset(preset)
    return found | {f"preset {name}, contact": replace(Scene.preset(name), contact=contact) for name in PRESETS}


def commands_of(scene: Scene, n_robots: int, n_strokes: int) -> NDArray[np.float64]:
    """Random commands, shape (n_strokes, n_robots, n_limbs); every other robot repeats its first one."""
    commands = np.random.default_rng(0).uniform(-1.0, 1.0, (n_strokes, n_robots, scene.robot.n_limbs))
    commands[:, ::2] = commands[0, ::2]
    return commands


def compared(name: str, device: str) -> dict[str, Any]:
    """How a scene swims on the device: whether all bits are the processor's, and names of what differs."""
    scene = scenes()[name]
    both = Simulator(scene, N_ROBOTS, threads=1), Simulator(scene, N_ROBOTS, device=device)
    differing: set[str] = set()
    for commands in commands_of(scene, N_ROBOTS, N_STROKES):
        here, there = (
            {**simulator.stroke(commands)._asdict(), **simulator.get_state()._asdict(),
             "elastic_energy": simulator.elastic_energy()}
            for simulator in both
        )  # fmt: skip
        differing |= {key for key in here if key != NOT_ON_DEVICES and not same(here[key], there[key])}
    return {"same": not differing, "differing": sorted(differing), "failed": int(both[0].failed.sum())}


def environments() -> dict[str, dict[str, Any]]:
    """Options of batches whose observations are compared, by name."""
    numbers = DomainRandomization({"robot.limb_length": Uniform(0.08, 0.12)})
    found: dict[str, dict[str, Any]] = {
        "pairs": {"actions": "pairs"},
        "continuous": {"actions": "continuous", "random_heading": True, "autoreset_mode": "SameStep"},
        "headings": {"headings": HeadingTargets("random"), "autoreset_mode": "SameStep"},
        "camera": {"sight": Sight(10.0, delay=0.1, noise=1e-3)},
        "timed": {"decision_period": 0.2},
        "numbers of each robot": {"randomization": numbers, "autoreset_mode": "SameStep"},
    }
    for n_limbs, n_nodes in ((3, 12), (8, 5)):
        found[f"{n_limbs} limbs"] = {"scene": Scene(Seastar(n_limbs, n_nodes), numerics=Numerics.preset("fast"))}
    return {f"observations, {name}": options for name, options in found.items()}


def batch_on(device: str, n_robots: int, on_device: bool = False, **options: Any) -> gym.vector.VectorEnv:
    """Batch environment, at "fast" without a scene. on_device: Whether observations stay on the device."""
    return gym.make_vec(
        "SeastarSwim-v0", n_robots, vectorization_mode="vector_entry_point", device=device, on_device=on_device,
        **options,
    )  # fmt: skip


def observed(name: str, device: str) -> dict[str, Any]:
    """How robots of an environment are seen and rewarded on the device, with observations copied and left there.

    Returns whether all bits are the processor's, and names of what differs, over episodes of EPISODE decisions.
    """
    batches = [
        batch_on(where, ROBOTS_OBSERVED, on_device, max_episode_steps=EPISODE, **environments()[name])
        for where, on_device in (("cpu", False), (device, False), (device, True))
    ]
    batches[0].action_space.seed(0)
    first, *others = ({"observations": on_processor(batch.reset(seed=0)[0])} for batch in batches)
    differing: set[str] = set()
    for _ in range(EPISODE + 2):
        differing |= {key for other in others for key in first if not same(first[key], other[key])}
        actions = batches[0].action_space.sample()
        first, *others = (_decided(batch, actions) for batch in batches)
    return {"same": not differing, "differing": sorted(differing)}


def _decided(batch: gym.vector.VectorEnv, actions: Any) -> dict[str, Any]:
    """Results of a decision by name, on the processor."""
    *results, info = batch.step(actions)
    last = [on_processor(row) for row in info.get("final_obs", ()) if row is not None]
    return {**dict(zip(Buffers._fields, map(on_processor, results), strict=True)), "final_obs": np.array(last)}


def on_processor(array: Any) -> Any:
    """An array of the processor or of a device, on the processor."""
    return array.get() if hasattr(array, "get") else array


def same(one: Any, other: Any) -> bool:
    """Whether two arrays have the same bits; None is like None."""
    if one is None or other is None:
        return one is other
    return bool(np.array_equal(one, other, equal_nan=np.asarray(one).dtype.kind == "f"))


def batches(preset: Fidelity, contact: bool, device: str) -> dict[str, dict[str, Any]]:
    """Speed of a preset by the size of the batch: steps of robots per second, and seconds of a stroke."""
    scene = replace(Scene.preset(preset), contact=Contact() if contact else None)
    row, seconds = dict[str, dict[str, Any]](), 0.0
    for n_robots in BATCHES if device == "cuda" else (USUAL,):
        if seconds > LONGEST and n_robots > USUAL:
            break
        simulator = Simulator(scene, n_robots, device=device)
        first, *others = commands_of(scene, n_robots, 3)
        simulator.stroke(first)
        done = []
        for commands in others:
            began = time.perf_counter()
            report = simulator.stroke(commands)
            done.append((time.perf_counter() - began, report.steps.sum(), report.newton_iterations.sum()))
        seconds, steps, iterations = min(done)
        row[str(n_robots)] = {
            "steps_per_second": rounded(steps / seconds), "seconds": rounded(seconds),
            "iterations_per_step": rounded(iterations / steps), "failed": int(simulator.failed.sum()),
        }  # fmt: skip
    return row


def traffic(preset: Fidelity) -> dict[str, float]:
    """Bytes that a robot's kernels read and write of its own numbers, per Newton iteration and per step beside."""
    parts = count_operations(Scene.preset(preset))
    return {name: 8.0 * numbers_moved(parts[name]) for name in ("iteration", "step")}


def bandwidth() -> float:
    """Bytes per second that the GPU copies, read and written."""
    arrays = cuda.arrays()
    source = arrays.zeros(2**28)
    target, seconds = arrays.empty_like(source), []
    for _ in range(5):
        arrays.cuda.Device().synchronize()
        began = time.perf_counter()
        target[:] = source
        arrays.cuda.Device().synchronize()
        seconds.append(time.perf_counter() - began)
    return float(2 * source.nbytes / min(seconds))


def decisions(device: str, on_device: bool = False) -> dict[str, float]:
    """Decisions per second of the batch environment at "fast" with random actions."""
    batch = batch_on(device, DECIDING, on_device)
    batch.reset(seed=0)
    batch.action_space.seed(0)
    actions = [batch.action_space.sample() for _ in range(4)]
    batch.step(actions[0])
    began = time.perf_counter()
    for action in actions[1:]:
        observations = batch.step(action)[0]
    on_processor(observations[:1])  # waits for the device
    seconds = time.perf_counter() - began
    batch.close()
    return {"decisions_per_second": rounded(3 * DECIDING / seconds), "robots": DECIDING}


def gpu() -> dict[str, Any]:
    """The GPU: its name, its driver's version, and CuPy's."""
    arrays = cuda.arrays()
    runtime = arrays.cuda.runtime
    name = runtime.getDeviceProperties(0)["name"].decode()
    return {"name": name, "driver": runtime.driverGetVersion(), "cupy": arrays.__version__}


@dataclass(frozen=True)
class Options:
    """Robots on a GPU against the processor's."""

    device: str = "cuda"
    """"cuda", or "scalar", which compares bits alone."""
    compared: tuple[str, ...] = ()
    """Scenes and environments that are compared; all if none is named."""


def run(options: Options, results: Results) -> str | None:
    """Compare scenes and environments, and measure, but for what is in the file; what is measured is kept at once."""
    if options.device == "cuda":
        results["gpu"] = gpu()
    all_of_them = (*scenes(), *environments())
    require_known("scene", options.compared, all_of_them)
    chosen = options.compared or all_of_them
    bits, observations = results.setdefault("bits", {}), results.setdefault("observations", {})
    with ProcessPoolExecutor(mp_context=multiprocessing.get_context("spawn")) as pool:
        for kept, compare, ours in ((bits, compared, scenes()), (observations, observed, environments())):
            missing = [name for name in ours if name in chosen and name not in kept]
            for name, found in zip(missing, pool.map(compare, missing, [options.device] * len(missing)), strict=True):
                kept[name] = found
                print(name, "same bits" if found["same"] else ", ".join(found["differing"]), sep=": ", flush=True)
                results.save()
    if options.device == "cuda":
        measure(results)
    different = [name for name, found in (bits | observations).items() if not found["same"]]
    return f"Other bits than the processor's: {', '.join(different)}." if different else None


def measure(results: Results) -> None:
    """Speed of the GPU and of the processor beside it."""
    results["bandwidth"] = rounded(bandwidth())
    results["traffic"] = {preset: traffic(preset) for preset in PRESETS}
    results.save()
    cells: dict[tuple[str, ...], Callable[[], Any]] = {("environment", ON_DEVICE): partial(decisions, "cuda", True)}
    for device in ("cuda", "cpu"):
        for preset, contact in product(PRESETS, (False, True)):
            name = f"{preset}{', contact' * contact}"
            cells["speed", name, device] = partial(batches, preset, contact, device)
        cells["environment", device] = partial(decisions, device)
    results.fill(cells, str)


def share_of_bandwidth(results: Mapping[str, Any], preset: str, n_robots: str) -> float:
    """Share of the GPU's bandwidth that the kernels' own numbers take, if none of them stays in a cache."""
    row, bytes_of = results["speed"][preset]["cuda"][n_robots], results["traffic"][preset]
    per_step = row["iterations_per_step"] * bytes_of["iteration"] + bytes_of["step"]
    return float(row["steps_per_second"] * per_step / results["bandwidth"])


def speeds(results: Mapping[str, Any]) -> str:
    """Table of speeds: the GPU's largest batch, and 4,096 robots on the processor beside it."""
    head = ["scene", "robots", "million steps per second", "share of bandwidth", "on the host", "ratio"]
    rows = []
    for name, row in results.get("speed", {}).items():
        of_gpu, beside = row["cuda"], row["cpu"][str(USUAL)]["steps_per_second"]
        largest = max(of_gpu, key=int)
        share = f"{100 * share_of_bandwidth(results, name, largest):.0f} %" if name in results["traffic"] else ""
        fastest = of_gpu[largest]["steps_per_second"]
        rows.append([
            name, f"{int(largest):,}", f"{fastest / 1e6:.1f}", share, f"{beside / 1e6:.2f}", f"{fastest / beside:.1f}"
        ])  # fmt: skip
    return markdown(head, rows)


def draw(results: Mapping[str, Any], path: Path) -> None:
    """Steps per second over the size of the batch."""
    if "speed" not in results:  # of a machine without a GPU
        return
    figure, axes = subplots(1, 1, figsize=(6.4, 4.4))
    for preset, colour in zip(PRESETS, CYCLE, strict=False):
        for contact, style in (("", "o-"), (", contact", "o--")):
            row = results["speed"][f"{preset}{contact}"]
            sizes = sorted(row["cuda"], key=int)
            rates = [row["cuda"][size]["steps_per_second"] for size in sizes]
            axes.loglog([int(size) for size in sizes], rates, style, color=colour, label=f"{preset}{contact}", ms=4)
            axes.axhline(row["cpu"][str(USUAL)]["steps_per_second"], color=colour, ls=":", lw=1)
    axes.set(
        xlabel="robots in the batch",
        ylabel="steps of robots per second",
        title=f"solid and dashed: one {results['gpu']['name']}; dotted: 16 cores of its host",
    )
    axes.legend()
    save_figure(figure, path)


STUDY = Study(
    "gpu", run, Options, "speed/gpu.json", Path("runs/gpu"), pictures={"gpu.png": draw}, tables={"gpu": speeds},
    settings=lambda options: {"device": options.device, "robots": N_ROBOTS, "strokes": N_STROKES},
)  # fmt: skip
