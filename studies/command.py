"""The command of all studies.

python -m studies                   lists the studies
python -m studies NAME [options]    runs one; `python -m studies.NAME` is the same
python -m studies NAME --out OUT    writes into OUT: a folder, or a file as its help says
python -m studies --check           names pages in docs/ that are not what the numbers beside them say
python -m studies --draw            fills them, in seconds and without running a study
"""  # fmt: skip

import argparse
import importlib
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import tyro

from seastar_gym.files import write_atomically
from studies.frame import Results, Study, provenance, require_known
from studies.pages import show, stale


def names() -> list[str]:
    """Names of all studies."""
    files = sorted(Path(__file__).parent.glob("*.py"))
    return [file.stem for file in files if "\nSTUDY = Study(" in file.read_text("utf-8")]


def module_of(name: str) -> Any:
    """Module of a study."""
    return importlib.import_module(f"studies.{name}")


def run(study: Study, doc: str, given: Sequence[str]) -> str | None:
    """Run a study as its command line says, and write its results; returns a sentence if something failed."""
    if study.run is None:
        raise ValueError(f"Of {study.name!r} there is nothing to run: --check or --draw.")
    prog, doc = f"python -m studies.{study.name}", f"{doc}\n--out OUT: where it writes; by default {study.default_out}."
    parser = argparse.ArgumentParser(prog, description=doc, add_help=study.options is None, allow_abbrev=False)
    parser.add_argument("--out", type=Path, default=study.default_out)
    asked, rest = parser.parse_known_args(given) if study.options else (parser.parse_args(given), [])
    options = (tyro.cli(study.options, prog=prog, description=doc, args=rest),) if study.options else ()
    file = asked.out / Path(study.file).name if study.file else None
    about = provenance(shlex.join([*prog.split(), *rest]))
    results = Results(about, file, study.settings(*options) if study.settings else None, asked.out)
    failed = study.run(*options, results)
    if file is not None and results.keys() - {"settings"}:
        results.save()
        results.read()
        for name, draw in study.pictures.items():
            draw(results, asked.out / name)
        for name, table in study.tables.items():
            show(table(results), name)
        print(f"Written: {file}")
    return failed


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; returns the exit code."""
    word, *given = (sys.argv[1:] if arguments is None else arguments) or [""]
    known = names()
    try:
        if word in ("--check", "--draw"):
            wrong = dict(stale([module_of(name).STUDY for name in known]))
            for file, text in wrong.items() if word == "--draw" else ():
                write_atomically(file, text.encode())
            print("\n".join(file.name for file in wrong) or "Everything is what its numbers say.")
            return int(bool(wrong) and word == "--check")
        if word in known:
            failed = run(module_of(word).STUDY, module_of(word).__doc__, given)
            print(failed or "", end="\n" if failed else "", file=sys.stderr)
            return int(bool(failed))
        require_known("study", {word} - {"", "-h", "--help"}, known)
    except (ValueError, ModuleNotFoundError) as refusal:
        print(refusal, file=sys.stderr)
        return 2
    print(__doc__, *(f"    {name:28}{module_of(name).__doc__.partition(chr(10))[0]}" for name in known), sep="\n")
    return 0
