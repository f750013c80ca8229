"""MuJoCo's discrete elastic rods beside ours: a clamped limb under a tip load, its ringing, and free fall.

`pip install -e ".[studies,mujoco]"` brings MuJoCo. Its rods are flexes of one dimension in the plane, integrated by
"discrete", its one integrator that is implicit in their elasticity. That elasticity is bending; equality constraints,
as stiff as MuJoCo makes them, keep the lengths of edges. Both codes simulate two of the chapter's limbs in a line.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from seastar_gym.files import save_figure
from seastar_gym.scene import Numerics, Scene, Seastar
from seastar_gym.scene.numerics import SchemeName
from seastar_gym.simulator import Simulator, State
from studies.benchmark import repeat
from studies.frame import Floats, Results, Study, rounded
from studies.pages import markdown
from studies.style import COLOURS, FAINT, MS, PERCENT, subplots
from studies.verification import exact
from studies.verification.unactuated import HUB, let_pass, pause

MUJOCO = "mujoco"
ROBOT = Seastar(n_limbs=2)
THIN = 0.1
"""Radius of MuJoCo's rods over that of the robot: edges must be longer. Their bending stiffness is the robot's."""
MODEL = """<mujoco>
  <option timestep="{step}" integrator="discrete" gravity="0 {gravity} 0"/>
  <worldbody>
    <flexcomp name="rod" type="grid" dim="1" dof="2d" count="{count} 1 1" spacing="{edge:.17g} 1 1"
              radius="{radius:.17g}" mass="{mass:.17g}">
      <elasticity young="{young:.17g}" poisson="0" damping="0"/>
      <edge equality="true" solref="1e-6 1" solimp="0.9999 0.9999 0.001 0.5 2"/>
      <contact selfcollide="none"/>
      {pin}
    </flexcomp>
  </worldbody>
</mujoco>"""

LOAD = 3.0
"""Tip load P L^2 / EI."""
LOADED_STEP, LOADED_TIME = 0.05, 30.0
"""Step and time [s] in which a loaded limb comes to rest: implicit Euler and MuJoCo's integrator damp it."""
LOADED_NODES = (10, 20, 40)
RINGING_NODES, PERIODS, SAMPLES, AMPLITUDE = 20, 3, 25, 1e-3
"""Nodes per limb, periods of the first mode, samples per period, and amplitude of the tip over the length."""
STEPS_PER_PERIOD = (50, 100, 200, 400, 800)
FALL, GRAVITY, FALL_STEP = 1.0, 9.81, 5e-3
"""Time [s], acceleration [m/s^2] and step [s] of the fall."""
BATCH = 512
ROUNDING = 1e-9
"""Errors below this are told as rounding."""
TIMED_STEPS = 300
"""Steps of MuJoCo that are timed."""


class Measured(NamedTuple):
    """Error of a code in a case [1], and its processor time for a step [s]: of one rod, and of one rod of a batch."""

    error: float
    alone: float
    in_batch: float | None = None


def robot_with(nodes: int) -> Seastar:
    """The robot with so many nodes per limb."""
    return replace(ROBOT, nodes_per_limb=nodes)


NAMES = {
    MUJOCO: "MuJoCo",
    "implicit-euler": "ours, implicit Euler",
    "implicit-midpoint": "ours, implicit midpoint",
    "sdirk3": "ours, SDIRK3",
}


class Rod:
    """MuJoCo's rod: nodes from one tip to the other, with the hub in the middle.

    nodes: Of each limb. step: [s]. held: Whether the hub is. gravity: Along y [m/s^2].
    """

    def __init__(self, nodes: int, step: float, held: bool = True, gravity: float = 0.0):
        import mujoco

        self.mujoco, count, robot = mujoco, 2 * nodes - 1, robot_with(nodes)
        mass = robot.density * np.pi * robot.rod_radius**2 * robot.edge_length
        text = MODEL.format(
            step=step, gravity=gravity, count=count, edge=robot.edge_length, radius=THIN * robot.rod_radius,
            mass=mass * count, young=robot.youngs_modulus / THIN**4, pin=f'<pin id="{nodes - 1}"/>' if held else "",
        )  # fmt: skip
        self.model = self.mujoco.MjModel.from_xml_string(text)
        self.bodies = np.array(self.model.flex_vertbodyid)
        self.model.body_mass[self.bodies[[0, -1]]] *= 0.5  # half an edge is at a tip
        self.data = self.mujoco.MjData(self.model)
        self.mujoco.mj_setConst(self.model, self.data)
        self.mujoco.mj_forward(self.model, self.data)

    def displace(self, across: Floats) -> None:
        """Move the nodes across the rod by these distances [m]."""
        for body, distance in zip(self.bodies, across, strict=True):
            for joint in range(self.model.body_jntnum[body]):
                k = self.model.body_jntadr[body] + joint
                if self.model.jnt_axis[k][1] == 1.0:
                    self.data.qpos[self.model.jnt_qposadr[k]] = distance
        self.mujoco.mj_forward(self.model, self.data)

    def push(self, force: float) -> None:
        """Put dead loads across both tips [N]."""
        self.data.xfrc_applied[self.bodies[[0, -1]], 1] = force

    def advance(self, steps: int) -> None:
        """Make time steps."""
        for _ in range(steps):
            self.mujoco.mj_step(self.model, self.data)

    @property
    def positions(self) -> Floats:
        """Positions of the nodes [m], shape (n, 2)."""
        return np.array(self.data.flexvert_xpos[:, :2])

    def seconds_per_step(self) -> float:
        """Processor time of a step [s], the best of five goes from where the rod is."""
        return min(repeat(lambda: self.advance(TIMED_STEPS), 0.0)) / TIMED_STEPS


def our_scene(nodes: int, duration: float, numerics: Numerics, **others: Any) -> Scene:
    """Scene of the robot in vacuum, not actuated, whose stroke takes a time [s]."""
    return Scene(robot_with(nodes), None, pause(duration), numerics, **others)


def our_seconds(scene: Scene, steps: float, n_robots: int, state: Any = None) -> float:
    """Processor time for a step of a robot [s], the best of three strokes of so many steps."""
    simulator, goes = Simulator(scene, n_robots, 1), []
    for _ in range(4):
        simulator.reset()
        if state is not None:
            positions = np.repeat(state.positions, n_robots, axis=0)
            simulator.set_state(simulator.get_state()._replace(positions=positions))
        began = time.process_time()
        let_pass(simulator)
        goes.append((time.process_time() - began) / steps / n_robots)
    return min(goes[1:])


def measured(error: float, scene: Scene, steps: float, state: Any = None) -> Measured:
    """Error of ours beside its times."""
    return Measured(error, our_seconds(scene, steps, 1, state), our_seconds(scene, steps, BATCH, state))


def loaded(nodes: int) -> dict[str, Measured]:
    """Errors of the tip of a clamped limb under a dead load, over its length."""
    robot = robot_with(nodes)
    EI, L = exact.bending_stiffness(robot), robot.limb_length
    force = LOAD * EI / L**2
    reference = exact.elastica_tip(force, EI, L)
    steps = round(LOADED_TIME / LOADED_STEP)
    rod = Rod(nodes, LOADED_STEP)
    rod.push(force)
    rod.advance(steps)
    found = {MUJOCO: Measured(_distance(rod.positions[-1], reference, L), rod.seconds_per_step())}
    tips = tuple((limb * (nodes - 1), 0.0, force) for limb in (1, 2))
    numerics = Numerics("implicit-euler", LOADED_STEP, 1e-12)
    scene = our_scene(nodes, LOADED_TIME, numerics, held_nodes=HUB, loads=tips)
    simulator = Simulator(scene)
    let_pass(simulator)
    reference = exact.elastica_tip(force, EI, L, exact.stretching_stiffness(robot))
    error = _distance(simulator.positions[0, nodes - 1], reference, L)
    return found | {"implicit-euler": measured(error, scene, steps)}


def _distance(tip: Floats, reference: Floats, length: float) -> float:
    return float(np.hypot(*(tip - reference)) / length)


def period() -> float:
    """Period of the first mode of a clamped limb [s]."""
    return float(1.0 / exact.cantilever_frequencies(ROBOT, ROBOT.limb_length)[0])


def mode() -> Floats:
    """First mode of a limb, from its root, with the tip's amplitude [m]."""
    across = exact.cantilever_shape(exact.CANTILEVER_ROOTS[0], np.arange(1, RINGING_NODES) / (RINGING_NODES - 1))
    return AMPLITUDE * ROBOT.limb_length * across


def ringing(steps_per_period: int) -> dict[str, Measured]:
    """Largest errors of the tip of a limb that rings in its first mode, over its amplitude."""
    step, tip = period() / steps_per_period, AMPLITUDE * ROBOT.limb_length
    wanted = np.cos(2.0 * np.pi * np.arange(PERIODS * SAMPLES + 1) / SAMPLES)
    rod, seen = Rod(RINGING_NODES, step), [1.0]
    rod.displace(np.concatenate([mode()[::-1], [0.0], mode()]))
    for _ in range(PERIODS * SAMPLES):
        rod.advance(steps_per_period // SAMPLES)
        seen.append(rod.positions[-1, 1] / tip)
    found = {MUJOCO: Measured(float(np.abs(seen - wanted).max()), rod.seconds_per_step())}
    schemes: tuple[SchemeName, ...] = ("implicit-euler", "implicit-midpoint", "sdirk3")
    for scheme in schemes:
        error, scene, state = our_ringing(Numerics(scheme, step, 1e-10), wanted)
        found[scheme] = measured(error, scene, PERIODS * steps_per_period, state)
    return found


def our_ringing(numerics: Numerics, wanted: Floats) -> tuple[float, Scene, State]:
    """Ours: the largest error of the tip over its amplitude, the scene, and the state from which it rings."""
    scene = our_scene(RINGING_NODES, PERIODS * period(), numerics, held_nodes=HUB)
    simulator = Simulator(scene)
    state = simulator.get_state()
    state.positions[0, 1:, 1] += np.tile(mode(), 2)
    simulator.set_state(state)
    tips = [1.0]
    for _ in simulator.stroke_in_parts(np.zeros((1, 2)), PERIODS * SAMPLES):
        tips.append(simulator.positions[0, RINGING_NODES - 1, 1] / (AMPLITUDE * ROBOT.limb_length))
    return float(np.abs(np.array(tips) - wanted).max()), scene, state


def falling() -> dict[str, Measured]:
    """Errors of the distance that a free rod falls, over that distance."""
    far, steps = 0.5 * GRAVITY * FALL**2, round(FALL / FALL_STEP)
    rod = Rod(RINGING_NODES, FALL_STEP, held=False, gravity=-GRAVITY)
    rod.advance(steps)
    found = {MUJOCO: Measured(float(np.abs(-rod.positions[:, 1] / far - 1.0).max()), rod.seconds_per_step())}
    for scheme in ("implicit-euler", "implicit-midpoint"):
        scene = our_scene(RINGING_NODES, FALL, Numerics(scheme, FALL_STEP), gravity=(0.0, -GRAVITY))
        simulator = Simulator(scene)
        let_pass(simulator)
        error = float(np.abs(-simulator.positions[0, :, 1] / far - 1.0).max())
        found[scheme] = measured(error, scene, steps)
    return found


def cases() -> dict[tuple[str, str], Callable[[], dict[str, Measured]]]:
    """How every case is computed, by its name and its number of nodes or its step."""
    found: dict[tuple[str, str], Callable[[], dict[str, Measured]]] = {}
    found |= {("tip load", str(nodes)): partial(loaded, nodes) for nodes in LOADED_NODES}
    found |= {("ringing", str(steps)): partial(ringing, steps) for steps in STEPS_PER_PERIOD}
    return found | {("free fall", str(RINGING_NODES)): falling}


def run(results: Results) -> None:
    """Compute all cases."""
    for (case, setting), compute in cases().items():
        found = {code: list(each) for code, each in compute().items()}
        results.row([case])[setting] = found
        print(case, setting, found, flush=True)


TOLD = {"tip load": ("20", "40"), "ringing": ("200",)}
"""Settings that the table tells; of other cases all."""


def named(case: str, setting: str) -> str:
    """A case in words."""
    if case == "tip load":
        return f"tip load, {setting} nodes, {MS * LOADED_STEP:g} ms"
    if case == "ringing":
        return f"ringing, {RINGING_NODES} nodes, {MS * period() / int(setting):.2g} ms"
    return f"free fall, {setting} nodes, {MS * FALL_STEP:g} ms"


def microseconds(seconds: float) -> str:
    """A time [s] in microseconds, to two digits."""
    return f"{rounded(1e6 * seconds, 2):g}"


def table(results: Mapping[str, Any]) -> str:
    """Errors and times of all cases."""
    rows = []
    for case, settings in ((case, results[case]) for case in ("tip load", "ringing", "free fall")):
        for setting in TOLD.get(case, tuple(settings)):
            for code, (error, alone, in_batch) in settings[setting].items():
                batch = microseconds(in_batch) if in_batch else ""
                shown = "rounding" if error < ROUNDING else f"{PERCENT * error:.2g} %"
                rows.append([named(case, setting), NAMES[code], shown, microseconds(alone), batch])
    return markdown(["case", "code", "error", "time per step [µs]", f"in a batch of {BATCH}"], rows, (0, 1))


def draw(results: Mapping[str, Any], file: Path) -> None:
    """Draw the errors of the ringing over processor time."""
    figure, axes = subplots(1, 1, figsize=(6.4, 3.6))
    for code in next(iter(results["ringing"].values())):
        found = [(int(steps), *row[code][:2]) for steps, row in results["ringing"].items()]
        seconds = [steps / period() * alone for steps, _, alone in found]
        ours = code != MUJOCO
        axes.loglog(
            seconds, [PERCENT * error for _, error, _ in found], "o-" if ours else "s--",
            color=COLOURS.get(code, FAINT), label=NAMES[code],
        )  # fmt: skip
    axes.set_xlabel("processor time for a simulated second [s]")
    axes.set_ylabel("largest error of the tip [% of its amplitude]")
    axes.legend()
    save_figure(figure, file)


STUDY = Study(
    "verification.mujoco", run, file="verification/mujoco.json", out=Path("runs/mujoco"),
    pictures={"mujoco.png": draw}, tables={"mujoco": table}, packages=("mujoco",), extra="mujoco",
)  # fmt: skip
