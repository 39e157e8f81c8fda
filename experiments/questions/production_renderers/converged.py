"""A converged mean from independent runs, how far off it is, and how two such means agree.

Runs are independent and alike, so that the deviation of their means, over the root of their number,
is the standard error of the mean's mean: of the whole image, of each block, and, as the root of the
mean over pixels and channels, of the image itself (its noise floor).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

BLOCK = 8
"""Pixels along the side of a block."""


@dataclass(frozen=True, eq=False)
class Converged:
    """image : (H, W, 3) float32, the mean of `runs` images
    halves : means of every other run, two images as long as there are two runs
    floor : RMSE of `image` by its own noise
    mean, mean_error : over pixels and channels, and its standard error
    blocks, block_error : (h, w) of blocks of BLOCK × BLOCK pixels; what is left over is not in one
    """

    image: NDArray[np.float32]
    halves: tuple[NDArray[np.float32], NDArray[np.float32]]
    floor: float
    mean: float
    mean_error: float
    blocks: NDArray[np.float64]
    block_error: NDArray[np.float64]
    runs: int

    @classmethod
    def of(cls, images: Sequence[NDArray[np.float32]]) -> "Converged":
        """The mean of at least two independent images of one size."""
        stack = np.stack(images).astype(np.float64)
        runs = len(stack)
        means, blocks = stack.mean(axis=(1, 2, 3)), np.stack([_blocks(one) for one in stack])
        halves = stack[::2].mean(axis=0), stack[1::2].mean(axis=0)
        return cls(
            image=stack.mean(axis=0).astype(np.float32),
            halves=(halves[0].astype(np.float32), halves[1].astype(np.float32)),
            floor=math.sqrt(stack.var(axis=0, ddof=1).mean() / runs),
            mean=float(means.mean()),
            mean_error=float(means.std(ddof=1) / math.sqrt(runs)),
            blocks=blocks.mean(axis=0),
            block_error=blocks.std(axis=0, ddof=1) / math.sqrt(runs),
            runs=runs,
        )


def _blocks(image: NDArray[np.float64]) -> NDArray[np.float64]:
    height, width = (size // BLOCK for size in image.shape[:2])
    cut = image[: height * BLOCK, : width * BLOCK]
    return cut.reshape(height, BLOCK, width, BLOCK, 3).mean(axis=(1, 3, 4))


@dataclass(frozen=True)
class Agreement:
    """How a mean agrees with another; all but `block_z` in units of the other's mean.

    difference, difference_error : of the image's mean, and its standard error
    block_difference : RMS over blocks, without what noise alone gives; 0 where that is all
    block_noise : what noise alone gives
    block_z : RMS over blocks of differences in units of their standard errors
    """

    difference: float
    difference_error: float
    block_difference: float
    block_noise: float
    block_z: float

    @classmethod
    def of(cls, one: Converged, other: Converged) -> "Agreement":
        between = one.blocks - other.blocks
        noise = one.block_error**2 + other.block_error**2
        lit = noise > 0.0
        unit = other.mean if other.mean > 0.0 else 1.0
        excess = float((between**2 - noise).mean())
        return cls(
            difference=(one.mean - other.mean) / unit,
            difference_error=math.hypot(one.mean_error, other.mean_error) / unit,
            block_difference=math.sqrt(max(0.0, excess)) / unit,
            block_noise=math.sqrt(float(noise.mean())) / unit,
            block_z=(
                math.sqrt(float((between[lit] ** 2 / noise[lit]).mean())) if lit.any() else math.nan
            ),
        )
