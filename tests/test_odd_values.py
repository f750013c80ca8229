"""Whatever is given as an argument is accepted, or refused with a ValueError of one sentence."""

import inspect
import traceback
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

import documented
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
ROOT = Path(__file__).parents[1]
FUNCTIONS = ("watch", "on_step", "make", "function")
"""Arguments that are functions of the caller's: what they raise is theirs."""
UNUSED = ("state", "episode_start", "deterministic", "info")
"""Arguments that are there for the form alone, at most of the calls."""
SHAPES = ((), (2,), (5,), (2, 2), (2, 5), (2, 2, 2), (1, 2), (1, 1, 2))


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


def is_our_own(refusal):
    """Whether a statement `raise` of this repository refused, rather than a library or an operation deep inside."""
    frame = traceback.extract_tb(refusal.__traceback__)[-1]
    return Path(frame.filename).is_relative_to(ROOT) and (frame.line or "").startswith("raise")


def outcome(call, arguments):
    """None where the arguments are accepted or refused as they should be, else what was raised."""
    try:
        call(**arguments)
    except (ValueError, FileNotFoundError, gym.error.Error) as refused:
        text = str(refused)
        if isinstance(refused, OSError) and refused.errno is not None:
            return None  # of which commands make a sentence
        if not text.endswith(".") or "\n" in text:
            return f"no sentence: {text!r}"
        return None if is_our_own(refused) else f"deep inside: {text!r}"
    except OSError as refused:
        return None if refused.errno is not None else f"no sentence: {refused!r}"
    except Exception as other:
        return f"{type(other).__name__}: {other}"
    return None


def wrong_outcomes(call, arguments, parameters):
    return [
        f"{parameter}={name}: {found}"
        for parameter in parameters
        for name, make in ODD.items()
        if not (parameter in FUNCTIONS and callable(make()))
        if (found := outcome(call, {**arguments, parameter: make()})) is not None
    ]


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("call, arguments", TARGETS, ids=lambda one: getattr(one, "__qualname__", ""))
def test_odd_values_are_accepted_or_refused_in_a_sentence(call, arguments):
    parameters = [p.name for p in inspect.signature(call).parameters.values() if p.kind is not p.VAR_KEYWORD]
    wrong = wrong_outcomes(call, arguments, parameters)
    assert not wrong, "\n".join([f"{len(wrong)} of {len(parameters) * len(ODD)}", *wrong])


@pytest.fixture(autouse=True)
def folder_of_ones_own(tmp_path, monkeypatch):
    """Odd names of files are names of files."""
    monkeypatch.chdir(tmp_path)


DOCUMENTED = sorted(documented.documented().keys() - documented.UNCALLED)


def calls_of(name):
    return [(call, arguments) for known, call, arguments in documented.calls() if known == name]


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", DOCUMENTED)
def test_what_is_documented_refuses_odd_values_itself(name):
    wrong = [each for call, arguments in calls_of(name) for each in wrong_outcomes(call, arguments, arguments)]
    assert calls_of(name) and not wrong, "\n".join([f"{len(wrong)}", *wrong])


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("call, arguments", TARGETS, ids=lambda one: getattr(one, "__qualname__", ""))
def test_masked_entries_are_refused(call, arguments):
    """What a mask hides is no value of the caller's."""
    parameters = [p.name for p in inspect.signature(call).parameters.values() if p.kind is not p.VAR_KEYWORD]
    assert not taken_masked(call, arguments, parameters)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", DOCUMENTED)
def test_masked_entries_are_refused_by_what_is_documented(name):
    taken = [each for call, arguments in calls_of(name) for each in taken_masked(call, arguments, arguments)]
    assert not taken


def taken_masked(call, arguments, parameters):
    return [
        f"{parameter}: {shape}"
        for parameter in parameters
        if parameter not in UNUSED
        for shape in SHAPES
        if outcome_of_masked(call, {**arguments, parameter: masked(shape)})
    ]


def masked(shape):
    """Numbers of which the first is masked."""
    numbers = np.ma.array(np.zeros(shape), mask=np.zeros(shape, bool))
    numbers.ravel()[:1] = np.ma.masked
    return numbers


def outcome_of_masked(call, arguments):
    """Whether it was taken, or refused by something deep inside."""
    try:
        call(**arguments)
    except (ValueError, gym.error.Error) as refused:
        return not is_our_own(refused)
    return True
