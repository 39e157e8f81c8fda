"""A scene by its name, or by the path of its file."""

import warnings
from pathlib import Path

from renderer import scenes
from renderer.scene import Scene
from renderer.scene.foreign import description
from renderer.scene.mesh_file import files_beside
from renderer.scene.scene_file import mesh_files, read_scene
from renderer.scene.written_scene import FORMATS, read_written

SUFFIX = ".toml"


def is_scene_file(text: str | Path) -> bool:
    """Whether a scene is named by the path of a file: names of built-in ones have no suffix."""
    return bool(Path(text).suffix)


def load_scene(scene: str | Path) -> Scene:
    """A built-in scene, by its name, or the user's own, by the path of its file.

    `README.md` beside this file says what a file may be, and what a TOML file holds; `envlight list
    scenes` lists the names.
    Raises EnvlightError for an unknown name, or with what is wrong with the file: the file, the
    key and the remedy.
    """
    if not is_scene_file(scene):
        return scenes.make(str(scene))
    path = Path(scene)
    if path.suffix.lower() == SUFFIX:
        return read_scene(path)
    if path.suffix.lower() in FORMATS:
        return read_written(path)[0]
    return read_scene(path, description(path))


def files_of(scene: str | Path) -> dict[str, Path]:
    """The files that a scene's file names, by the names it gives them."""
    path = Path(scene)
    if path.suffix.lower() in FORMATS:
        with warnings.catch_warnings():  # told where the scene is taken
            warnings.simplefilter("ignore")
            return read_written(path)[1]
    return mesh_files(path) if path.suffix.lower() == SUFFIX else files_beside(path)
