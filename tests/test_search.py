"""Fifteen questions find their page by the search of the guide, which answers them; `.ci/run` asks them, too."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SPEC = importlib.util.spec_from_file_location("search", ROOT / ".ci" / "search.py")
search = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(search)


@pytest.mark.parametrize("question", search.QUESTIONS)
def test_the_page_answers_the_question(question):
    page, answer = search.QUESTIONS[question]
    assert answer in (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8")


def test_a_heading_and_words_of_the_title_count_and_rare_pages_come_last(monkeypatch):
    monkeypatch.setattr(search, "stemmed", lambda question: set(question.split()))
    index = {
        "docnames": ["a", "b", "changelog"], "titles": ["Apples", "Change the drag", "Drag"],
        "alltitles": {"Apples": [[0, None]], "Change the drag": [[1, None]], "Drag": [[0, "drag"], [2, None]]},
        "terms": {"drag": [0, 1, 2], "apple": 0}, "titleterms": {"drag": [0, 1, 2], "chang": 1},
    }  # fmt: skip
    assert search.results(index, "drag", "changelog") == ["b", "a", "changelog"]
    assert search.results(index, "drag apple", "changelog") == ["a"]
    assert search.results(index, "pears", "changelog") == []


def test_every_question_finds_its_page(tmp_path, capsys):
    for name in ("sphinx", "myst_parser", "furo"):
        pytest.importorskip(name, reason="the guide is built with the extra docs")
    subprocess.run([sys.executable, "-m", "sphinx", "-q", ROOT / "docs", tmp_path], check=True)
    assert search.main(tmp_path) == 0, capsys.readouterr().out


def test_a_question_that_nothing_answers_is_named(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(search, "stemmed", lambda question: set(question.split()))
    empty = {"docnames": [], "titles": [], "alltitles": {}, "terms": {}, "titleterms": {}}
    (tmp_path / "searchindex.js").write_text(f"Search.setIndex({json.dumps(empty)})", encoding="utf-8")
    assert search.main(tmp_path) == 1
    assert "'cite' finds nothing, not index." in capsys.readouterr().out
