"""The hyperparameter file for rl_zoo3 has the project's own hyperparameters, and learners can be made of it."""

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import gymnasium as gym
import pytest
import yaml

import seastar_gym
from later import Later

ppo = Later("agents.ppo")

FILE = Path(__file__).parents[2] / "agents" / "rl_zoo3" / "ppo.yml"
SETTINGS = yaml.safe_load(FILE.read_text(encoding="utf-8"))
IDS = [name for name in SETTINGS if name.endswith("-v0")]


def ours(id):
    """Hyperparameters of the project for an id."""
    from agents.ppo import OWN

    row = seastar_gym.IDS[id]
    if row.task is not None:
        return ppo.Hyperparameters(**{"decision_period": row.decision_period, **OWN[row.task]})
    if row.decision_period < 1.0:  # the trainings of docs/training.md
        timed = {"discount": 0.9, "rollout": 32, "num_envs": 64, "gae_lambda": 0.95}
        return ppo.Hyperparameters(decision_period=row.decision_period, **timed)
    return ppo.Hyperparameters()


@pytest.mark.parametrize("id", IDS)
def test_the_file_has_the_project_s_hyperparameters(id):
    assert {"SeastarSwim-v0", "SeastarSwimTimed-v0", "SeastarPrey-v0"} <= {*IDS} <= {*gym.registry}
    told, known = SETTINGS[id], ours(id)
    assert told["gamma"] == pytest.approx(known.discount_per_decision, abs=1e-12)
    for name, field in {
        "n_envs": "num_envs", "n_steps": "rollout", "batch_size": "batch_size", "n_epochs": "epochs",
        "clip_range": "clip_range", "gae_lambda": "gae_lambda", "ent_coef": "entropy",
    }.items():  # fmt: skip
        assert told[name] == getattr(known, field), name
    assert told["learning_rate"] == f"lin_{known.learning_rate:g}"
    assert told["policy_kwargs"] == f"dict(net_arch={list(known.hidden)})"


@pytest.mark.parametrize("id", ["SeastarSwim-v0", "SeastarPrey-v0"])
def test_a_learner_is_made_of_it_and_learns(id):
    from stable_baselines3 import PPO
    from stable_baselines3.common.env_util import make_vec_env

    told = dict(SETTINGS[id])
    wrapper = getattr(seastar_gym, told.pop("env_wrapper").removeprefix("seastar_gym."))
    env = make_vec_env(id, 2, wrapper_class=wrapper, env_kwargs=told.pop("env_kwargs"))
    for name in ("n_timesteps", "n_envs", "policy_kwargs"):
        del told[name]
    told |= {"batch_size": 32, "learning_rate": float(told["learning_rate"].removeprefix("lin_"))}
    learner = PPO(env=env, device="cpu", **told)
    learner.learn(1)
    assert learner.num_timesteps == 2 * told["n_steps"]


@pytest.mark.skipif(find_spec("rl_zoo3") is None, reason="rl_zoo3 has an environment of its own")
def test_rl_zoo3_trains_by_it(tmp_path):
    command = [
        *("-m", "rl_zoo3.train", "--algo", "ppo", "--env", "SeastarSwim-v0", "--gym-packages", "seastar_gym"),
        *("--conf-file", str(FILE), "-n", "32", "--eval-freq", "-1", "-f", str(tmp_path), "--device", "cpu"),
        *("-params", "n_envs:2", "batch_size:16"),
    ]
    done = subprocess.run([sys.executable, *command], cwd=FILE.parents[2], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "Saving to" in done.stdout and list(tmp_path.rglob("SeastarSwim-v0.zip"))
