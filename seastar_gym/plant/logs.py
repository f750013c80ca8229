"""Logs of a plant: sightings by the times at which pictures were taken, and commands, as `seastar identify` reads them.

    tracking.csv   time since the first decision [s], places of hub and markers [m], orientation of a body [rad], in the
                   frame in which the robot lay before it: the hub at the origin, limb 1 along +x
    commands.csv   time of every decision since the first one [s], and its commands, limb by limb
    poses.csv      time of the picture, time at which it was known [s], x, y [m], heading [rad]: in the tank
"""  # fmt: skip

import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from seastar_gym.command import refused_by_disk
from seastar_gym.envs.layout import N_STATIONS
from seastar_gym.envs.sight import stations_seen
from seastar_gym.files import LineFile
from seastar_gym.plant.plant import PlantError, Sighting
from seastar_gym.scene import Seastar


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
            for name in ("tracking", "commands", "poses"):
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
