"""Robots with a body: conservation, closed forms, limits and symmetry."""

import math

import numpy as np
import pytest

from momenta import cross
from seastar_gym import Attachment, Body, Numerics, Scene, Seastar, Simulator, SmaPulse, Water

MIDPOINT = Numerics("implicit-midpoint", 1e-3, newton_tolerance=1e-10)
SPECK = {"n_limbs": 2, "nodes_per_limb": 2, "limb_length": 1e-3, "rod_radius": 1e-4, "density": 1.0}
"""Limbs without weight, for bodies by themselves."""
AT_HUB = (Attachment(0.0, 0.0, 0.0), Attachment(0.0, 0.0, math.pi))


def alone(body: Body, fluid: Water | None, numerics: Numerics = MIDPOINT, **parts) -> Simulator:
    """A body with a limb that is next to nothing, in a scene without actuation."""
    return Simulator(Scene(Seastar(**SPECK, body=body), fluid, SmaPulse(0.0), numerics, **parts))


def set_moving(simulator: Simulator, velocity: tuple[float, float], spin: float) -> None:
    """Rigid motion from rest."""
    q = simulator.positions
    v = np.array(velocity) + spin * np.stack([-q[..., 1], q[..., 0]], axis=-1)
    simulator.set_state(simulator.get_state()._replace(velocities=v, spin=np.full(len(q), spin)))


def test_a_robot_with_a_lopsided_body_turns_about_its_centre_of_mass():
    """Its hub goes round the centre, which moves on uniformly: off by the square of the step."""
    errors = []
    for h in (4e-3, 2e-3):
        body = Body(radius=0.02, mass=0.01, centre_of_mass=(0.01, 0.0), attachments=AT_HUB)
        simulator = alone(body, None, Numerics("implicit-midpoint", h, 1e-11))
        set_moving(simulator, (0.0, 0.0), 5.0)
        simulator.advance(0.4, [[0.0, 0.0]])
        # Centre at (0.01, 0) with the velocity (0, 0.05).
        exact = np.array([0.01, 0.02]) - 0.01 * np.array([math.cos(2.0), math.sin(2.0)])
        errors.append(np.abs(simulator.hub_position()[0] - exact).max())
    assert errors[1] < 2e-5 and errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)


def complete_elliptic(k: float) -> float:
    a, b = 1.0, math.sqrt(1.0 - k * k)
    while abs(a - b) > 1e-15:
        a, b = 0.5 * (a + b), math.sqrt(a * b)
    return math.pi / (2.0 * a)


@pytest.mark.slow
def test_a_body_held_at_its_hub_swings_with_the_period_of_a_pendulum():
    mass, away, inertia, swing = 5e-3, 0.01, 1e-6, 1.0
    body = Body(radius=0.02, mass=mass, inertia=inertia, centre_of_mass=(away, 0.0), attachments=AT_HUB)
    rate = math.sqrt(mass * 9.81 * away / (inertia + mass * away**2))
    period = 4.0 * complete_elliptic(math.sin(0.5 * swing)) / rate
    angles = []
    for h in (2e-3, 1e-3):
        numerics = Numerics("implicit-midpoint", h, newton_tolerance=1e-11)
        simulator = alone(body, None, numerics, held_nodes=(0,), gravity=(0.0, -9.81))
        simulator.reset(heading=swing - 0.5 * math.pi)
        energy = -mass * 9.81 * away * math.cos(swing)
        simulator.advance(0.25 * period, [[0.0, 0.0]])
        hanging = simulator.orientation()[0] + 0.5 * math.pi
        now = simulator.kinetic_energy()[0] - mass * 9.81 * away * math.cos(hanging)
        assert now == pytest.approx(energy, abs=1e-3 * mass * 9.81 * away)
        angles.append(abs(hanging))
    assert angles[1] < 1e-3 and angles[0] / angles[1] == pytest.approx(4.0, rel=0.1)


@pytest.mark.parametrize("heading", [0.0, 0.5 * math.pi])
def test_a_heavy_body_sinks_with_the_terminal_speed_of_its_side(heading):
    body = Body.rectangle(0.06, 0.02, mass=0.03, drag_along=0.7, drag_across=1.9, attachments=AT_HUB)
    simulator = alone(body, Water(), Numerics("sdirk2", 0.01), gravity=(0.0, -9.81))
    simulator.reset(heading=heading)
    simulator.advance(5.0, [[0.0, 0.0]])
    area, C = (0.06, 1.9) if heading == 0.0 else (0.02, 0.7)
    weight = (0.03 - 1000.0 * 0.06 * 0.02 * 0.01 - 2.0 * 999.0 * math.pi * 1e-4**2 * 1e-3) * 9.81
    limbs = 2.0 * 1e-3 * 2e-4  # their drag is alike in all directions
    speed = math.sqrt(weight / (0.5 * 1000.0 * (C * area * 0.01 + limbs)))
    np.testing.assert_allclose(simulator.velocities[0, 0], [0.0, -speed], rtol=1e-6, atol=1e-9)
    assert simulator.orientation()[0] == pytest.approx(heading, abs=1e-6)


def test_a_turning_plate_slows_down_as_strips_of_it_say():
    """d(omega)/dt = -k omega^2/I, k = rho C h a^4/64 for the long sides, and of the short ones likewise."""
    body = Body.rectangle(0.06, 0.01, mass=0.01, attachments=AT_HUB)
    simulator = alone(body, Water())
    set_moving(simulator, (0.0, 0.0), 8.0)
    simulator.advance(0.5, [[0.0, 0.0]])
    k = 0.5 * 1000.0 * 0.01 * (0.06**4 + 0.01**4) / 32.0
    inertia = 0.01 * (0.06**2 + 0.01**2) / 12.0
    assert simulator.spin()[0] == pytest.approx(8.0 / (1.0 + k * 8.0 * 0.5 / inertia), rel=0.01)


@pytest.mark.slow
def test_an_ellipse_in_an_ideal_fluid_keeps_impulse_and_energy():
    """Kirchhoff's equations: the mass of the fluid turns with the body."""
    body = Body.rectangle(0.08, 0.02, mass=0.01, attachments=AT_HUB)
    numerics = Numerics("sdirk2", 1e-3, 1e-10)  # without ringing of the limbs, which spoils first guesses
    simulator = alone(body, Water(drag_coefficient=0.0, added_mass_coefficient=1.0), numerics)
    set_moving(simulator, (0.05, 0.02), 1.0)
    rods = simulator.coefficients.rods(0)
    own = np.diag(rods.inertia.node[0] + rods.body.added_mass[[0, 2]])

    def kept():
        c, s = math.cos(simulator.orientation()[0]), math.sin(simulator.orientation()[0])
        R, v, omega = np.array([[c, -s], [s, c]]), simulator.velocities[0, 0], simulator.spin()[0]
        impulse = R @ own @ R.T @ v
        spin = rods.body.inertia[0] * omega + cross(simulator.positions[0, 0], impulse)
        return np.array([*impulse, spin, v @ impulse + rods.body.inertia[0] * omega**2])

    before = kept()
    simulator.advance(1.0, [[0.0, 0.0]])
    assert abs(simulator.orientation()[0]) > 0.3
    np.testing.assert_allclose(kept(), before, rtol=2e-4)
