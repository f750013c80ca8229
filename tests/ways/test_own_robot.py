"""From a scene of one's own, the page's or another, to a policy that is filmed, played, trained on and published."""

import json
import re

import pytest

from ways.story import block, command

SHORT = "--strokes 8192 --save-freq 2048"
"""Options of a training that takes seconds."""


@pytest.mark.parametrize(
    "n_limbs, options",
    [(4, "--no-video"), (3, "--decision-period 0.5 --seed 3 --no-symmetry"), (8, "--seed 1 --no-video")],
)
def test_a_robot_of_ones_own_is_trained_compared_filmed_played_and_published(story, n_limbs, options):
    scene = block("docs/own_robot.md", "n_limbs=4").replace("n_limbs=4", f"n_limbs={n_limbs}")
    scene = scene.replace("),) * 4", f"),) * {n_limbs}")
    if "decision-period" in options:
        scene = scene.replace("SmaPulse", "SmaWires")
    symmetric = "--no-symmetry" not in options
    if not symmetric:  # one limb is longer than the others
        scene = scene.replace(f"),) * {n_limbs}", f"),) * {n_limbs - 1} + (Limb(length=0.09),)")
    story.has("my_scene.py", scene)
    run, checkpoint = story.folder / "runs/mine", story.folder / "runs/mine/checkpoints"

    # It is trained; Ctrl-C stops it after the first checkpoint, and the command that it names goes on.
    train = f"{command('docs/own_robot.md', 'train.py --scene')} {SHORT} {options} --out runs/mine"
    story.types(train, ends=130, stop=lambda: any(checkpoint.glob("*.zip")))
    (goes_on,) = re.findall(r"python \S*train.py --resume .*", story.told)
    story.types(goes_on)
    assert (run / "evaluation/report.html").is_file()
    assert (run / "evaluation/learned.mp4").is_file() == (not options.endswith("--no-video"))
    learned, greedy = re.findall(r"^(?:learned|greedy)\s+\S+\s+([\d.-]+)\s+(\d) of 5", story.told, re.MULTILINE)
    assert int(learned[1]) >= symmetric and greedy[1] == "5", story.told

    # It is compared again, as the page and the report say.
    evaluate = command("docs/own_robot.md", "seastar evaluate --agents")
    story.types(f"{evaluate.replace('runs/FOLDER', 'runs/mine')} --out again")
    assert "policy" in story.told and "greedy" in story.told

    # It swims and is played, without that anybody says again what it is.
    swim = command("docs/command.md", "seastar swim --agent runs/FOLDER").replace("runs/FOLDER", "runs/mine")
    story.types(f"{swim} --seconds 3")
    story.types('seastar play --scene my_scene.py --keys "right*2 1w ." --film played.gif')
    assert (story.folder / "mine.mp4").stat().st_size > 1000 < (story.folder / "played.gif").stat().st_size

    # Its card says whose it is.
    story.types("python -m agents.cards --policies runs/mine/policy.safetensors")
    card = (run / "policy.md").read_text(encoding="utf-8")
    assert f"a robot of {n_limbs} limbs" in card
    assert json.loads((run / "policy.json").read_text())["symmetry"] is symmetric
