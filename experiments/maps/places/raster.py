"""From a picture of all directions to texels.

A picture is a function from directions to radiance, plus small emitters. The function is averaged
over a grid of sub-texels weighted by solid angle; the emitters are added with exact coverage. Below
a height of 256 the grid is the same for all heights that divide it, so that a coarse map is the
average of a finer one.

Cost: at least two by two sub-texels each; the function is called on blocks of rows whose bounds
depend on the height alone, so that the bits do not depend on the number of threads.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from experiments.maps.places.emitters import Emitter, add_emitters
from experiments.maps.places.shapes import Shade
from samplers.sphere import pixel_direction
from samplers.threads import for_blocks

SAMPLES_PER_BLOCK = 16384
FINEST = 256


@dataclass(frozen=True)
class Picture:
    """All that a map shows: extended radiance, and what is too small for sampling."""

    shade: Shade
    emitters: list[Emitter] = field(default_factory=list)


def subdivision(height: int) -> int:
    """Sub-texels along a texel's side."""
    return max(2, math.ceil(FINEST / height))


def rasterized(picture: Picture, height: int, split: int | None = None) -> NDArray[np.float32]:
    """Radiance (H, 2H, 3) of a picture. split : in place of `subdivision`"""
    width, split = 2 * height, split or subdivision(height)
    fine = height * split
    radiance = np.empty((height, width, 3))

    def rows(start: int, stop: int) -> None:
        row = np.arange(start * split, stop * split)[:, None]
        column = np.arange(width * split)[None, :]
        direction = pixel_direction(row, column, fine).reshape(-1, 3)
        value = picture.shade(direction, math.pi / fine)
        value = value.reshape(stop - start, split, width, split, 3).mean(axis=3)
        weight = np.sin((row + 0.5) * (math.pi / fine)).reshape(stop - start, split)
        weight /= weight.sum(axis=1, keepdims=True)
        radiance[start:stop] = np.einsum("rs,rswk->rwk", weight, value)

    for_blocks(rows, height, max(1, SAMPLES_PER_BLOCK // (width * split * split)))
    add_emitters(radiance, picture.emitters)
    return radiance.astype(np.float32)
