"""Scenes that have the symmetry of the regular polygon, and the reasons why others have not."""

from collections.abc import Iterable, Iterator

from seastar_gym.envs.randomization import LIMB_STRENGTHS, DomainRandomization
from seastar_gym.scene import Scene
from seastar_gym.scene.actuators.actuator import Actuator, Mirrored, StatefulActuator
from seastar_gym.scene.actuators.heating import Mirror


def require_symmetry(scene: Scene, randomization: DomainRandomization | None = None) -> None:
    """ValueError for scenes, and draws of their numbers, that a turn or a mirror would change."""
    why = next(_asymmetries(scene, () if randomization is None else randomization.distributions), None)
    if why is not None:
        raise ValueError(f"This scene has not the symmetry of the regular polygon: {why}.")


def memory_mirror(actuator: Actuator) -> Mirror:
    """What a mirror does to the numbers that are observed of a limb's actuator; empty without memory."""
    if not isinstance(actuator, StatefulActuator) or not isinstance(actuator, Mirrored):
        return ()
    return actuator.mirror[: actuator.observe(actuator.rest).shape[-1]]


def _asymmetries(scene: Scene, drawn: Iterable[str]) -> Iterator[str]:
    """Reasons why a scene, some of whose numbers are drawn, is not symmetric."""
    if not scene.robot.is_symmetric:
        yield "its limbs are not alike, straight and evenly spread" + (
            "" if scene.robot.body is None else " around a body of their symmetry"
        )
    if len(set(scene.limb_strengths)) > 1:
        yield "its limbs are not equally strong"
    if isinstance(scene.actuator, StatefulActuator) and not isinstance(scene.actuator, Mirrored):
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
        if name.startswith(("robot.body.drag_a", "robot.body.added_mass_a")):
            yield f"{name} is drawn for one direction by itself"
