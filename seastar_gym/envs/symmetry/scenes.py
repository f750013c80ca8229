"""Scenes that have the symmetry of the regular polygon, or a lesser one, and the reasons why others have none."""

from collections.abc import Iterable, Iterator

from seastar_gym.envs.randomization import LIMB_STRENGTHS, DomainRandomization
from seastar_gym.envs.symmetry.group import Group
from seastar_gym.scene import Scene
from seastar_gym.scene.actuators.actuator import Actuator, Mirror, complete, is_actuator
from seastar_gym.scene.checks import require_kind, shown
from seastar_gym.scene.symmetry import SAME, PointGroup


def require_symmetry(scene: Scene, randomization: DomainRandomization | None = None) -> None:
    """ValueError for scenes, and draws of their numbers, that every turn and mirror would change."""
    why = next(_asymmetries(scene, () if randomization is None else randomization.distributions), None)
    if why is not None:
        raise ValueError(f"This scene has neither the symmetry of the regular polygon nor a lesser one: {why}.")


def symmetry_of(scene: Scene) -> Group:
    """Turns and mirrors that leave the robot of a scene unchanged: all of its polygon, or those that there are.

    Robots of the chapter's discretisation have all or none.
    """
    require_kind("scene", scene, Scene, "a Scene")
    robot, nothing = scene.robot, tuple(range(scene.robot.n_limbs))
    if robot.discretisation == "chapter":
        return robot.n_limbs if robot.is_symmetric else PointGroup(1, None, (nothing, nothing))
    group = robot.point_group(_feels_directions(scene))
    is_whole = robot.is_symmetric and group.n_turns == robot.n_limbs and group.axis == 0.0
    return robot.n_limbs if is_whole else group


def _feels_directions(scene: Scene) -> bool:
    """Whether fluid that moves along with a body is that of an ellipse along its axes."""
    body, fluid = scene.robot.body, scene.fluid
    if body is None or fluid is None or fluid.added_mass_coefficient is None:
        return False
    along, across = body.shape.widths
    return abs(along - across) > SAME


def memory_mirror(actuator: Actuator) -> Mirror:
    """What a mirror does to the numbers that are observed of a limb's actuator; empty without memory."""
    if not is_actuator(actuator):
        raise ValueError(f"actuator must be an actuator, such as SmaWires, not {shown(actuator)}.")
    known = complete(actuator)
    return (known.mirror or ())[: known.observe(known.rest).shape[-1]]


def _asymmetries(scene: Scene, drawn: Iterable[str]) -> Iterator[str]:
    """Reasons why a scene, some of whose numbers are drawn, is not symmetric."""
    group = symmetry_of(scene)
    if isinstance(group, PointGroup) and group.is_trivial:
        yield "its limbs are not alike, straight and evenly spread" + (
            "" if scene.robot.body is None else " around a body of their symmetry"
        )
    if len(set(scene.limb_strengths)) > 1:
        yield "its limbs are not equally strong"
    if complete(scene.actuator).mirror is None:
        yield "its actuators remember what they did, and do not say what a mirror makes of it (`mirror`)"
    if any(node != 0 for node in scene.held_nodes):
        yield "nodes of limbs are held"
    if scene.loads:
        yield "its nodes are loaded"
    if scene.gravity is not None:
        yield "gravity has a direction"
    if scene.fluid is not None and scene.fluid.current is not None:
        yield "its water has a current"
    for name in drawn:
        if name == LIMB_STRENGTHS or name.startswith("robot.limbs."):
            yield f"{name} is drawn for every limb by itself"
