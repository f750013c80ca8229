"""Simulates many designs and writes how they swim: `seastar sweep robot.n_limbs=3,5 --out runs/limbs`.

Axes are NAME=VALUES. The name is that of a number of the scene, such as robot.limb_length, actuator.peak_angle or
numerics.step, of a whole part (robot, fluid, actuator, numerics, contact), fidelity, gait or controller. The values are

    3,4,5               a list of numbers or names; parts are named by their class, SmaPulse,SmaWires, or by a JSON file
                        of a part, @robot.json. Gaits are straight, lagged, thrifty or a pair: between gaits stands a
                        slash, straight/1+,4-
                        Controllers are agents of seastar evaluate, learned,greedy,runs/here/policy.safetensors: they
                        swim --path, and what they learned or computed is of the scene without the robots' own numbers
    0.05:0.15:11        eleven numbers, evenly spaced, 0.05:0.15:11:log in their logarithm
    0.05:0.15           a range, 0.05:0.15:log in the logarithm, for --latin or --optuna

Without ranges, the sweep is the grid of all combinations. Numbers that robots may have of their own are simulated side
by side. Every batch, of some hundred designs, has one file of results, OUT/parts/*/*.parquet. The same command goes on
with the batches that have none. In the end OUT/best.json is the scene of the best design, for `train.py --scene`;
with parts of your own, OUT/best.py is.
"""

import argparse
import sys
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from tqdm import tqdm

from seastar_gym.command import DEFAULT, INTERRUPTED, answered
from seastar_gym.envs.paths import PATH_HELP, load_path
from seastar_gym.evaluation.swim import TIME_LIMIT
from seastar_gym.files import read_json, require_extra, within, write_atomically, write_json
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import require_choice, shown
from seastar_gym.scene.scene import load_scene
from seastar_gym.scene.serial import KINDS, from_dict, has_own_kinds
from seastar_gym.simulator import SolverStatus
from seastar_gym.simulator.device import DEVICES
from seastar_gym.sweep.designs import PARTS, Axis, Batch, Choices, Range, Route, Sweep
from seastar_gym.sweep.executors import add_options, executor_of
from seastar_gym.sweep.run import (
    OF_CONTROLLERS,
    REFUSED,
    UNITS,
    Progress,
    ResultFiles,
    judged,
    result_file_of,
    run,
)


def axis_of(text: str) -> Axis:
    """Axis of a text such as "robot.limb_length=0.05:0.15"."""
    name, equals, values = text.partition("=")
    if not equals or not name or not values:
        raise ValueError(f"An axis is written NAME=VALUES, such as robot.n_limbs=3,4,5, not {shown(text)}.")
    if name == "gait":
        return Choices(name, tuple(values.split("/")))
    if name == "controller":
        return Choices(name, tuple(values.split(",")))
    if ":" in values and not values.startswith("@"):
        return _spaced(name, values.split(":"))
    tokens = values.split(",")
    return Choices(name, tuple(_value(name, token) for token in tokens), tuple(map(_label, tokens)))


def _spaced(name: str, words: list[str]) -> Axis:
    """Axis from low to high, of a number of values or of all in between."""
    is_log = words[-1] == "log"
    words = words[: len(words) - is_log]
    numbers = [_number(word) for word in words]
    if not 2 <= len(numbers) <= 3 or any(isinstance(number, str) for number in numbers):
        raise ValueError(
            f"{name} is written LOW:HIGH, LOW:HIGH:COUNT or either with :log, not {shown(':'.join(words))}."
        )
    low, high, *count = numbers
    are_whole = not is_log and all(isinstance(number, int) for number in numbers)
    if are_whole and count and 2 <= count[0] <= high - low + 1 and (high - low) % (count[0] - 1) == 0:
        return Choices(name, tuple(range(low, high + 1, (high - low) // (count[0] - 1))))
    axis = Range(name, float(low), float(high), is_log)
    if not count:
        return axis
    if not isinstance(count[0], int) or not 2 <= count[0] <= 1_000_000:
        raise ValueError(f"{name} needs a count from 2 to 1000000 as its third number, not {shown(count[0])}.")
    return axis.spaced(count[0])


def _number(word: str) -> Any:
    """A whole number, a number, or the word itself."""
    for kind in (int, float):
        try:
            return kind(word)
        except ValueError:
            pass
    return word


def _value(name: str, word: str) -> Any:
    if word.startswith("@"):
        return from_dict(read_json(Path(word[1:])), object)
    if name in PARTS:
        if word == "None":
            return None
        if word not in KINDS:
            raise ValueError(f"{name} is a class of seastar_gym such as SmaPulse, or @FILE.json, not {shown(word)}.")
        return KINDS[word]()
    return None if word == "None" else _number(word)


def _label(word: str) -> Any:
    return Path(word[1:]).stem if word.startswith("@") else _number(word)


def make_parser() -> argparse.ArgumentParser:
    """Parser of the command line."""
    parser = argparse.ArgumentParser(
        "seastar sweep", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("axes", nargs="*", metavar="NAME=VALUES", help="what differs from design to design")
    parser.add_argument("--out", type=Path, default=Path("runs/sweep"), help=f"folder of the results {DEFAULT}")
    parser.add_argument("--scene", type=Path, help="file of the scene, .py or .json (default: the chapter's at `fast`)")
    parser.add_argument("--gait", default="straight", help=f"what robots do, unless an axis says it {DEFAULT}")
    parser.add_argument(
        "--settling", type=int, default=2, help=f"strokes before the measurement, or seconds of gaits in time {DEFAULT}"
    )
    parser.add_argument("--measured", type=int, default=8, help=f"strokes of the measurement {DEFAULT}")
    parser.add_argument("--path", default="pentagon", help=f"controllers: {PATH_HELP} {DEFAULT}")
    parser.add_argument("--seconds", type=float, default=TIME_LIMIT, help=f"controllers: time limit [s] {DEFAULT}")
    parser.add_argument("--decision-period", type=float, help="controllers: time between decisions [s] (default: 1)")
    parser.add_argument("--latin", type=int, default=0, metavar="N", help="designs of every combination of choices")
    parser.add_argument("--optuna", type=int, default=0, metavar="N", help="search with Optuna, N designs in all")
    parser.add_argument("--objective", default="speed", help=f"column of results that is searched for {DEFAULT}")
    parser.add_argument("--minimize", action="store_true", help="search for the smallest, not the largest")
    parser.add_argument("--storage", help="Optuna: database (default: sqlite:///OUT/study.db)")
    parser.add_argument(
        "--stale-after", type=float, default=600.0, metavar="SECONDS",
        help=f"Optuna: proposals without result for so long are put back {DEFAULT}",
    )  # fmt: skip
    parser.add_argument("--seed", type=int, default=0, help=f"seed of what is drawn {DEFAULT}")
    parser.add_argument("--robots", type=int, default=256, help=f"designs of a batch at most {DEFAULT}")
    parser.add_argument(
        "--device", choices=("cpu", *DEVICES), default="cpu",
        help=f"where robots swim, to the same bits: cuda is a GPU, with --robots 16384 --workers 1 {DEFAULT}",
    )  # fmt: skip
    add_options(parser)
    parser.add_argument("--count", action="store_true", help="say how many designs and batches there are, and stop")
    return parser


def bar_of(total: int, bar: Any) -> Callable[[Progress], None]:
    """Progress that shows batches, designs and strokes per second and the estimate of the rest.

    Strokes of controllers, which end when they arrive, are not counted.
    """

    def show(tally: Progress) -> None:
        seconds = max(bar.format_dict["elapsed"], 1e-9)
        bar.total = total - tally.kept
        bar.set_postfix_str(
            f"{tally.designs / seconds:.0f} designs/s"
            + (f", {tally.strokes / seconds:.0f} strokes/s" if tally.strokes else "")
            + (f", {tally.losses} lost" if tally.losses else ""),
            refresh=False,
        )
        bar.update(tally.done - bar.n)

    return show


def as_text(tally: Progress, out: Path) -> str:
    """What was done, in a sentence or two."""
    text = f"New in {out}: {tally.designs:,} designs, batches: {tally.done}; there before, batches: {tally.kept}."
    if tally.damaged:
        text += f" Damaged before, and simulated again: {', '.join(map(str, tally.damaged))}."
    if tally.problems:
        name, problem = next(iter(tally.problems.items()))
        text += f" Without result, batches: {len(tally.problems)}, such as {name[:8]}: {problem}"
    return text


def sweep_of(options: argparse.Namespace) -> Sweep:
    """Sweep that the options describe. ValueError for what they cannot mean."""
    scene = Scene.preset("fast") if options.scene is None else load_scene(options.scene)
    axes = tuple(map(axis_of, options.axes))  # after the scene's file, which may register parts
    if options.latin and options.optuna:
        raise ValueError("Designs are drawn by --latin or searched by --optuna: leave one out.")
    if ranges := [axis.name for axis in axes if isinstance(axis, Range) and not options.latin + options.optuna]:
        raise ValueError(f"{ranges[0]} has a range: say --latin N or --optuna N, or how many values, LOW:HIGH:COUNT.")
    return Sweep(
        scene, axes, options.gait, options.settling, options.measured,
        1 if options.optuna and any(isinstance(axis, Range) for axis in axes) else options.latin,
        options.seed, options.robots, Route(load_path(options.path), options.seconds, options.decision_period),
    )  # fmt: skip


def work_of(options: argparse.Namespace) -> Callable[[Batch], bytes]:
    """What makes a part of a batch, on the device that the options name. ValueError if this machine is to have it."""
    if options.device != "cpu" and options.executor in ("here", "processes"):
        DEVICES[options.device].arrays()
    return partial(result_file_of, device=options.device)


def run_sweep(sweep: Sweep, options: argparse.Namespace) -> int:
    """Run the batches of a grid or a Latin hypercube; returns the exit code."""
    print(f"{sweep.n_designs:,} designs in {sweep.n_batches:,} batches.")
    if options.count:
        return 0
    work = work_of(options)
    with tqdm(total=sweep.n_batches, unit="batch") as bar, executor_of(options) as executor:
        tally = run(sweep.batches(), options.out, executor, bar_of(sweep.n_batches, bar), work)
    print(as_text(tally, options.out))
    keep_best(options, (batch.name for batch in sweep.batches()))
    return 1 if tally.problems else 0


REGISTERED = """from seastar_gym import Scene
from seastar_gym.scene.scene import load_scene

load_scene({file!r})  # registers parts of the robot
scene = Scene.from_dict({scene!r})
"""
"""Python of a scene with parts that a file registers."""


def keep_best(options: argparse.Namespace, batches: Iterable[str]) -> None:
    """Say which designs of a sweep have no result and which is best, and write its scene; nothing without results.

    batches: Names of the batches of the sweep. The folder may have those of others.
    """
    names = set(batches)
    if names.isdisjoint(ResultFiles(options.out).names()):
        return
    best, without = judged(options.out, options.objective, not options.minimize, names)
    for status, count in without.items():
        why = "no scene has such a robot" if status == REFUSED else SolverStatus(status).sentence
        print(f"Designs without result: {count:,}, with status {status}: {why}")
    if best is None:
        print(f"There is no best design: none has swum, uncrossed, and has {options.objective}.")
        return
    file, design = options.out / "best.json", ", ".join(f"{name}={shown(value)}" for name, value in best.design.items())
    write_json(file, best.scene.to_dict())
    if options.scene is not None and has_own_kinds(best.scene):
        file = file.with_suffix(".py")
        write_atomically(file, REGISTERED.format(file=str(options.scene.absolute()), scene=best.scene.to_dict()))
    unit = (UNITS | OF_CONTROLLERS)[options.objective]
    of = f", of {design}" if design else ""
    print(f"Best {options.objective}: {best.value:.6g} {unit}{of}. Its scene: {file}.")


def search(sweep: Sweep, options: argparse.Namespace) -> int:
    """Search with Optuna; returns the exit code."""
    require_extra("Searches", "search", "optuna", "sqlalchemy")
    from seastar_gym.sweep.proposals import Search, batches_of, explore

    work = work_of(options)
    options.out.mkdir(parents=True, exist_ok=True)
    for file in options.out.glob("study.db*"):
        within(options.out, file.name)  # SQLite writes through links
    storage = options.storage or f"sqlite:///{options.out}/study.db"
    wanted = Search(options.objective, not options.minimize, options.seed, options.stale_after)
    with tqdm(total=options.optuna, unit="design") as bar, executor_of(options) as executor:
        study = explore(sweep, wanted, storage, options.optuna, options.out, executor,
                        lambda tally: bar.update(tally.designs - bar.n), work, options.workers)  # fmt: skip
    keep_best(options, batches_of(study))
    return 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    options = make_parser().parse_args(arguments)

    def work() -> int:
        require_choice("--objective", options.objective, tuple(UNITS | OF_CONTROLLERS))
        sweep = sweep_of(options)
        return search(sweep, options) if options.optuna else run_sweep(sweep, options)

    try:
        return answered(work, options)
    except KeyboardInterrupt:
        print(f"Interrupted: all finished batches are in {shown(str(options.out))}, and the same command goes on.",
              file=sys.stderr)  # fmt: skip
        return INTERRUPTED
