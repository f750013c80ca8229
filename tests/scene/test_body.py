"""What a body is: outlines, masses, drag and added mass from them, attachments and symmetry."""

import math
from dataclasses import replace

import numpy as np
import pytest

from seastar_gym import Attachment, Body, Limb, Scene, Seastar, Water
from seastar_gym.model import make_rods
from seastar_gym.scene.body import Outline, is_convex

TRIANGLE = ((0.03, -0.01), (-0.01, 0.02), (-0.02, -0.02))
HEXAGON = tuple((0.02 * math.cos(a), 0.02 * math.sin(a)) for a in np.arange(6) * math.pi / 3.0)
CORNERS = tuple(Attachment(x, y, d) for x, y, d in
                ((0.03, 0.015, 1.0), (-0.03, 0.015, 2.0), (-0.03, -0.015, -2.0), (0.03, -0.015, -1.0)))  # fmt: skip


@pytest.mark.parametrize("points", [TRIANGLE, HEXAGON, Body.rectangle(0.06, 0.03).outline])
def test_moments_of_an_outline_are_those_of_points_in_it(points):
    outline, grid = Outline(0.0, points), np.linspace(-0.04, 0.04, 1601)
    x, y = np.meshgrid(grid, grid)
    normals, _, places = outline.sides()
    inside = np.all([(x - a) * n + (y - b) * m < 0.0 for (n, m), (a, b) in zip(normals, places, strict=True)], axis=0)
    cell = (grid[1] - grid[0]) ** 2
    assert outline.area == pytest.approx(inside.sum() * cell, rel=3e-3)
    np.testing.assert_allclose(outline.centre, [x[inside].mean(), y[inside].mean()], atol=3e-5)
    cx, cy = outline.centre
    about = ((x - cx) ** 2 + (y - cy) ** 2)[inside].sum() * cell
    assert outline.second_moment == pytest.approx(about, rel=5e-3)


def test_heights_are_over_the_nearest_side_or_corner():
    plate, places = Body.rectangle(0.06, 0.02).shape, [[0.02, 0.02], [-0.04, 0.0], [0.033, 0.014], [0.0, 5e-3]]
    np.testing.assert_allclose(plate.height_over(np.array(places)), [0.01, 0.01, 5e-3, -5e-3], rtol=1e-12)
    np.testing.assert_allclose(Body(radius=0.02).shape.height_over(np.array([[0.03, -0.04]])), [0.03], rtol=1e-12)


def on_body(body: Body, **water):
    return make_rods(Scene(Seastar(4, 5, body=body), Water(**water)))


@pytest.mark.parametrize("attachments", [CORNERS, (Attachment(0.02, 0.01, 0.0),) * 4])
def test_mass_moment_and_inertia_are_those_of_body_and_roots(attachments):
    body = Body.rectangle(0.06, 0.03, mass=0.02, centre_of_mass=(2e-3, -1e-3), attachments=attachments)
    rods = on_body(body)
    root = 1000.0 * math.pi * 1.6e-3**2 * 0.1 / 4 / 2
    places = np.array([[at.x, at.y] for at in attachments])
    assert rods.inertia.node[0] == pytest.approx(0.02 + 4 * root)
    np.testing.assert_allclose(rods.body.moment, 0.02 * np.array([2e-3, -1e-3]) + root * places.sum(axis=0), atol=1e-18)
    inertia = 0.02 * ((0.06**2 + 0.03**2) / 12.0 + 5e-6) + root * (places**2).sum()
    assert rods.body.inertia[0] == pytest.approx(inertia)
    disc = Body(radius=0.02, height=0.01)
    assert disc.mass_at(1200.0) == pytest.approx(1200.0 * math.pi * 0.02**2 * 0.01)
    assert disc.inertia_at(1200.0) == pytest.approx(0.5 * disc.mass_at(1200.0) * 0.02**2)


def force_and_torque(rods, velocity, omega) -> np.ndarray:
    """Drag of a body that is not turned [N], [N m], from its coefficients."""
    c, strips = rods.drag.node[0], rods.body.strips.reshape(-1, 4)
    w = np.array(velocity)
    flows = strips[:, :2] @ w + strips[:, 2] * omega
    pushed = -(strips[:, 3] * np.abs(flows) * flows) @ strips[:, :3]
    return pushed - np.append(c * np.linalg.norm(w) * w, 0.0)


def test_drag_of_outlines_is_that_of_their_frontal_area_unless_coefficients_are_given():
    plate, disc = (on_body(body, drag_coefficient=1.2) for body in (Body.rectangle(0.06, 0.03), Body(radius=0.02)))
    given = on_body(Body.rectangle(0.06, 0.03, drag_along=0.3, drag_turning=2.0), drag_coefficient=1.2)
    per_area, turning = 0.5 * 1000.0 * 1.2 * 0.01, (0.06**4 + 0.03**4) / 32.0
    for rods, velocity, omega, expected in (
        (plate, (0.2, 0.0), 0.0, [-per_area * 0.03 * 0.04, 0, 0]),
        (plate, (0.0, 0.2), 0.0, [0, -per_area * 0.06 * 0.04, 0]),
        (plate, (0.0, 0.0), 3.0, [0, 0, -per_area * turning * 9.0]),
        (disc, (0.12, 0.16), 5.0, -per_area * 0.04 * 0.2 * np.array([0.12, 0.16, 0.0])),
        (given, (1.0, 0.0), 0.0, [-5.0 * 0.3 * 0.03, 0, 0]),
        (given, (0.0, 1.0), 0.0, [0, -per_area * 0.06, 0]),
        (given, (0.0, 0.0), 1.0, [0, 0, -5.0 * 2.0 * 0.06**4 / 32.0]),
    ):
        found, close = force_and_torque(rods, velocity, omega), 0.01 if omega == 3.0 else 1e-7
        np.testing.assert_allclose(found, expected, rtol=close, atol=1e-15)


@pytest.mark.parametrize("own", [{}, {"drag_along": 0.3, "drag_turning": 2.0}])
@pytest.mark.parametrize("body", [Body(radius=0.02), Body.rectangle(0.06, 0.03)])
def test_a_drag_coefficient_of_the_body_stands_for_the_fluids(body, own):
    """And leaves that of limbs as it is."""
    same = on_body(replace(body, **own), drag_coefficient=1.9)
    draggy = on_body(replace(body, drag_coefficient=1.9, **own), drag_coefficient=1.2)
    for motion in (((0.1, 0.2), 0.0), ((0.0, 0.0), 3.0)):
        np.testing.assert_array_equal(force_and_torque(draggy, *motion), force_and_torque(same, *motion))
    np.testing.assert_allclose(draggy.drag.node[1:], 1.2 / 1.9 * same.drag.node[1:])


def test_added_mass_is_that_of_an_ellipse():
    body = Body.rectangle(0.06, 0.03, mass=0.02, attachments=(Attachment(0, 0, 0),) * 4)
    rods, per_area = on_body(body, added_mass_coefficient=0.9), 1000.0 * math.pi * 0.01 * 0.9
    np.testing.assert_allclose(rods.body.added_mass, per_area / 4.0 * np.array([0.03**2, 0.0, 0.06**2]))
    fluid = per_area * (0.06**2 - 0.03**2) ** 2 / 128.0
    assert rods.body.inertia[0] == pytest.approx(0.02 * (0.06**2 + 0.03**2) / 12.0 + fluid)


def test_limbs_begin_where_and_as_they_are_attached_or_at_the_rim_in_their_direction():
    star = Seastar(5, 6, body=Body(radius=0.02))
    np.testing.assert_allclose(np.hypot(*star.nodes()[1:].reshape(5, 5, 2)[:, -1].T), 0.12)
    frame = Seastar(4, 6, body=Body.rectangle(0.06, 0.03, attachments=CORNERS))
    steps = [[at.x + 0.02 * math.cos(at.direction), at.y + 0.02 * math.sin(at.direction)] for at in CORNERS]
    np.testing.assert_allclose(frame.nodes()[1::5], steps, atol=1e-15)
    roots = [limb.root for limb in Seastar(4, 5, body=Body.rectangle(0.06, 0.03)).limb_shapes()]
    np.testing.assert_allclose(roots, [(0.03, 0.0), (0.0, 0.015), (-0.03, 0.0), (0.0, -0.015)], atol=1e-15)


def test_a_joint_is_a_spring_in_a_row_with_the_clamp():
    stiff, joint = Scene(), Scene(Seastar(limbs=(Limb(joint_stiffness=2e-5), *(Limb(),) * 4)))
    K, with_joint = (make_rods(scene).bending for scene in (stiff, joint))
    assert with_joint.EI_over_dl[0] == pytest.approx(1.0 / (1.0 / K.EI_over_dl[0] + 1.0 / 2e-5))
    assert with_joint.dl_over_EI[0] == pytest.approx(1.0 / with_joint.EI_over_dl[0])
    np.testing.assert_array_equal(with_joint.EI_over_dl[1:], K.EI_over_dl[1:])


@pytest.mark.parametrize("size", [1e-200, 1e-6, 1.0, 1e200])
def test_whether_an_outline_is_convex_does_not_depend_on_its_size(size, recwarn):
    points = tuple((size * x, size * y) for x, y in TRIANGLE)
    assert is_convex(points) and not is_convex(points[::-1]) and not recwarn
