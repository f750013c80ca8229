"""Lists what a wheel and an sdist hold, folder by folder, and fails where something is missing or a stranger.

python .ci/contents.py dist
python .ci/contents.py dist --release    # fails, too, where a published package would have no address or a placeholder
"""

import sys
import tarfile
import tomllib
import zipfile
from collections import Counter
from pathlib import Path, PurePosixPath

ROOT = Path(__file__).resolve().parent.parent
IN_SDIST = (
    "pyproject.toml", "hatch_build.py", "README.md", "LICENSE", "CHANGELOG.md", "train.py", "docs/index.md",
    "tests/conftest.py",
)  # fmt: skip
MOST_MEGABYTES = 30


def files_of(archive: Path) -> list[PurePosixPath]:
    """Paths in a wheel, or in an sdist below its one folder."""
    if archive.suffix == ".whl":
        return [PurePosixPath(name) for name in zipfile.ZipFile(archive).namelist()]
    with tarfile.open(archive) as opened:
        return [PurePosixPath(*PurePosixPath(each.name).parts[1:]) for each in opened if each.isfile()]


def shown(archive: Path, files: list[PurePosixPath]) -> str:
    """Number of files in every folder, and the archive's size."""
    folders = Counter(file.parts[0] if len(file.parts) > 1 else "." for file in files)
    parts = ", ".join(f"{name} {count}" for name, count in sorted(folders.items()))
    return f"{archive.name}: {archive.stat().st_size / 1e6:.1f} MB, {len(files)} files ({parts})"


def complaints(archive: Path, files: list[PurePosixPath]) -> list[str]:
    """Sentences on what is wrong with an archive."""
    package = sorted(file.relative_to(ROOT).as_posix() for file in (ROOT / "seastar_gym").rglob("*.py"))
    names = {file.as_posix() for file in files}
    wanted = [*package] if archive.suffix == ".whl" else [*package, *IN_SDIST]
    policies = [name.removesuffix(".safetensors") for name in names if name.endswith(".safetensors")]
    wanted += [f"{policy}{suffix}" for policy in policies for suffix in (".json", ".md")]
    wrong = [f"{archive.name} lacks {name}." for name in wanted if name not in names]
    if archive.suffix == ".whl":
        strangers = [name for name in names if not name.startswith(("seastar_gym/", "seastar_gym-"))]
        wrong += [f"{archive.name} installs {name}." for name in strangers]
    wrong += [f"{archive.name} holds {name}." for name in names if "__pycache__" in name or name.startswith("runs/")]
    if archive.stat().st_size > 1e6 * MOST_MEGABYTES:
        wrong.append(f"{archive.name} has more than {MOST_MEGABYTES} MB.")
    return wrong


def placeholders(root: Path = ROOT) -> list[str]:
    """Sentences on what has to be filled in before anything is published."""
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))
    wrong = []
    if not project["tool"]["hatch"]["metadata"]["hooks"]["custom"]["repository"]:
        wrong.append(
            "The address of the repository is not known: fill in repository under [tool.hatch.metadata.hooks.custom] "
            "in pyproject.toml. README's links are relative without it, and lead nowhere on a package index."
        )
    if "OWNER" in (root / ".ci" / "release.md").read_text(encoding="utf-8"):
        wrong.append(".ci/release.md still says OWNER: write whose repository it is.")
    citation = (root / "CITATION.cff").read_text(encoding="utf-8")
    if "repository-code:" not in citation:
        wrong.append("CITATION.cff has no repository-code: add the address of the repository.")
    if "family-names:" not in citation:
        wrong.append("CITATION.cff names no person: add family-names and given-names of the authors.")
    return wrong


def main() -> None:
    archives = sorted(Path(sys.argv[1]).glob("seastar_gym-*"))
    if {archive.suffix for archive in archives} != {".whl", ".gz"}:
        sys.exit(f"{sys.argv[1]} must have a wheel and an sdist, not {[archive.name for archive in archives]}.")
    wrong = placeholders() if "--release" in sys.argv[2:] else []
    for archive in archives:
        files = files_of(archive)
        print(shown(archive, files))
        wrong += complaints(archive, files)
    sys.exit("\n".join(wrong) or 0)


if __name__ == "__main__":
    main()
