"""Scenes as chosen on the command line: names, patterns and scene files."""

from functools import cache
from pathlib import Path

from experiments.maps.patterns import select, split_list
from experiments.run.identity import file_digest
from renderer.scene.load import files_of, is_scene_file, load_scene
from samplers import EnvlightError


def choose_scenes(texts: list[str]) -> tuple[str, ...]:
    """Built-in names and absolute paths of scene files, each once, in the order of the texts.

    Every scene file is read once with its meshes, so that a run fails before it begins.
    Raises EnvlightError for a name or pattern that fits none, a file that is no good, and for two
    scenes of one name.
    """
    from renderer import scenes

    chosen: dict[str, str] = {}
    for text in split_list(texts):
        if is_scene_file(text):
            load_scene(text)
            found = [str(Path(text).resolve())]
        else:
            found = select(scenes.names(), [text], "scene")
        for scene in found:
            name = name_and_file(scene)[0]
            if chosen.setdefault(name, scene) != scene:
                raise EnvlightError(f"two scenes are called '{name}': rename the file {scene}")
    return tuple(chosen.values())


def name_and_file(scene: str) -> tuple[str, str]:
    """What tables call a scene, and its file; the latter is empty for a built-in one.

    Tables call a scene file by its file's name, which is also that of folders.
    """
    path = Path(scene)
    return (path.stem, str(path)) if is_scene_file(path) else (scene, "")


@cache
def scene_file_digests(path: str) -> dict[str, str]:
    """Hashes of a scene file and of the mesh files it names, by their names in it."""
    meshes = {name: file_digest(file) for name, file in sorted(files_of(path).items())}
    return {"scene": file_digest(Path(path)), **meshes}
