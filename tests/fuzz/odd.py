"""Arguments that nobody should give, for everything that takes arguments."""

# ruff: noqa: C408 - what is given reads as a call
from collections.abc import Callable
from functools import partial
from random import Random
from typing import Any

import numpy as np

import seastar_gym
from documented import complete
from odd_values import ODD, REFUSED, TAKEN, outcome
from seastar_gym import (
    AlongLimb,
    Body,
    Contact,
    DomainRandomization,
    GridCurrent,
    HeadingTargets,
    Numerics,
    Scene,
    Seastar,
    Sight,
    Simulator,
    SmaLimb,
    SmaPulse,
    Stiffening,
    Uniform,
    UniformCurrent,
    scene_for,
)
from seastar_gym.accuracy import chapters_certificate, timed_certificate
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.vector import SeastarSwimVectorEnv

Calls = dict[str, tuple[Callable[..., Any], dict[str, Any]]]

VALUES = tuple(ODD.values())

FAST = Numerics.preset("fast")
SCENE = Scene(numerics=FAST)
DENSITIES = DomainRandomization({"robot.density": Uniform(900.0, 1100.0)})


MADE: Calls = {
    **{name: (getattr(seastar_gym, name), given) for name, given in {
        "Seastar": dict(nodes_per_limb=4, relaxation_time=1e-3),
        "Limb": dict(direction=0.0, length=0.1, radius=(1e-3, 2e-3), youngs_modulus=1e6, natural_curvature=1.0),
        "Body": dict(outline=((0.02, -0.01), (0.0, 0.02), (-0.02, -0.01)), mass=0.01, inertia=1e-6, drag_along=1.0,
                     centre_of_mass=(0.0, 1e-3), drag_across=1.0, drag_turning=1.0, added_mass_along=1.0,
                     added_mass_across=1.0, added_mass_turning=1.0),
        "Attachment": dict(x=0.01, y=0.0, direction=0.1), "AlongLimb": dict(share=0.5, profile=(1.0, 0.5)),
        "Stiffening": dict(ratio=2.0), "UniformCurrent": dict(u_y=0.1), "ShearCurrent": dict(rate=0.1, direction=0.1),
        "Water": dict(tangential_drag_coefficient=0.1, current=UniformCurrent(), added_mass_coefficient=1.0),
        "Vortex": dict(circulation=0.1), "Contact": dict(layer=5e-3), "SmaPulse": {}, "SmaWires": dict(period=0.5),
        "GridCurrent": dict(corner=(0.0, 0.0), spacing=0.1, velocities=np.ones((2, 2, 2))), "SmaLimb": dict(delay=0.02),
        "MeasuredCurve": dict(times=(0.0, 0.1, 1.0), angles=(0.0, 0.5, 0.0)), "ThermalSma": {},
        "Limited": dict(actuator=SmaPulse(), largest_angle=0.3, largest_rate=1.0),
        "Numerics": dict(scheme="implicit-midpoint", damping=0.002),
        "relaxation_time": dict(loss_factor=0.1, frequency=10.0), "Uniform": dict(low=0.0, high=1.0),
        "Scene": dict(numerics=FAST, held_nodes=(0,), loads=((1, 0.0, 1e-3),), limb_strengths=(1.0,) * 5,
                      contact=Contact()),
        "LogUniform": dict(low=0.1, high=1.0), "Normal": dict(mean=1.0, deviation=0.1), "RewardWeights": {},
        "DomainRandomization": dict(distributions=DENSITIES.distributions), "HeadingTargets": dict(target=(0.1, 0.2)),
        "Sight": dict(delay=Uniform(0.0, 0.1), jitter=0.1, dropout=0.1, noise=1e-3, turn_noise=0.1),
        "Simulator": dict(scene=SCENE, n_robots=2, threads=1),
    }.items()},
    "Body.rectangle": (Body.rectangle, dict(length=0.06, width=0.03, mass=0.01)),
    "Robot with a body": (Seastar, dict(body=Body(radius=0.02), along=AlongLimb(), stiffening=Stiffening(2.0),
                                        discretisation="continuum")),
    "GridCurrent.from_function": (GridCurrent.from_function, dict(
        function=lambda x, y: (0.0 * x, y), x=(0.0, 1.0), y=(0.0, 1.0), spacing=0.5)),
    "SmaLimb.preset": (SmaLimb.preset, dict(liquid_metal=20)),
    "Numerics.preset": (Numerics.preset, dict(fidelity="fast")),
    "Scene.preset": (Scene.preset, dict(fidelity="fast")),
    "scene_for": (scene_for, dict(error=0.1, any_gait=True)),
    "chapters_certificate().for_error": (chapters_certificate().for_error, dict(error=0.1, classes=("small",))),
    "chapters_certificate().of": (chapters_certificate().of, dict(scene=Scene.preset("fast"))),
    "timed_certificate": (timed_certificate, dict(decision_period=0.2)),
    "SeastarSwimEnv": (SeastarSwimEnv, dict(
        path="line", fidelity="fast", scene=SCENE, frames_per_stroke=2, randomization=DENSITIES, decision_period=1.0,
        observe_actuators=True, headings=HeadingTargets(), sight=Sight(), action_delay=1.0)),
    "SeastarSwimVectorEnv": (SeastarSwimVectorEnv, complete(SeastarSwimEnv, dict(
        num_envs=2, max_episode_steps=3, path="line", actions="pairs", fidelity="fast", scene=SCENE,
        random_heading=True, threads=1))),
}  # fmt: skip
PARTS: Calls = {name: (make, complete(make, given)) for name, (make, given) in MADE.items()}
"""What is made, and arguments with which it can be."""


def is_refused(call: Callable[..., Any], arguments: dict[str, Any], where: str) -> bool:
    """Whether a call is refused, in one sentence; anything else that goes wrong is an error of its own."""
    found = outcome(call, arguments)
    assert found in (TAKEN, REFUSED), f"{where}: {found}"
    return found == REFUSED


# --- what has a state, and must lose nothing by a refusal -------------------------------------------------------------

SIMULATOR = Simulator(SCENE, 2, threads=1)
SIMULATOR_CALLS: Calls = {
    "stroke": (SIMULATOR.stroke, dict(commands=np.zeros((2, 5)))),
    "stroke_in_parts": (lambda **given: list(SIMULATOR.stroke_in_parts(**given)),
                        dict(commands=np.zeros((2, 5)), parts=2)),
    "advance": (SIMULATOR.advance, dict(duration=0.2, commands=np.zeros((2, 5)))),
    "advance_in_parts": (lambda **given: list(SIMULATOR.advance_in_parts(**given)),
                         dict(duration=0.2, commands=None, parts=2)),
    "advance_pausing": (lambda **given: list(SIMULATOR.advance_pausing(**given)),
                        dict(duration=0.2, commands=None, pauses=[0.05, 0.1])),
    "reset": (SIMULATOR.reset, dict(mask=[True, False], heading=0.1)),
    "set_state": (SIMULATOR.set_state, dict(state=SIMULATOR.get_state())),
    "State": (lambda **fields: SIMULATOR.set_state(SIMULATOR.get_state()._replace(**fields)),
              SIMULATOR.get_state()._asdict()),
    "set_limb_strengths": (SIMULATOR.set_limb_strengths, dict(strengths=np.ones(5))),
    "set_scene": (SIMULATOR.set_scene, dict(scene=SCENE, mask=[True, True])),
}  # fmt: skip


def begin() -> None:
    """Bring what has a state into one that can be lost."""
    for env in (ENV, VECTOR_ENV):
        env.reset(seed=0, options={"path": "line"})
    SIMULATOR.set_scene(SCENE)
    SIMULATOR.set_limb_strengths(1.0)
    SIMULATOR.reset()
    SIMULATOR.stroke([[0.0, 1.0, 0.0, 0.0, -1.0]] * 2)


def check_odd_call(name: str, argument: str, value: Callable[[], Any]) -> None:
    """Call a simulator that has begun with one odd argument; what it refuses changes nothing."""
    before = SIMULATOR.get_state()
    call, arguments = SIMULATOR_CALLS[name]
    where = f"Simulator.{name}({argument}={value()!r})"
    if is_refused(call, {**arguments, argument: value()}, where):
        for one, other in zip(SIMULATOR.get_state(), before, strict=True):
            np.testing.assert_array_equal(one, other, err_msg=where)
        return
    assert np.isfinite(SIMULATOR.positions).all() and np.isfinite(SIMULATOR.time).all(), where
    begin()


ENV = SeastarSwimEnv(fidelity="fast", path="line")
VECTOR_ENV = SeastarSwimVectorEnv(2, fidelity="fast", path="line", threads=1)
ENV_CALLS: Calls = {
    f"{type(env).__name__}.{name}": (call, arguments)
    for env, actions in ((ENV, [0, 1, 0, 0, 2]), (VECTOR_ENV, [[0, 1, 0, 0, 2]] * 2))
    for name, call, arguments in (
        ("reset", env.reset, dict(seed=1, options={"path": "line"})),
        ("reset to path", partial(lambda env, path: env.reset(options={"path": path}), env), dict(path="line")),
        (
            "reset by mask",
            partial(lambda env, mask: env.reset(options={"reset_mask": mask}), env),
            dict(mask=[True, False]),
        ),
        ("step", env.step, dict(**{"action" if env is ENV else "actions": np.array(actions)})),
    )
}


def check_odd_env_call(name: str, argument: str, value: Callable[[], Any]) -> None:
    """Call an environment that has begun with one odd argument; it can be used afterwards."""
    env = ENV if name.startswith("SeastarSwimEnv") else VECTOR_ENV
    call, arguments = ENV_CALLS[name]
    is_refused(call, {**arguments, argument: value()}, f"{name}({argument}={value()!r})")
    env.reset(seed=0)
    env.step(env.action_space.sample())


def check_odd_arguments(rng: Random, count: int = 50) -> None:
    """Make parts with several odd arguments at once, drawn among all places and values."""
    for _ in range(count):
        name = rng.choice(sorted(PARTS))
        make, arguments = PARTS[name]
        places = rng.sample(sorted(arguments), min(len(arguments), rng.randint(1, 3)))
        given = {place: rng.choice(VALUES) for place in places}
        where = f"{name}({', '.join(f'{place}={value()!r}' for place, value in given.items())})"
        is_refused(make, arguments | {place: value() for place, value in given.items()}, where)
