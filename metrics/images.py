"""What every metric asks of an image: a shape, and finite values."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from samplers.errors import EnvlightError


def checked_image(image: ArrayLike, what: str) -> NDArray[np.float32]:
    """`image` as a C-contiguous (H, W, 3) float32 array.

    what : how messages call the image

    Raises EnvlightError for any other shape, for an empty image, and for NaN or infinity (also
    where a value overflows float32): no metric turns those into a number.
    """
    array = np.asarray(image)
    if array.ndim != 3 or array.shape[2] != 3 or array.size == 0:
        raise EnvlightError(f"{what}: an array of shape {array.shape}; wanted (H, W, 3), not empty")
    with np.errstate(over="ignore"):
        array = np.ascontiguousarray(array, np.float32)
    finite = np.isfinite(array)
    if not finite.all():
        row, column, channel = np.unravel_index(int(finite.argmin()), array.shape)
        raise EnvlightError(
            f"{what}: {array.size - int(finite.sum())} values are NaN or infinite (first in row "
            f"{row}, column {column}, channel {'RGB'[channel]}); find out where they come from"
        )
    return array


def checked_pair(
    image: ArrayLike, reference: ArrayLike
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Both images, each checked, and of one shape; EnvlightError otherwise."""
    test, truth = checked_image(image, "image"), checked_image(reference, "reference")
    check_same_shape(test, truth.shape)
    return test, truth


def check_same_shape(image: NDArray[np.float32], shape: tuple[int, ...]) -> None:
    """EnvlightError unless `image` has the reference's `shape`."""
    if image.shape != shape:
        raise EnvlightError(
            f"image of shape {image.shape} against a reference of shape {shape}; "
            "render both at one resolution"
        )
