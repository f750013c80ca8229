"""Every registered environment keeps the same promises, alone and in a batch, with every option."""

import copy
import inspect
import json
import pickle
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

import seastar_gym
from episodes import SHORT, assert_same, assert_same_steps, both, break_robot, goes_on, swim_together, swum
from refusals import assert_refused
from seastar_gym import (
    Body,
    Contact,
    DomainRandomization,
    FailBlind,
    HeadingTargets,
    Limited,
    LogUniform,
    Miswired,
    Normal,
    Numerics,
    ObstTrap,
    Prey,
    Prizes,
    RewardWeights,
    Scene,
    Seastar,
    Sight,
    SimToReal,
    SmaPulse,
    SmaWires,
    SolverStatus,
    Station,
    SymmetryReduction,
    ThermalSma,
    Uniform,
    UniformCurrent,
    VectorSymmetryReduction,
    Water,
)
from seastar_gym.accuracy.chapters import NAMES
from seastar_gym.envs.rewards import pulses_of
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.lanes.registers import N_LANES
from seastar_gym.scene.serial import to_dict

SWIM = "SeastarSwim-v0"
IDS = tuple(sorted(id for id in gym.registry if id.startswith("Seastar")))
OF_TASKS = {id for id in IDS if "task" in gym.spec(id).kwargs}
OF_USERS = OF_TASKS - {*seastar_gym.TASKS}
"""Ids of a user's module, `pytest -p module`."""
SWIMS = tuple(id for id in IDS if id not in OF_TASKS)
DRAWN = {"path": "random", "random_heading": True}
"""What makes episodes of waypoints differ, as those of tasks do anyway."""


def of(robot=None, **parts) -> Scene:
    return Scene(robot or Seastar(), numerics=Numerics.preset("fast"), **parts)


FOUR = of(Seastar(4, 4), actuator=SmaPulse(0.5))
REFRACTORY = of(actuator=SmaWires(refractory=True))
HOT = of(actuator=ThermalSma(largest_temperature=240.0 - 220.0 * np.exp(-0.05 / 0.42)))
"""Wires reach the largest temperature after 0.05 s."""
DISTRIBUTIONS = {
    "limb_strengths": Uniform(0.5, 1.0), "robot.density": LogUniform(900.0, 2e3), "fluid.density": Normal(1e3, 9.0),
}  # fmt: skip
SIZES = DomainRandomization({"robot.limb_length": Uniform(0.08, 0.12), "actuator.peak_angle": Uniform(0.4, 0.6)})
ALIKE = DomainRandomization({"limb_strengths": Uniform(0.2, 1.0), "fluid.density": Uniform(900.0, 1100.0)})
LATE = DomainRandomization(
    {"sight.delay": Uniform(0.1, 0.2), "robot.density": Uniform(990.0, 1010.0), "action_delay": Uniform(0.1, 0.3)}
)
BAD = Sight(delay=Uniform(0.05, 0.15), jitter=0.03, dropout=0.2, noise=Uniform(0.0, 2e-3), turn_noise=0.02, sees="pose")
MARKED = Sight(1e2 / 3, Uniform(0.1, 1 / 3), dropout=0.1, sees=np.int64(3))
TURNS = (0.1, 1 / 3, 0.0, 1.0, 2.0)
MODES = ("limbs", "joint", "pairs", "continuous")
RECORDED = {
    "pairs": {**DRAWN, "actions": "pairs", "path": "figure-eight"},
    "joint": {**DRAWN, "actions": "joint", "path": "square"},
    "drawn scene": {**DRAWN, "randomization": DomainRandomization(DISTRIBUTIONS), "path": "triangle"},
    "headings along": {**DRAWN, "headings": HeadingTargets(tolerance=3.0), "path": "pentagon"},
    "headings drawn": {**DRAWN, "headings": HeadingTargets("random", 0.5), "path": "line"},
    "aim": {**DRAWN, "waypoint_radius": 0.03, "path": [[0.05, 0.0], [0.05, 0.02], [0.2, 0.0]]},
}
"""Options of `SeastarSwim-v0` of which episodes.json has the first decisions."""
OPTIONS = RECORDED | {
    "nothing": {},
    "reached": {"path": SHORT, "waypoint_radius": 0.0085, "max_episode_steps": 5, "num_envs": N_LANES + 1},
    "both ends at once": {"path": SHORT, "waypoint_radius": 0.0085, "max_episode_steps": 2},
    "two threads": {**DRAWN, "threads": 2, "num_envs": 2 * N_LANES + 1},
    "one thread": {"threads": 1, "num_envs": N_LANES + 1, "path": "random"},
    "weights": {"reward": RewardWeights(100 / 3, 2, 0.2), "waypoint_radius": np.float64(0.1 / 3)},
    "single precision": {"path": ((np.float32(0.1), 0), (1 / 3, np.float64(0.1))), "scene": FOUR},
    "four limbs": {"scene": FOUR, "actions": "pairs", "path": "random", "random_heading": np.bool_(True)},
    "two nodes": {"scene": of(Seastar(nodes_per_limb=2))},
    "seven nodes": {"scene": of(Seastar(nodes_per_limb=7))},
    "many nodes": {"scene": of(Seastar(nodes_per_limb=19))},
    "a body in a current": {
        "scene": of(Seastar(4, 4, body=Body(0.02)), fluid=Water(current=UniformCurrent(1e-3)), contact=Contact())
    },
    "limited": {"scene": of(actuator=Limited(SmaPulse(), 0.5, 3.0))},
    "drawn": {**DRAWN, "randomization": SIZES},
    "error bars": {"scene": of(Seastar(nodes_per_limb=4)), "error_bars": True},
    "plain code": {"device": "scalar"},
    "blind to wires": {"decision_period": 0.2, "observe_actuators": False},
    "continuous": {"actions": "continuous", "decision_period": np.float64(0.3)},
    "turns": {"headings": HeadingTargets(TURNS)},
    "one turn": {**DRAWN, "headings": HeadingTargets(0.5, 1.0), "waypoint_radius": 0.15},
    "legs": {**DRAWN, "headings": HeadingTargets("along", 1.0), "waypoint_radius": 0.15},
    "pose": {"decision_period": 0.5, "sight": BAD, "action_delay": Uniform(0.0, 0.7), "num_envs": 5, "path": SHORT},
    "markers": {"decision_period": 0.5, "sight": MARKED, "action_delay": Uniform(0.0, 1 / 3)},
    "all nodes": {"decision_period": 0.5, "sight": Sight(delay=0.1, noise=1e-3, sees="nodes")},
    "late strokes": {"sight": Sight(), "action_delay": np.float64(1.0)},
    "drawn sight": {"decision_period": 0.5, "sight": Sight(sees=1), "randomization": LATE},
    "pictures": {**DRAWN, "randomization": SIZES, "render_mode": "rgb_array", "num_envs": 2},
    "pictures of turns": {"headings": HeadingTargets("random"), "render_mode": "rgb_array", "num_envs": 2},
    "plain": {
        "sight": to_dict(Sight(delay=Uniform(0.1, 1 / 3))),
        "headings": to_dict(HeadingTargets("random")),
        "scene": FOUR.to_dict(),
        "reward": to_dict(RewardWeights(1.0)),
        "randomization": to_dict(DomainRandomization({"fluid.density": Uniform(900.0, 1000.0)})),
    },
    **{f"refractory {mode}": {"scene": REFRACTORY, "actions": mode, "decision_period": 0.2} for mode in MODES},
    **{f"hot {mode}": {"scene": HOT, "actions": mode, "decision_period": 0.2} for mode in MODES},
    **{f"reduced {mode}": {**DRAWN, "scene": FOUR, "actions": mode, "reduced": True} for mode in MODES},
    "reduced wires": {"scene": REFRACTORY, "actions": "pairs", "decision_period": 0.2, "reduced": True, **DRAWN},
    "reduced and blind to wires": {**DRAWN, "decision_period": 0.5, "observe_actuators": False, "reduced": True},
    "reduced turns": {**DRAWN, "headings": HeadingTargets("random"), "reduced": True},
    "reduced and drawn": {**DRAWN, "scene": FOUR, "randomization": ALIKE, "reduced": True},
}
"""Options of `SeastarSwim-v0`; `num_envs`, `threads` and `reduced` are those of `both`."""
SEEN = ("SeastarFailBlind-v0", "SeastarPrizesTimed-v0", "SeastarObstTrap-v0", "SeastarMiswiredTimed-v0",
        "SeastarPreyTimed-v0", "SeastarStation-v0", "SeastarSwimHeading-v0")  # fmt: skip
OWN = (
    Miswired(0.1, RewardWeights(100.0)), Prey(speed=(0.005, 1 / 180), wanted=1), Station(current=(0.0, 1e-3)),
    FailBlind(1), ObstTrap(scattered=1, potential="geodesic"), Prizes(side=0.6, gain=0.1),
    SimToReal(Sight(20.0, 0.2), DomainRandomization({"robot.density": Uniform(990.0, 1010.0)})),
)  # fmt: skip
TABLE = {
    **{f"own {type(task).__name__}": ("SeastarStation-v0", {"task": task}) for task in OWN},
    **{id: (id, {} if id in OF_TASKS else DRAWN) for id in IDS},
    **{f"{id} seen": (id, {"sight": BAD, "action_delay": 1.0, "num_envs": 2}) for id in SEEN},
    **{name: (SWIM, options) for name, options in OPTIONS.items()},
}
"""Ids and options of everything below."""


def given(name: str, *batch: str) -> tuple[str, dict]:
    """Id and arguments of a row of the table. batch: Names of those arguments of `both` that are wanted."""
    id, options = TABLE[name]
    options = {key: value for key, value in options.items() if key in batch or key not in OF_BOTH}
    return id, ({} if "scene" in options else {"fidelity": "fast"}) | options


OF_BOTH = ("num_envs", "threads", "reduced")
ROUNDED = ("heating_time", "energy", "energy_per_metre")
"""Sums over the pieces of a decision, which has more of them where delays of other robots end in it."""


def made(name: str, **more):
    id, arguments = given(name)
    env = gym.make(id, **(arguments | more))
    return SymmetryReduction(env) if TABLE[name][1].get("reduced") else env


def batched(name: str, n: int, **more):
    id, arguments = given(name)
    return gym.make_vec(id, n, "vector_entry_point", **(arguments | more))


def by_json(spec: EnvSpec) -> EnvSpec:
    """The spec by way of text, whose names a library may have sorted."""
    return EnvSpec.from_json(json.dumps(json.loads(spec.to_json()), sort_keys=True))


def test_all_ids_and_all_arguments_are_there():
    assert {*IDS} - OF_USERS == {*seastar_gym.IDS}
    told = {"fidelity", *(key for options in OPTIONS.values() for key in options)}
    others = {"frames_per_stroke", "certificate", "task", "split"}  # which have tests of their own
    assert told - {*OF_BOTH, "max_episode_steps"} | others == {*inspect.signature(SeastarSwimEnv).parameters}


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", [*IDS, "pairs", "joint", "headings drawn", "nothing", "continuous"])
def test_an_environment_passes_gymnasiums_and_stable_baselines_checkers(name, no_display):
    """The first makes an environment of its spec with every render mode that it names, one of them twice."""
    env = made(name).unwrapped
    check_env(env, skip_render_check=name != "nothing")
    pytest.importorskip("stable_baselines3.common.env_checker").check_env(env, warn=True, skip_render_check=True)


@pytest.mark.parametrize("name, mode", [
    *((name, AutoresetMode.SAME_STEP) for name in TABLE), *((id, AutoresetMode.NEXT_STEP) for id in IDS),
    *((name, AutoresetMode.DISABLED) for name in (SWIM, "SeastarPrey-v0", "reached", "both ends at once")),
])  # fmt: skip
def test_a_batch_has_the_bits_of_single_environments(name, mode):
    """Over ends of episodes, and where a robot cannot be solved: all results, their types, masks and pictures."""
    id, arguments = given(name, *OF_BOTH)
    batch, singles = both(id, mode=mode, **({"max_episode_steps": 3} | arguments))
    for space in ("single_observation_space", "observation_space", "single_action_space", "action_space"):
        assert getattr(batch, space) == getattr(singles, space)
    in_a_point = mode is not AutoresetMode.NEXT_STEP and name != "error bars"  # of which a new state knows nothing
    status = SolverStatus.NOT_CONVERGED if in_a_point else SolverStatus.NOT_FINITE
    n = 7 if mode is AutoresetMode.NEXT_STEP else 6  # a robot fails in the fourth decision, which is not of a reset
    steps = swim_together(batch, singles, n, status, ROUNDED if "sight" in arguments else ())
    assert np.any([step[2] | step[3] for step in steps], axis=0).all()
    assert name in ("reached", "both ends at once") or last_failed(steps[n - 3])  # or it rests then
    assert name != "reached" or np.any([step[2] for step in steps[:5]], axis=0).sum() > 2


def last_failed(step: tuple) -> bool:
    """Whether robot 1 was not solved in a step."""
    return step[4].get("final_info", step[4])["solver_status"][1] != 0


# Whatever Gymnasium's own batch of single environments takes or gives, ours takes and gives.


DIFFERENT = {
    **dict.fromkeys(("envs", "env_fns", "copy", "observation_mode"), "there are no environments one by one"),
    **dict.fromkeys(("simulator", "unwrapped", "spec"), "robots share one simulator, batch and spec"),
    **dict.fromkeys(("reset", "step"), "robots of one simulator cannot be called alone: call(name) is refused"),
    **dict.fromkeys(("get_wrapper_attr",), "of a batch it is what call gives of that name"),
    **dict.fromkeys(("draw_frame", "frame", "picture", "pictures"), "a batch draws no pictures within decisions"),
    "metadata": "a batch draws no windows and no lists, and has an autoreset mode",
}
"""Names that mean something else in `SyncVectorEnv` or its environments than in our batch, with the reason."""


def public(thing) -> set[str]:
    return {name for name in dir(thing) if not name.startswith("_")} | set(getattr(thing, "_arguments", ()))


def assert_alike(found, expected, where: str) -> None:
    """The same types, names, shapes and values at any depth, and where masks leave out, too."""
    if isinstance(expected, dict):
        assert set(found) == set(expected), where
        for name in expected:
            assert_alike(found[name], expected[name], f"{where}, {name}")
    elif isinstance(expected, np.ndarray) and expected.dtype != object:
        assert (found.dtype, found.shape) == (expected.dtype, expected.shape), where
        np.testing.assert_allclose(found, expected, 1e-14, 0.0, err_msg=where)
    elif isinstance(expected, tuple | np.ndarray):
        assert type(found) is type(expected) and len(found) == len(expected), where
        for one, other in zip(found, expected, strict=True):
            assert_alike(one, other, where)
    elif isinstance(expected, np.random.Generator):
        assert found.bit_generator.state == expected.bit_generator.state, where
    else:
        assert type(found) is type(expected) and found == expected, where


def uses(id: str) -> dict:
    """What users do with a batch, in this order, as functions of it and of an action of all robots."""
    option, one, other = ("instance", 3, 4) if id in OF_TASKS else ("path", "line", [[0.1, 0.1], [0.2, 0.1]])
    resets = {
        "a seed": {"seed": 5}, "a list": {"seed": [3, None]}, "a tuple": {"seed": (4, 5)},
        "no options": {"options": {}},
        "an option": {"seed": 7, "options": {option: one}},
        "all robots": {"seed": 1, "options": {"reset_mask": np.ones(2, bool)}},
        "one robot": {"seed": [1, 8], "options": {"reset_mask": np.array([False, True]), option: other}},
    }  # fmt: skip
    steps = {
        "an array": np.array, "a list": np.ndarray.tolist, "a tuple": tuple, "a list of arrays": list,
        "other numbers": lambda a: a.astype(np.uint8 if a.dtype.kind == "i" else np.float64),
    }  # fmt: skip
    calls = {"has_wrapper_attr": ("scene",), "render": (), "np_random": (), "np_random_seed": (), "mark": ()}
    return {
        **{f"reset with {what}": lambda env, _, m=more: env.reset(**copy.deepcopy(m)) for what, more in resets.items()},
        **{f"step with {what}": lambda env, action, form=form: env.step(form(action)) for what, form in steps.items()},
        "a new attribute": lambda env, _: env.set_attr("mark", 3),
        "one for each": lambda env, _: env.set_attr("mark", ["a", "b"]),
        **{f"call {name}": lambda env, _, n=name, m=more: env.call(n, *m) for name, more in calls.items()},
        "generators": lambda env, _: env.set_attr("np_random", [np.random.default_rng(seed) for seed in (1, 2)]),
        "their seeds": lambda env, _: env.np_random_seed, "their states": lambda env, _: env.np_random,
        "reset with nothing": lambda env, _: env.reset(), "render": lambda env, _: env.render(),
        **{f"attribute {name}": lambda env, _, name=name: getattr(env, name)
           for name in ("num_envs", "single_action_space", "action_space", "single_observation_space", "render_mode",
                        "observation_space", "autoreset_mode", "closed")},
        "metadata": lambda env, _: {name: env.metadata[name] for name in ("render_fps", "autoreset_mode")},
        "close": lambda env, _: env.close(terminate=True, timeout=1), "is closed": lambda env, _: env.closed,
        "close again": lambda env, _: env.close(),
    }  # fmt: skip


@pytest.mark.parametrize("id, mode", [
    (id, mode) for k, id in enumerate(IDS) for mode in (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP)
    if id in (SWIM, "SeastarPrey-v0") or (mode is AutoresetMode.SAME_STEP) == k % 2
])  # fmt: skip
def test_a_batch_takes_and_gives_whatever_gymnasiums_own_does(id, mode):
    """All public names of both, forms of arguments, and entries of info, which are numbers and flags."""
    pytest.importorskip("pygame")
    more = {"max_episode_steps": 2, "fidelity": "fast", "render_mode": "rgb_array", "disable_env_checker": True}
    batch, singles = both(id, 2, mode, **more)
    for name in ("render", "step"):
        for env in (batch, singles):
            with pytest.raises(gym.error.ResetNeeded):
                getattr(env, name)(*([env.action_space.sample()] if name == "step" else ()))
    singles.action_space.seed(0)
    for what, use in uses(id).items():
        action = singles.action_space.sample()
        found, expected = (use(env, action.copy()) for env in (batch, singles))
        assert_alike(found, expected, what)
        for info in [part for part in found if isinstance(part, dict)] if isinstance(found, tuple) else ():
            texts = {name for name, values in [*info.items(), *info.get("final_info", {}).items()]
                     if not isinstance(values, dict) and values.dtype.kind not in "biuf"}  # fmt: skip
            assert texts <= {"final_obs"}  # which is Gymnasium's own form
    assert public(singles) - public(batch) <= set(DIFFERENT)
    one = singles.envs[0].unwrapped
    assert public(one) - public(batch) <= set(DIFFERENT)
    for name in public(one) - set(DIFFERENT) - {"has_wrapper_attr", "set_wrapper_attr", "render", "np_random"}:
        assert_alike(batch.call(name), singles.call(name), name)


@pytest.mark.parametrize("forms", [
    {}, {"vectorization_mode": gym.VectorizeMode.VECTOR_ENTRY_POINT}, {"vector_kwargs": {}, "wrappers": []},
    {"max_episode_steps": -1}, {"max_episode_steps": 3}, {"disable_env_checker": False}, {"frames_per_stroke": 3},
    {"render_mode": "rgb_array"},
], ids=str)  # fmt: skip
@pytest.mark.parametrize("id", [SWIM, "SeastarPrey-v0"])
def test_make_vec_takes_its_own_arguments_for_one_robot_as_for_many(id, forms):
    batch = gym.make_vec(id, **{"fidelity": "fast", "num_envs": 1} | forms)
    singles = gym.make_vec(id, **{"fidelity": "fast"} | forms | {"vectorization_mode": "sync"})
    assert_alike(batch.reset(seed=3), singles.reset(seed=3), "reset")
    for _ in range(2):
        actions = singles.action_space.sample()
        assert_alike(batch.step(actions), singles.step(actions), "step")
    assert batch.metadata["render_fps"] == singles.metadata["render_fps"]


# Arguments that are set later, as in a curriculum


LATER = {"path": "figure-eight", "random_heading": True, "waypoint_radius": 0.05, "reward": RewardWeights(100.0, 2.0)}
"""Arguments of `SeastarSwim-v0` that hold from the next episode on, and another value of each."""
WAYS = {
    "unwrapped": lambda env, name, value: setattr(env.unwrapped, name, value),
    "wrapped": lambda env, name, value: env.set_wrapper_attr(name, value),
    "a batch": lambda env, name, value: env.set_attr(name, value),
    "each of a batch": lambda env, name, value: env.set_attr(name, [value] * env.num_envs),
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("id", [SWIM, "SeastarPrey-v0"])
def test_every_argument_that_is_set_later_holds_from_the_next_episode_on_or_is_refused(id, way):
    """One that is refused changes nothing."""

    def new(**more):
        make = gym.make_vec if "batch" in way else gym.make
        return make(id, **{"num_envs": 2} if "batch" in way else {}, fidelity="fast", **more)

    env, twin = new(), new()
    assert_alike(env.reset(seed=0), twin.reset(seed=0), "the first episode")
    own, others = (inspect.signature(kind).parameters for kind in (type(env.unwrapped), SeastarSwimEnv))
    for name in sorted({*own, *others} - {"arguments"}):
        if name in LATER or name == "max_episode_steps" or (way == "wrapped" and name == "render_mode"):
            continue  # the last is refused by Gymnasium's wrappers
        with assert_refused(name):
            WAYS[way](env, name, getattr(env.unwrapped, name, None))
    action = env.action_space.sample()
    assert_alike(env.step(action), twin.step(action), "what was refused")
    for name, value in LATER.items() if id == SWIM else ():
        fresh = new(**{name: value})
        WAYS[way](env, name, value)
        np.testing.assert_equal(np.asarray(getattr(env.unwrapped, name)), np.asarray(getattr(fresh.unwrapped, name)))
        assert_alike(env.step(action), twin.step(action), f"the present episode without {name}")
        for one in (env, fresh):
            one.action_space.seed(0)
        assert_alike(env.reset(seed=1), fresh.reset(seed=1), f"the next episode with {name}")
        for _ in range(2):
            action = env.action_space.sample()
            assert_alike(env.step(action), fresh.step(action), f"the next episode with {name}")
        with assert_refused():
            WAYS[way](env, name, "no such thing")
        env, twin = new(), new()
        assert_alike(env.reset(seed=0), twin.reset(seed=0), "another first episode")


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_robots_of_a_batch_begin_their_next_episodes_by_what_each_was_asked_for(mode):
    """In the middle of episodes that end at different times, as single environments do."""
    batch, singles = both(SWIM, 3, mode, max_episode_steps=3, fidelity="fast", render_mode="rgb_array")
    values = {"path": ["line", SHORT, "random"], "waypoint_radius": [0.01, 0.0085, 0.02], "random_heading": True,
              "reward": [RewardWeights(aim=aim) for aim in (0.0, 0.5, 1.0)]}  # fmt: skip
    for env in (batch, singles):
        env.reset(seed=0)
        env.reset(options={"reset_mask": np.array([False, True, False])})
    singles.action_space.seed(0)
    for step in range(9):
        actions = singles.action_space.sample()
        assert_alike(batch.step(actions), singles.step(actions), f"step {step}")
        for env in (batch, singles) if step == 0 else ():
            for name, value in values.items():
                env.set_attr(name, value)
        for name in values:
            np.testing.assert_equal(batch.get_attr(name), singles.get_attr(name))
    assert_alike(batch.render(), singles.render(), "pictures")
    batch.set_attr("max_episode_steps", 1)
    assert not batch.step(actions)[3].all() and batch.reset() and batch.step(actions)[3].all()


# Every episode


@pytest.mark.parametrize("name", TABLE)
def test_an_episode_follows_from_its_seed_in_a_copy_a_pickle_and_what_is_made_of_the_spec(name):
    """Nothing goes from one episode into the next."""
    env = made(name, **({"split": "test"} if TABLE[name][0] in OF_TASKS else {}))
    spec, first, other = by_json(env.spec), swum(env), swum(env, seed=7)
    assert spec == env.spec
    assert name not in IDS or np.abs(other[0] - first[0]).max() > 1e-3
    for twin in (env, gym.make(spec), pickle.loads(pickle.dumps(env)), copy.deepcopy(env)):
        assert twin.spec == env.spec and type(twin) is type(env) and twin.unwrapped.scene == env.unwrapped.scene
        assert_same(swum(twin), first)
    env.reset(seed=0)
    goes_on(env, 1)
    expected, *others = [goes_on(twin, 3) for twin in (env, pickle.loads(pickle.dumps(env)), copy.deepcopy(env))[::-1]]
    for found in others:
        assert_same(found, expected)


@pytest.mark.parametrize("name", TABLE)
def test_a_batch_goes_on_to_the_same_bits_in_a_pickle_and_a_copy_and_comes_back_from_its_spec(name):
    """From the middle of an episode, over its end and the beginning of the next."""
    batch = batched(name, 2, max_episode_steps=3, autoreset_mode=AutoresetMode.SAME_STEP, threads=1)
    made_again = gym.make_vec(by_json(batch.spec))
    assert made_again.spec == batch.spec and made_again.autoreset_mode is AutoresetMode.SAME_STEP
    batch.action_space.seed(4)
    assert_same_steps(batch.reset(seed=3), made_again.reset(seed=3))
    actions = batch.action_space.sample()
    assert_same_steps(batch.step(actions), made_again.step(actions))
    twins = [batch, pickle.loads(pickle.dumps(batch)), copy.deepcopy(batch)]
    for _ in range(4):
        actions = batch.action_space.sample()
        expected, *others = [twin.step(actions) for twin in twins]
        for found in others:
            assert_same_steps(found, expected)


@pytest.mark.parametrize("id", IDS)
def test_observations_lie_in_their_space_share_no_memory_and_no_number_of_theirs_is_constant(id):
    batch, env = batched(id, 8), made(id)
    seen = [batch.reset(seed=0)[0]]
    batch.action_space.seed(0)
    seen += [batch.step(batch.action_space.sample())[0] for _ in range(12)]
    assert all(one in batch.observation_space and one.dtype == np.float32 for one in seen)
    assert not np.shares_memory(seen[-1], seen[-2])
    every = np.concatenate(seen)
    assert (np.ptp(every, axis=0) > (1e-6 if id in SWIMS else 0.0)).all() and np.isfinite(every).all()
    assert id != SWIM or min(len(np.unique(column)) for column in every.T) > 10
    first, _ = env.reset(seed=0)
    kept, second = first.copy(), env.step(env.action_space.sample())[0]
    assert first in env.observation_space and second in env.observation_space and not np.shares_memory(first, second)
    np.testing.assert_array_equal(first, kept)


@pytest.mark.parametrize("name", TABLE)
def test_rewards_are_sums_of_their_terms_and_info_has_the_same_names_types_and_shapes_always(name):
    """On a reset, on a step, and on a failure, which ends an episode with a sentence."""
    env = made(name)
    infos = [env.reset(seed=0)[1]]
    terms = [term for term in infos[0] if term.startswith("reward_")]
    env.action_space.seed(1)
    for k in range(4):
        if k == 3:
            break_robot(env.unwrapped, SolverStatus.NOT_FINITE)
        action = env.action_space.sample()
        observation, reward, terminated, truncated, info = env.step(action)
        infos.append(info)
        assert type(reward) is float and type(terminated) is type(truncated) is bool
        assert np.isfinite(observation).all() and reward == pytest.approx(sum(info[term] for term in terms), abs=1e-12)
        if terminated:
            break
    assert terminated and (k < 3) == (info["solver_status"] == 0)
    for info in [*infos, env.reset()[1]]:
        assert list(info) == list(infos[0])
        for entry, value in info.items():
            assert type(value) is type(infos[0][entry]) and np.shape(value) == np.shape(infos[0][entry]), entry
            assert type(value) in (int, float, bool, np.ndarray), entry


@pytest.mark.parametrize("id", IDS)
def test_effort_is_the_price_of_pulses_and_the_time_limit_truncates(id):
    assert batched(id, 1).max_episode_steps == gym.spec(id).max_episode_steps
    env = made(id, max_episode_steps=2)
    env.reset(seed=0)
    env.action_space.seed(1)
    table = env.unwrapped.command_table
    for k in range(2):
        action = env.action_space.sample()
        *_, terminated, truncated, info = env.step(action)
        assert not terminated and truncated == (k == 1)
        if table is not None and id not in OF_USERS:
            pulses = pulses_of(np.array([info["heating_time"]]), table[[action]])[0]
            assert info["reward_effort"] == -0.01 * pulses < 0.0


def no_actions(mode: str) -> list:
    """What is no action of a robot of four limbs."""
    good, beyond = {
        "limbs": (np.zeros(4, int), 3), "joint": (np.array(0), 81), "pairs": (np.array(0), 13),
        "continuous": (np.zeros(4), 1.001),
    }[mode]  # fmt: skip
    wrong = [good + np.nan, good + beyond, good - beyond, np.ones(good.shape, bool), good[..., None], None, "up"]
    of_limbs = [good[:3], *([10**400, good + 0.0] if mode == "limbs" else [good + np.inf])] if good.ndim else []
    return [*wrong, [[0, 1], [0]], *(of_limbs or [good + 0.5, np.zeros(4, int), 10**12])]


@pytest.mark.parametrize("kind", [SeastarSwimEnv, SeastarSwimVectorEnv])
@pytest.mark.parametrize("reduced", [False, True])
@pytest.mark.parametrize("mode", MODES)
def test_what_is_no_action_is_refused_and_changes_nothing(mode, reduced, kind):
    is_one = kind is SeastarSwimEnv
    env = kind(**({} if is_one else {"num_envs": 2, "max_episode_steps": 2}), scene=FOUR, actions=mode)
    if reduced:
        env = (SymmetryReduction if is_one else VectorSymmetryReduction)(env)
    env.reset(seed=0)
    twin, good = copy.deepcopy(env), env.action_space.sample()
    wrong = no_actions(mode) if is_one else [[action] * 2 for action in no_actions(mode)]
    for _ in range(3):
        for action in [*wrong, *([] if is_one else [good[:1], good[:, None], np.concatenate([good, good])])]:
            with assert_refused("action"):
                env.step(action)
        found, expected = env.step(good), twin.step(good)
        assert_same([*found[:4], *found[4].values()], [*expected[:4], *expected[4].values()])


# The first decisions of every id, as they were recorded: whoever trains on a -v0 has the same task in every release.


EPISODES = Path(__file__).parent / "episodes.json"


def numbers(info: dict) -> dict[str, list]:
    """Numbers of an info, but for measured errors and iterations."""
    left_out = {*NAMES, "newton_iterations"}
    return {name: np.ravel(value).astype(float) for name, value in info.items() if name not in left_out}


def to_the_target(env: SeastarSwimEnv) -> None:
    """Carry the robot, as it is, to a millimetre from the first point that it observes."""
    state = env.simulator.get_state()
    target = env.task.targets(env._robots)[0, :2] + [1e-3, 0.0]
    state.positions[:] += target - env.simulator.hub_position()
    env.simulator.set_state(state)


def first_decisions(name: str) -> list[dict[str, list]]:
    """What an environment gives in four decisions; before the last but one, the robot is at its target."""
    env = made(name)
    observation, info = env.reset(seed=11)
    env.action_space.seed(12)
    rows = [{"observation": observation, **numbers(info)}]
    for k in range(4):
        if k == 2:
            to_the_target(env.unwrapped)
        observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
        rows.append({"reward": [reward], "ends": [terminated, truncated], **numbers(info)})
        if terminated:
            break
    scenery = env.unwrapped.task.scenery(env.unwrapped._robots, 0)
    rows[-1] |= {"observation": observation, "scenery": scenery.points.ravel()}
    return rows


def changes(rows: list[dict]) -> list[dict[str, list]]:
    """What differs from the row before, to five digits."""
    short = [{name: [float(f"{x:.5g}") for x in values] for name, values in row.items()} for row in rows]
    pairs = zip(short, [{}, *short[:-1]], strict=True)
    return [{name: values for name, values in row.items() if values != last.get(name)} for row, last in pairs]


@pytest.mark.parametrize("name", [*(id for id in IDS if id not in OF_USERS), *RECORDED])
def test_an_id_is_what_it_was(name):
    known = json.loads(EPISODES.read_text(encoding="utf-8")) if EPISODES.exists() else {}
    found, case = first_decisions(name), name if name in IDS else f"{SWIM} {name}"
    if case not in known:
        known[case] = changes(found)
        lines = ",\n".join(f"{json.dumps(one)}: {json.dumps(known[one])}" for one in sorted(known))
        EPISODES.write_text(f"{{\n{lines}\n}}\n", encoding="utf-8")
        pytest.fail(f"{name} is recorded: look at it.")
    expected: dict[str, list] = {}
    for row, changed in zip(found, known[case], strict=True):
        expected |= changed
        for entry in row:
            np.testing.assert_allclose(row[entry], expected[entry], rtol=1e-3, atol=2e-5, err_msg=entry)
