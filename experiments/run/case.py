"""A case: a scene under a map at a scale, which all samplers share, and its reference."""

from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from pathlib import Path
from typing import Any

from experiments.maps.patterns import select, split_list
from experiments.maps.sources import EnvironmentSource
from experiments.run.identity import (
    Shared,
    digest,
    file_digest,
    library_versions,
    own_programs,
    programs,
)
from experiments.run.scale import Scale
from metrics.registry import Metric, metrics
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
            found = [str(Path(text).resolve())]
            load_scene(found[0])
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


PLACES = "experiments.maps.places"
MAP_FEATURES, SCENE_FEATURES = "experiments.maps.features", "experiments.run.scene_features"
"""What can be measured on a map and on a scene stands in every row, under a key of its own each."""
JUDGING = "experiments.run.judging"
"""Its own file counts for scores; what it imports stands in identities under names of its own."""


@dataclass(frozen=True)
class Case:
    """A scene under an environment at a scale.

    scene_file : path of a scene's TOML file, or empty for a built-in scene
    """

    scene: str
    environment: EnvironmentSource
    scale: Scale
    scene_file: str = ""

    @cached_property
    def identity(self) -> dict[str, Any]:
        """What is rendered, by whatever method: the scene, the map and the pixels."""
        return {
            **self._scene_identity,
            "environment": environment_identity(self.environment),
            "view": [self.scale.width, self.scale.height, self.scale.subpixels],
            "libraries": library_versions(self._scene_module, *self._map_modules),
        }

    @cached_property
    def shared(self) -> Shared:
        """The identity, as part of others."""
        return Shared(self.identity)

    @property
    def _scene_identity(self) -> dict[str, Any]:
        files = {}
        if self.scene_file:
            files = {"files": scene_file_digests(self.scene_file)}
        return {"scene": self.scene, "programs": programs(self._scene_module), **files}

    @property
    def _scene_module(self) -> str:
        if self.scene_file:
            return "renderer.scene.scene_file"
        return f"renderer.scenes.{self.scene.replace('-', '_')}"

    @property
    def _map_modules(self) -> tuple[str, ...]:
        return () if self.environment.path else (PLACES,)

    @cached_property
    def reference_identity(self) -> dict[str, Any]:
        """What determines the reference: what is rendered, how well, and by which source."""
        return {
            "case": self.shared,
            "reference": [self.scale.noise_target, self.scale.max_samples],
            "programs": programs("renderer.reference"),
            "libraries": library_versions("renderer.reference"),
        }

    @cached_property
    def reference_key(self) -> str:
        return digest(self.reference_identity)

    @cached_property
    def features_identities(self) -> dict[str, dict[str, Any]]:
        """What determines the features of the map and of the scene, by the module that finds them.

        The map's identity has the name and the content, the scene's nothing of map or resolution.
        """
        return {
            MAP_FEATURES: {
                "environment": environment_identity(self.environment),
                "programs": programs(MAP_FEATURES),
                "libraries": library_versions(MAP_FEATURES, *self._map_modules),
            },
            SCENE_FEATURES: {
                **self._scene_identity,
                "programs": programs(SCENE_FEATURES, self._scene_module),
                "libraries": library_versions(SCENE_FEATURES, self._scene_module),
            },
        }

    @cached_property
    def features_keys(self) -> dict[str, str]:
        return {name: digest(found) for name, found in self.features_identities.items()}

    @property
    def score_identities(self) -> dict[str, Shared]:
        """What determines the value of an image by each metric, beside the image."""
        return {one.name: _score_identity(self.reference_key, one) for one in metrics()}

    @property
    def score_keys(self) -> dict[str, str]:
        """The key of an image's value by each metric, among those of the image."""
        return {name: shared.key for name, shared in self.score_identities.items()}

    def __str__(self) -> str:
        return f"{self.scene} · {self.environment.name}"


def _score_identity(reference: str, metric: Metric) -> Shared:
    found = {
        "reference": reference,
        "metric": metric.name,
        "programs": programs(metric.module) | own_programs(JUDGING),
        "libraries": library_versions(metric.module),
    }
    return Shared(found)


@lru_cache(maxsize=1024)
def environment_identity(source: EnvironmentSource) -> dict[str, Any]:
    """What determines a map: its file's content, or the source that makes it, and its height."""
    if source.path:
        content = file_digest(Path(source.path))
        return {"name": source.name, "file": content, "repair": source.repair}
    return {"name": source.name, "height": source.height, "programs": programs(PLACES)}
