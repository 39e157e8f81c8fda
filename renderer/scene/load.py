"""A scene by its name, or by the path of its file."""

from pathlib import Path

from renderer import scenes
from renderer.scene import Scene
from renderer.scene.scene_file import read_scene

SUFFIX = ".toml"


def is_scene_file(text: str | Path) -> bool:
    """Whether a scene is named by the path of a TOML file, and not by a built-in scene's name."""
    return Path(text).suffix.lower() == SUFFIX


def load_scene(scene: str | Path) -> Scene:
    """A built-in scene, by its name, or the user's own, by the path of its TOML file.

    `scene_file.py` says what such a file holds; `envlight list scenes` lists the names.
    Raises EnvlightError for an unknown name, or with what is wrong with the file: the file, the
    key and the remedy.
    """
    return read_scene(scene) if is_scene_file(scene) else scenes.make(str(scene))
