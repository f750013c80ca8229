"""Makes a trajectory that `seastar identify` reads from the file of a tracker.

Formats are table, any CSV file, whose columns are named, deeplabcut (CSV or HDF5), sleap (analysis CSV or HDF5) and
motive (CSV of OptiTrack).

A table has a line for every picture, with the columns time,x,y and theta unless options name others. A point has the
name of its column of x. Units are those in names, such as "x (mm)", unless options say so. Options of some files:

Kinovea: --time "Time (ms)" --x Hub/X Tip/X --y Hub/Y Tip/Y --nodes Hub/X=hub Tip/X=tip1

Vicon: --skip 2 --headers 3 --rate 100 --time Frame --x Star:Hub.X.mm --y Star:Hub.Y.mm

Tracker: --headers 2 --time mass_A.t --x mass_A.x --y mass_A.y

rostopic echo -p: --time %time --time-unit ns --begin first, x and y of field.pose.position, and --theta with the four
columns of the quaternion

idtracker.ai: --time seconds --x x1 x2 --y y1 y2 --unit px --metres-per-pixel 4e-4 --nodes x1=hub x2=tip1

TRex: --x "X#wcentroid (cm)" --y "Y#wcentroid (cm)" --theta ANGLE --y-down

several tags: --only id=7

a logger: --skip 1 --time Stamp --time-unit ms --degrees --begin 56911.836

Pixels become metres by --metres-per-pixel, for a camera that looks straight down, or --homography, a CSV file with the
pixel and the place u,v,x,y of four points or more.

The trajectory is moved and turned to where the robot begins: its hub at the origin, limb 1 along +x. Pictures in which
something was not seen have empty fields.
"""

import argparse
from collections.abc import Callable, Sequence
from inspect import signature
from itertools import chain
from pathlib import Path

import numpy as np

from seastar_gym.command import DEFAULT, command_parser, main_of
from seastar_gym.files import UNITS
from seastar_gym.identify.measurement import write_trajectory
from seastar_gym.identify.tracks.table import LENGTHS, read_motive, read_table
from seastar_gym.identify.tracks.track import Track
from seastar_gym.identify.tracks.videos import read_deeplabcut, read_sleap
from seastar_gym.scene.scene import load_scene

Options = argparse.Namespace


FORMATS: dict[str, Callable[..., Track]] = {
    "table": read_table, "deeplabcut": read_deeplabcut, "sleap": read_sleap, "motive": read_motive
}  # fmt: skip
"""Readers of formats by their names; the options of a format are its reader's arguments."""


def parser() -> argparse.ArgumentParser:
    """Parser of the options. Those of some formats only are None where they are not given."""
    found = command_parser("seastar track2csv", __doc__)
    found.add_argument("file", type=Path, help="file of the tracker")
    found.add_argument("--from", dest="format", choices=FORMATS, required=True, help="format of the file")
    found.add_argument("--out", type=Path, required=True, help="CSV file for the trajectory")
    nodes = "points that are kept and their nodes: hub, tip1, tip2, .. or a number (default: the only one is the hub)"
    found.add_argument("--nodes", nargs="+", action="extend", metavar="POINT=NODE", help=nodes)
    found.add_argument("--scene", type=Path, help="file of the robot's scene, .py or .json (default: the chapter's)")
    found.add_argument("--metres-per-pixel", type=float, help="size of a pixel; y of pictures points down")
    found.add_argument("--homography", type=Path, help="CSV file with u,v,x,y of four points or more")
    begin = "time of the file that becomes 0 [s], or first for that of the first picture; pictures before are left out"
    found.add_argument("--begin", metavar="TIME", help=begin)
    rest = f"time for which the robot is at rest at the beginning [s]; 0 is the first picture {DEFAULT}"
    found.add_argument("--rest", type=float, default=0.0, help=rest)
    found.add_argument("--aligned", action="store_true", help="the robot begins at the origin, limb 1 along +x")

    some = found.add_argument_group("options of some formats")
    some.add_argument("--rate", type=float, help="pictures per second, of files without times [Hz]")
    some.add_argument("--individual", help="one of several animals of deeplabcut or tracks of sleap")
    sure = "points of a lower likelihood or score were not seen (default: 0.6 for deeplabcut, 0.2 for sleap)"
    some.add_argument("--likelihood", type=float, help=sure)
    some.add_argument("--up", choices=("y", "z"), help="axis of motive that points up (default: y)")
    some.add_argument("--separator", help="character between fields, or tab (default: as in the first line)")
    some.add_argument("--decimal", choices=(".", ","), help="character before decimals (default: as in the file)")

    table = found.add_argument_group("options of tables, columns by their names")
    table.add_argument("--time", help="time, or with --rate the number of the picture (default: time)")
    table.add_argument("--time-unit", choices=UNITS["time"], help="(default: that of the name, or s)")
    table.add_argument("--x", nargs="+", action="extend", metavar="COLUMN", help="x of one point or more (default: x)")
    table.add_argument("--y", nargs="+", action="extend", metavar="COLUMN", help="y of as many (default: y)")
    table.add_argument("--unit", choices=LENGTHS, help="unit of x and y (default: that of the name, or m)")
    table.add_argument("--y-down", action="store_true", default=None, help="y points down, though not in pixels")
    theta = "orientation of the first point, or x y z w of its quaternion (default: theta, if there is one)"
    table.add_argument("--theta", nargs="+", action="extend", metavar="COLUMN", help=theta)
    table.add_argument("--degrees", action="store_true", default=None, help="theta is in degrees")
    table.add_argument(
        "--score", nargs="+", action="extend", metavar="COLUMN", help="scores of the points, for --likelihood"
    )
    table.add_argument(
        "--only", nargs="+", action="extend", metavar="COLUMN=TEXT", help="lines that count (default: all)"
    )
    table.add_argument("--skip", type=int, help="lines above the names (default: 0)")
    table.add_argument("--headers", type=int, help="lines of names, which are joined by points (default: 1)")
    return found


def pairs(option: str, texts: Sequence[str] | None) -> dict[str, str] | None:
    """What stands after the last = of texts, by what stands before."""
    for text in texts or ():
        if "=" not in text:
            raise ValueError(f"{option} must be such as {'nose=hub' if option == '--nodes' else 'id=3'}, not {text}.")
    return None if texts is None else dict(text.rsplit("=", 1) for text in texts)


def read(options: Options) -> Track:
    """Track of the file, as it is there."""
    taken = {name: list(signature(reader).parameters)[1:] for name, reader in FORMATS.items()}
    given = vars(options) | {"only": pairs("--only", options.only)}
    unused = [name for name in sorted({*chain(*taken.values())} - {*taken[options.format]}) if given[name] is not None]
    if unused:
        raise ValueError(f"Files of {options.format} have no use for --{unused[0].replace('_', '-')}.")
    if options.rate is None and options.format in ("deeplabcut", "sleap"):
        raise ValueError(f"Files of {options.format} have no times: give --rate, pictures per second.")
    asked = {name: given[name] for name in taken[options.format] if given[name] is not None}
    return FORMATS[options.format](options.file, **asked)


def begun(track: Track, options: Options) -> Track:
    """Track whose time 0 is what --begin says."""
    if options.begin is None:
        return track
    if options.begin == "first":
        return track.since(float(track.time[0]))
    try:
        begin = float(options.begin)
    except ValueError:
        raise ValueError(f"--begin must be a time of the file or the word first, not {options.begin}.") from None
    return track.since(begin)


def convert(options: Options) -> str:
    """Write the trajectory; returns a sentence on it."""
    scene = load_scene(options.scene)
    track = read(options)
    if options.metres_per_pixel is not None or options.homography is not None:
        track = track.in_metres(options.metres_per_pixel, options.homography)
    n_read, track = len(track.time), begun(track, options)
    seen = track.seen(scene, pairs("--nodes", options.nodes), options.rest, options.aligned)
    write_trajectory(options.out, track.time, seen.positions, seen.nodes)
    lost = np.isnan(seen.positions).any(axis=2).mean()
    n, lasted = len(track.time), np.ptp(track.time)
    told = f"{options.out}: {n} pictures in {lasted:.4g} s, {100.0 * lost:.1f} % of their points not seen."
    if not scene.robot.has_body and track.orientations:
        told += " The orientation, which is that of a body, is left out."
    if n < n_read:
        told += f" {n_read - n} pictures from before were left out."
    return told if options.aligned else f"{told} At rest they are within {1e3 * seen.off:.2g} mm of the robot's shape."


main = main_of(parser, convert)
