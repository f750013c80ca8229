"""The help of every study names its command and shows its docstring."""

import importlib

import pytest

ROOMS = ("accuracy", "stability", "chapter", "validation", "verification")
MODULES = ("speed.throughput", "speed.terms", "scenes.gallery", "scenes.thermal")


@pytest.mark.parametrize("command", [*ROOMS, *MODULES])
def test_help_names_the_command_and_shows_the_docstring_in_the_width_of_the_terminal(command, monkeypatch, capsys):
    module = importlib.import_module(f"studies.{command}.study" if command in ROOMS else f"studies.{command}")
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr("sys.argv", ["anything", "--help"])
    with pytest.raises(SystemExit):
        module.main()
    shown = capsys.readouterr().out
    assert shown.startswith(f"usage: python -m studies.{command} [")
    assert " ".join(module.__doc__.split()) in " ".join(shown.split())
    assert all(len(line) <= 80 for line in shown.splitlines())


@pytest.mark.parametrize("name", ["ablations", "bound"])
def test_help_of_a_study_of_learning_names_its_command(name, capsys):
    module = importlib.import_module(f"studies.learning.{name}")
    with pytest.raises(SystemExit):
        module.main(["--help"])
    assert f"usage: python -m studies.learning.{name} [-h]" in capsys.readouterr().out
