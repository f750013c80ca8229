"""Training with RLlib: it learns policies of this package; killed env runners, nodes and drivers cost little."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

if any(find_spec(name) is None for name in ("ray", "tree", "stable_baselines3")):
    pytest.skip("the extra rllib is not installed", allow_module_level=True)

import ray

from agents.hyperparameters import Hyperparameters
from agents.rllib.algorithm import make_algorithm, policy_of
from agents.rllib.command import main
from agents.rllib.options import Options, read_options
from agents.rllib.training import checkpoints, last_checkpoint, save_checkpoint, train
from agents.training.folder import recorded
from seastar_gym.controllers.learned import load
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.executors.on_ray import connect

ROOT = Path(__file__).resolve().parents[2]
SMALL = Hyperparameters(num_envs=8, rollout=8, batch_size=32, epochs=2, hidden=(16, 8), max_episode_time=10.0)
WORDS = (
    "--num-envs", "8", "--rollout", "8", "--batch-size", "32", "--epochs", "2", "--hidden", "16", "8",
    "--save-freq", "64", "--env-runners", "2",
)  # fmt: skip

# Ray and its RLlib warn of themselves.
pytestmark = pytest.mark.filterwarnings("ignore")


@pytest.fixture(autouse=True)
def path_of_workers(monkeypatch):
    """What Ray starts finds this checkout."""
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    yield
    ray.shutdown()


def options(tmp_path, **changes):
    return replace(Options(strokes=256, save_freq=64, out=tmp_path / "run", ppo=SMALL), **changes)


def on(done):
    return True


# Options


@pytest.mark.parametrize(
    "words, sentence",
    [
        (["--env-runners", "3"], "128 robots cannot be shared by 3 env runners evenly."),
        (["--coasting"], "Progress by coasting is a reward of train.py"),
        (["--resume", "nowhere"], "There is no run to continue in nowhere"),
        (["--address", "127.0.0.1:1"], "There is no Ray cluster at 127.0.0.1:1"),
    ],
)
def test_bad_input_is_one_sentence(words, sentence, tmp_path, capsys):
    told = ""
    try:
        code = main(["--out", str(tmp_path / "run"), *words])
    except SystemExit as refused:  # tyro says the sentence in a frame
        code = refused.code
    except OSError as refused:  # of which `run_command` makes a sentence
        code, told = 2, str(refused)
    told = " ".join((told + capsys.readouterr().err).split())
    assert code == 2 and sentence in told and "Traceback" not in told


def test_a_run_goes_on_with_its_own_options(tmp_path):
    options(tmp_path, seed=3).write()
    again = read_options(["--resume", str(tmp_path / "run"), "--strokes", "512", "--env-runners", "4"])
    assert again.seed == 3 and again.ppo == SMALL and again.out == tmp_path / "run"
    assert (again.strokes, again.env_runners) == (512, 4)
    with pytest.raises(ValueError, match="cannot continue with another seed"):
        read_options(["--resume", str(tmp_path / "run"), "--seed", "4"])


# Learning


@pytest.mark.slow
def test_a_run_leaves_a_policy_and_goes_on_where_it_was(tmp_path):
    """The policy acts as RLlib's network."""
    import torch

    connect(None, 2)
    wanted, rates = options(tmp_path), []
    done = train(wanted, on)
    assert done.strokes >= 256 and done.restarts == 0
    assert load(wanted.out / "policy.safetensors").actions == "pairs"
    assert [row[0] for row in recorded(wanted.out)][-1] == done.strokes and len(checkpoints(wanted.out)) == 2

    def watch(done):
        optimiser = done.algorithm.learner_group._learner.get_optimizer("default_policy")
        rates.append((done.strokes, optimiser.param_groups[0]["lr"]))
        return True

    again = train(replace(wanted, strokes=512), watch)
    assert rates[0][0] > done.strokes and again.strokes >= 512 and 0.0 < rates[0][1] < 0.5e-3
    algorithm = make_algorithm(wanted)
    algorithm.train()
    batch = SeastarSwimVectorEnv(32, path="random", actions="pairs", fidelity="fast", random_heading=True)
    observations, _ = batch.reset(seed=0)
    network = algorithm.learner_group._learner.module["default_policy"]
    with torch.no_grad():
        logits = network.forward_inference({"obs": torch.as_tensor(observations)})["action_dist_inputs"]
    ours = policy_of(algorithm, wanted).logits(observations)[:, 0]
    np.testing.assert_allclose(ours, logits.numpy(), rtol=1e-4, atol=1e-5)
    algorithm.stop()


def test_a_checkpoint_that_cannot_be_written_leaves_the_last_one(tmp_path):
    class Full:
        def save_to_path(self, place):
            Path(place).mkdir(parents=True)
            (Path(place) / "half").touch()
            raise OSError(28, "No space left on device")

    class Sound:
        def save_to_path(self, place):
            Path(place).mkdir(parents=True)

    save_checkpoint(Sound(), tmp_path, 64)
    with pytest.raises(OSError, match="No space"):
        save_checkpoint(Full(), tmp_path, 128)
    assert last_checkpoint(tmp_path).name == f"{64:012d}"
    assert [file.name for file in (tmp_path / "checkpoints").iterdir()] == [f"{64:012d}"]
    for strokes in (128, 192):
        save_checkpoint(Sound(), tmp_path, strokes)
    assert [int(place.name) for place in checkpoints(tmp_path)] == [128, 192]


# Losses


def process_of_runner(algorithm):
    """Process of the first env runner."""
    return algorithm.env_runner_group.foreach_env_runner(lambda runner: os.getpid(), local_env_runner=False)[0]


PATIENCE = 600.0
"""Time that Ray has for starting an env runner again [s]: how soon it does is the machine's affair."""


class Killing:
    """Watch that kills after the first round, and ends the training some rounds after an env runner is back."""

    def __init__(self, kill):
        self.kill, self.killed_after, self.back_after = kill, None, None
        self.end = time.monotonic() + PATIENCE

    def __call__(self, done):
        if self.killed_after is None:
            self.killed_after = done.strokes
            self.kill(done.algorithm)
        if done.restarts and self.back_after is None:
            self.back_after = done.strokes
        return time.monotonic() < self.end and (self.back_after is None or done.strokes < self.back_after + 128)


def kill_runner(algorithm, cluster, nodes):
    os.kill(process_of_runner(algorithm), signal.SIGKILL)


def kill_node(algorithm, cluster, nodes):
    busy = algorithm.env_runner_group.foreach_env_runner(
        lambda runner: ray.get_runtime_context().get_node_id(), local_env_runner=False
    )
    cluster.remove_node(next(node for node in nodes if node.node_id == busy[0]), allow_graceful=False)


@pytest.fixture
def cluster():
    """A cluster whose head runs nothing, and three nodes."""
    from ray.cluster_utils import Cluster

    made = Cluster(initialize_head=True, head_node_args={"num_cpus": 0, "include_dashboard": False})
    yield made, [made.add_node(num_cpus=1) for _ in range(3)]
    ray.shutdown()
    made.shutdown()


@pytest.mark.slow
@pytest.mark.parametrize("kill", [kill_runner, kill_node])
def test_what_is_killed_costs_its_env_runner_for_a_while(kill, cluster, tmp_path):
    connect(cluster[0].address, None)
    watch = Killing(lambda algorithm: kill(algorithm, *cluster))
    done = train(options(tmp_path, strokes=1_000_000, save_freq=1_000_000), watch)
    assert done.restarts == 1 and done.strokes >= watch.back_after + 128


def command(*words):
    return subprocess.Popen(
        [sys.executable, "-m", "agents.rllib", *words], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True, start_new_session=True,
    )  # fmt: skip


@pytest.mark.slow
def test_a_killed_driver_is_continued_by_the_command(cluster, tmp_path):
    """On a cluster that outlives it."""
    place, end = tmp_path / "run", time.monotonic() + 400
    driver = command("--address", cluster[0].address, "--strokes", "100000", "--out", str(place), *WORDS)
    while last_checkpoint(place) is None:
        assert driver.poll() is None, driver.communicate()
        assert time.monotonic() < end
        time.sleep(0.1)
    driver.kill()
    driver.communicate(timeout=60)
    reached = int(last_checkpoint(place).name)
    again = command("--resume", str(place), "--strokes", str(reached + 128))
    told, errors = again.communicate(timeout=400)
    assert again.returncode == 0, errors
    strokes = [row[0] for row in recorded(place)]
    assert strokes[-1] >= reached + 128 and strokes == sorted(set(strokes)) and "Policy:" in told
