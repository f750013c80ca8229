"""Certificates of the robots that won: how far the numbers of designs.json can be trusted, by their total errors.

Robots are those of the table, with its rounded numbers. `seastar_gym.certify` swims random sequences of commands with
each and compares them with swims of many nodes and short steps: some processor minutes for every robot. Certificates
are kept in OUT, so that the command goes on with those that are missing. Writes certificates.json once all robots have
theirs.
"""

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from tqdm import tqdm

from seastar_gym.accuracy import Certificate
from seastar_gym.accuracy.measure import SAMPLES, certify
from seastar_gym.scene import Scene, SmaPulse
from seastar_gym.sweep.batches import Batch
from seastar_gym.sweep.configurations import Swim, configuration_with
from seastar_gym.sweep.swimming import swim
from studies.designs import study
from studies.designs.space import MEASURED, SETTLING, Body
from studies.frame import DOCS, Results, Study, require_known
from studies.pages import numbers

Table = dict[str, Any]
WINNERS = (
    "fastest", "fastest in its lengths", "fastest at the chapter's length and angle", "fastest of them without taper",
)  # fmt: skip
CLASS = "repeated ternary"
"""Class of commands that are repeated, as the study's are."""
NODES = (7, 19)
"""Nodes per limb of the certified settings that are told of: those of `fast`, and most."""
STEPS = (5e-3, 1e-3)
"""Their steps [s]."""


def scene_of(row: Table) -> Scene:
    """Scene of a winner as designs.json describes it."""
    body = Body(row["n_limbs"], 1e-3 * row["mean_radius_mm"], row["taper"])
    robot = replace(
        body.robot(), limb_length=1e-3 * row["limb_length_mm"], youngs_modulus=1e6 * row["youngs_modulus_MPa"]
    )
    return replace(Scene.preset("fast"), robot=robot, actuator=SmaPulse(row["peak_angle_rad"]))


def file_of(name: str, folder: Path, samples: int) -> Path:
    """File of the certificate of a winner."""
    return folder / f"{name.replace(' ', '_')}_{samples}.json"


def certificate_of(name: str, scene: Scene, folder: Path, samples: int) -> Certificate:
    """Certificate of a winner: that of the folder if it holds, or a new one, which is kept there."""
    file = file_of(name, folder, samples)
    if file.exists():
        certificate = Certificate.load(file)
        certificate.require_valid(scene)
        return certificate
    with tqdm(total=100, unit="%", desc=name, bar_format="{l_bar}{bar}| {elapsed}<{remaining}") as bar:

        def progress(share: float) -> None:
            bar.update(100.0 * share - bar.n)

        certificate = certify(scene, samples, progress=progress)
    folder.mkdir(parents=True, exist_ok=True)
    certificate.save(file)
    return certificate


def told(certificate: Certificate) -> Table:
    """Errors of a robot's settings [%], and its speed at them [mm/s]."""
    found: Table = {"samples": certificate.samples, "limit_percent": round(100 * certificate.limit_error, 3)}
    for nodes, step in zip(NODES, STEPS, strict=True):
        setting = next(
            each for each in certificate.settings
            if (each.nodes_per_limb, each.step, each.scheme) == (nodes, step, "implicit-midpoint")
        )  # fmt: skip
        scene = certificate.at(setting)
        columns = swim(Batch(configuration_with(scene, "straight", Swim(SETTLING, MEASURED), {}), {}, 1))
        found[f"{nodes} nodes, {1e3 * step:g} ms"] = {
            "repeated_percent": round(100 * setting.error((CLASS,)), 3),
            "typical_percent": round(100 * setting.typical_error((CLASS,)), 3),
            "promised_percent": round(100 * setting.error(certificate.promised), 3),
            "energy_growth": setting.energy_growth,
            "mm_per_s": round(1e3 * float(columns["speed"][0]), 3),
        }
    return found


def table(found: Table) -> str:
    """Table in Markdown of all robots and settings."""
    lines = [
        "| robot | setting | repeated [%] | median [%] | all [%] | energy |",
        "|---|---|---:|---:|---:|---:|",
    ]
    for name, robot in found["robots"].items():
        for nodes, step in zip(NODES, STEPS, strict=True):
            setting = f"{nodes} nodes, {1e3 * step:g} ms"
            row = robot[setting]
            lines.append(
                f"| {name} | {setting} | {row['repeated_percent']:g} | {row['typical_percent']:g} "
                f"| {row['promised_percent']:g} | {row['energy_growth']:g} |"
            )
    return "\n".join(lines)


@dataclass(frozen=True)
class Options:
    """Certificates of the robots that won."""

    out: Path = Path("runs/certificates")
    """Folder of the files, or the file of the numbers."""
    samples: int = SAMPLES
    """Sequences per class."""
    robots: tuple[str, ...] = WINNERS
    """Winners."""

    def __post_init__(self) -> None:
        require_known("robot", self.robots, WINNERS)


def certify_all(options: Options, results: Results) -> None:
    """Certify robots, and tell their errors once all winners have certificates."""
    rows = numbers(DOCS, study.STUDY)
    found: Table = {}

    def add(name: str) -> None:
        found[name] = told(certificate_of(name, scene_of(rows[name]), options.out, options.samples))

    for name in options.robots:
        add(name)
        print(json.dumps({name: found[name]}, indent=1), flush=True)
    if missing := [name for name in WINNERS if not file_of(name, options.out, options.samples).exists()]:
        print(f"certificates.json is written once these have certificates, too: {', '.join(missing)}.")
        return
    for name in set(WINNERS) - set(found):
        add(name)
    results["robots"] = {name: found[name] for name in WINNERS}


STUDY = Study(
    "designs.certificates", certify_all, Options, "designs/certificates.json", tables={"certificates": table}
)
