"""Which pixels of a run's images show the scene, or its glossy objects."""

import numpy as np
from numpy.typing import NDArray

from experiments.run.loaded_run import Run
from experiments.run.rendering import cached_view
from renderer.scene.materials import Lambert
from renderer.view import View


def _view_of(run: Run, scene: str) -> View:
    scale = run.record["scale"]
    return cached_view(scene, scale["width"], scale["height"], scale["subpixels"])


def foreground(run: Run, scene: str) -> NDArray[np.bool_]:
    """(H, W), the pixels that see any surface."""
    return _view_of(run, scene).coverage > 0.0


def glossy_pixels(run: Run, scene: str) -> NDArray[np.bool_]:
    """(H, W), the pixels that see an object whose material is not ideally diffuse."""
    view = _view_of(run, scene)
    glossy = np.array([not isinstance(item.material, Lambert) for item in view.scene.objects])
    mask = np.zeros(view.height * view.width, np.bool_)
    mask[view.pixel[glossy[view.material]]] = True
    return mask.reshape(view.height, view.width)
