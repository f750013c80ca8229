"""The command of all studies.

    python -m studies                   lists the studies
    python -m studies NAME [options]    runs one; `python -m studies.NAME` is the same
    python -m studies [NAME] --check    names pictures and pages in docs/ that are not what the numbers beside them say
    python -m studies [NAME] --draw     draws and fills them again, in seconds and without running a study
"""

import ast
import importlib
import shlex
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import tyro

from seastar_gym.command import command_parser
from seastar_gym.extras import require_extra
from studies.frame import DOCS, Results, Study, require_known
from studies.pages import check, draw, fill, show
from studies.provenance import provenance

HERE = Path(__file__).parent
DECLARED = "\nSTUDY = Study("
"""What a module of a study has."""


def declared() -> dict[str, str]:
    """Names of all studies, and the first lines of their docstrings."""
    found = {}
    for file in sorted(HERE.rglob("*.py")):
        text = file.read_text(encoding="utf-8")
        if file != Path(__file__) and DECLARED in text:
            name = ".".join(file.relative_to(HERE).with_suffix("").parts).removesuffix(".study")
            found[name] = (ast.get_docstring(ast.parse(text)) or "").partition("\n")[0]
    return found


def module_of(name: str) -> Any:
    """Module of a study."""
    room = (HERE / name.replace(".", "/") / "study.py").is_file()
    return importlib.import_module(f"studies.{name}{'.study' if room else ''}")


def all_studies() -> Iterator[Study]:
    """Every study."""
    return (module_of(name).STUDY for name in declared())


def run(study: Study, given: Sequence[str], doc: str) -> int:
    """Run a study as its command line says; returns the exit code. doc: What its help begins with, in full lines."""
    if study.run is None:
        raise ValueError("There is nothing to run: --check or --draw.")
    prog = f"python -m studies.{study.name}"
    if {"-h", "--help"} & set(given):
        print(command_parser(prog, doc).description, end="\n\n")
    options = study.with_folder(tyro.cli(study.options, prog=prog, args=given))
    out = Path(getattr(options, "out", "."))
    file = study.place(out, study.file) if study.file else None
    command = prog if study.settings else shlex.join([*prog.split(), *given])
    if study.extra:
        require_extra(f"Runs of {prog}", study.extra, *study.packages)
    about = provenance(command, *study.packages)
    results = Results(about, file, study.settings(options) if study.settings else None)
    failed = study.run(options, results)
    if results.keys() - {"settings"} and file is not None:
        told(study, results, out, file)
    if failed:
        print(failed, file=sys.stderr)
    return int(bool(failed))


def told(study: Study, results: Results, out: Path, file: Path) -> None:
    """Write results into a file, and what follows from them beside it and, if the file is that of docs/, into pages."""
    if study.settings is None or not file.is_file():
        results.save()
    results.read()
    files = [file, *study.write(results, out)]
    for name, text in study.tables.items():
        show(f"{name}:\n\n{text(results)}")
    print(f"Written: {', '.join(map(str, files))}")
    if file.resolve() == study.committed(DOCS, study.file):
        fill(DOCS, (study,))


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; returns the exit code."""
    given, names = list(sys.argv[1:] if arguments is None else arguments), declared()
    name = given.pop(0) if given and given[0] in names else ""
    try:
        if {"--check", "--draw"} & set(given):
            chosen = [study for study in all_studies() if name in ("", study.name)]
            return check(DOCS, chosen) if "--check" in given else draw(DOCS, chosen)
        if name:
            return run(module_of(name).STUDY, given, module_of(name).__doc__)
        require_known("study", [each for each in given[:1] if each not in ("-h", "--help")], names)
    except (ValueError, ModuleNotFoundError) as wrong:
        print(wrong, file=sys.stderr)
        return 2
    print(__doc__, *(f"    {each:28}{line}" for each, line in names.items()), sep="\n")
    return 0
