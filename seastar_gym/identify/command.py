"""Fits numbers of a scene to measured trajectories: `seastar identify --help`.

The trajectory is a CSV file with a line of names, `time,x0,y0,x9,y9,..`, and then one line for every time: the time [s]
and the coordinates [m] of any nodes. Node 0 is the hub, node j (N - 1) the tip of limb j. The robot begins at rest with
its hub at the origin and limb 1 along +x. Empty fields are nodes that were not seen. A last column `theta` is the
orientation of a body [rad]. `seastar track2csv` makes this file from those of trackers.

A second CSV file has one line for every stroke, with one command per limb. Strokes follow one another from time 0, or
begin when a first column says [s], under a line of names, `time,limb1,..`. With `--delay`, the two files may be of
clocks that differ.

Parameters are positive numbers of the scene, by name: fluid.drag_coefficient, robot.youngs_modulus, robot.limb_length,
robot.limbs.0.length, actuator.peak_angle, or actuator.angles.2, a point of a measured curve. Their first guesses are
the values of the scene: a Python file that defines `scene` (it is executed), a JSON file as `Scene.to_dict` writes it,
or none for the chapter's.
"""

import argparse
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from seastar_gym.command import answered, command_parser
from seastar_gym.files import require_extra, require_place, save_figure, write_json
from seastar_gym.identify.fit import Estimate, identify
from seastar_gym.identify.measurement import ARM, ORIENTATION, Measurement
from seastar_gym.scene import Numerics
from seastar_gym.scene.scene import load_scene

FITTED = ["fluid.drag_coefficient", "robot.youngs_modulus", "actuator.peak_angle"]
"""Parameters that are fitted unless others are named."""
LABELS = {0: "hub", ORIENTATION: f"orientation, at {1e3 * ARM:.0f} mm"}
"""Names of what is tracked, other than nodes, in the picture."""
STEP = 5e-3
"""Time step where neither the scene nor the command line names one [s]."""


def draw(estimate: Estimate, measurement: Measurement, file: Path) -> None:
    """Draw measured and fitted paths, and the residuals over time, into a file."""
    import matplotlib.pyplot as plt

    figure, (paths, over_time) = plt.subplots(1, 2, figsize=(10, 4.2), layout="constrained")
    fitted = measurement.positions - estimate.residuals
    for k, node in enumerate(measurement.nodes):
        (line,) = paths.plot(*1e3 * fitted[:, k].T, label=LABELS.get(node, f"node {node}"))
        paths.plot(*1e3 * measurement.positions[:, k].T, ".", color=line.get_color(), markersize=3, alpha=0.4)
        over_time.plot(measurement.time, 1e3 * estimate.residuals[:, k], ".", color=line.get_color(), markersize=3)
    paths.set(xlabel="x [mm]", ylabel="y [mm]", title="dots: measured, lines: fitted", aspect="equal")
    figure.legend(loc="outside lower center", ncols=len(measurement.nodes))
    over_time.axhline(0.0, color="black", linewidth=0.8)
    over_time.set(xlabel="time [s]", ylabel="measured minus fitted, x and y [mm]")
    over_time.set_title(f"{1e3 * estimate.root_mean_square:.2f} mm root mean square")
    save_figure(figure, file, dpi=120)
    plt.close(figure)


def fit(options: argparse.Namespace) -> None:
    """Fit, and write what is asked for."""
    if options.picture is not None:
        require_extra("Pictures", "studies", "matplotlib")
    asked = load_scene(options.scene)
    scene = asked
    if options.step is not None or not scene.numerics.named:
        scene = replace(scene, numerics=Numerics("implicit-midpoint", options.step or STEP))
    measurement = Measurement.from_csv(options.trajectory, options.commands)
    for file in (options.picture, options.out, options.intervals):
        require_place(file)
    begin = time.perf_counter()
    estimate = identify(scene, options.fit or FITTED, measurement, largest_delay=options.delay)
    print(estimate.report(), f"{time.perf_counter() - begin:.1f} s", sep="\n")
    if options.picture is not None:
        draw(estimate, measurement, options.picture)
    if options.out is not None:
        write_json(options.out, replace(estimate.scene, numerics=asked.numerics).to_dict())
    if options.intervals is not None:
        write_json(options.intervals, estimate.intervals())


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    parser = command_parser("seastar identify", __doc__)
    parser.add_argument("trajectory", type=Path, help="CSV file with a first line time,x0,y0,..")
    parser.add_argument("commands", type=Path, help="CSV file with one line of commands per stroke")
    delay = "fit how late the trajectory's clock is, too, up to this many seconds either way (default: not at all)"
    parser.add_argument("--delay", type=float, metavar="LARGEST", help=delay)
    names = f"names of the parameters to fit (default: {' '.join(FITTED)})"
    parser.add_argument("--fit", nargs="+", action="extend", metavar="PARAMETER", help=names)
    parser.add_argument("--scene", type=Path, help="file of the robot's scene, .py or .json (default: the chapter's)")
    step = "time step of the implicit midpoint rule [s] (default: the scene's own numerics, or 0.005)"
    parser.add_argument("--step", type=float, help=step)
    parser.add_argument("--out", type=Path, help="JSON file for the fitted scene, which certify reads")
    intervals = "JSON file for the confidence intervals by name, from which train.py --intervals draws robots"
    parser.add_argument("--intervals", type=Path, help=intervals)
    parser.add_argument("--picture", type=Path, help="file for a picture of the fit")
    options = parser.parse_args(arguments)
    return answered(lambda: fit(options), options)
