"""Measures what speed costs a scene in accuracy: `seastar certify my_scene.py --error 0.01`.

The scene is a Python file that defines `scene`, a JSON file as `Scene.to_dict` writes it, or none for the chapter's. A
file of Python is executed. Errors are those of the hub's path in space, in time and in sum, against swims with 37 nodes
per limb and steps of 0.25 ms, over the classes of commands of seastar_gym/accuracy/commands.py: the largest of a class,
the typical one, which is the median, and what is promised, 1.5 times the largest. With --decision-period, commands are
given several times a stroke, and the modes of limbs that they drive are named.

Writes a certificate (JSON), and a picture of error over speed where matplotlib is installed. `Certificate.load(file)`
reads it, `certificate.for_error(0.01)` is the scene at the fastest setting that keeps 1 %, and
`gym.make("SeastarSwim-v0", scene=..., certificate=file)` tells its errors in `info`.

With --chosen, that scene is written, too. An older file of its name is moved away first, to one that ends with .old.
"""

import argparse
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from seastar_gym.accuracy.certificate import MARGIN, Certificate
from seastar_gym.accuracy.measure import SAMPLES, Progress, certify
from seastar_gym.accuracy.resonance import told as told_of
from seastar_gym.command import DEFAULT, answered, command_parser
from seastar_gym.files import require_extra, require_place, save_figure, write_json
from seastar_gym.scene.checks import require_error
from seastar_gym.scene.scene import load_scene


def as_text(certificate: Certificate) -> str:
    """Table of the certificate, fastest settings first."""
    repeated = certificate.repeated(certificate.promised)
    classes = {"random": [each for each in certificate.promised if each not in repeated], "repeated": repeated}
    heads = "".join(f" {name + ' (typical)':>18}" for name, some in classes.items() if some)
    lines = [f"{'setting':52} {'space':>8} {'time':>8}{heads} {'promise':>8} {'x real time':>12}"]
    for each in sorted(certificate.settings, key=lambda each: -each.speed):
        told = " ".join(_percent(error, 6) for error in (each.space_error, each.time_error))
        for some in filter(None, classes.values()):
            told += f" {_percent(each.error(some), 6)} ({_percent(each.typical_error(some))})".ljust(19)
        gathers = "" if each.is_energy_stable else "  gathers energy over long swims, not chosen"
        promise = _percent(each.promise(certificate.promised), 6)
        lines.append(f"{each!s:52} {told} {promise} {each.speed:>12,.0f}{gathers}")
    limit = _percent(certificate.limit_error)
    lines.append(
        f"Errors are the largest of {certificate.samples} sequences of a class, and the median, of the class where it "
        f"is largest. {MARGIN:g} times the largest is promised. The limit errs by {limit}."
    )
    if (period := certificate.decision_period) is not None:
        lines.append(told_of(certificate.measured_over.get("resonances", ()), period))
    return "\n".join(filter(None, lines))


def _percent(share: float, width: int = 0) -> str:
    return f"{100 * share:>{width}.2g} %"


def draw(certificate: Certificate, file: Path) -> None:
    """Picture of the error over speed, one line for each number of nodes."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6.4, 4.4), layout="constrained")
    for nodes in sorted({each.nodes_per_limb for each in certificate.settings}):
        some = sorted((each for each in certificate.settings if each.nodes_per_limb == nodes), key=lambda x: x.speed)
        errors = [100 * each.promise(certificate.promised) for each in some]
        axes.loglog([each.speed for each in some], errors, "o-", label=f"{nodes} nodes per limb")
    axes.set(xlabel="x real time, batch on one core", ylabel="promised error of the hub's path [%]")
    axes.grid(True, which="major", color="0.9")
    axes.legend(frameon=False)
    save_figure(figure, file, dpi=130)
    plt.close(figure)


@contextmanager
def progress_bar(what: str = "") -> Iterator[Progress]:
    """Bar of the share of some work that is done."""
    from tqdm import tqdm

    bar_format = "{l_bar}{bar}| {elapsed}<{remaining}"
    with tqdm(total=100, unit="%", desc=what, bar_format=bar_format) as bar:

        def progress(share: float) -> None:
            bar.n = min(100.0 * share, 100.0)  # sums of differences may exceed it
            bar.update(0)

        yield progress


def certify_as_asked(options: argparse.Namespace) -> None:
    """Measure and write a certificate, and the setting that is asked for."""
    require_extra("Certificates", "studies", "tqdm")
    scene = load_scene(options.scene)
    scene.to_dict()  # now, not after minutes, refuses what a certificate could not hold
    if options.error is not None:
        require_error(options.error)
    if options.chosen is not None and options.error is None:
        raise ValueError("--chosen writes the scene that --error chooses: give both.")
    for name in ("out", "chosen"):
        require_place(getattr(options, name))
    if options.out.suffix == ".png":
        raise ValueError(f"{options.out} is where the picture goes: give --out a file such as certificate.json.")
    if options.chosen is not None and options.chosen.exists():
        before = options.chosen.with_name(f"{options.chosen.name}.old")
        options.chosen.replace(before)  # now: no training takes it for this scene's, whatever happens
        print(f"Moved: {options.chosen}, of before, to {before}", flush=True)
    with progress_bar() as progress:
        certificate = certify(scene, options.samples, options.seed, progress, options.decision_period)
    certificate.save(options.out)
    print(as_text(certificate))
    print(f"Written: {options.out}")
    try:
        draw(certificate, options.out.with_suffix(".png"))
        print(f"Written: {options.out.with_suffix('.png')}")
    except ModuleNotFoundError:
        print('No picture: that needs matplotlib, pip install "seastar-gym[studies]".')
    if options.error is not None:
        try:
            chosen = certificate.for_error(options.error)
        except ValueError as none:
            raise ValueError(
                f"{none}{'' if options.chosen is None else f' {options.chosen} is not written.'}"
            ) from none
        print(f"{100 * options.error:g} %: nodes_per_limb={chosen.robot.nodes_per_limb}, {chosen.numerics}")
        if options.chosen is not None:
            write_json(options.chosen, chosen.to_dict())
            print(f"Written: {options.chosen}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    parser = command_parser("seastar certify", __doc__)
    parser.add_argument("scene", nargs="?", type=Path, help="file of the scene, .py or .json (default: the chapter's)")
    parser.add_argument("--error", type=float, help="print the fastest setting that keeps this error, such as 0.01")
    parser.add_argument("--samples", type=int, default=SAMPLES, help=f"sequences per class {DEFAULT}")
    parser.add_argument("--seed", type=int, default=0, help=f"seed of the sequences {DEFAULT}")
    period = "time between decisions that are shorter than a stroke [s], of a scene with wires"
    parser.add_argument("--decision-period", type=float, help=period)
    parser.add_argument("--out", type=Path, default=Path("certificate.json"), help=f"file to write {DEFAULT}")
    file = "JSON file for the scene at the setting that --error chooses, which train.py --scene takes"
    parser.add_argument("--chosen", type=Path, help=file)
    options = parser.parse_args(arguments)
    return answered(lambda: certify_as_asked(options), options)
