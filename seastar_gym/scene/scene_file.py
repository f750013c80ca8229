"""`load_scene`: a scene from a file of Python or JSON, as command lines take it."""

import runpy
from os import PathLike
from pathlib import Path

from seastar_gym.files import read_json
from seastar_gym.scene.checks import require_file
from seastar_gym.scene.scene import Scene


def load_scene(file: str | PathLike[str] | None) -> Scene:
    """Scene of a file of Python or JSON, the chapter's for none.

    A file of Python is executed and defines `scene`; one of JSON is as `Scene.to_dict` writes it.
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
            raise ValueError(f"{file} is no scene: {wrong}") from wrong
    try:
        found = runpy.run_path(str(file)).get("scene")
    except SyntaxError as wrong:
        raise ValueError(f"{file}, line {wrong.lineno}, is not Python: {wrong.msg}.") from wrong
    if not isinstance(found, Scene):
        raise ValueError(f"{file} must define `scene`, a Scene.")
    return found
