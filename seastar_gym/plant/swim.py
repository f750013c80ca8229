"""`PlantSwim`: the environment in which policies drive a plant.

Logs of a plant: sightings by the times at which pictures were taken, and commands, as `seastar identify` reads them.

    tracking.csv   time since the first decision [s], places of hub and markers [m], orientation of a body [rad], in the
                   frame in which the robot lay before it: the hub at the origin, limb 1 along +x
    commands.csv   time of every decision since the first one [s], and its commands, limb by limb
    poses.csv      time of the picture, time at which it was known [s], x, y [m], heading [rad]: in the tank
"""

from __future__ import annotations

import math
from collections.abc import Generator, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.command import refused_by_disk
from seastar_gym.envs.attributes import arguments_of
from seastar_gym.envs.delays import Lag, Pictures, Tracker
from seastar_gym.envs.layout import N_STATIONS
from seastar_gym.envs.observation import lengths_of
from seastar_gym.envs.options import SwimOptions
from seastar_gym.envs.robots import Flags, Floats, Robots
from seastar_gym.envs.seastar_swim import Observation, OneRobotEnv, RenderMode
from seastar_gym.envs.sight import Sight, bounds_of, stations_seen
from seastar_gym.envs.waypoints import AlongPath
from seastar_gym.files import LineFile
from seastar_gym.plant.guard import NOISES, ROUNDING, Guard, Heat, Limits
from seastar_gym.plant.plant import Plant, PlantError, Sighting
from seastar_gym.scene import Scene, Seastar
from seastar_gym.scene.actuators.wires import ThermalSma
from seastar_gym.scene.checks import require_file, require_kind, shown
from seastar_gym.simulator import StrokeReport
from seastar_gym.simulator.simulator import pausing

LOGS = ("tracking", "commands", "poses")
"""Names of the logs, without .csv."""


class Logs:
    """Files of a swim in a folder, written line by line, so that what was measured is there whatever happens.

    folder: Where the files go, which are written anew; links are replaced. robot: Whose nodes are seen. n_markers: Of a
    limb. PlantError: the disk refuses.
    """

    def __init__(self, folder: Path, robot: Seastar, n_markers: int):
        self._nodes, self._has_body = nodes_of(robot, n_markers), robot.has_body
        self._origin, self._begun = (0.0, 0.0, 0.0), math.inf
        self._at_rest: list[tuple[float, float, float]] = []
        self._files: dict[str, LineFile] = {}
        with self._told_in_a_sentence():
            folder.mkdir(parents=True, exist_ok=True)
            for name in LOGS:
                self._files[name] = LineFile(folder / f"{name}.csv")
        places = [f"{axis}{node}" for node in [0, *self._nodes.values()] for axis in "xy"]
        self._write("tracking", ["time", *places, *(["theta"] if self._has_body else [])])
        self._write("commands", ["time", *(f"limb{limb + 1}" for limb in range(robot.n_limbs))])
        self._write("poses", ["captured_at", "seen_at", "x", "y", "heading"])

    def begin(self, seen: Sighting, time: float) -> None:
        """A robot that was seen so begins to swim at a time [s]; it lay at the mean of the sightings before."""
        poses = np.array(self._at_rest or [seen.pose])
        poses[:, 2] = np.unwrap(poses[:, 2])
        x, y, heading = poses.mean(axis=0).tolist()
        self._origin, self._begun = (x, y, heading), time

    def sighting(self, seen: Sighting) -> None:
        """Write a sighting."""
        self._write("poses", [f"{number:.6f}" for number in (seen.captured_at, seen.seen_at, *seen.pose)])
        if seen.captured_at < self._begun:
            self._at_rest.append(seen.pose)
            return
        markers = np.zeros((0, 2)) if seen.markers is None else seen.markers.reshape(-1, 2)[list(self._nodes)]
        places = self._as_begun(np.concatenate([[seen.pose[:2]], markers]))
        turn = math.remainder(seen.pose[2] - self._origin[2], math.tau)
        numbers = [seen.captured_at - self._begun, *places.ravel().tolist(), *([turn] if self._has_body else [])]
        self._write("tracking", ["" if math.isnan(number) else f"{number:.6f}" for number in numbers])

    def _as_begun(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Places [m], shape (n, 2), in the frame in which the robot lay when it began."""
        x, y, heading = self._origin
        c, s = math.cos(heading), math.sin(heading)
        return (places - [x, y]) @ np.array([[c, -s], [s, c]])

    def decision(self, commands: NDArray[np.float64], time: float) -> None:
        """Write the commands of a decision, shape (n_limbs,), that is followed from a time on [s]."""
        self._write("commands", [f"{time - self._begun:.6f}", *(f"{command:g}" for command in commands.tolist())])

    def _write(self, name: str, fields: Iterable[str]) -> None:
        with self._told_in_a_sentence():
            self._files[name].add(fields)

    @contextmanager
    def _told_in_a_sentence(self) -> Iterator[None]:
        """Context in which the disk may refuse; the files are closed then."""
        try:
            yield
        except OSError as failure:
            self.close()
            raise PlantError(refused_by_disk(failure)) from None

    def close(self) -> None:
        """Close the files; may be called again."""
        for file in self._files.values():
            file.close()


def nodes_of(robot: Seastar, n_markers: int) -> dict[int, int]:
    """Nodes at which markers stand, by the numbers of the markers, limb after limb; markers between nodes are left out.

    n_markers: Of a limb, 0 to 9, evenly spaced.
    """
    if n_markers == 0:
        return {}
    n_edges, found = robot.nodes_per_limb - 1, {}
    for limb in range(robot.n_limbs):
        for k, station in enumerate(stations_seen(n_markers)):
            node, between = divmod(int(station + 1) * n_edges, N_STATIONS)
            if not between:
                found[limb * n_markers + k] = limb * n_edges + node
    return found


REST = 0.5
"""Time for which a robot is watched at rest before it is driven and logged [s]: the noise of a single picture would
otherwise be an error of all places in its logs."""


def limits_for(limits: Limits, sight: Sight) -> Limits:
    """Limits that do not drop what a camera with these errors sees of a robot that lies still."""
    blur, turn_blur = (NOISES * bounds_of(value)[1] for value in (sight.noise, sight.turn_noise))
    return replace(limits, blur=max(limits.blur, blur), turn_blur=max(limits.turn_blur, turn_blur))


def require_limbs(plant: Plant, scene: Scene) -> None:
    """ValueError where a plant has not as many limbs as the robot of a scene."""
    if plant.n_limbs != (n_limbs := scene.robot.n_limbs):
        raise ValueError(f"The plant has {plant.n_limbs} limbs, the scene's robot {n_limbs}.")


class PlantRobot(Robots):
    """Robot in a tank. Its simulator swims along, and is put where the robot was seen after every decision.

    plant: What is driven. limits: Of its guard. logs: Folder of logs; None: none.
    """

    def __init__(self, plant: Plant, limits: Limits, task: AlongPath, options: SwimOptions, logs: Path | None):
        sight = Sight() if options.sight is None else options.sight
        if sight.sees == "nodes":
            raise ValueError('A tracker sees no nodes: use Sight(sees="pose"), or markers.')
        if options.action_delay != 0.0 or options.randomization is not None or task.random_heading:
            raise ValueError("A plant is late and at random by itself: leave action_delay, randomization and headings.")
        super().__init__(task, replace(options, sight=Sight(sees=sight.sees)), 1, 1)
        self.per_episode = ("path", "reward", "waypoint_radius")
        self.pulse = getattr(self.scene.actuator, "heating_time", math.nan)
        if not self.pulse <= limits.longest_pulse:
            raise ValueError(
                f"A full command heats a wire for {self.pulse:g} s, the guard allows {limits.longest_pulse:g} s: use "
                "an actuator with a shorter heating_time, such as SmaWires(heating_time=0.08), or, in Python, other "
                "Limits."
            )
        require_limbs(plant, self.scene)
        self.can_be_masked = True
        if limits.wire is None and isinstance(self.scene.actuator, ThermalSma):
            limits = replace(limits, wire=self.scene.actuator)
        if (reached := Heat(1, limits).from_cold(self.pulse)) > limits.hottest:
            raise ValueError(
                f"A full command heats a cold wire to {reached:.0f} deg C, the guard allows {limits.hottest:g} deg C: "
                "use an actuator with a shorter heating_time, or, in Python, other Limits."
            )
        span = float(np.linalg.norm(self.simulator.positions[0] - self.simulator.hub_position()[0], axis=-1).max())
        self.guard = Guard(plant, limits_for(limits, sight), self.pulse, span)
        self._folder = logs
        self.logs: Logs | None = None
        self.stopped = ""
        self._late, self.latest = 0.0, 0.0  # the last decision, and the latest but for the first [s]
        self._begun = 0.0  # time of the plant's clock that is time 0 of the episode [s]
        self._origin = Sighting(0.0, 0.0, (0.0, 0.0, 0.0))
        self._noted = -math.inf  # when the last picture that is known was taken [s]

    def reset(self, robots: Flags, generators: list[np.random.Generator], asked: Any = None) -> None:
        """Begin an episode where the robot lies. PlantError: it is not seen."""
        self.stopped, self._late, self.latest, self._noted = "", 0.0, 0.0, -math.inf
        with self.stopped_if_interrupted():
            self._open_logs()
        seen = self._origin = self._watched(self.guard.begin())
        super().reset(robots, generators, asked)
        self.simulator.reset(heading=seen.pose[2])
        self._begun = self.guard.now()
        self._note(seen)
        self._known_pictures.restart(self._picture(seen))
        self.task.begin(self, robots)

    def _watched(self, seen: Sighting) -> Sighting:
        """The last sighting of a robot that was seen so, after a while in which it rests and is logged, if it is."""
        if self.logs is None:
            return seen
        until = self.guard.now() + REST
        while until - (now := self.guard.now()) > ROUNDING:
            self.guard.wait_until(min(now + self.scene.numerics.step, until))
            newest = self.guard.newest
            if newest is not None and newest.captured_at > seen.captured_at:
                self.logs.sighting(seen)
                seen = newest
        return seen

    def _open_logs(self) -> None:
        """Begin the logs of an episode, which take the place of those of the last one."""
        self.close_logs()
        if self._folder is not None:
            n_markers = len(self._known_pictures.columns) // (2 * self.scene.robot.n_limbs)
            self.logs = Logs(self._folder, self.scene.robot, n_markers)

    def close_logs(self) -> None:
        """Close the logs, if there are any."""
        if self.logs is not None:
            self.logs.close()
            self.logs = None

    @property
    def _known_pictures(self) -> Tracker:
        assert self.tracker is not None
        return self.tracker

    def _picture(self, seen: Sighting) -> Pictures:
        """Sighting on the episode's clock, which is known at once."""
        return Pictures(self._row(seen)[None], np.array([seen.captured_at - self._begun]))

    def _row(self, seen: Sighting) -> Floats:
        """Sighting as a picture, see delays.py: relative to where the robot began."""
        (x, y, heading), (x_0, y_0, _) = seen.pose, self._origin.pose
        c, s = math.cos(heading), math.sin(heading)
        n_places = len(self._known_pictures.columns)
        if not n_places:
            return np.array([x - x_0, y - y_0, c, s])
        if seen.markers is None or seen.markers.size != n_places:
            n_seen = 0 if seen.markers is None else seen.markers.size // 2
            raise self.guard.refuse(f"The tracker sees {n_seen} markers, not {n_places // 2}: all wires are stopped.")
        away = (seen.markers.reshape(-1, 2) - [x, y]) @ np.array([[c, -s], [s, c]]) / lengths_of(self.simulator)[0]
        return np.array([x - x_0, y - y_0, c, s, *away.ravel()])

    def _note(self, seen: Sighting) -> None:
        """Know a sighting, and write it down."""
        if seen.captured_at == self._noted:
            return
        self._noted = seen.captured_at
        self._known_pictures.keep(np.ones(1, bool), self._picture(seen), np.zeros(1))
        if self.logs is not None:
            self.logs.sighting(seen)

    def refractory_wires(self) -> Flags:
        """Wires that have to rest, shape (1, n_limbs, 2)."""
        return self.guard.resting()[None]

    def swim_late(self, lag: Lag, commands: Floats, ends: list[float]) -> Generator[float, None, StrokeReport]:
        """One decision, on the plant's clock; yields the time since it began [s] after about every time step."""
        n_steps = math.ceil(self.decision_period / self.scene.numerics.step)
        steps = self.simulator.advance_in_parts(self.decision_period, commands, n_steps)
        with self.stopped_if_interrupted():
            self._attempt(lambda: self._begin_decision(commands[0]))
            planned = self._begun + float(self.simulator.time[0])

            def attend(since: float) -> float:
                self._attempt(lambda: self._attend(planned + since))
                return since

            report = yield from pausing(steps, attend)
        self._known_pictures.look(self.simulator.time)
        self._put_where_seen()
        return report

    @contextmanager
    def stopped_if_interrupted(self) -> Iterator[None]:
        """Context that stops all wires, whatever ends it but its end."""
        try:
            yield
        except BaseException:  # a fault of the policy's or an interrupt: wires are cold all the same
            self.guard.plant.stop()
            raise

    def _attempt(self, work: Any) -> None:
        """Do something to the plant, unless it was stopped; what stops it is told in info."""
        if self.stopped:
            return
        try:
            work()
        except PlantError as why:
            self.guard.refuse(str(why))
            self.stopped = str(why)

    def _begin_decision(self, commands: Floats) -> None:
        """Heat wires, now; where that is late, the episode's clock waits."""
        planned = self._begun + float(self.simulator.time[0])
        self.guard.look()
        now = self.guard.now()
        self._late = now - planned
        if self.simulator.time[0] > 0.0:
            self.latest = max(self.latest, self._late)
        if self.simulator.time[0] == 0.0 and self.logs is not None:
            self.logs.begin(self._origin, now)
        if self._late > 0.0:
            self._begun += self._late
            self._known_pictures.wait(self._late)
        for share in np.unique(np.abs(commands[commands != 0.0])).tolist():
            limbs = np.where(np.abs(commands) == share, np.sign(commands), 0.0).astype(int)
            self.guard.heat(limbs.tolist(), share * self.pulse)
        if self.logs is not None:
            self.logs.decision(commands, now)

    def _attend(self, until: float) -> None:
        """Wait until a time of the plant's clock [s], and note what is seen."""
        self.guard.wait_until(until)
        if self.guard.newest is not None:
            self._note(self.guard.newest)

    def _put_where_seen(self) -> None:
        """Put the simulated robot where the real one was seen last, with the limbs that it has."""
        state, hub = self.simulator.get_state(), self.simulator.hub_position()
        turn = self.seen_heading() - self.heading()
        c, s = np.cos(turn[0]), np.sin(turn[0])
        turned = np.array([[c, s], [-s, c]])
        orientation = None if state.orientation is None else state.orientation + turn
        self.simulator.set_state(
            state._replace(
                positions=(state.positions - hub[:, None]) @ turned + self.seen_hub()[:, None],
                velocities=state.velocities @ turned,
                orientation=orientation,
            )
        )

    def facts(self, hub: Floats | None = None) -> dict[str, NDArray[Any]]:
        """What is known of the robot now, and what `PlantSwim` adds to `info`."""
        late, message = np.array([self._late]), np.array([self.stopped], dtype=object)
        dropped = np.array([self.guard.plausibility.n_dropped])
        return {**super().facts(hub), "late": late, "dropped_pictures": dropped, "plant_message": message}


class PlantSwim(OneRobotEnv):
    """Environment of a robot in a tank, for policies that were trained with the same `sight`.

    Actions, observations, rewards and `info` are those of `SeastarSwimEnv` with that `sight`; the origin is where the
    hub was seen when the episode began, the axes are those of the tank. Places in rewards and in `info` are those
    that were seen last. Decisions come on the plant's clock: a step returns when the next decision is due.

    `info` has `late`, how late the last decision was [s], for which the episode's clock waits, `dropped_pictures`, how
    many pictures of the episode were dropped because no robot can be there, and `plant_message`. The guard ends an
    episode with `truncated` and a sentence in `plant_message`: then all wires are stopped. Wires that have to rest are
    masked, as refractory ones are.

    ## Arguments besides those of `SeastarSwimEnv`
    plant: What is driven, see `seastar_gym.plant.plant`.
    limits: Of the guard, a `Limits`.
    logs: Folder of tracking.csv, commands.csv and poses.csv of the last episode, see `seastar_gym.plant.swim`; None:
        none.
    """

    def __init__(
        self,
        plant: Plant,
        limits: Limits | None = None,
        logs: Path | str | None = None,
        render_mode: RenderMode | None = None,
        frames_per_stroke: int | None = None,
        **options: Any,
    ):
        if not hasattr(plant, "sight"):
            raise ValueError(f"plant must be a Plant, not {shown(plant)}.")
        limits = Limits() if limits is None else limits
        require_kind("limits", limits, Limits, "Limits")
        if logs is not None:
            require_file("logs", logs)
        folder = None if logs is None else Path(logs)
        self.plant, self.limits, self.logs = plant, limits, logs
        own = {name: options.pop(name) for name in arguments_of(AlongPath) & {*options}}
        self._driven = PlantRobot(plant, limits, AlongPath(**own), SwimOptions(**options), folder)
        super().__init__(self._driven, render_mode, frames_per_stroke)

    _arguments = arguments_of(__init__) | arguments_of(AlongPath) | arguments_of(SwimOptions)

    @property
    def stopped(self) -> str:
        """Why the guard stopped the plant, in a sentence; empty if it did not."""
        return self._driven.stopped

    @property
    def latest(self) -> float:
        """How late the latest decision of the episode was, but for the first [s]."""
        return self._driven.latest

    @property
    def dropped_pictures(self) -> int:
        """Number of pictures of the episode that were dropped, because no robot can be there."""
        return self._driven.guard.plausibility.n_dropped

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Swim for one decision; returns observation, reward, terminated, truncated and info."""
        with self._driven.stopped_if_interrupted():
            observation, reward, terminated, _, info = super().step(action)
        truncated = bool(info["plant_message"])
        self._batch.needs_reset[:] |= truncated
        return observation, reward, terminated, truncated, info

    def close(self) -> None:
        """Stop the plant, and close its logs and the window. A step needs a reset again."""
        self._batch.needs_reset[:] = True
        try:
            self._driven.guard.plant.stop()
        finally:
            self._driven.close_logs()
            super().close()
