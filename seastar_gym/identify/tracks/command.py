"""Makes a trajectory that `seastar identify` reads from the file of a tracker.

Formats are pose (CSV with the columns time,x,y,theta, as of AprilTags), deeplabcut (CSV), sleap (analysis CSV or HDF5)
and motive (CSV of OptiTrack). Pixels become metres by --metres-per-pixel, for a camera that looks straight down, or
--homography, a CSV file with the pixel and the place u,v,x,y of four points or more.

The trajectory is moved and turned to where the robot begins: its hub at the origin, limb 1 along +x. Pictures in which
something was not seen have empty fields.
"""

import argparse
import re
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from seastar_gym.command import DEFAULT, answered, command_parser
from seastar_gym.identify.measurement import Measurement, write_trajectory
from seastar_gym.identify.tracks.deeplabcut import LIKELIHOOD, read_deeplabcut
from seastar_gym.identify.tracks.motive import read_motive
from seastar_gym.identify.tracks.plane import in_metres, read_homography, scaled
from seastar_gym.identify.tracks.pose import read_pose
from seastar_gym.identify.tracks.sleap import read_sleap
from seastar_gym.identify.tracks.track import Track, from_rest, misfit, seen_nodes
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import require_number
from seastar_gym.scene.scene_file import load_scene

Options = argparse.Namespace
READERS: dict[str, Callable[[Options], Track]] = {
    "pose": lambda options: read_pose(options.file),
    "deeplabcut": lambda options: read_deeplabcut(options.file, _rate(options), options.individual, options.likelihood),
    "sleap": lambda options: read_sleap(options.file, _rate(options), options.individual),
    "motive": lambda options: read_motive(options.file, options.up),
}
"""Readers by the names of their formats."""
IN_PIXELS = ("deeplabcut", "sleap")
"""Formats whose files are in pixels."""
ASSIGNED = re.compile(r"(.+)=(hub|tip([1-9][0-9]{0,2})|[0-9]{1,5})")
"""A point and its node: the hub, the tip of a limb, or a number."""


def parser() -> argparse.ArgumentParser:
    """Parser of the options."""
    found = command_parser("seastar track2csv", __doc__)
    found.add_argument("file", type=Path, help="file of the tracker")
    found.add_argument("--from", dest="format", choices=READERS, required=True, help="format of the file")
    found.add_argument("--out", type=Path, required=True, help="CSV file for the trajectory")
    nodes = "points that are kept and their nodes: hub, tip1, tip2, .. or a number (default: the only one is the hub)"
    found.add_argument("--nodes", nargs="+", metavar="POINT=NODE", help=nodes)
    found.add_argument("--scene", type=Path, help="file of the robot's scene, .py or .json (default: the chapter's)")
    found.add_argument("--rate", type=float, help="pictures per second, of deeplabcut and sleap [Hz]")
    found.add_argument("--metres-per-pixel", type=float, help="size of a pixel; y of pictures points down")
    found.add_argument("--homography", type=Path, help="CSV file with u,v,x,y of four points or more")
    found.add_argument("--individual", help="one of several animals of deeplabcut or tracks of sleap")
    sure = f"points of deeplabcut below this likelihood were not seen {DEFAULT}"
    found.add_argument("--likelihood", type=float, default=LIKELIHOOD, help=sure)
    found.add_argument("--up", choices=("y", "z"), default="y", help=f"axis of motive that points up {DEFAULT}")
    rest = f"time for which the robot is at rest at the beginning [s]; 0 is the first picture {DEFAULT}"
    found.add_argument("--rest", type=float, default=0.0, help=rest)
    found.add_argument("--aligned", action="store_true", help="the robot begins at the origin, limb 1 along +x")
    return found


def _rate(options: Options) -> float:
    """Pictures per second [Hz]."""
    if options.rate is None:
        raise ValueError(f"Files of {options.format} have no times: give --rate, pictures per second.")
    return float(options.rate)


def metres(track: Track, options: Options) -> Track:
    """Track in metres, by the options."""
    if options.metres_per_pixel is not None and options.homography is not None:
        raise ValueError("--metres-per-pixel or --homography, not both.")
    if options.metres_per_pixel is not None:
        return in_metres(track, scaled(options.metres_per_pixel))
    if options.homography is not None:
        return in_metres(track, read_homography(options.homography))
    if options.format in IN_PIXELS:
        raise ValueError(f"Files of {options.format} are in pixels: give --metres-per-pixel or --homography.")
    return track


def assigned(texts: Sequence[str] | None, track: Track, scene: Scene) -> dict[str, int]:
    """Nodes of points, of texts such as "nose=hub"."""
    if texts is None:
        if len(track.points) != 1:
            raise ValueError(f"Say which points are which nodes, with --nodes: there are {', '.join(track.points)}.")
        return dict.fromkeys(track.points, 0)
    robot, found = scene.robot, {}
    for text in texts:
        match = ASSIGNED.fullmatch(text)
        if match is None:
            raise ValueError(f"--nodes must be such as nose=hub, left=tip1 or left=11, not {text}.")
        point, word, tip = match.groups()
        node = int(tip) * (robot.nodes_per_limb - 1) if tip else 0 if word == "hub" else int(word)
        if node >= robot.n_nodes:
            raise ValueError(f"{text}: the robot has {robot.n_limbs} limbs and {robot.n_nodes} nodes.")
        found[point] = node
    return found


def convert(options: Options) -> str:
    """Write the trajectory; returns a sentence on it."""
    scene = load_scene(options.scene)
    require_number("--rest", options.rest, "s", zero_allowed=True)
    track = metres(READERS[options.format](options), options)
    told = ""
    seen = seen_nodes(track, assigned(options.nodes, track, scene))
    if not options.aligned:
        seen = from_rest(seen, track.time, options.rest, scene)
        off = misfit(seen, track.time, options.rest, scene)
        told = f" At rest they are within {1e3 * off:.2g} mm of the robot's shape."
    Measurement(track.time, *seen, np.zeros((1, scene.robot.n_limbs)))  # refuses what identify would
    write_trajectory(options.out, track.time, *seen)
    lost = np.isnan(seen.positions).any(axis=2).mean()
    n, lasted = len(track.time), np.ptp(track.time)
    return f"{options.out}: {n} pictures in {lasted:.4g} s, {100.0 * lost:.1f} % of their points not seen.{told}"


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; returns the exit code."""
    options = parser().parse_args(arguments)
    return answered(lambda: print(convert(options)))
