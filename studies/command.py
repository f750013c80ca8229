"""The command of all studies.

python -m studies                   lists the studies
python -m studies NAME [options]    runs one; `python -m studies.NAME` is the same
python -m studies NAME --out OUT    writes into OUT: a folder, or a file as its help says
python -m studies [NAME] --check    names pictures and pages in docs/ that are not what the numbers beside them say
python -m studies [NAME] --draw     draws and fills them again, in seconds and without running a study
"""  # fmt: skip

import argparse
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


def options_of(study: Study, given: Sequence[str], prog: str, doc: str) -> tuple[Any, ...]:
    """The options as a command line has them, if the study has any; ends with the help if that is asked for."""
    if {"-h", "--help"} & set(given):
        what = "folder of the files, or file of the numbers" if study.file else "folder of the files"
        what = "the file" if study.default_out.suffix else what
        text = f"{doc}\n\n--out OUT: {what}; by default {study.default_out}."
        print(command_parser(prog, text).description, end="\n\n")
    if study.options is None:
        argparse.ArgumentParser(prog).parse_args(given)
        return ()
    return (tyro.cli(study.options, prog=prog, args=given),)


def run(study: Study, given: Sequence[str], doc: str, out: Path | None = None) -> int:
    """Run a study as its command line says; returns the exit code.

    doc: What its help begins with, in full lines. out: Where --out says that it writes.
    """
    if study.run is None:
        raise ValueError("There is nothing to run: --check or --draw.")
    prog = f"python -m studies.{study.name}"
    options, out = options_of(study, given, prog, doc), out or study.default_out
    file = study.place(out, study.file) if study.file else None
    command = prog if study.settings else shlex.join([*prog.split(), *given])
    if study.extra:
        require_extra(f"Runs of {prog}", study.extra, *study.packages)
    about = provenance(command, *study.packages)
    results = Results(about, file, study.settings(*options) if study.settings else None, out)
    failed = study.run(*options, results)
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
        show(text(results), name)
    print(f"Written: {', '.join(map(str, files))}")
    if file.resolve() == study.committed(DOCS, study.file):
        fill(DOCS, (study,))


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; returns the exit code."""
    parser, names = argparse.ArgumentParser("python -m studies", add_help=False, allow_abbrev=False), declared()
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--draw", action="store_true")
    parser.add_argument("--out", type=Path)
    asked, given = parser.parse_known_args(arguments)
    name = given.pop(0) if given and given[0] in names else ""
    try:
        if asked.check or asked.draw:
            chosen = [study for study in all_studies() if name in ("", study.name)]
            return check(DOCS, chosen) if asked.check else draw(DOCS, chosen)
        if name:
            return run(module_of(name).STUDY, given, module_of(name).__doc__, asked.out)
        if asked.out:
            raise ValueError("--out is for a study: name it.")
        require_known("study", [each for each in given[:1] if each not in ("-h", "--help")], names)
    except (ValueError, ModuleNotFoundError) as wrong:
        print(wrong, file=sys.stderr)
        return 2
    print(__doc__, *(f"    {each:28}{line}" for each, line in names.items()), sep="\n")
    return 0
