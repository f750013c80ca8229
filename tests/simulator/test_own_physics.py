"""Forces and time stepping schemes from a user's own file: closed forms, the guard, the code on disk, and refusals."""

import math
from dataclasses import dataclass, replace
from importlib.util import module_from_spec, spec_from_file_location

import numpy as np
import pytest

from own_terms import Trap
from refusals import assert_refused
from seastar_gym import Body, Contact, Numerics, Scene, Seastar, Simulator, SmaPulse, register_scheme, register_term
from seastar_gym.envs.symmetry import require_symmetry
from seastar_gym.gradients import differentiate
from seastar_gym.lanes.functions import code_digest
from seastar_gym.scene import numerics

START = (0.03, -0.01)  # m/s


G = (3.0 + math.sqrt(3.0)) / 6.0


@pytest.fixture(autouse=True)
def own_schemes(monkeypatch):
    """Own schemes that no other test finds."""
    monkeypatch.setattr(numerics, "SCHEME_NAMES", [*numerics.SCHEME_NAMES])
    register_scheme("crouzeix3", [[G, 0.0], [1.0 - 2.0 * G, G]], [0.5, 0.5])
    register_scheme("two-thirds", [[2 / 3]], [1.0])


def trapped(term, n_limbs=3, scheme="crouzeix3", step=2e-3):
    fine = Numerics(scheme, step, newton_tolerance=1e-12)
    actuator = SmaPulse(peak_angle=0.0) if n_limbs == 1 else SmaPulse()
    return Scene(Seastar(n_limbs, nodes_per_limb=4), None, actuator, fine, terms=(term,))


def thrown(scene, duration, n_robots=1):
    """A simulator whose robots have been thrown by START, once they have moved for a time [s]."""
    simulator = Simulator(scene, n_robots=n_robots)
    state = simulator.get_state()
    simulator.set_state(state._replace(velocities=np.zeros_like(state.velocities) + START))
    assert not simulator.advance(duration).status.any()
    return simulator


def mass_per_length(scene):
    return scene.robot.density * math.pi * scene.robot.rod_radius**2


@pytest.mark.parametrize("n_limbs", [1, 3, 4, 8])
def test_a_robot_slows_down_by_its_own_linear_drag_as_the_closed_form_says(n_limbs):
    scene = trapped(Trap(c=0.02), n_limbs)
    speed = np.exp(-0.02 / mass_per_length(scene) * 0.5)
    velocities = thrown(scene, 0.5).velocities
    np.testing.assert_allclose(velocities[0], np.broadcast_to(speed * np.array(START), velocities[0].shape), rtol=1e-6)


def test_every_robot_of_a_batch_may_have_numbers_of_its_own():
    rates = np.array([0.0, 0.01, 0.02])
    scene = trapped(Trap(c=rates))
    speed = np.exp(-rates / mass_per_length(scene) * 0.5)
    np.testing.assert_allclose(thrown(scene, 0.5, 3).velocities[:, 0], speed[:, None] * START, rtol=1e-6)


def test_an_own_energy_swings_the_hub_as_an_oscillator():
    scene = trapped(Trap(k=0.5, c=0.005, x=0.0))
    rate, omega = 0.005 / mass_per_length(scene) / 2, math.sqrt(0.5 / mass_per_length(scene))
    simulator = thrown(scene, 0.3)
    damped = math.sqrt(omega**2 - rate**2)
    place = np.exp(-rate * 0.3) * math.sin(damped * 0.3) / damped * np.array(START)
    np.testing.assert_allclose(simulator.hub_position()[0], place, rtol=2e-3)


@pytest.mark.parametrize(("scheme", "order"), [("crouzeix3", 3), ("two-thirds", 1)])
def test_an_own_scheme_has_its_order(scheme, order):
    rate = 0.05 / mass_per_length(trapped(Trap()))
    exact = START[0] * math.exp(-rate * 0.2)
    scenes = (trapped(Trap(c=0.05), scheme=scheme, step=step) for step in (0.02, 0.01, 0.005))
    errors = [abs(thrown(scene, 0.2).velocities[0, 0, 0] - exact) for scene in scenes]
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx([order] * 2, abs=0.15)


def test_the_guard_knows_an_own_energy():
    """At a hill, where implicit Euler gives a robot some percents of its energy of motion, nothing is gained."""
    scene = trapped(Trap(k=-2.0), scheme="implicit-euler", step=0.01)
    simulator = Simulator(scene)
    state = simulator.get_state()
    simulator.set_state(state._replace(velocities=np.zeros_like(state.velocities) + START))

    def energies():
        return np.array([simulator.elastic_energy()[0], simulator.kinetic_energy()[0]])

    before = energies()
    simulator.advance(0.1)
    after = energies()
    assert after[1] > 2.0 * before[1]
    assert after.sum() <= before.sum() + 1e-8 * after[1]


SOURCE = """
from constants import RATE
from seastar_gym.lanes.compile import kernel

@kernel
def half(x):
    return {half} * x

def dissipation(c, wx, wy):
    return half(RATE * c * (wx * wx + wy * wy)), (RATE * c * wx, RATE * c * wy), (RATE * c, 0.0 * c, RATE * c)
"""


def digest_of(folder, monkeypatch, half="0.5", rate="1.0"):
    folder.mkdir()
    (folder / "constants.py").write_text(f"RATE = {rate}\n")
    (folder / "drag.py").write_text(SOURCE.format(half=half))
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.delitem(__import__("sys").modules, "constants", raising=False)
    spec = spec_from_file_location("drag", folder / "drag.py")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return code_digest(module.dissipation)


def test_compiled_code_is_found_by_what_the_users_code_says_and_names(tmp_path, monkeypatch):
    """Two users' files of one name are two, an edited one is another, a moved one is the same."""
    first = digest_of(tmp_path / "a", monkeypatch)
    assert digest_of(tmp_path / "b", monkeypatch) == first
    edited = digest_of(tmp_path / "c", monkeypatch, half="0.50001")
    assert len({first, edited, digest_of(tmp_path / "d", monkeypatch, rate="2.0")}) == 3


def wrong(energy=None, dissipation=None, of_node=lambda mesh: mesh.dl):
    """A term with these functions, as a user would write it."""
    functions = {"energy": energy, "dissipation": dissipation}
    contents = {name: staticmethod(each) for name, each in functions.items() if each is not None}
    contents |= {"coefficients": lambda self, mesh: of_node(mesh), "__annotations__": {}}
    kind = dataclass(frozen=True)(type("Wrong", (), contents))
    kind.__qualname__ = f"Wrong{id(kind)}"
    kind.__name__ = kind.__qualname__
    return register_term(kind)()


def swims(term):
    return lambda: Simulator(trapped(term))


REFUSED = {
    "no dataclass": (lambda: register_term(int), "A term is a frozen dataclass"),
    "not registered": (lambda: trapped(3.0), "Scene.terms must be a tuple of terms of classes"),
    "no tuple": (lambda: Scene(terms=[Trap()]), "Scene.terms must be a tuple"),
    "a body": (lambda: Scene(Seastar(body=Body(radius=0.02)), terms=(Trap(),)), "know of no body"),
    "slopes": (
        swims(wrong(lambda c, x, y: (c * x * x, (c * x, 0.0 * y), (c, 0.0 * c, 0.0 * c)))), "has other slopes than",
    ),
    "second slopes": (
        swims(wrong(lambda c, x, y: (c * x * x, (2.0 * c * x, 0.0 * y), (c, 0.0 * c, 0.0 * c)))),
        "has other second slopes than",
    ),
    "energy from drag": (
        swims(wrong(None, lambda c, x, y: (-0.5 * c * x * x, (-c * x, 0.0 * y), (-c, 0.0 * c, 0.0 * c)))),
        "must be convex and least at rest",
    ),
    "other numbers": (
        swims(wrong(lambda c, x, y: c * x)), "on lanes, which it does not",
    ),
    "a list": (
        swims(wrong(None, lambda c, x, y: (0.5 * c * x * x, [c * x, 0.0 * y], (c, 0.0, 0.0)))), "does not compile: ",
    ),
    "a power": (swims(wrong(lambda c, x, y: (0.5 * c * x**2, (c * x, 0.0), (c, 0.0, 0.0)))), "for ** or pow"),
    "an infinite one": (
        swims(wrong(lambda c, x, y: (c / x, (-c / (x * x), 0.0 * y), (2.0 * c / (x * x * x), 0.0 * c, 0.0 * c)))),
        "is not finite where both",
    ),
    "a node too few": (swims(wrong(lambda c, x, y: c, of_node=lambda mesh: mesh.dl[1:])), "one finite number per node"),
    "a device": (lambda: Simulator(trapped(Trap()), device="scalar"), "compiled for the processor alone"),
    "derivatives": (
        lambda: differentiate(trapped(Trap()), np.zeros((1, 3)), ["commands"]), "Derivatives know the package's terms",
    ),
    "error bars": (lambda: Simulator(trapped(Trap()), error_bars=True), "Nobody has measured how far"),
    "symmetry": (lambda: require_symmetry(trapped(Trap())), "does not say that turns and mirrors leave it"),
    "Gauss": (
        lambda: register_scheme("gauss", [[0.25, 0.25 - math.sqrt(3) / 6], [0.25 + math.sqrt(3) / 6, 0.25]], [0.5] * 2),
        "Stages are solved one after the other",
    ),
    "an explicit stage": (lambda: register_scheme("trapezium", [[0, 0], [0.5, 0.5]], [0.5, 0.5]), "Stages are solved"),
    "no sum": (lambda: register_scheme("half", [[1.0]], [0.5]), "must add up to 1"),
    "unstable": (lambda: register_scheme("unstable", [[0.3]], [1.0]), "is not A-stable"),
    "no tableau": (lambda: register_scheme("row", [[1.0, 0.0]], [1.0]), "A tableau is finite numbers"),
    "a name that is taken": (lambda: register_scheme("sdirk2", [[1.0]], [1.0]), "with other numbers already"),
    "no name": (lambda: register_scheme("", [[1.0]], [1.0]), "must be a text"),
    "contact": (
        lambda: Simulator(Scene(contact=Contact(), numerics=Numerics("crouzeix3"))), "does not end with its last stage",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("call", "sentence"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_done_is_said_in_a_sentence(call, sentence):
    with assert_refused(sentence):
        call()


def test_error_bars_know_own_terms():
    scene = replace(trapped(Trap(c=0.02)), numerics=Numerics("sdirk2", 5e-3))
    simulator = Simulator(scene, error_bars=True)
    assert np.isfinite(simulator.stroke([[0, 1, -1]]).error_estimate).all()
