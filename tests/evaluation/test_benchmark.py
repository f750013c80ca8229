"""The benchmark: one contract for an id, results that merge, and tables that say how many seeds they have."""

import json
from pathlib import Path

import numpy as np
import pytest

from refusals import assert_refused
from seastar_gym.cli.main import main
from seastar_gym.controllers.learned import pretrained
from seastar_gym.controllers.open_loop import scripted
from seastar_gym.evaluation import benchmark
from seastar_gym.evaluation.benchmark import ENTRIES, Cell, contract, make, read, swum, tables, write
from seastar_gym.evaluation.results import interquartile_mean, over_trainings, probability_of_improvement
from studies.tasks import greedy

PREY, STATION = "SeastarPreyTimed-v0", "SeastarStation-v0"
SCALES = {PREY: (0.0, 8.0), STATION: (2.0, 0.5)}


def cell(agent, id, seed, mean, track="plain", contract="a"):
    return Cell(agent, track, id, seed, contract, 0, [mean - 0.1, mean + 0.1], [1.0, 2.0], [True, False])


def row(agent, means, id=PREY, **how):
    return [cell(agent, id, seed, mean, **how) for seed, mean in enumerate(means)]


@pytest.fixture
def scales(monkeypatch):
    monkeypatch.setattr(benchmark, "scales", lambda: SCALES)


# Statistics


@pytest.mark.parametrize("n", [1, 2, 3])
def test_a_learner_has_an_interval_from_three_seeds_on(n, scales):
    seeds = np.arange(1.0, n + 1.0)
    for found in (over_trainings(seeds), interquartile_mean([seeds, [1.0, 2.0, 3.0]])):
        assert found.mean > 0.0 and np.isnan([found.low, found.high]).all() == (n < 3)
    (text,) = (line for line in tables(row("mine", seeds)).splitlines() if line.startswith("mine"))
    assert f"({n})" in text and ("[" in text) == (n == 3)


def test_an_interval_of_the_score_holds_for_other_seeds():
    """Of 200 draws of ten seeds on six ids, 95 % of the intervals have the true mean; a bootstrap has a few less."""
    rng, held = np.random.default_rng(0), 0
    for _ in range(200):
        found = interquartile_mean(rng.normal(size=(6, 10)))
        held += found.low < 0.0 < found.high
    assert 0.88 < held / 200 < 0.99


def test_the_probability_of_improvement_counts_pairs_of_seeds_and_ids_alike():
    assert probability_of_improvement([[1.0, 3.0], [2.0]], [[2.0, 2.0], [1.0]]) == pytest.approx((0.5 + 1.0) / 2.0)


def test_a_score_is_0_for_the_greedy_rule_and_1_for_the_oracle_whichever_is_better(scales):
    means = {PREY: (0.0, 8.0, 4.0), STATION: (2.0, 0.5, 1.25)}
    for id, values in means.items():
        assert [benchmark.score(cell("a", id, 0, mean)) for mean in values] == pytest.approx([0.0, 1.0, 0.5])
    assert np.isnan(benchmark.score(cell("a", "SeastarFailBlind-v0", 0, 1.0)))


def test_rows_that_lack_an_id_have_no_score_and_tables_say_over_which_ids_scores_are(scales):
    cells = row("whole", [4.0] * 3) + row("whole", [1.0] * 3, STATION) + row("part", [8.0] * 3)
    text = tables([*cells, *row("whole", [9.0] * 3, "SeastarFailBlind-v0")])
    whole, part = (next(line for line in text.splitlines() if line.startswith(name)) for name in ("whole", "part"))
    assert "PreyTimed, Station" in text and part.split()[-3:] == ["–"] * 3 and "0.583" in whole
    *_, best = tables([*row("part", [8.0] * 3), *cells[:6], *row("best", [9.0] * 3), *row("best", [0.0] * 3, STATION)],
                      benchmark.as_markdown).strip().splitlines()  # fmt: skip
    assert best.startswith("| best |") and best.endswith(" 1.00 |")


# Files


def test_files_of_one_contract_merge_unless_they_have_different_results_of_one_training(tmp_path, scales):
    write(row("mine", [1.0, 2.0]), tmp_path / "a.json")
    write(row("mine", [1.0]) + row("yours", [3.0], track="symmetric"), tmp_path / "b.json")
    found = read([tmp_path / "a.json", tmp_path / "b.json"])
    assert [np.mean(one.measure) for one in found] == pytest.approx([1.0, 2.0, 3.0])
    plain, symmetric = tables(found).split("Track symmetric")
    assert "mine" in plain and "yours" not in plain and "yours" in symmetric
    write(row("mine", [5.0]), tmp_path / "c.json")
    with assert_refused("a.json", "c.json have different results of mine", "seed 0", "LABEL="):
        read([tmp_path / "a.json", tmp_path / "c.json"])


ODD = {
    "agent": [5, "", []], "track": ["banana", []], "id": [5, "SeastarSwim-v0"], "contract": [None],
    "seed": [-3, 0.5, "zero", [0]], "first": ["0", 0.5, None], "decisions": [-2048, 2048.5, "2048", [1], 10**400],
    "measure": [["x", "y"], [None, 1.0], [True, False], [1.0], [], 1.0],
    "returns": [[1.0]], "success": [[7, 7], [True]], "seconds": ["fast", -1.0], "curve": [5, [3], [{"measure": 1.0}]],
}  # fmt: skip
"""What entries of a cell cannot be."""
WRONG = ['{"runs": 3}', '{"cells": [', '{"cells": [{"agent": "mine"}]}', ""]
WRONG += [
    json.dumps({"cells": [cell("mine", PREY, 0, 1.0)._replace(**{name: value})._asdict()]})
    for name, values in ODD.items()
    for value in values
]


@pytest.mark.parametrize("text", WRONG)
def test_an_out_that_is_damaged_or_no_folder_is_refused_before_anything_swims(text, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(benchmark, "measured", None)
    (tmp_path / "benchmark.json").write_text(text)
    assert main(["evaluate", "--benchmark", "--agents", "greedy", "--out", str(tmp_path)]) == 2
    assert "benchmark.json is no " in capsys.readouterr().err
    told = "benchmark.json is no file of the benchmark: " if '"curve"' in text else "benchmark.json is no "
    assert main(["evaluate", "--merge", str(tmp_path)]) == 2
    assert told in (said := capsys.readouterr().err) and said.count("\n") == 1
    assert (tmp_path / "benchmark.json").read_text() == text
    (tmp_path / "mine").write_text(text)
    with pytest.raises(FileExistsError):
        main(["evaluate", "--benchmark", "--agents", "greedy", "--out", str(tmp_path / "mine")])


def test_results_join_those_of_a_folder_and_files_are_shown_by_ids(tmp_path, scales, monkeypatch, capsys):
    monkeypatch.setattr(benchmark, "contract", lambda id: "a")
    monkeypatch.setattr(benchmark, "EPISODES", 2)
    monkeypatch.setattr(
        benchmark, "measured",
        lambda id, label, names, first, threads, decisions: [
            cell(label, id, seed, 1.0)._replace(first=first, decisions=decisions) for seed, _ in enumerate(names)
        ],
    )  # fmt: skip
    out, call = str(tmp_path), ["evaluate", "--benchmark", "--task", PREY, "--agents"]
    for agent, more in {"mine=a,b": [], "yours": ["--decisions", "1000000"], "ours": ["--decisions", "200000"]}.items():
        assert main([*call, agent, "--out", out, *more]) == 0
    told = capsys.readouterr().out
    assert "count as of 200,000 decisions" in told and "Track plain, 1,000,000 decisions" in told
    found = read([tmp_path / "benchmark.json"])
    assert [(one.agent, one.decisions) for one in found] == [
        ("mine", 200_000), ("mine", 200_000), ("yours", 1_000_000), ("ours", 200_000),
    ]  # fmt: skip
    rows = [line.split(",")[:6] for line in (tmp_path / "benchmark.csv").read_text().splitlines()]
    assert rows[0] == ["agent", "track", "decisions", "first", "id", "seeds"]
    assert [each[2:4] for each in rows[1:]] == [["200000", "0"], ["200000", "0"], ["1000000", "0"]]
    assert main(["evaluate", "--merge", str(tmp_path / "benchmark.json"), "--task", STATION]) == 2
    assert "nothing to show" in capsys.readouterr().err
    assert main(["evaluate", "--benchmark", "check", "--merge", str(tmp_path / "benchmark.json")]) == 2  # has none
    monkeypatch.setattr(benchmark, "EPISODES", 64)
    assert main(["evaluate", "--merge", str(tmp_path / "benchmark.json")]) == 2
    assert f"has 2 episodes of {PREY}, not 64" in capsys.readouterr().err


def pentagon(env):
    return scripted("pentagon")


OWN = pretrained("station").training["strokes"]


@pytest.mark.parametrize("name, length", [("pentagon", None), ("station", OWN), (f"{__name__}:pentagon", 200_000)])
def test_rules_have_no_length_and_what_the_package_brings_its_own(name, length, monkeypatch):
    monkeypatch.setattr(benchmark, "swum", lambda *_: {"measure": [1.0], "returns": [1.0], "success": [True]})
    (found,) = benchmark.measured(STATION, "mine", [name])
    assert found.decisions == length


@pytest.mark.parametrize("mode", ["--benchmark", "--seeds=2"])
def test_code_of_ones_own_that_fails_is_told_with_its_line_and_others_go_on(mode, monkeypatch, capsys):
    monkeypatch.syspath_prepend(Path(__file__).parents[1] / "controllers")
    monkeypatch.setattr(benchmark, "EPISODES", 2)
    agents = [f"{name}=own_agents:{name}" for name in ("Failing", "FailingRobot", "unborn")]
    assert main(["evaluate", mode, "--task", STATION, "--agents", *agents, f"good={__name__}:pentagon"]) == 2
    out, told = capsys.readouterr()
    lines = [line.partition("own_agents.py, line ")[2] for line in told.splitlines()]
    assert lines == ["40: ZeroDivisionError: division by zero."] * 2 + ["51: KeyError: 'no weights'."] and "good" in out


REFUSED = {
    "leave out --seeds": ["--seeds", "10"], "leave out --path": ["--path", "pentagon"],
    "leave out --decision-period": ["--decision-period", "0.5"], "leave out --random-heading": ["--random-heading"],
    "called greedy": ["--agents", "greedy", "greedy"], "lacks a label": ["--agents", "=a.zip"],
    "--decisions": ["--decisions", "0"], "name them": ["--decisions", "10"],
    "mine has ./a.zip twice": ["--agents", "mine=a.zip,b.zip,./a.zip"],
    "--out is a folder for them, not mine.csv": ["--agents", "greedy", "--out", "mine.csv"],
}  # fmt: skip


@pytest.mark.parametrize("sentence", REFUSED)
def test_what_the_benchmark_would_not_heed_is_refused(sentence, capsys):
    assert main(["evaluate", "--benchmark", *REFUSED[sentence]]) == 2
    told = capsys.readouterr().err
    assert sentence in told and told.count("\n") == 1


def test_files_of_another_contract_than_others_or_than_this_version_are_refused_in_a_sentence(tmp_path, capsys):
    files = [str(tmp_path / f"{name}.json") for name in "ab"]
    for file in files:
        write([cell("mine", PREY, 0, 1.0, contract=file)], file)
    for merged, other in ((files, files[1]), (files[:1], "this version")):
        assert main(["evaluate", "--merge", *merged]) == 2
        assert f"{files[0]} and {other} are of different contracts of {PREY}" in capsys.readouterr().err


def test_tables_are_written_in_every_form(tmp_path, scales):
    benchmark.write_all(row("ppo_lstm", [1.0, 2.0, 4.0]) + row("mine", [2.0, 3.0, 4.0], STATION), tmp_path)
    tex = (tmp_path / "benchmark.tex").read_text("utf-8")
    odd = benchmark.as_latex(["a"], [["a & 1%$#_{}"]]), benchmark.as_markdown(["a"], [["a|b"]])
    assert r"a \& 1\%\$\#\_\{\} \\" in odd[0] and r"| a\|b |" in odd[1]
    assert "PreyTimed [1], more is better" in tex and "Station [mm], less is better" in tex
    assert r"\toprule" in tex and r"ppo\_lstm & 2.33 [1, 4] (3)" in tex and tex.count(r"\\") == 3
    assert "| ppo_lstm | 2.33 [1, 4] (3) |" in (tmp_path / "benchmark.md").read_text("utf-8")
    assert (tmp_path / "benchmark.csv").read_text().splitlines()[1].startswith(f"ppo_lstm,plain,,0,{PREY},3,")
    with np.load(tmp_path / "benchmark.npz") as arrays:  # what rliable takes
        assert {*arrays} == {"ppo_lstm, plain", "mine, plain"}
        assert arrays["ppo_lstm, plain"].tolist() == [[0.125], [0.25], [0.5]]
    with assert_refused("There are no cells to write"):
        benchmark.write_all([], tmp_path)
    assert len(json.loads((tmp_path / "benchmark.json").read_text())["cells"]) == 6


# Contracts


def test_a_contract_is_of_observations_rewards_and_numbers_of_the_task(monkeypatch):
    known = contract(PREY)
    contract.cache_clear()
    assert contract(PREY) == known
    for name, changed in {"EPISODES": 32, "FIDELITY": "rapid", "PROBED": 3}.items():
        with monkeypatch.context() as patch:
            patch.setattr(benchmark, name, changed)
            contract.cache_clear()
            assert contract(PREY) != known, name
    contract.cache_clear()
    with monkeypatch.context() as patch:
        patch.setattr(benchmark, "SIZES", {**benchmark.SIZES, "unused": None})
        assert contract(PREY) == known
    contract.cache_clear()
    assert {one.contract for one in read([benchmark.REFERENCES]) if one.id == PREY} == {known}


def test_references_are_what_rules_swim_in_the_first_test_episodes():
    batch = make(STATION, 2, "test", 1)
    now = swum(batch, greedy(batch))
    (kept,) = (one for one in read([benchmark.REFERENCES]) if (one.agent, one.id) == (benchmark.GREEDY, STATION))
    for name in ("measure", "returns"):
        assert now[name] == pytest.approx(getattr(kept, name)[:2], rel=1e-3), name


def test_a_price_of_time_is_charged_where_returns_would_not_see_it():
    batch = make("SeastarMiswiredTimed-v0", 2, "test", 1)
    batch.reset(options={"instance": 0})
    _, rewards, _, _, info = batch.step([0, 0])
    assert info["reward_time"].tolist() == [-0.5, -0.5] and (rewards < -0.4).all()
    assert sum(entry.price is not None for entry in ENTRIES.values()) == 3
    with assert_refused("SeastarSwim-v0 is no id of the benchmark"):
        make("SeastarSwim-v0", 2)
