"""A view whose background has shading points too: what a renderer does that does not skip it.

Each background sub-pixel gets a black point in front of the eye, facing it. Lights shade it and
rays are traced from it, but it adds exactly nothing to the picture.
"""

from dataclasses import replace

import numpy as np

from renderer.scene import Object, Scene
from renderer.scene.materials import Lambert
from renderer.view import CELLS, CELLS_X, CELLS_Y, TILE, View

DISTANCE = 100.0
"""In units of the distance from the eye to what it looks at: beyond the scene."""


def with_background_points(view: View) -> View:
    """The same picture, with a point at every background sub-pixel after all others."""
    camera = view.scene.camera
    eye = np.array(camera.eye)
    reach = DISTANCE * float(np.linalg.norm(np.subtract(camera.target, eye)))
    order, key = _tile_order(view)
    way = view.background_direction[order]
    count, number = len(way), len(view)
    subpixel = np.zeros(count, np.int32)
    bounds = number + np.concatenate([np.flatnonzero(np.diff(key)) + 1, [count]])
    black = Object("background", view.scene.objects[0].mesh, Lambert((0.0, 0.0, 0.0)))
    scene = Scene(view.scene.name, (*view.scene.objects, black), camera)
    row = np.zeros((1, view.materials.shape[1]))
    tile = number + np.concatenate([np.flatnonzero(np.diff(key // CELLS)) + 1, [count]])

    def joined(first: np.ndarray, second: np.ndarray) -> np.ndarray:
        return np.concatenate([first, second.astype(first.dtype)])

    return replace(
        view,
        scene=scene,
        position=joined(view.position, eye + reach * way),
        normal=joined(view.normal, -way),
        geometric=joined(view.geometric, -way),
        toward_eye=joined(view.toward_eye, -way),
        depth=joined(view.depth, np.full(count, reach)),
        material=joined(view.material, np.full(count, len(view.materials))),
        pixel=joined(view.pixel, view.background_pixel[order]),
        subpixel=joined(view.subpixel, subpixel),
        group=joined(view.group, bounds),
        group_cell=joined(
            view.group_cell, key[np.concatenate([[0], bounds[:-1] - number])] % CELLS
        ),
        tile=joined(view.tile, tile),
        materials=np.concatenate([view.materials, row]),
    )


def _tile_order(view: View) -> tuple[np.ndarray, np.ndarray]:
    """Order of the background's sub-pixels by tile and cell, and their keys in that order."""
    y, x = np.divmod(view.background_pixel.astype(np.int64), view.width)
    tile = (y // TILE) * -(-view.width // TILE) + x // TILE
    key = tile * CELLS + (y % CELLS_Y) * CELLS_X + x % CELLS_X
    order = np.argsort(key, kind="stable")
    return order, key[order]
