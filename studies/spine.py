"""The spine: the files that a decision passes on its way from `gym.make` to Newton's step, in this order.

A decision of one robot with few nodes runs in plain Python, and every call of a function of the package is seen.
"""

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from seastar_gym.files import save_figure
from studies.frame import Results, Study
from studies.style import INK, subplots

PASSED = """
import json, sys
from pathlib import Path
import gymnasium as gym
import seastar_gym
from seastar_gym import Numerics, Scene, Seastar

package, passed = Path(seastar_gym.__file__).parent, {}

def see(frame, event, argument):
    code = frame.f_code
    if event == "call" and code.co_name != "<module>" and code.co_filename.startswith(str(package)):
        passed.setdefault(Path(code.co_filename).relative_to(package).as_posix(), code.co_name)

def make():
    scene = Scene(Seastar(nodes_per_limb=3), numerics=Numerics("implicit-midpoint", 0.05))
    env = gym.make("SeastarSwim-v0", scene=scene)
    env.reset(seed=0)
    return env

make()  # what is imported meanwhile is not passed again
sys.setprofile(see)
make().step([1, 0, 0, 2, 0])
sys.setprofile(None)
print(json.dumps([[file, name, len((package / file).read_text().splitlines())] for file, name in passed.items()]))
"""
COLOURS = ("#2b6cb0", "#c05621", "#2f855a", "#6b46c1", "#b7791f", "#c53030", "#4a5568", "#0987a0")
ROWS = 24


def run(results: Results) -> None:
    """See what a decision passes."""
    plain = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    told = subprocess.run([sys.executable, "-c", PASSED], env=plain, check=True, capture_output=True, text=True).stdout
    results["files"] = json.loads(told)


def draw(results: Mapping[str, Any], file: Path) -> None:
    """Draw the files in columns, from top left to bottom right, in the colours of their rooms."""
    files = results["files"]
    rooms = list(dict.fromkeys(path.partition("/")[0].removesuffix(".py") for path, _, _ in files))
    columns = -(-len(files) // ROWS)
    figure, axes = subplots(figsize=(2.15 * columns, 0.36 * ROWS + 0.4))
    for number, (path, first, lines) in enumerate(files):
        x, y = divmod(number, ROWS)
        room, _, rest = path.rpartition("/")
        colour = COLOURS[rooms.index(path.partition("/")[0].removesuffix(".py")) % len(COLOURS)]
        axes.text(x, -y, f"{number + 1}", color=colour, fontsize=9, ha="right", va="center", weight="bold")
        axes.text(x + 0.04, -y + 0.12, f"{room}/{rest}" if room else rest, color=colour, fontsize=7.5, va="center")
        axes.text(x + 0.04, -y - 0.22, f"{first}, {lines} lines", color=INK, fontsize=6, va="center")
    axes.set_xlim(-0.1, columns - 0.05)
    axes.set_ylim(-ROWS + 0.5, 0.6)
    axes.axis("off")
    axes.set_title(f"A decision passes {len(files)} files of {sum(each[2] for each in files):,} lines", fontsize=9)
    save_figure(figure, file, dpi=118)


STUDY = Study("spine", run, file="spine/spine.json", pictures={"spine.png": draw})
