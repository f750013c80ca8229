"""Arguments that nobody should give, for everything that takes arguments."""

# ruff: noqa: C408 - what is given reads as a call
from collections.abc import Callable
from functools import partial
from random import Random
from typing import Any

import gymnasium as gym
import numpy as np

from fuzz.sentences import assert_one_sentence
from odd_values import ODD
from seastar_gym import (
    AlongLimb,
    Attachment,
    Body,
    Contact,
    DomainRandomization,
    GridCurrent,
    HeadingTargets,
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
    Sight,
    Simulator,
    SmaLimb,
    SmaPulse,
    SmaWires,
    Stiffening,
    ThermalSma,
    Uniform,
    UniformCurrent,
    Vortex,
    Water,
    relaxation_time,
)
from seastar_gym.accuracy import chapters_certificate, timed_certificate
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.vector import SeastarSwimVectorEnv

Calls = dict[str, tuple[Callable[..., Any], dict[str, Any]]]

VALUES = tuple(ODD.values())

FAST = Numerics.preset("fast")

PARTS: Calls = {
    "Seastar": (Seastar, dict(n_limbs=5, nodes_per_limb=4, limb_length=0.1, rod_radius=1e-3, youngs_modulus=1e6,
                              density=1e3, hub_hinge="opening", limbs=(), relaxation_time=1e-3)),
    "Limb": (Limb, dict(direction=0.0, length=0.1, radius=(1e-3, 2e-3), youngs_modulus=1e6, natural_curvature=1.0)),
    "Body": (Body, dict(radius=0.0, outline=((0.02, -0.01), (0.0, 0.02), (-0.02, -0.01)), height=0.01, mass=0.01,
                        inertia=1e-6, centre_of_mass=(0.0, 1e-3), drag_along=1.0, drag_across=1.0, drag_turning=1.0,
                        added_mass_along=1.0, added_mass_across=1.0, added_mass_turning=1.0, attachments=())),
    "Body.rectangle": (Body.rectangle, dict(length=0.06, width=0.03, mass=0.01)),
    "Attachment": (Attachment, dict(x=0.01, y=0.0, direction=0.1)),
    "AlongLimb": (AlongLimb, dict(share=0.5, profile=(1.0, 0.5))),
    "Stiffening": (Stiffening, dict(ratio=2.0, middle=0.4, width=0.1)),
    "Robot with a body": (Seastar, dict(body=Body(radius=0.02), along=AlongLimb(), stiffening=Stiffening(2.0),
                                        discretisation="continuum")),
    "Water": (Water, dict(density=1e3, drag_coefficient=1.0, tangential_drag_coefficient=0.1,
                          current=UniformCurrent(), added_mass_coefficient=1.0)),
    "UniformCurrent": (UniformCurrent, dict(u_x=0.0, u_y=0.1)),
    "ShearCurrent": (ShearCurrent, dict(rate=0.1, direction=0.1)),
    "Vortex": (Vortex, dict(circulation=0.1, x=0.0, y=0.0, core_radius=0.05)),
    "GridCurrent": (GridCurrent, dict(corner=(0.0, 0.0), spacing=0.1, velocities=np.ones((2, 2, 2)))),
    "GridCurrent.from_function": (GridCurrent.from_function, dict(
        function=lambda x, y: (0.0 * x, y), x=(0.0, 1.0), y=(0.0, 1.0), spacing=0.5)),
    "Contact": (Contact, dict(layer=5e-3, opening_angle=0.2)),
    "SmaPulse": (SmaPulse, dict(peak_angle=0.5, heating_time=0.1, cooling_time=0.9)),
    "SmaWires": (SmaWires, dict(peak_angle=0.5, heating_time=0.1, cooling_time=0.9, period=0.5, refractory=False,
                                heating_power=5.0)),
    "SmaLimb": (SmaLimb, dict(peak_angle=0.5, rise=10.0, middle=7.0, time_constant=0.7, heating_time=0.05, delay=0.02,
                              period=1.0, rest_curvature=125.0, curvature_change=90.0, heating_power=5.0)),
    "SmaLimb.preset": (SmaLimb.preset, dict(liquid_metal=20, period=1.0, peak_angle=0.5)),
    "MeasuredCurve": (MeasuredCurve, dict(times=(0.0, 0.1, 1.0), angles=(0.0, 0.5, 0.0), scale=1.0)),
    "Limited": (Limited, dict(actuator=SmaPulse(), largest_angle=0.3, largest_rate=1.0)),
    "ThermalSma": (ThermalSma, dict(peak_angle=0.5, heating_time=0.1, cooling_time=0.9, time_constant=0.4,
                                    steady_rise=200.0, water_temperature=20.0, austenite_start=23.0,
                                    austenite_finish=70.0, martensite_start=56.0, martensite_finish=21.0)),
    "Numerics": (Numerics, dict(scheme="implicit-midpoint", step=3e-3, newton_tolerance=1e-8, max_iterations=60,
                                path_tolerance=0.01, damping=0.002)),
    "Numerics.preset": (Numerics.preset, dict(fidelity="fast")),
    "Scene.preset": (Scene.preset, dict(fidelity="fast")),
    "Scene.for_error": (Scene.for_error, dict(error=0.1, any_gait=True, robot=None, certificate=None)),
    "chapters_certificate().for_error": (
        chapters_certificate().for_error, dict(error=0.1, classes=("random",), robot=None)
    ),
    "chapters_certificate().of": (chapters_certificate().of, dict(scene=Scene.preset("fast"))),
    "timed_certificate": (timed_certificate, dict(decision_period=0.2)),
    "relaxation_time": (relaxation_time, dict(loss_factor=0.1, frequency=10.0)),
    "Scene": (Scene, dict(robot=Seastar(), fluid=Water(), actuator=SmaPulse(), numerics=FAST, held_nodes=(0,),
                          loads=((1, 0.0, 1e-3),), limb_strengths=(1.0,) * 5, contact=Contact())),
    "Uniform": (Uniform, dict(low=0.0, high=1.0)),
    "LogUniform": (LogUniform, dict(low=0.1, high=1.0)),
    "Normal": (Normal, dict(mean=1.0, deviation=0.1)),
    "DomainRandomization": (DomainRandomization, dict(distributions={"robot.density": Uniform(900.0, 1100.0)})),
    "HeadingTargets": (HeadingTargets, dict(target=(0.1, 0.2), tolerance=0.1)),
    "Sight": (Sight, dict(rate=30.0, delay=Uniform(0.0, 0.1), jitter=0.1, dropout=0.1, noise=1e-3, turn_noise=0.1,
                          sees="pose")),
    "RewardWeights": (RewardWeights, dict(progress=1.0, waypoint=1.0, effort=0.0)),
    "Simulator": (Simulator, dict(scene=Scene(numerics=FAST), n_robots=2, threads=1)),
    "SeastarSwimEnv": (SeastarSwimEnv, dict(
        path="line", actions="limbs", fidelity="fast", scene=Scene(numerics=FAST), reward=RewardWeights(),
        waypoint_radius=0.01, random_heading=False, render_mode=None, frames_per_stroke=2,
        randomization=DomainRandomization({"robot.density": Uniform(900.0, 1100.0)}), decision_period=1.0,
        observe_actuators=True, headings=HeadingTargets(), sight=Sight(), action_delay=1.0)),
    "SeastarSwimVectorEnv": (SeastarSwimVectorEnv, dict(
        num_envs=2, max_episode_steps=3, path="line", actions="pairs", fidelity="fast", scene=Scene(numerics=FAST),
        reward=RewardWeights(), waypoint_radius=0.01, random_heading=True, render_mode=None,
        autoreset_mode="NextStep", threads=1, randomization=None)),
}  # fmt: skip
"""What is made, and arguments with which it can be."""


def assert_taken_or_refused(make: Callable[[], Any], where: str) -> bool:
    """Whether it was refused, in one sentence; anything else that goes wrong is an error of its own."""
    try:
        made = make()
    except (ValueError, gym.error.Error) as refusal:
        assert_one_sentence(refusal, where)
        return True
    if isinstance(made, gym.Env | gym.vector.VectorEnv):
        made.close()
    return False


# --- what has a state, and must lose nothing by a refusal -------------------------------------------------------------

SIMULATOR = Simulator(Scene(numerics=FAST), 2, threads=1)
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
    "set_scene": (SIMULATOR.set_scene, dict(scene=Scene(numerics=FAST), mask=[True, True])),
}  # fmt: skip


def begin() -> None:
    """Bring what has a state into one that can be lost."""
    for env in (ENV, VECTOR_ENV):
        env.reset(seed=0, options={"path": "line"})
    SIMULATOR.set_scene(Scene(numerics=FAST))
    SIMULATOR.set_limb_strengths(1.0)
    SIMULATOR.reset()
    SIMULATOR.stroke([[0.0, 1.0, 0.0, 0.0, -1.0]] * 2)


def check_odd_call(name: str, argument: str, value: Callable[[], Any]) -> None:
    """Call a simulator that has begun with one odd argument; what it refuses changes nothing."""
    before = SIMULATOR.get_state()
    call, arguments = SIMULATOR_CALLS[name]
    where = f"Simulator.{name}({argument}={value()!r})"
    if assert_taken_or_refused(lambda: call(**{**arguments, argument: value()}), where):
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
    assert_taken_or_refused(lambda: call(**{**arguments, argument: value()}), f"{name}({argument}={value()!r})")
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
        odd = {place: value() for place, value in given.items()}
        assert_taken_or_refused(lambda make=make, all_=arguments | odd: make(**all_), where)
