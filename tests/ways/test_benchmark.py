"""A row of the benchmark: trained, stopped, gone on with, evaluated, and merged with another's."""

import json

from ways.story import command

CELL = "--methods PPO --tracks symmetric --ids SeastarStation-v0 --decisions 4096 --processes 1"


def test_a_row_is_trained_after_a_stop_evaluated_and_merged(story):
    train = f"python -m agents.tasks --benchmark {CELL}"
    files = [story.folder / f"runs/benchmark/4096/ppo-symmetric/SeastarStation-v0-{seed}.json" for seed in (0, 1)]
    story.types(f"{train} --seeds 0 1", ends=130, stop=files[0].is_file)
    assert files[0].is_file() and not files[1].is_file()
    first = files[0].read_bytes()
    story.types(f"{train} --seeds 0 1")
    assert "1 cells to train" in story.told and files[0].read_bytes() == first and files[1].is_file()
    evaluate = command("docs/benchmark.md", "seastar evaluate --benchmark", "--agents").partition("--agents")[0]
    zips = ",".join(str(file.with_suffix(".zip").relative_to(story.folder)) for file in files)
    story.types(f"{evaluate} --agents mine={zips} --out runs/mine", ends=2)
    assert "learned for 4,096 decisions: say --decisions 4096." in story.told
    story.types(f"{evaluate} --agents mine={zips} --decisions 4096 --out runs/mine")
    assert "4,096 decisions" in story.told
    mine = json.loads((story.folder / "runs/mine/benchmark.json").read_text())["cells"]
    trained = [json.loads(file.read_text())["cells"][0] for file in files]
    assert {one["track"] for one in mine} == {"symmetric"}
    assert [one["measure"] for one in mine] == [one["measure"] for one in trained]
    story.types(f"seastar evaluate --merge runs/mine/benchmark.json {files[0].relative_to(story.folder)}")
    assert "mine" in story.told and "PPO" in story.told and "(2)" in story.told
