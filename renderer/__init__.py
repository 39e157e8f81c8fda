"""From a view of a scene and a lighting to an image.

    from renderer import load_scene, make_view, render

    view = make_view(load_scene("vase"), 640, 480)   # or the path of a scene's TOML file
    image = render(view, lighting, environment).image

Other names are loaded when they are first used. `render` is loaded at once, and is the function: a
later import of the module `renderer.render` leaves it so.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from samplers import kernel_cache as kernel_cache  # before any kernel is declared

if TYPE_CHECKING:
    from renderer.image import write_exr, write_png
    from renderer.reference import render_reference
    from renderer.render import Rendering, render
    from renderer.scene.load import load_scene
    from renderer.view import View, make_view

__all__ = [
    "Rendering",
    "View",
    "load_scene",
    "make_view",
    "render",
    "render_reference",
    "write_exr",
    "write_png",
]

_HOME = {  # as data, not as imports: a result depends on what computes it, not on this list
    "Rendering": "render",
    "render": "render",
    "View": "view",
    "load_scene": "scene.load",
    "make_view": "view",
    "render_reference": "reference",
    "write_exr": "image",
    "write_png": "image",
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'renderer' has no attribute '{name}'")
    return getattr(import_module(f"renderer.{_HOME[name]}"), name)


if not TYPE_CHECKING:
    render = __getattr__("render")
