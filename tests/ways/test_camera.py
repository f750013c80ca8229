"""From a robot of three limbs to a policy for its camera, to a drive of another such robot, and to C for its board.

A story by documented commands alone, each in a process of its own, in an empty folder. The same again with other
limbs, decisions, seeds and a camera that sees markers.
"""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
DECISIVE = ["--coasting", "--discount", "0.3", "--gae-lambda", "0.95"]
"""Options of a training whose decisions are shorter than strokes (docs/training.md)."""
STORIES = {
    "three limbs": (3, 0.2, 0, {"rate": 30, "delay": {"kind": "Uniform", "low": 0.05, "high": 0.15}, "jitter": 0.01,
                                "dropout": 0.01, "noise": 5e-4, "turn_noise": 0.01, "sees": "pose"}),
    "four limbs, markers": (4, 0.25, 1, {"rate": 60, "delay": 0.08, "noise": 1e-3, "sees": 1, "action_delay": 0.02}),
}  # fmt: skip
"""Number of limbs, time between decisions [s], seed, and camera."""
SCENE = "from seastar_gym import Scene, Seastar, SmaWires\n\nscene = Scene(Seastar({}), actuator=SmaWires())\n"
DRIVE = """
import json, sys
import numpy as np
from seastar_gym import Simulator
from seastar_gym.controllers.learned import load
from seastar_gym.evaluation.path_file import load_path
from seastar_gym.evaluation.swim import swim
from seastar_gym.plant.simulated import SimulatedPlant
from seastar_gym.plant.swim import PlantSwim
from seastar_gym.scene.scene_file import load_scene

policy = load(sys.argv[1])
about, seen = policy.description, []
tank = SimulatedPlant(Simulator(load_scene("other.py").at("fast")), about.sight, seed=7)
env = PlantSwim(
    tank, scene=policy.scene, decision_period=policy.decision_period, sight=about.sight, actions=policy.actions,
    path=load_path("path.txt"), logs="logs",
)


class Watched:
    actions = policy.actions

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        action, state = policy.predict(observation, state, episode_start, deterministic)
        seen.append((observation, action))
        return action, state


swum = swim("driven", Watched(), env, max_strokes=1000)
np.savetxt("observations.txt", [observation for observation, _ in seen], "%.9g")
np.savetxt("actions.txt", [action for _, action in seen], "%d")
print(json.dumps([swum.finished, swum.time[-1], env.stopped]))
"""
BOARD = """
#include <stdio.h>
#include "policy.c"

int main(void)
{
    float observation[SEASTAR_SIZE], commands[SEASTAR_LIMBS];
    int action[SEASTAR_NUMBERS];
    struct seastar robot;
    seastar_begin(&robot);
    for (;;) {
        for (int k = 0; k < SEASTAR_SIZE; k++)
            if (scanf("%f", &observation[k]) != 1)
                return 0;
        seastar_act(&robot, observation, action, commands);
        printf("%d\\n", action[0]);
    }
}
"""


def done(folder: Path, *command: str, code: int = 0, **more) -> str:
    """What a command says, in a process of its own, that ends with an exit code."""
    found = subprocess.run(
        [sys.executable, *command], cwd=folder, env=os.environ | {"PYTHONPATH": str(ROOT), "PYTHONWARNINGS": "ignore"},
        capture_output=True, text=True, check=False, **more,
    )  # fmt: skip
    assert found.returncode == code, found.stderr
    return found.stdout if code == 0 else found.stderr


@pytest.mark.parametrize("story", STORIES)
def test_a_training_ends_in_a_policy_that_drives_another_robot_and_a_board(story, tmp_path):
    n_limbs, period, seed, camera = STORIES[story]
    (tmp_path / "robot.py").write_text(SCENE.format(f"n_limbs={n_limbs}"))
    (tmp_path / "other.py").write_text(SCENE.format(f"n_limbs={n_limbs}, youngs_modulus=1.08e6"))
    (tmp_path / "camera.json").write_text(json.dumps(camera))
    (tmp_path / "path.txt").write_text("0.1,0.0\n0.15,0.05\n")
    train = str(ROOT / "train.py")
    seastar = ("-m", "seastar_gym.cli")
    run, policy = "runs/mine", "runs/mine/camera/policy.safetensors"

    done(tmp_path, train, "--scene", "robot.py", "--decision-period", str(period), *DECISIVE, "--strokes", "65536",
         "--save-freq", "65536", "--seed", str(seed), "--no-video", "--out", run)  # fmt: skip
    told = done(tmp_path, *seastar, "drive", f"{run}/policy.safetensors", code=2)
    assert f"python train.py --resume {run} --for-camera camera.json" in told and "full sight" in told

    done(tmp_path, train, "--resume", run, "--for-camera", "camera.json", "--quick")
    assert (tmp_path / run / "camera" / "evaluation" / "report.html").is_file()
    rows = (tmp_path / run / "camera" / "evaluation" / "evaluation.csv").read_text().splitlines()
    assert [row.split(",")[0] for row in rows[1:]] == ["camera", "full sight"]

    planned = done(tmp_path, *seastar, "drive", policy, "--path", "path.txt", "--dry", "--seed", str(seed))
    decisions = int(re.search(r"Plan: (\d+) decisions", planned)[1])
    driven = done(tmp_path, *seastar, "drive", policy, "--plant", "sim:other.py", "--path", "path.txt", "--yes",
                  "--no-window", "--seconds", "2", "--out", "short")  # fmt: skip
    assert "Driven: 0 of 2 waypoints. The guard had nothing to stop." in driven

    finished, seconds, stopped = json.loads(done(tmp_path, "-c", DRIVE, policy))
    assert finished and not stopped
    assert seconds == pytest.approx(decisions * period, rel=0.3)

    if shutil.which("gcc") is None:
        pytest.skip("there is no C compiler gcc")
    done(tmp_path, *seastar, "export", policy, "--to", "c", "--out", "policy.c")
    (tmp_path / "board.c").write_text(BOARD)
    subprocess.run(["gcc", "-std=c99", "-Wall", "-Werror", "board.c", "-o", "board", "-lm"], cwd=tmp_path, check=True)
    with (tmp_path / "observations.txt").open() as observations:
        found = subprocess.run(["./board"], cwd=tmp_path, stdin=observations, capture_output=True, check=True)
    np.testing.assert_array_equal(np.array(found.stdout.split(), int), np.loadtxt(tmp_path / "actions.txt", int))
