"""Noise taken off an image by a trained network: Intel's Open Image Denoise, an extra.

The network sees the image, and the albedo and the normals of what each pixel shows, which have no
noise. It is what programs put behind few samples a pixel, so its time belongs to the image's.
Pixels that show the map alone are exact already and stay as they are.
"""

import numpy as np
from numpy.typing import NDArray

from renderer.upsampling import guides_of
from renderer.view import View
from samplers.errors import EnvlightError

NORMAL, ALBEDO = slice(0, 3), slice(4, 7)
"""Of the guides, which upsampling has too."""


def is_denoised(lighting: object) -> bool:
    """Whether a lighting asks for it: by an attribute `denoised` that is true."""
    return bool(getattr(lighting, "denoised", False))


def denoised(view: View, image: NDArray[np.float32]) -> NDArray[np.float32]:
    """The view's image (height, width, 3) without its noise.

    Raises EnvlightError where the package is not there.
    """
    try:
        import pyoidn
    except ImportError as error:
        raise EnvlightError(
            f"denoising: the package pyoidn cannot be loaded ({error}); install envlight[denoise]"
        ) from error
    depth_range = (float(view.depth.min()), float(view.depth.max())) if len(view) else (0.0, 1.0)
    guides = guides_of(view, depth_range)
    normal, albedo = (np.ascontiguousarray(guides.feature[..., part]) for part in (NORMAL, ALBEDO))
    found = pyoidn.denoise(
        image, albedo=np.clip(albedo, 0.0, 1.0), normal=normal, hdr=True, clean_aux=True
    )
    return np.where((guides.coverage > 0.0)[..., None], found, image)
