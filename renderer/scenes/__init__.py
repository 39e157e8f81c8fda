"""The built-in scenes, made from code, found by name.

A scene is one module of this package with a function `scene() -> Scene`; its name is the module's
with hyphens. Frame: +Y up, the ground's upper side at y = 0.
"""

import difflib
import importlib
import pkgutil

from renderer.scene import Scene
from samplers.errors import EnvlightError


def names() -> list[str]:
    """The names of all built-in scenes, sorted."""
    return sorted(module.name.replace("_", "-") for module in pkgutil.iter_modules(__path__))


def make(name: str) -> Scene:
    """The scene called `name`; EnvlightError with the nearest names otherwise."""
    known = names()
    if name not in known:
        near = difflib.get_close_matches(name, known, n=3, cutoff=0.4) or known
        raise EnvlightError(f"no scene is called '{name}'; did you mean {', '.join(near)}?")
    scene: Scene = importlib.import_module(f"{__name__}.{name.replace('-', '_')}").scene()
    return scene
