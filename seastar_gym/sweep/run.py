"""Runs the batches of a sweep that have no part yet, and writes their parts.

How the designs of a batch swim, one number per design and column.

Files of results: those of a batch each, as Parquet files with units and the scene in their metadata.
"""

from __future__ import annotations

import json
import os
import warnings
from collections import Counter
from collections.abc import Callable, Container, Iterable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet
from numpy.typing import NDArray

from seastar_gym.command import refused_by_disk
from seastar_gym.controllers.contract import actions_of, require_fit
from seastar_gym.envs.options import SwimOptions
from seastar_gym.envs.paths import WAYPOINT_RADIUS
from seastar_gym.envs.robots import Robots
from seastar_gym.envs.vector import ManyRobotsEnv
from seastar_gym.envs.waypoints import AlongPath
from seastar_gym.evaluation.rollout import rollout
from seastar_gym.files import require_writable, within, write_atomically
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import require_callable, require_count, require_file, require_flag, require_kind, shown
from seastar_gym.scene.number import numbers_of, unit_of, with_numbers
from seastar_gym.simulator import Simulator, SolverStatus
from seastar_gym.sweep.designs import Batch, Configuration, Controller
from seastar_gym.sweep.executors import Done, Outcome, Work, outcomes

REFUSED = -1
"""Status of a design that a scene refuses; others have that of the solver, see `SolverStatus`."""
UNITS = {
    "speed": "m/s", "strokes_per_metre": "1/m", "ahead": "m", "aside": "m", "turn": "rad", "energy": "J",
    "work": "J", "peak_moment": "N m", "smallest_opening_angle": "rad", "newton_iterations": "1", "status": "1",
}  # fmt: skip
"""Columns of results and their units.

speed: Distance between the places of the hub at the beginning and at the end of the measurement, over its time.
strokes_per_metre: Periods of the actuator that a metre takes at that speed.
ahead, aside: That distance along the robot's x axis at the beginning, and to the left of it. The axis is that of the
    rest shape that fits all nodes best; for controllers, that of observations, which fits hub and stations.
turn: Rotation of the robot during the measurement.
energy: Electric energy of the measured intervals.
work: Mechanical work of the actuators in these intervals, see `StrokeReport`.
peak_moment: Largest moment that a limb resisted its actuator with in them.
smallest_opening_angle: Between neighbouring limbs at the hub, at any time. Below zero, limbs have crossed.
    With a body it is pi.
newton_iterations: Of all intervals.
status: SolverStatus, the largest of all intervals, or REFUSED. All else is NaN unless it is zero.

Of a controller, the measurement is the whole swim, and the speed is the length of the path up to the last waypoint
reached over the time of the swim.
"""
OF_CONTROLLERS = {"time": "s", "waypoints": "1"}
"""Columns besides, of controllers, and their units.

time: Time until the last waypoint is reached; NaN if it is not. waypoints: Number of waypoints reached.
"""

OF_EPISODES = (
    "time", "waypoint_index", "hub_position", "energy", "work", "peak_moment", "smallest_opening_angle",
    "newton_iterations", "solver_status",
)  # fmt: skip
"""Entries of info that the columns of controllers are made of."""


def units_of(frame: Configuration) -> dict[str, str]:
    """Columns of results of a frame, and their units."""
    return UNITS if frame.controller is None else UNITS | OF_CONTROLLERS


def swim(batch: Batch, device: str = "cpu") -> dict[str, NDArray[Any]]:
    """Columns of results of a batch's designs, shape (n_robots,) each. device: Where robots swim, see `Simulator`."""
    sound = np.ones(batch.n_robots, bool)
    try:
        scene = scene_of(batch, sound)
    except ValueError:
        sound = np.array([_is_sound(batch, k) for k in range(batch.n_robots)])
        scene = scene_of(batch, sound) if sound.any() else batch.configuration.scene
    found = measure(scene, batch, int(sound.sum()), device) if sound.any() else {}
    columns: dict[str, NDArray[Any]] = {}
    for name in units_of(batch.configuration):
        columns[name] = np.full(batch.n_robots, np.nan)
        columns[name][sound] = found.get(name, np.nan)
    columns["status"] = np.where(sound, columns["status"], REFUSED).astype(np.int64)
    return columns


def scene_of(batch: Batch, chosen: NDArray[np.bool_] | int) -> Scene:
    """Scene of some robots of a batch side by side, or of one."""
    return with_numbers(batch.configuration.scene, {name: values[chosen] for name, values in batch.numbers.items()})


def _is_sound(batch: Batch, robot: int) -> bool:
    try:
        scene_of(batch, robot)
    except ValueError:
        return False
    return True


def measure(scene: Scene, batch: Batch, n_robots: int, device: str = "cpu") -> dict[str, NDArray[Any]]:
    """Columns of results of robots side by side, NaN where the solver failed."""
    frame, controller = batch.configuration, batch.configuration.controller
    if controller is None:
        columns = repeat(scene, frame, n_robots, device)
    else:
        columns = steer(scene, frame.scene, controller, n_robots, device)
    status = columns.pop("status")
    return {**{name: np.where(status == 0.0, column, np.nan) for name, column in columns.items()}, "status": status}


def repeat(scene: Scene, frame: Configuration, n_robots: int, device: str) -> dict[str, NDArray[Any]]:
    """Columns of results of robots side by side that repeat a gait."""
    simulator, gait = Simulator(scene, n_robots, 1, effort=True, device=device), frame.gait
    interval = scene.actuator.period if gait.interval is None else gait.interval
    status, iterations, energy, work, moment = np.zeros((5, n_robots))
    angle = np.full(n_robots, np.inf)
    hub, heading = simulator.hub_position(), simulator.heading()
    settling, measured = frame.settling * gait.per_stroke, frame.measured * gait.per_stroke
    for k in range(settling + measured):
        if k == settling:
            hub, heading, energy[:] = simulator.hub_position(), simulator.heading(), 0.0
            work[:] = moment[:] = 0.0
        report = simulator.advance(interval, np.tile(gait.commands[k % len(gait.commands)], (n_robots, 1)))
        status, angle = np.maximum(status, report.status), np.fmin(angle, report.smallest_opening_angle)
        iterations, energy = iterations + report.newton_iterations, energy + report.energy
        work, moment = work + report.work, np.maximum(moment, report.peak_moment)
    way = (simulator.hub_position() - hub) @ [1.0, 1.0j] * np.exp(-1j * heading)
    speed = np.abs(way) / (measured * interval)
    return {
        **ways(scene, speed, way, simulator.heading() - heading), "energy": energy, "work": work, "peak_moment": moment,
        "smallest_opening_angle": angle, "newton_iterations": iterations, "status": status,
    }  # fmt: skip


def steer(scene: Scene, frame: Scene, controller: Controller, n_robots: int, device: str) -> dict[str, NDArray[Any]]:
    """Columns of results of robots side by side that a controller steers, up to the last waypoint or the time limit.

    frame: Scene that the controller knows.
    """
    n_limbs, policy, waypoints = scene.robot.n_limbs, controller.policy(frame), np.array(controller.waypoints)
    actions = actions_of(policy, n_limbs)
    require_fit(policy, scene, actions, controller.decision_period)
    options = SwimOptions(actions, scene=scene, decision_period=controller.decision_period, device=device)
    robots = Robots(AlongPath(waypoints, waypoint_radius=WAYPOINT_RADIUS), options, n_robots, 1, effort=True)
    headings: list[Floats] = []
    swum = rollout(
        ManyRobotsEnv(robots), policy, seeds=0, until=controller.decisions, record=OF_EPISODES,
        on_step=lambda info: headings.append(robots.heading()),
    )  # fmt: skip
    begin, end = headings[0], np.array(headings)[swum.decisions, np.arange(n_robots)]
    reached, time = swum.last("waypoint_index"), swum.last("time")
    lengths = np.cumsum([0.0, *np.hypot(*np.diff(waypoints, axis=0, prepend=0.0).T)])
    way = swum.last("hub_position") @ [1.0, 1.0j] * np.exp(-1j * begin)
    return {
        **ways(scene, lengths[reached] / time, way, end - begin),
        "energy": swum.total("energy"), "work": swum.total("work"),
        "peak_moment": swum.of("peak_moment", 0.0).max(axis=0),
        "smallest_opening_angle": np.fmin.reduce(swum.of("smallest_opening_angle"), axis=0),
        "newton_iterations": swum.total("newton_iterations"),
        "time": np.where(reached == len(waypoints), time, np.nan), "waypoints": reached.astype(np.float64),
        "status": swum.last("solver_status").astype(np.float64),
    }  # fmt: skip


def ways(scene: Scene, speed: Floats, way: NDArray[np.complex128], turn: Floats) -> dict[str, Floats]:
    """Columns of where robots swam. way: Of the hub, in the body frame of the beginning [m]. turn: On it [rad]."""
    with np.errstate(divide="ignore"):
        strokes = 1.0 / (speed * scene.actuator.period)
    return {
        "speed": speed, "strokes_per_metre": strokes, "ahead": way.real, "aside": way.imag,
        "turn": turn - 2.0 * np.pi * np.rint(turn / (2.0 * np.pi)),
    }  # fmt: skip


def result_file_of(batch: Batch, device: str = "cpu") -> bytes:
    """Parquet file of a batch's results. device: Where robots swim, see `Simulator`; the results are the same."""
    columns = {**dict(batch.configuration.labels), **batch.numbers, **swim(batch, device)}
    arrays = [pa.array([column] * batch.n_robots if name in dict(batch.configuration.labels) else column)
              for name, column in columns.items()]  # fmt: skip
    schema = pa.schema(
        [_field(name, array, batch.configuration.scene) for name, array in zip(columns, arrays, strict=True)],
        {"seastar_gym": batch.configuration.text, "cell": batch.name},
    )
    sink = pa.BufferOutputStream()
    table = pa.Table.from_arrays(arrays, schema=schema)
    pa.parquet.write_table(table, sink, compression="zstd", write_page_checksum=True)
    return sink.getvalue().to_pybytes()


def _field(name: str, array: Any, scene: Scene) -> Any:
    unit = (UNITS | OF_CONTROLLERS).get(name) or unit_of(scene, name)
    return pa.field(name, array.type, metadata={"unit": unit} if unit else None)


def read_result_file(file: Path) -> Any:
    """Table of a part. ValueError, with one sentence, if it is damaged."""
    try:
        with pa.parquet.ParquetFile(file, page_checksum_verification=True) as part:
            table = part.read()
    except (OSError, pa.ArrowException) as damaged:
        raise ValueError(f"{file} is damaged: {str(damaged).splitlines()[0].rstrip('.')}.") from damaged
    if (table.schema.metadata or {}).get(b"cell") != file.stem.encode():
        raise ValueError(f"{file} is damaged: it has another batch.")
    return table


class ResultFiles:
    """Folder of a sweep's parts. It may hold those of several sweeps, and several may write into it at once."""

    def __init__(self, folder: str | os.PathLike[str]):
        self.folder = Path(folder) / "parts"

    def file(self, name: str) -> Path:
        """File of the batch of this name. ValueError where it would be written through a link."""
        return within(self.folder.parent, self.folder.name, name[:2]) / f"{name}.parquet"

    def has(self, name: str) -> bool:
        """Whether the batch of this name is finished: its part is there and sound."""
        try:
            read_result_file(self.file(name))
        except ValueError:
            return False
        return True

    def write(self, name: str, part: bytes) -> None:
        """Write a part: whoever looks finds all of it or nothing."""
        write_atomically(self.file(name), part)

    def names(self) -> Iterator[str]:
        """Names of the batches that have parts."""
        for place in sorted(self.folder.glob("??/*.parquet")):
            yield place.stem


def read_results(folder: str | os.PathLike[str]) -> Any:
    """All results of a folder as one pyarrow.Table, in the order of the batches' names.

    Parts that are damaged are left out with a warning: the same sweep simulates their batches again.
    """
    tables = list(_tables(folder))  # which differ in their columns, and in whether labels are texts
    texts = {field.name for table in tables for field in table.schema if pa.types.is_string(field.type)}
    tables = [
        table.cast(pa.schema(
            [field.with_type(pa.string()) if field.name in texts else field for field in table.schema],
            table.schema.metadata,
        ))
        for table in tables
    ]  # fmt: skip
    return pa.concat_tables(tables, promote_options="permissive")


def _tables(folder: str | os.PathLike[str], batches: Container[str] | None = None) -> Iterator[Any]:
    """Tables of all parts, or those of batches of these names, that are not damaged, see `read_results`. ValueError if
    there is none."""
    require_file("folder", folder)
    files, found = sorted(ResultFiles(folder).folder.glob("??/*.parquet")), 0
    files = [file for file in files if batches is None or file.stem in batches]
    for file in files:
        try:
            yield read_result_file(file)
            found += 1
        except ValueError as damaged:
            warnings.warn(f"{damaged} It is left out: the same sweep simulates its batch again.", stacklevel=3)
    if not found:
        raise ValueError(f"There are no results in {folder}.")


class Best(NamedTuple):
    """The best design of a sweep. value: Of its objective. design: Values of the axes by name. scene: With them."""

    value: float
    design: dict[str, Any]
    scene: Scene


class Judged(NamedTuple):
    """What came of a sweep. best: None if there is none. without: Numbers of designs without result, by status."""

    best: Best | None
    without: dict[int, int]


def best_result(folder: str | os.PathLike[str], objective: str = "speed", is_largest_best: bool = True) -> Best | None:
    """Best of all results of a folder that have the objective, a column; None if there is none.

    Robots whose limbs crossed do not count, nor those without speed, such as of a controller that reached no waypoint.
    """
    return judged(folder, objective, is_largest_best).best


COUNTING = "smallest_opening_angle", "speed"
"""Columns by which designs count: robots whose limbs crossed do not, nor those without speed."""


def worth(table: Any, objective: str, sign: float) -> Floats:
    """Objective of every design of a table, times the sign; minus infinity of those that do not count."""
    angle, speed = (table[name].to_numpy() for name in COUNTING)
    values = sign * table[objective].to_numpy().astype(float)
    return np.where((angle >= 0.0) & (speed > 0.0) & ~np.isnan(values), values, -np.inf)


def judged(
    folder: str | os.PathLike[str], objective: str, is_largest_best: bool, batches: Container[str] | None = None
) -> Judged:
    """Best result, see `best_result`, and what has none. batches: Names of those that count; None means all."""
    require_kind("objective", objective, str, "the name of a column")
    require_flag("is_largest_best", is_largest_best)
    without = Counter[int]()
    best, sign = None, 1.0 if is_largest_best else -1.0
    for table in _tables(folder, batches):
        without.update(table["status"].to_numpy().astype(int).tolist())
        if objective not in table.column_names:
            continue
        values = worth(table, objective, sign)
        row = int(values.argmax())
        if values[row] > (-np.inf if best is None else sign * best.value):
            told = json.loads(table.schema.metadata[b"seastar_gym"])
            scene = Scene.from_dict(told["scene"])
            labels = dict(told["labels"])
            numbers = {name: table[name][row].as_py() for name in numbers_of(scene)
                       if name in table.column_names and name not in labels}  # fmt: skip
            best = Best(sign * float(values[row]), labels | numbers, with_numbers(scene, numbers))
    return Judged(best, {status: n for status, n in sorted(without.items()) if status != SolverStatus.CONVERGED})


AT_ONCE = 1000
"""Batches that an executor has at a time, unless somebody says it."""
ATTEMPTS = 3
"""How often a batch is tried whose worker is lost."""
MOST_LOST = 1000
"""Batches that wait for another attempt at most. With more, something is wrong with all of them."""
IN_A_ROW = 10
"""Parts in a row that the disk refuses at most, and batches in a row of a search without result. With more, the next
ones would be lost, too."""


@dataclass
class Progress:
    """Counts of a run.

    kept: Batches that had parts before. damaged: Parts that were damaged before, whose batches are run again.
    done: Batches and, in them, designs and their strokes that were run.
    losses: Attempts that failed. problems: Why batches have no part after all attempts, by the name of the batch.
    """

    kept: int = 0
    damaged: list[Path] = field(default_factory=list)
    done: int = 0
    designs: int = 0
    strokes: int = 0
    losses: int = 0
    problems: dict[str, str] = field(default_factory=dict)

    def count(self, batch: Batch) -> None:
        """Count a finished batch."""
        self.done += 1
        self.designs += batch.n_robots
        self.strokes += batch.n_robots * batch.configuration.strokes


OnProgress = Callable[[Progress], None]
"""Called after every batch."""


def run(
    batches: Iterable[Batch], folder: str | os.PathLike[str], executor: Executor | None = None,
    progress: OnProgress | None = None, work: Work = result_file_of, at_once: int = AT_ONCE,
) -> Progress:  # fmt: skip
    """Run the batches that have no part in the folder; those that were lost again at the end.

    An interrupt, such as Ctrl-C, leaves the parts of all finished batches. A part that the disk refuses costs its
    batch, which is lost; OSError if the disk refuses IN_A_ROW in a row.

    executor: Any of `concurrent.futures`; None runs batches in this process, one after the other. A lost worker costs
        its batch alone, but where its executor is broken then, as ProcessPoolExecutor is: the same run goes on with
        another. work: What makes a part of a batch. at_once: Batches that the executor has at a time at most.
    """
    require_file("folder", folder)
    require_count("at_once", at_once, 1, 1_000_000)
    if executor is not None:
        require_kind("executor", executor, Executor, "an executor of concurrent.futures, such as Processes()")
    if progress is not None:
        require_callable("progress", progress)
    require_writable(folder)
    parts, tally = ResultFiles(folder), Progress()
    waiting, lost = unfinished(batches, parts, tally), list[Done]()
    for _ in range(ATTEMPTS):
        lost = _attempt(outcomes(executor, work, waiting, at_once), parts, tally, progress)
        if not lost:
            return tally
        waiting = iter([outcome.task for outcome in lost])
    tally.problems = {outcome.task.name: outcome.problem for outcome in lost}
    return tally


def unfinished(batches: Iterable[Batch], parts: ResultFiles, tally: Progress) -> Iterator[Batch]:
    """Batches without a sound part; others are counted."""
    try:
        each = iter(batches)
    except TypeError:
        raise ValueError(f"batches must be batches, as Sweep.batches gives them, not {shown(batches)}.") from None
    for batch in each:
        require_kind("A batch", batch, Batch, "a Batch, as Sweep.batches gives it")
        if parts.has(batch.name):
            tally.kept += 1
            continue
        if parts.file(batch.name).exists():
            tally.damaged.append(parts.file(batch.name))
        yield batch


def _attempt(found: Iterator[Done], parts: ResultFiles, tally: Progress, progress: OnProgress | None) -> list[Done]:
    """Write the parts of outcomes; returns those without."""
    lost = list[Done]()
    refused = 0
    for outcome in found:
        try:
            if outcome.part is not None:
                parts.write(outcome.task.name, outcome.part)
                refused = 0
        except OSError as failure:
            refused += 1
            if refused == IN_A_ROW:
                raise
            outcome = Outcome(outcome.task, None, refused_by_disk(failure))
        _count(outcome, lost, tally)
        if progress is not None:
            progress(tally)
    return lost


def _count(outcome: Done, lost: list[Done], tally: Progress) -> None:
    """Count an outcome. ValueError if too many are lost."""
    if outcome.part is not None:
        tally.count(outcome.task)
        return
    lost.append(outcome)
    tally.losses += 1
    if len(lost) > MOST_LOST:
        raise ValueError(f"More than {MOST_LOST} batches failed, the last one so: {outcome.problem}")


Floats = NDArray[np.float64]
