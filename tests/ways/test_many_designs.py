"""From a sweep that was stopped, and resumed on other workers, to the best design, trained."""

import json
import re

import pytest

from ways.story import command


@pytest.mark.parametrize("n_limbs, options", [("3,5", ""), ("4,8", "--seed 7 --decision-period 0.5")])
def test_the_best_of_many_designs_is_trained(story, n_limbs, options):
    folder = story.folder / "runs/limbs"
    sweep = command("docs/cluster.md", "seastar sweep robot.limb_length").rstrip("\\ ")
    sweep = sweep.replace("n_limbs=3,5", f"n_limbs={n_limbs}").replace("100000", "60")
    sweep += " --robots 8 --measured 1 --scene scene.py"
    wires = "SmaWires()" if options else "SmaPulse(0.4)"
    story.has("scene.py", f'from seastar_gym import *\nscene = Scene(Seastar(), actuator={wires}).at("fast")')

    # Ctrl-C keeps what is finished; the same command goes on, here on other workers.
    story.types(f"{sweep} --executor processes", ends=130, stop=lambda: any(folder.glob("parts/*/*.parquet")))
    story.types(f"{sweep} --executor here")
    ((new, kept),) = re.findall(r"batches: (\d+); there before, batches: (\d+)", story.told)
    assert int(kept) >= 1 and int(new) + int(kept) == 16
    (said,) = re.findall(r"Best speed: ([\d.]+) m/s, of (.*)\. Its scene: runs/limbs/best\.json", story.told)
    best = json.loads((folder / "best.json").read_text())
    assert f"robot.n_limbs={best['robot']['n_limbs']}" in said[1] and float(said[0]) > 1e-3

    # The same on an executor of one's own finds nothing to do, and the same best.
    story.types(f"{sweep} --executor here")
    assert "New in runs/limbs: 0 designs" in story.told and f"Best speed: {said[0]} " in story.told

    train = f"{command('docs/cluster.md', 'train.py --scene')} --strokes 4096 --no-video {options}"
    story.types(f"{train} --out mine")
    assert (story.folder / "mine/evaluation/report.html").is_file()
