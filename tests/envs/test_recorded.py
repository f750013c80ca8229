"""The first decisions of every id, as they were recorded: whoever trains on a -v0 has the same task in every release.

Where an id is to change, it gets a new version: then delete the file, run this test, and look at the difference.
"""

import json
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

import seastar_gym
from seastar_gym import DomainRandomization, HeadingTargets, LogUniform, Normal, Uniform
from seastar_gym.accuracy.info import NAMES
from seastar_gym.envs.seastar_swim import SeastarSwimEnv

RECORDED = Path(__file__).parent / "episodes.json"
DRAWN = {"path": "random", "random_heading": True}
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


def swum(name: str) -> list[dict[str, list]]:
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
    found = swum(name)
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
