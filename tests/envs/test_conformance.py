"""Every registered environment keeps the same promises, alone and in a batch."""

import copy
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
from episodes import assert_same, assert_same_steps, both, break_robot, swim_together, swum
from seastar_gym import DomainRandomization, HeadingTargets, LogUniform, Normal, SolverStatus, Uniform
from seastar_gym.accuracy.info import NAMES
from seastar_gym.envs.reward import pulses_of
from seastar_gym.envs.seastar_swim import SeastarSwimEnv

IDS = tuple(sorted(id for id in gym.registry if id.startswith("Seastar")))
SWIMS = tuple(id for id in IDS if id not in seastar_gym.TASKS)
DRAWN = {"path": "random", "random_heading": True}
"""What makes episodes of waypoints differ, as those of tasks do anyway."""


def arguments(id: str) -> dict:
    return {"fidelity": "fast", **({} if id in seastar_gym.TASKS else DRAWN)}


def made(id: str, **more):
    return gym.make(id, **(arguments(id) | more))


def batched(id: str, n: int, **more):
    return gym.make_vec(id, n, "vector_entry_point", **(arguments(id) | more))


def test_all_ids_are_there():
    assert len(IDS) == 6 + len(seastar_gym.TASKS) and {*seastar_gym.TASKS, *seastar_gym.TIMED} < {*IDS}


@pytest.mark.parametrize(
    "id, more",
    [
        *((id, {}) for id in IDS),
        *(("SeastarSwim-v0", {"actions": actions, **more}) for actions in ("joint", "pairs") for more in ({}, DRAWN)),
        ("SeastarSwim-v0", DRAWN),
    ],
)
def test_an_environment_passes_gymnasiums_and_stable_baselines_checkers(id, more):
    env = gym.make(id, fidelity="fast", **more).unwrapped
    check_env(env, skip_render_check=True)
    pytest.importorskip("stable_baselines3.common.env_checker").check_env(env, warn=True, skip_render_check=True)


@pytest.mark.parametrize("id", IDS)
@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_a_batch_has_the_bits_of_single_environments(id, mode):
    batch, singles = both(id, 3, mode, max_episode_steps=3, **arguments(id))
    for name in ("single_observation_space", "observation_space", "single_action_space", "action_space"):
        assert getattr(batch, name) == getattr(singles, name)
    swim_together(batch, singles, 8)


@pytest.mark.parametrize("id", IDS)
def test_seeds_decide_everything_and_nothing_goes_from_one_episode_into_the_next(id):
    env, new = made(id), made(id)
    first = swum(env)
    other = swum(env, seed=7)
    assert np.abs(other[0] - first[0]).max() > 1e-3
    assert_same(swum(env), first)
    assert_same(swum(new), first)


@pytest.mark.parametrize("id", IDS)
def test_an_environment_comes_back_from_its_spec_a_pickle_and_a_copy(id):
    env = made(id, **({"split": "test"} if id in seastar_gym.TASKS else {}))
    spec = EnvSpec.from_json(json.dumps(json.loads(env.spec.to_json()), sort_keys=True))
    expected = swum(env)
    for other in (gym.make(spec), pickle.loads(pickle.dumps(env)), copy.deepcopy(env)):
        assert_same(swum(other), expected)


@pytest.mark.parametrize("id", IDS)
def test_the_middle_of_an_episode_goes_on_to_the_same_bits_in_a_pickle_and_in_a_copy(id):
    """Over its end and the beginning of the next."""
    env, batch = made(id, max_episode_steps=4), batched(id, 3, max_episode_steps=4)
    env.reset(seed=0), batch.reset(seed=0)
    env.action_space.seed(0), batch.action_space.seed(0)
    env.step(env.action_space.sample()), batch.step(batch.action_space.sample())
    for twins in ([one, pickle.loads(pickle.dumps(one)), copy.deepcopy(one)] for one in (env, batch)):
        for k in range(6):
            action = twins[0].action_space.sample()
            if twins[0] is env and k == 3:
                results = [[*twin.reset()] for twin in twins]
                assert all(result[0].tobytes() == results[0][0].tobytes() for result in results)
                continue
            results = [twin.step(action) for twin in twins]
            for result in results[1:]:
                if twins[0] is batch:
                    assert_same_steps(result, results[0])
                else:
                    assert_same([*result[:4], *result[4].values()], [*results[0][:4], *results[0][4].values()])


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
    assert id != "SeastarSwim-v0" or min(len(np.unique(column)) for column in every.T) > 10
    first, _ = env.reset(seed=0)
    kept, second = first.copy(), env.step(env.action_space.sample())[0]
    assert first in env.observation_space and second in env.observation_space and not np.shares_memory(first, second)
    np.testing.assert_array_equal(first, kept)


@pytest.mark.parametrize("id", IDS)
def test_the_reward_is_the_sum_of_its_terms_in_info(id):
    env = made(id)
    names = [name for name in env.reset(seed=0)[1] if name.startswith("reward_")]
    env.action_space.seed(1)
    for _ in range(3):
        action = env.action_space.sample()
        _, reward, terminated, truncated, info = env.step(action)
        assert type(reward) is float and type(terminated) is type(truncated) is bool
        assert [name for name in info if name.startswith("reward_")] == names
        assert reward == pytest.approx(sum(info[name] for name in names), abs=1e-12)
        table = env.unwrapped.command_table
        if table is not None:
            pulses = pulses_of(np.array([info["heating_time"]]), table[[action]])[0]
            assert info["reward_effort"] == -0.01 * pulses < 0.0


@pytest.mark.parametrize("id", IDS)
def test_info_has_the_same_names_types_and_shapes_on_a_reset_on_a_step_and_on_a_failure(id):
    env = made(id)
    infos = [env.reset(seed=0)[1], env.step(env.action_space.sample())[4]]
    break_robot(env.unwrapped, SolverStatus.NOT_FINITE)
    infos += [env.step(env.action_space.sample())[4], env.reset()[1]]
    assert infos[2]["solver_message"]
    for info in infos:
        assert list(info) == list(infos[0])
        for name, value in info.items():
            assert type(value) is type(infos[0][name]) and np.shape(value) == np.shape(infos[0][name]), name
            assert type(value) in (int, float, bool, str, np.ndarray), name
    assert infos[1]["hub_position"].shape == (2,) and infos[1]["hub_position"].dtype == np.float64


@pytest.mark.parametrize("id", IDS)
def test_the_time_limit_is_the_same_alone_and_in_a_batch_and_truncates(id):
    assert batched(id, 1).max_episode_steps == gym.spec(id).max_episode_steps
    env = made(id, max_episode_steps=2)
    env.reset(seed=0)
    none = np.zeros(env.action_space.shape, env.action_space.dtype)
    ends = [env.step(none)[2:4] for _ in range(2)]
    assert ends == [(False, False), (False, True)]


@pytest.mark.parametrize("id", IDS)
def test_a_step_before_the_first_reset_is_refused(id):
    for env in (made(id).unwrapped, batched(id, 2)):
        with pytest.raises(gym.error.ResetNeeded, match=r"reset\(\) before step\(\)\.$"):
            env.step(env.action_space.sample())


@pytest.mark.parametrize("id", IDS)
def test_pictures_are_drawn_alone_and_of_a_batch(id):
    pytest.importorskip("pygame")
    env, batch = made(id, render_mode="rgb_array"), batched(id, 2, render_mode="rgb_array")
    env.reset(seed=0), batch.reset(seed=0)
    for picture in (env.render(), *batch.render()):
        assert picture.shape == (720, 960, 3) and picture.dtype == np.uint8 and np.ptp(picture) > 0


# The first decisions of every id, as they were recorded: whoever trains on a -v0 has the same task in every release.


RECORDED = Path(__file__).parent / "episodes.json"
DISTRIBUTIONS = {
    "limb_strengths": Uniform(0.5, 1.0), "robot.density": LogUniform(900.0, 2e3), "fluid.density": Normal(1e3, 9.0),
}  # fmt: skip
OPTIONS = {
    "": {},
    "pairs": {"actions": "pairs", "path": "figure-eight"},
    "joint": {"actions": "joint", "path": "square"},
    "drawn scene": {
        "randomization": DomainRandomization(DISTRIBUTIONS),
        "path": "triangle",
    },
    "headings along": {"headings": HeadingTargets(tolerance=3.0), "path": "pentagon"},
    "headings drawn": {"headings": HeadingTargets("random", 0.5), "path": "line"},
    "aim": {"waypoint_radius": 0.03, "path": [[0.05, 0.0], [0.05, 0.02], [0.2, 0.0]]},
}
"""Options of `SeastarSwim-v0`, beside ids with their own."""
CASES = {
    **{id: {} if id in seastar_gym.TASKS else DRAWN for id in gym.registry if id.startswith("Seastar")},
    **{f"SeastarSwim-v0 {name}": DRAWN | options for name, options in OPTIONS.items() if name},
}


def numbers(info: dict) -> dict[str, list]:
    """Numbers of an info, but for measured errors and iterations."""
    left_out = {*NAMES, "newton_iterations", "solver_message"}
    return {name: np.ravel(value).astype(float) for name, value in info.items() if name not in left_out}


def to_the_target(env: SeastarSwimEnv) -> None:
    """Carry the robot, as it is, to a millimetre from the first point that it observes."""
    state = env.simulator.get_state()
    target = env._task._targets()[0, :2] + [1e-3, 0.0]
    state.positions[:] += target - env.simulator.hub_position()
    env.simulator.set_state(state)


def first_decisions(name: str) -> list[dict[str, list]]:
    """What an environment gives in four decisions; before the last but one, the robot is at its target."""
    env = gym.make(name.partition(" ")[0], fidelity="fast", **CASES[name])
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
    rows[-1] |= {"observation": observation, "scenery": env.unwrapped._task.scenery(0).points.ravel()}
    return rows


def changes(rows: list[dict]) -> list[dict[str, list]]:
    """What differs from the row before, to five digits."""
    short = [{name: [float(f"{x:.5g}") for x in values] for name, values in row.items()} for row in rows]
    before = [{}, *short[:-1]]
    return [
        {name: values for name, values in row.items() if values != last.get(name)}
        for row, last in zip(short, before, strict=True)
    ]


@pytest.mark.parametrize("name", CASES)
def test_an_id_is_what_it_was(name):
    known = json.loads(RECORDED.read_text(encoding="utf-8")) if RECORDED.exists() else {}
    found = first_decisions(name)
    if name not in known:
        known[name] = changes(found)
        lines = ",\n".join(f"{json.dumps(case)}: {json.dumps(known[case])}" for case in sorted(known))
        RECORDED.write_text(f"{{\n{lines}\n}}\n", encoding="utf-8")
        pytest.fail(f"{name} is recorded: look at it.")
    expected: dict[str, list] = {}
    for row, changed in zip(found, known[name], strict=True):
        expected |= changed
        for entry in row:
            np.testing.assert_allclose(row[entry], expected[entry], rtol=1e-3, atol=2e-5, err_msg=entry)
