"""From a force in a file of one's own to a policy that swims with it, with the page's numbers and others."""

import json
import re

import pytest

from ways.story import block, command

PAGE = "docs/extending.md"
SCENE = """
from drag import LinearDrag

from seastar_gym import Scene, Seastar, SmaWires

scene = Scene(Seastar({}), actuator=SmaWires(), terms=(LinearDrag({}),))
"""
SHORT = "--strokes 4096 --save-freq 4096 --no-video"


@pytest.mark.parametrize(
    "n_limbs, drag, options", [(4, 0.004, ""), (3, 0.002, "--decision-period 0.5 --seed 3"), (8, 0.001, "--seed 1")]
)
def test_a_robot_with_a_force_of_its_own_is_trained_continued_and_compared(story, n_limbs, drag, options):
    story.has("drag.py", block(PAGE, "class LinearDrag").partition("\nscene = ")[0])
    story.has("my_scene.py", SCENE.format(n_limbs, drag))
    story.types(f"{command('docs/own_robot.md', 'train.py --scene')} {SHORT} {options} --out runs/mine")
    story.types("python train.py --resume runs/mine --strokes 8192 --no-video", ends=2)
    assert "--run-scene" in story.told  # code of a run is executed for those only who say so
    story.types("python train.py --resume runs/mine --run-scene --strokes 8192 --no-video")
    about = json.loads((story.folder / "runs/mine/policy.json").read_text("utf-8"))
    assert about["scene"]["robot"]["nodes_per_limb"] == 7  # it still swims at "fast", which its file does not name
    period = "--decision-period 0.5" if "0.5" in options else ""
    story.types(f"seastar evaluate --scene runs/mine/scene.py --agents runs/mine/policy.safetensors greedy {period}")
    policy, greedy = re.findall(r"^(?:policy|greedy) .*? (\d) of 5 ", story.told, re.MULTILINE)
    assert greedy == "5" and int(policy) >= 1, story.told


SWIM = """
from seastar_gym import Simulator

simulator = Simulator(scene)
simulator.advance(1.0, [[0, 1, -1]])
print(abs(simulator.hub_position()).sum())
"""


def test_an_edited_force_is_another_force(story):
    """Twice the drag in the same file is twice the number, although the code of the first is on disk."""

    def swum(drag):
        return float(story.runs(SCENE.format(3, drag) + SWIM).splitlines()[-1])

    story.has("drag.py", block(PAGE, "class LinearDrag").partition("\nscene = ")[0])
    once, twice = swum(0.01), swum(0.02)
    code = (story.folder / "drag.py").read_text("utf-8")
    story.has("drag.py", code.replace("return 0.5 * c *", "c = 2.0 * c\n        return 0.5 * c *"))
    assert swum(0.01) == pytest.approx(twice, rel=1e-9) != pytest.approx(once, rel=1e-3)
