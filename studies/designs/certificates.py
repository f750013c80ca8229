"""Certificates of the robots that won: how far numbers of designs.json and front.json can be trusted, by total errors.

Robots are those of the tables, with their rounded numbers; those of front.json have limbs that touch.
`seastar_gym.certify` swims random sequences of commands with each and compares them with swims of many nodes and short
steps: some processor minutes for every robot. Certificates are kept in FOLDER, and numbers of a robot are written once
it has its certificate, so that the command goes on with those that are missing. Writes certificates.json.
"""

import json
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from seastar_gym.accuracy import Certificate
from seastar_gym.accuracy.measure import SAMPLES
from seastar_gym.scene import Contact, Scene
from studies.accuracy.promises import kept_certificate
from studies.designs import front, space, study
from studies.designs.front import AT_WORK, THRIFTIEST
from studies.designs.space import Body, swum
from studies.frame import DOCS, Results, Study, require_known
from studies.pages import markdown, numbers

Table = dict[str, Any]
WINNERS = (
    "fastest", "fastest in its lengths", "fastest at the chapter's length and angle", "fastest of them without taper",
)  # fmt: skip
ENDS = (AT_WORK, THRIFTIEST)
"""Robots of front.json: ends of the search at equal work."""
ROBOTS = WINNERS + ENDS
CLASS = "repeated ternary"
"""Class of commands that are repeated, as the study's are."""
NODES = (7, 19)
"""Nodes per limb of the certified settings that are told of: those of `fast`, and most."""
STEPS = (5e-3, 1e-3)
"""Their steps [s]."""


def rows() -> Table:
    """What designs.json and front.json say of the robots, by their names."""
    designs, ends = (numbers(DOCS, each.STUDY) for each in (study, front))
    return {name: designs[name] for name in WINNERS} | {name: ends["robots"][name] for name in ENDS}


def scene_of(row: Table) -> Scene:
    """Scene of a robot as its row describes it: of front.json with contact, and radii of root and tip."""
    is_front = "radius_mm" in row
    if is_front:
        root, tip = (1e-3 * radius for radius in row["radius_mm"])
        body = Body(row["n_limbs"], 0.5 * (root + tip), tip / root)
    else:
        body = Body(row["n_limbs"], 1e-3 * row["mean_radius_mm"], row["taper"])
    length, modulus = 1e-3 * row["limb_length_mm"], 1e6 * row["youngs_modulus_MPa"]
    return space.scene_of(body, length, modulus, row["peak_angle_rad"], Contact() if is_front else None)


def certificate_of(name: str, scene: Scene, folder: Path, samples: int) -> Certificate:
    """Certificate of a winner: that of the folder if it holds, or a new one, which is kept there."""
    return kept_certificate(folder / f"{name.replace(' ', '_')}_{samples}.json", scene, samples)


def told(certificate: Certificate) -> Table:
    """Errors of a robot's settings [%], and its speed at them [mm/s]."""
    found: Table = {"samples": certificate.samples, "limit_percent": round(100 * certificate.limit_error, 3)}
    for nodes, step in zip(NODES, STEPS, strict=True):
        setting = next(
            each for each in certificate.settings
            if (each.nodes_per_limb, each.step, each.scheme) == (nodes, step, "implicit-midpoint")
        )  # fmt: skip
        found[f"{nodes} nodes, {1e3 * step:g} ms"] = {
            "repeated_percent": round(100 * setting.error((CLASS,)), 3),
            "typical_percent": round(100 * setting.typical_error((CLASS,)), 3),
            "promised_percent": round(100 * setting.error(certificate.promised), 3),
            "energy_growth": setting.energy_growth,
            "mm_per_s": round(1e3 * swum(certificate.at(setting))["speed"], 3),
        }
    return found


def table(found: Table) -> str:
    """Table in Markdown of all robots and settings."""
    head, rows = [column for n in NODES for column in (f"{n} nodes, repeated [%]", "all [%]", "energy")], []
    for name, robot in found["robots"].items():
        row = (robot[f"{nodes} nodes, {1e3 * step:g} ms"] for nodes, step in zip(NODES, STEPS, strict=True))
        cells = (f"{one[key]:g}" for one in row for key in ("repeated_percent", "promised_percent", "energy_growth"))
        rows.append([name, robot["samples"], *cells])
    return markdown(["robot", "sequences", *head], rows)


@dataclass(frozen=True)
class Options:
    """Certificates of the robots that won."""

    samples: int = SAMPLES
    """Sequences per class."""
    robots: tuple[str, ...] = ROBOTS
    """Robots; those whose numbers are there, of as many sequences, are left as they are."""

    def __post_init__(self) -> None:
        require_known("robot", self.robots, ROBOTS)


def certify_all(options: Options, results: Results, folder: Path = Path("runs/certificates")) -> None:
    """Certify the robots that are missing, and tell their errors. folder: Where their certificates are kept."""

    def certified(name: str, row: Table) -> Table:
        return told(certificate_of(name, scene_of(row), folder, options.samples))

    results.fill(
        {("robots", name): partial(certified, name, row) for name, row in rows().items() if name in options.robots},
        lambda found: json.dumps(found, indent=1),
        lambda found: found["samples"] == options.samples,
    )


STUDY = Study(
    "designs.certificates", certify_all, Options, "designs/certificates.json", settings=lambda _: {"class": CLASS},
    tables={"certificates": table},
)  # fmt: skip
