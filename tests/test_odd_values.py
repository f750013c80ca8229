"""Whatever is given as an argument is accepted, or refused with a ValueError of one sentence."""

import inspect

import gymnasium as gym
import numpy as np
import pytest

from agents.hyperparameters import Hyperparameters
from odd_values import ODD
from seastar_gym import (
    Contact,
    DomainRandomization,
    GridCurrent,
    Limb,
    Limited,
    LogUniform,
    MeasuredCurve,
    Normal,
    Numerics,
    RewardWeights,
    Scene,
    Seastar,
    ShearCurrent,
    Simulator,
    SmaLimb,
    SmaPulse,
    SmaWires,
    ThermalSma,
    Uniform,
    UniformCurrent,
    Vortex,
    Water,
    relaxation_time,
)  # fmt: skip
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.identify import Measurement, get_parameter, identify
from seastar_gym.scene.fidelity import cheapest, promise

CURVE = {"times": (0.0, 0.5, 1.0), "angles": (0.0, 0.5, 0.0)}
FAST = Scene(numerics=Numerics.preset("fast"))
AT_REST = Simulator(FAST, 2)


def state(**changes):
    return AT_REST.set_state(AT_REST.get_state()._replace(**changes))


def measurement(time, positions, nodes, commands):
    return Measurement(time, positions, nodes, commands)


def fit(parameters, confidence=0.95):
    """Only what is refused before the fit begins."""
    return identify(FAST, parameters, Measurement(np.zeros(1), np.zeros((1, 1, 2)), (0,), np.zeros((1, 4))), confidence)


def step(action):
    env = SeastarSwimEnv(scene=FAST)
    env.reset(seed=0)
    return env.step(action)


def swirl(x, y):
    return -y, x


def swim_path(path="pentagon"):
    return SeastarSwimEnv(scene=FAST).reset(options={"path": path})


def reset(seed, options):
    return SeastarSwimEnv(scene=FAST).reset(seed=seed, options=options)


def reset_batch(seed, options):
    return SeastarSwimVectorEnv(num_envs=2, scene=FAST).reset(seed=seed, options=options)


TARGETS = [
    (Seastar, {}), (Limb, {}), (Water, {}), (Contact, {}), (SmaPulse, {}), (MeasuredCurve, CURVE), (ThermalSma, {}),
    (SmaWires, {}), (SmaLimb, {}), (AT_REST.advance, {"duration": 0.1, "commands": None}),
    (Limited, {"actuator": SmaPulse()}), (Numerics, {}), (Numerics.preset, {"fidelity": "fast"}),
    (Scene.for_error, {"error": 0.05}), (Scene.preset, {"fidelity": "fast"}), (Scene, {}), (UniformCurrent, {}),
    (ShearCurrent, {"rate": 1.0}),
    (Vortex, {"circulation": 1.0}), (Uniform, {"low": 1.0, "high": 2.0}), (LogUniform, {"low": 1.0, "high": 2.0}),
    (Normal, {"mean": 1.0, "deviation": 1.0}), (DomainRandomization, {"distributions": {}}), (RewardWeights, {}),
    (relaxation_time, {"loss_factor": 0.1, "frequency": 10.0}), (promise, {"setting": "fast"}),
    (cheapest, {"error": 0.05}), (Simulator, {"scene": FAST, "n_robots": 2}), (AT_REST.reset, {}),
    (AT_REST.set_limb_strengths, {"strengths": 1.0}), (AT_REST.set_scene, {"scene": FAST}),
    (AT_REST.set_state, {"state": AT_REST.get_state()}), (state, AT_REST.get_state()._asdict()),
    (AT_REST.stroke, {"commands": np.zeros((2, 5))}), (step, {"action": np.zeros(5, int)}),
    (fit, {"parameters": ["x"]}),
    (GridCurrent, {"corner": (0.0, 0.0), "spacing": 0.1, "velocities": np.zeros((2, 2, 2))}), (swim_path, {}),
    (GridCurrent.from_function, {"function": swirl, "x": (0.0, 0.5), "y": (0.0, 0.5), "spacing": 0.1}),
    (SeastarSwimEnv, {"scene": FAST}), (SeastarSwimVectorEnv, {"num_envs": 2, "scene": FAST}),
    (reset, {"seed": 0, "options": None}), (reset_batch, {"seed": 0, "options": None}),
    (measurement, {"time": np.zeros(1), "positions": np.zeros((1, 1, 2)), "nodes": (0,), "commands": np.zeros((1, 5))}),
    (get_parameter, {"scene": FAST, "name": "fluid.density"}), (Hyperparameters, {}),
]  # fmt: skip


def outcome(call, arguments):
    """None where the arguments are accepted or refused as they should be, else what was raised."""
    try:
        call(**arguments)
    except (ValueError, gym.error.Error) as refused:
        text = str(refused)
        return None if text.endswith(".") and "\n" not in text else f"no sentence: {text!r}"
    except Exception as other:
        return f"{type(other).__name__}: {other}"
    return None


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("call, arguments", TARGETS, ids=lambda one: getattr(one, "__qualname__", ""))
def test_odd_values_are_accepted_or_refused_in_a_sentence(call, arguments):
    parameters = [p for p in inspect.signature(call).parameters.values() if p.kind is not p.VAR_KEYWORD]
    wrong = [
        f"{parameter.name}={name}: {found}"
        for parameter in parameters
        for name, make in ODD.items()
        if (found := outcome(call, {**arguments, parameter.name: make()})) is not None
    ]
    assert not wrong, "\n".join([f"{len(wrong)} of {len(parameters) * len(ODD)}", *wrong])
