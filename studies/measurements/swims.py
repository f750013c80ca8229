"""How far the chapter's robot swims with measured limbs instead of the ramp of Fig. 13.5b."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from seastar_gym.controllers.contract import Policy, actions_of
from seastar_gym.controllers.learned import LearnedPolicy, pretrained
from seastar_gym.controllers.scripted import scripted
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.evaluation.swim import Swim, swim
from seastar_gym.gaits import PAIRS, pair_gait, straight_gait
from seastar_gym.scene import Scene, SmaLimb, SmaPulse
from seastar_gym.scene.actuators.actuator import Actuator
from seastar_gym.scene.actuators.sma_limb import MEASURED
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.simulator import Simulator, SolverStatus

Floats = NDArray[np.float64]

FIDELITY: Fidelity = "accurate"
STROKES = 20
"""Strokes from rest, of which the second half is measured: limbs are as warm then as they get."""
GAITS = {
    **{name: command[None] for name, command in PAIRS.items()},
    "{2+,5-}": straight_gait(),
    "{2+,5-}, {3+,4-}": np.concatenate([straight_gait(), pair_gait(3, 4)]),
}
"""The pairs of Fig. 13.8, the straight swim, and the alternation of two pairs; commands of shape (n, n_limbs)."""


MOST_STROKES = 400
"""Strokes after which a swim round the pentagon ends."""


def actuators() -> dict[str, Actuator]:
    """The chapter's pulse and every measured limb, at its own period."""
    limbs = {f"{liquid_metal} %": SmaLimb.preset(liquid_metal) for liquid_metal in MEASURED}
    return {"pulse": SmaPulse(), **limbs}


def distances(actuator: Actuator) -> Floats:
    """Distance of the hub per stroke [mm] of every gait, over the second half of the strokes from rest."""
    simulator = Simulator(replace(Scene.preset(FIDELITY), actuator=actuator), len(GAITS))
    commands = np.stack([np.resize(gait, (STROKES, gait.shape[1])) for gait in GAITS.values()], axis=1)
    half = np.zeros((len(GAITS), 2))
    for stroke, command in enumerate(commands):
        if stroke == STROKES // 2:
            half = simulator.hub_position().copy()
        simulator.stroke(command)
        if simulator.failed.any():
            raise RuntimeError(SolverStatus.NOT_CONVERGED.sentence)
    return np.asarray(1e3 * np.linalg.norm(simulator.hub_position() - half, axis=1) / (STROKES - STROKES // 2))


def policies(period: float) -> dict[str, Policy]:
    """The bundled policy of strokes, trained with the ramp, and the chapter's gait, for strokes so long [s]."""
    trained = pretrained("strokes")
    ramp = replace(trained.scene, actuator=SmaPulse(heating_time=0.1 * period, cooling_time=0.9 * period))
    learned = LearnedPolicy(trained.description._replace(scene=ramp), trained.weights)
    return {"learned": learned, "pentagon": scripted("pentagon")}


def round_the_pentagon(name: str, policy: Policy, scene: Scene) -> Swim:
    """Swim of a policy that does not see how warm limbs are, as with the ramp there is nothing to see."""
    actions = actions_of(policy, scene.robot.n_limbs)
    env = SeastarSwimEnv("pentagon", scene=scene, actions=actions, observe_actuators=False)
    return swim(name, policy, env, max_strokes=MOST_STROKES)
