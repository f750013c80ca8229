"""`load_scene`: a scene from a file of Python or JSON, as command lines take it."""

import importlib
import runpy
import sys
import traceback
from os import PathLike
from pathlib import Path

from seastar_gym.files import read_json
from seastar_gym.scene.checks import require_file
from seastar_gym.scene.scene import Scene


def load_scene(file: str | PathLike[str] | None) -> Scene:
    """Scene of a file of Python or JSON, the chapter's for none.

    A file of Python is executed and defines `scene`; it may import modules of its folder and of the current one. One of
    JSON is as `Scene.to_dict` writes it.
    """
    if file is None:
        return Scene()
    require_file("file", file)
    file = Path(file)
    if not file.is_file():
        raise ValueError(f"{file} is no file.")
    if file.suffix == ".json":
        try:
            return Scene.from_dict(read_json(file))
        except ValueError as wrong:
            raise ValueError(f"{file} is no scene: {str(wrong).rstrip('.')}.") from wrong
    search(file.parent, Path.cwd())
    try:
        found = runpy.run_path(str(file)).get("scene")
    except SyntaxError as wrong:
        raise ValueError(f"{file}, line {wrong.lineno}, is not Python: {wrong.msg}.") from wrong
    except ValueError:
        raise  # a sentence of ours, as of a robot without limbs
    except Exception as wrong:  # the file is anybody's code
        raise ValueError(f"{file}, {_line(wrong, file)}{type(wrong).__name__}: {str(wrong).rstrip('.')}.") from wrong
    if not isinstance(found, Scene):
        raise ValueError(f"{file} must define `scene`, a Scene.")
    return found


def search(*folders: Path) -> None:
    """Have modules of folders found, after all others."""
    for folder in map(str, map(Path.absolute, folders)):
        if folder not in sys.path:
            sys.path.append(folder)
            importlib.invalidate_caches()


def _line(wrong: Exception, file: Path) -> str:
    """Last line of a file at which something went wrong, as the beginning of a sentence."""
    lines = [frame.lineno for frame in traceback.extract_tb(wrong.__traceback__) if frame.filename == str(file)]
    return f"line {lines[-1]}: " if lines else ""
