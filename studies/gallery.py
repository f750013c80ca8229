"""Pictures and costs of scenes that differ from the default; writes `gallery.json`.

A picture shows the robot at rest (grey, limbs numbered), at the end of heating (blue) and its hub's path, and below the
robot the cross sections at root and tip of limbs that are no plain discs. The cost is the processor time of a stroke of
random commands relative to that of the default scene. Scenes take turns, stroke by stroke, so that other work of the
machine affects all of them alike, and the median over strokes counts.
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from seastar_gym import scene
from seastar_gym.files import save_figure
from seastar_gym.scene import Numerics, Scene, Strip
from seastar_gym.scene.section import AnySection, Disc, Section
from seastar_gym.simulator import Simulator
from studies.frame import Floats, Results, Study
from studies.pages import markdown
from studies.style import INK, subplots

NUMERICS, NODES = Numerics.preset("balanced"), 10
ROBOTS, ROUNDS, STROKES = 64, 9, 5
"""Robots and rounds of the measured cost, and strokes in a picture."""
REST, HEATED, PATH = "#c8c8c8", "#2b6cb0", "#c53030"
SECTION, LARGER, SECTIONS = "#4a5568", 4.0, -84.0
NUMBERS = 7e-3
"""Distance of a limb's number from its tip at rest [m]."""
TURN, CORNERS = np.linspace(0.0, 2.0 * np.pi, 60), np.array([[-1.0, 1.0, 1.0, -1.0], [-1.0, -1.0, 1.0, 1.0]])
"""Colour of cross sections, how much larger than the robot they are drawn, and how high [mm]; outlines."""


class Exhibit(NamedTuple):
    """A scene of the gallery.

    code: Arguments that make the scene, as the page has them. command: Of every limb in every stroke of the picture.
    whole: The arguments where the page leaves something out.
    """

    name: str
    code: str
    command: tuple[float, ...] = (0.0, 1.0, 0.0, 0.0, -1.0)
    whole: str = ""

    @property
    def scene(self) -> Scene:
        """The scene, with the nodes and numerics of the gallery."""
        made: Scene = eval(f"Scene({self.whole or self.code})", vars(scene))
        return replace(made, robot=replace(made.robot, nodes_per_limb=NODES), numerics=NUMERICS)


CURVE = "actuator=MeasuredCurve((0.0, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0), (0.0, 0.35, 0.6, 0.5, 0.25, 0.08, 0.0))"
UNEVEN = (
    "Seastar(limbs=(Limb(0.0, 0.12), Limb(1.0, 0.08), Limb(2.2, 0.06), Limb(4.1, 0.06), Limb(5.3, 0.08))), "
    "actuator=SmaPulse(0.4)"
)
EXHIBITS = (
    Exhibit("default", ""),
    Exhibit("one limb", "Seastar(1, 10), actuator=SmaPulse(0.0), held_nodes=(0,), loads=((9, 0.0, -1e-3),)", (0.0,)),
    Exhibit("two limbs", "Seastar(2)", (1.0, -1.0)),
    Exhibit("three limbs", "Seastar(3), actuator=SmaPulse(0.4)", (0.0, 1.0, -1.0)),
    Exhibit("eight limbs", "Seastar(8)", (0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0, 0.0)),
    Exhibit(
        "twelve limbs", "Seastar(12), actuator=SmaPulse(0.25)",
        (0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0, -1.0, 0.0),
    ),
    Exhibit("tapered limbs", "Seastar(limbs=(Limb(radius=(2e-3, 1e-3)),) * 5)"),
    Exhibit("strips", "Seastar(limbs=(Limb(section=Strip(width=3e-3, height=8e-3)),) * 5)"),
    Exhibit("tubes", "Seastar(limbs=(Limb(section=Tube(outer=3e-3, inner=2e-3)),) * 5)"),
    Exhibit("a profile", "Seastar(limbs=(Limb(section=Strip(width=(4e-3, 2e-3), height=(4e-3, 12e-3))),) * 5)"),
    Exhibit("curved limbs", "Seastar(limbs=(Limb(natural_curvature=10.0),) * 5)"),
    Exhibit(
        "uneven limbs", "Seastar(limbs=(Limb(0.0, 0.12), Limb(1.0, 0.08), ..)), actuator=SmaPulse(0.4)", whole=UNEVEN
    ),
    Exhibit("measured curve", 'actuator=MeasuredCurve.from_csv("curve.csv")', whole=CURVE),
    Exhibit("limited rate", "actuator=Limited(SmaPulse(), largest_rate=2.0)"),
    Exhibit("thermal", "actuator=ThermalSma()"),
    Exhibit("weak limb", "limb_strengths=(1.0, 1.0, 1.0, 1.0, 0.3)"),
    Exhibit("contact", "contact=Contact()", (1.0, -1.0, 0.0, 0.0, 0.0)),
)  # fmt: skip
"""Scenes of the gallery, the default first."""


def measure_costs(shown: Sequence[Exhibit]) -> tuple[Floats, Floats]:
    """Processor time of a stroke relative to the first scene, and Newton iterations per step, shape (n_scenes,)."""
    simulators = [Simulator(exhibit.scene, ROBOTS, threads=1) for exhibit in shown]
    seconds, per_step = np.zeros((2, ROUNDS, len(shown)))
    for k in range(-1, ROUNDS):  # the first round compiles
        for i, simulator in enumerate(simulators):
            commands = np.random.default_rng(k + 1).integers(-1, 2, (ROBOTS, simulator.scene.robot.n_limbs))
            begin = time.process_time()
            report = simulator.stroke(commands)
            if k >= 0:
                seconds[k, i] = time.process_time() - begin
                per_step[k, i] = report.newton_iterations.sum() / report.steps.sum()
    return np.median(seconds / seconds[:, :1], axis=0), per_step.mean(axis=0)


def outline(centre: Floats, radius: Floats) -> Floats:
    """Contour of a limb [m], shape (2 n, 2), from its nodes [m], shape (n, 2), and its radii there [m], shape (n,)."""
    tangent = np.gradient(centre, axis=0)
    normal = tangent[:, ::-1] * [-1.0, 1.0] / np.linalg.norm(tangent, axis=1, keepdims=True)
    return np.concatenate([centre + radius[:, None] * normal, (centre - radius[:, None] * normal)[::-1]])


def draw_sections(axes: Any, section: AnySection) -> None:
    """Draw a strip or tube at the limb's root and, if it differs there, at its tip; the plane is horizontal."""
    ends = {name: [1e3 * LARGER * np.atleast_1d(number)[k] for number in vars(section).values()]
            for name, k in (("root", 0), ("tip", -1))}  # fmt: skip
    if isinstance(section, Disc | Section):
        return
    same = ends["root"] == ends["tip"]
    for x, (name, (first, second)) in zip((76.0, 110.0), list(ends.items())[: 1 if same else 2], strict=False):
        if isinstance(section, Strip):
            axes.fill(x + 0.5 * first * CORNERS[0], SECTIONS + 0.5 * second * CORNERS[1], color=SECTION, linewidth=0.0)
        else:
            for radius, colour in ((first, SECTION), (second, "white")):
                axes.fill(x + radius * np.cos(TURN), SECTIONS + radius * np.sin(TURN), color=colour, linewidth=0.0)
        axes.text(x, -122.0, f"{LARGER:.0f} : 1" if same else name, color=INK, fontsize=8, ha="center")


def draw(exhibit: Exhibit, file: Path) -> None:
    """Draw the robot at rest and at the end of the first heating, and its hub's path over STROKES."""
    simulator, robot = Simulator(exhibit.scene, threads=1), exhibit.scene.robot
    shapes, hub = [simulator.positions[0]], [np.zeros(2)]
    for _ in range(STROKES):
        for since in simulator.stroke_in_parts([exhibit.command], 20):
            hub.append(simulator.hub_position()[0])
            if len(shapes) == 1 and since >= exhibit.scene.actuator.corners[1] - 1e-9:
                shapes.append(simulator.positions[0])
    figure, axes = subplots(figsize=(2.6, 2.6), layout=None)
    share = np.linspace(0.0, 1.0, robot.nodes_per_limb)
    for nodes, colour in zip(shapes, (REST, HEATED), strict=True):
        limbs = nodes[1:].reshape(robot.n_limbs, -1, 2)
        for limb, shape in zip(limbs, robot.limb_shapes(), strict=True):
            reach = [cut.reach for cut in shape.cuts(robot.density, share)]
            axes.fill(*1e3 * outline(np.concatenate([nodes[:1], limb]), np.array(reach)).T, color=colour, linewidth=0.5)
    for limb, tip in enumerate(shapes[0][1:].reshape(robot.n_limbs, -1, 2)[:, -1], start=1):
        place = tip * (1.0 + NUMBERS / np.hypot(*tip))
        axes.text(*1e3 * place, f"{limb}", color=INK, fontsize=7, ha="center", va="center")
    axes.plot(*1e3 * np.array(hub).T, color=PATH, linewidth=1.2)
    draw_sections(axes, robot.limb_shapes()[0].section)
    axes.plot([-120.0, -70.0], [-116.0, -116.0], color=INK, linewidth=1.5)
    axes.text(-95.0, -112.0, "50 mm", color=INK, fontsize=8, ha="center")
    axes.set_aspect("equal")
    axes.set_xlim(-128, 128)
    axes.set_ylim(-128, 128)
    axes.axis("off")
    save_figure(figure, file, dpi=320, bbox_inches="tight", pad_inches=0.02)


def table(results: Mapping[str, Any]) -> str:
    """Table of scenes in Markdown: pictures, code and costs."""
    rows = []
    for exhibit in EXHIBITS:
        picture, cost = f"![{exhibit.name}](gallery/{_file_name(exhibit)})", results["scenes"][exhibit.name]["cost"]
        rows.append([picture, f"**{exhibit.name}**<br>`{exhibit.code or 'Scene()'}`", f"{cost:.2f}"])
    return markdown(["", "scene", "cost"], rows, (0, 1))


def _file_name(exhibit: Exhibit) -> str:
    return exhibit.name.replace(" ", "_") + ".png"


def run(results: Results) -> None:
    """Draw the pictures into docs/gallery, or where --out says, and measure the costs."""
    folder = Path("docs/gallery") if results.out == STUDY.default_out else results.folder
    for exhibit in EXHIBITS:
        draw(exhibit, folder / _file_name(exhibit))
    found = zip(EXHIBITS, *measure_costs(EXHIBITS), strict=True)
    results["scenes"] = {
        one.name: {"cost": round(cost, 3), "iterations_per_step": round(each, 3)} for one, cost, each in found
    }


STUDY = Study("gallery", run, file="gallery/gallery.json", tables={"gallery": table})
