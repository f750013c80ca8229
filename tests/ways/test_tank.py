"""From a film of a robot in a tank to a policy that drives it, to its logs, and to C on a board.

The tank is simulated, as fast as it can be, so that a busy machine disturbs nothing: another robot than the one written
down, and a camera that is turned, late and noisy. Another number of limbs has another time between decisions, another
seed, and a camera that sees markers.
"""

import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from ways.story import block, command

PAGE = "docs/three_limbs.md"
TRUE = {"fluid.drag_coefficient": 1.25, "robot.youngs_modulus": 1.15e6, "actuator.peak_angle": 0.44}
PIXEL, MIDDLE = 4e-4, (640.0, 360.0)  # [m], [px]
POSE = {"rate": 30, "delay": {"kind": "Uniform", "low": 0.05, "high": 0.15}, "jitter": 0.01, "noise": 5e-4,
        "turn_noise": 0.01, "sees": "pose"}  # fmt: skip
MARKERS = {"rate": 60, "delay": 0.08, "noise": 1e-3, "sees": 1, "action_delay": 0.02}
DECIDE = """
import numpy as np
from seastar_gym.controllers.learned import load

policy = load("runs/three/camera/policy.safetensors")
seen = np.random.default_rng(0).normal(0.0, 0.5, (300, policy.description.observation_size)).astype(np.float32)
state, actions = None, []
for k, row in enumerate(seen):
    action, state = policy.predict(row, state, np.array([k == 0]), deterministic=True)
    actions.append(int(action))
np.savetxt("seen.txt", seen, "%.9g")
print(*actions)
"""


def film(folder, turn, seed):
    """Write DeepLabCut's file of a film of the pulses, that begins a second before them, and that of its corners."""
    rows = np.genfromtxt(folder / "pulses/tracking.csv", delimiter=",", skip_header=1)
    n_points, rng = rows.shape[1] // 2, np.random.default_rng(seed)
    times = np.arange(0.0, rows[-1, 0], 1.0 / 30.0)
    swum = np.stack([np.interp(times, rows[:, 0], column) for column in rows.T[1:]], axis=1).reshape(-1, n_points, 2)
    angles = 2.0 * np.pi * np.arange(n_points - 1) / (n_points - 1)
    rest = np.concatenate([np.zeros((1, 2)), 0.1 * np.stack([np.cos(angles), np.sin(angles)], axis=1)])
    c, s = np.cos(turn), np.sin(turn)
    to_pixels = np.array([[c, -s], [-s, -c]]).T / PIXEL  # y of pictures points down
    pixels = np.concatenate([np.tile(rest, (30, 1, 1)), swum]) @ to_pixels + MIDDLE
    seen = np.concatenate([rng.normal(pixels, 1.0), np.full((*pixels.shape[:2], 1), 0.99)], axis=2)
    names = ["hub", *(f"tip{limb + 1}" for limb in range(n_points - 1))]
    header = [["scorer", *["net"] * 3 * n_points], ["bodyparts", *np.repeat(names, 3)]]
    header += [["coords", *["x", "y", "likelihood"] * n_points]]
    lines = [*header, *([k, *row] for k, row in enumerate(seen.reshape(len(seen), -1)))]
    (folder / "video.csv").write_text("".join(f"{','.join(map(str, line))}\n" for line in lines))
    corners = np.array([[-0.2, -0.1], [0.2, -0.1], [0.2, 0.1], [-0.2, 0.1]])
    places = np.hstack([corners @ to_pixels + MIDDLE, corners])
    np.savetxt(folder / "corners.csv", places, "%.6g", ",", header="u,v,x,y", comments="")


@pytest.mark.parametrize(
    "n_limbs, period, seed, camera, options",
    [(3, "0.2", 0, POSE, ""), (4, "0.25", 1, MARKERS, "--no-symmetry")],
    ids=["three limbs", "four limbs, markers, no symmetry"],
)
def test_a_robot_in_a_tank_is_filmed_fitted_trained_driven_and_put_on_a_board(
    story, n_limbs, period, seed, camera, options
):
    def types(*words, more="", **how):
        line = command(PAGE, *words).replace("--decision-period 0.2", f"--decision-period {period}")
        line = re.sub(r"(tip3=tip3)", " ".join(f"tip{limb}=tip{limb}" for limb in range(3, n_limbs + 1)), line)
        return story.types(f"{line} {more}", **how)

    for name, words in (("three.py", "peak_angle=0.5"), ("tank.py", "peak_angle=0.44")):
        coarser = block(PAGE, words).replace('"implicit-midpoint", 1e-3', '"implicit-midpoint", 4e-3')
        story.has(name, coarser.replace("Seastar(3,", f"Seastar({n_limbs},"))
    story.has("camera.json", json.dumps(camera))
    story.has("film.json", json.dumps({"rate": 120, "delay": 0.05, "sees": 1}))
    story.has("path.txt", "0.1,0.0\n")

    # Pulses, a film of them, and the numbers of the robot in the tank.
    types("seastar drive random", more=f"--sight film.json --seed {seed} --seconds 14 --yes --no-window --unpaced")
    film(story.folder, turn=0.4, seed=seed)
    types("seastar track2csv")
    types("seastar identify", "--intervals")
    assert float(re.search(r"([\d.]+) times the noise", story.told)[1]) < 1.1, story.told
    fitted = json.loads((story.folder / "fitted.json").read_text())
    for name, true in TRUE.items():
        assert fitted[name.split(".")[0]][name.split(".")[1]] == pytest.approx(true, rel=0.04), name

    # A policy that sees everything cannot drive, and says what to do; that for the camera drives.
    short = f"--strokes 16384 --save-freq 16384 --seed {seed} --no-video {options}"
    types("train.py --scene fitted.json", more=short)
    story.types("seastar drive runs/three/policy.safetensors", ends=2)
    assert "python train.py --resume runs/three --for-camera camera.json" in story.told
    types("--for-camera", more="--quick")
    types("seastar drive runs/three/camera", more=f"--path path.txt --seed {seed} --yes --no-window --unpaced")
    assert "The guard had nothing to stop" in story.told
    if not options:  # without symmetry so short a training reaches nothing
        planned, driven = map(int, re.findall(r"^(?:Plan|Driven): (\d+) decisions", story.told, re.MULTILINE))
        assert driven == pytest.approx(planned, rel=0.3)

    # Logs of the drive, too, tell which robot is in the tank.
    types("seastar identify driven/tracking.csv")
    (drag,) = re.findall(r"fluid.drag_coefficient = ([\d.]+)", story.told)
    assert float(drag) == pytest.approx(TRUE["fluid.drag_coefficient"], rel=0.1), story.told

    # The board decides as the policy does.
    types("seastar export")
    actions = story.runs(DECIDE).split()
    if shutil.which("gcc") is None:
        pytest.skip("there is no C compiler gcc")
    story.has("board.c", Path(__file__).with_name("board.c").read_text("utf-8"))
    compiler = ["gcc", "-std=c99", "-Wall", "-Werror", "board.c", "-o", "board", "-lm"]
    subprocess.run(compiler, cwd=story.folder, check=True)
    seen = (story.folder / "seen.txt").read_bytes()
    board = subprocess.run(["./board"], cwd=story.folder, input=seen, capture_output=True, check=True)
    assert board.stdout.decode().split() == actions
