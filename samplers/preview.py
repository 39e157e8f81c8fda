"""Linear radiance as something to look at: sRGB bytes, thumbnails, sheets of labelled pictures."""

import io
import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from samplers.grids.map_kernels import luminance_of
from samplers.sphere import uv_from_direction

if TYPE_CHECKING:
    from PIL.ImageFont import FreeTypeFont

LEAST_LABEL, LABEL_SHARE = 12, 26
"""Letters of labels have at least so many pixels, and otherwise one for so many of the width."""
GAP = 4
PAPER = 24
LEAST_WIDTH = 240
THUMBNAIL_WIDTH = 512


def automatic_exposure(radiance: ArrayLike, key: float = 0.24) -> float:
    """Stops after which the mean luminance of (H, W, 3), clipped at white, is `key`.

    Unlike the mean itself it is not decided by a sun. A dim map gets a darker key, so that night
    does not turn into day: a tenth of the median level costs a factor of 0.75.
    """
    luminance = luminance_of(np.ascontiguousarray(radiance, np.float32)).astype(np.float64)
    if not luminance.max(initial=0.0) > 0.0:
        return 0.0
    level = max(float(np.median(luminance)), 1e-4)
    key *= min(1.0, (level / 0.1) ** 0.125)
    low, high = -24.0, 24.0
    for _ in range(24):
        middle = 0.5 * (low + high)
        if float(np.minimum(luminance * 2.0**middle, 1.0).mean()) < key:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def encoded(radiance: ArrayLike, exposure: float = 0.0) -> NDArray[np.uint8]:
    """sRGB bytes (H, W, 3) of linear Rec. 709 radiance scaled by 2 to the power of `exposure`.

    Values above white are clipped, as they are where a low-dynamic-range metric compares.
    """
    import colour

    scaled = np.clip(np.asarray(radiance, np.float64) * 2.0**exposure, 0.0, 1.0)
    # The square root spaces the table finely where the curve is steep.
    nodes = (np.arange(4096) / 4095.0) ** 2
    curve = colour.cctf_encoding(nodes, function="sRGB")
    code = np.interp(np.sqrt(scaled), np.arange(4096) / 4095.0, curve)
    return np.round(code * 255.0).astype(np.uint8)


def lettering(size: int) -> "FreeTypeFont":
    """A font of so many pixels that has the letters of all authors' names; Pillow's own lacks í."""
    import matplotlib
    from PIL import ImageFont

    return ImageFont.truetype(f"{matplotlib.get_data_path()}/fonts/ttf/DejaVuSans.ttf", size)


def contact_sheet(
    pictures: list[tuple[str, NDArray[np.uint8]]], columns: int = 4
) -> NDArray[np.uint8]:
    """A grid of pictures (H, W, 3), all of the size of the first, below labels of some lines."""
    from PIL import Image, ImageDraw

    height, width = pictures[0][1].shape[:2]
    rows, letters = math.ceil(len(pictures) / columns), max(LEAST_LABEL, width // LABEL_SHARE)
    label = letters * 3 // 2 * max(1 + name.count("\n") for name, _ in pictures)
    size = (columns * (width + GAP) + GAP, rows * (height + label + GAP) + GAP)
    sheet = Image.new("RGB", size, (PAPER,) * 3)
    draw, font = ImageDraw.Draw(sheet), lettering(letters)
    for index, (name, picture) in enumerate(pictures):
        left = GAP + (index % columns) * (width + GAP)
        top = GAP + (index // columns) * (height + label + GAP)
        draw.text((left + 2, top + 1), name, fill=(230, 230, 230), font=font)
        sheet.paste(Image.fromarray(picture), (left, top + label))
    return np.array(sheet)


def enlarged(picture: NDArray[np.uint8], least_width: int = LEAST_WIDTH) -> NDArray[np.uint8]:
    """A picture repeated by a whole factor until it is at least this wide, for labels to fit."""
    factor = max(1, -(-least_width // picture.shape[1]))
    return picture.repeat(factor, axis=0).repeat(factor, axis=1)


def reduced(image: NDArray[np.float32], width: int) -> NDArray[np.float32]:
    """Box-filtered to at most `width` columns; any number of trailing channels."""
    from PIL import Image

    if image.shape[1] <= width:
        return image
    size = (width, max(1, round(image.shape[0] * width / image.shape[1])))
    planes = np.moveaxis(image.reshape(*image.shape[:2], -1), -1, 0)
    small = [
        np.asarray(Image.fromarray(np.ascontiguousarray(plane)).resize(size, Image.Resampling.BOX))
        for plane in planes
    ]
    return np.stack(small, axis=-1).reshape(size[1], size[0], *image.shape[2:])


def thumbnail(radiance: NDArray[np.float32]) -> bytes:
    """Linear radiance (H, W, 3) as a small PNG file, exposed by itself: what a notebook shows."""
    small = reduced(radiance, THUMBNAIL_WIDTH)
    return _png(encoded(small, automatic_exposure(small)))


def lights_thumbnail(direction: NDArray[np.float64], irradiance: NDArray[np.float64]) -> bytes:
    """Lights on a black map as a PNG file: dots in their colours, with areas as their energies."""
    from PIL import Image, ImageDraw

    picture = Image.new("RGB", (THUMBNAIL_WIDTH, THUMBNAIL_WIDTH // 2))
    draw, energy = ImageDraw.Draw(picture), irradiance.max(axis=1, initial=0.0)
    size = np.sqrt(energy / max(energy.max(initial=0.0), np.finfo(np.float64).tiny))
    colours = encoded((irradiance / np.maximum(energy, 1e-300)[:, None])[None])[0]
    across, down = uv_from_direction(direction)
    for x, y, share, colour in zip(across, down, size, colours, strict=True):
        radius = 1.5 + 10.0 * share
        x, y = x * picture.width, y * picture.height
        draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill=tuple(colour.tolist()))
    return _png(np.asarray(picture))


def _png(picture: NDArray[np.uint8]) -> bytes:
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(picture).save(stream, "PNG")
    return stream.getvalue()
