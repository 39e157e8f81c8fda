"""What a table leaves to BRDF sampling: a constant is taken off its radiance, clamped at 0.

Source: Karlík, Šik, Vévoda, Skřivan and Křivánek, "MIS compensation: optimizing sampling techniques
in multiple importance sampling", SIGGRAPH Asia 2019. Where half of the samples come from the table,
the constant is the mean over the sphere.
"""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from samplers.base import LightSampler
from samplers.grids.tabulated import COMPENSATED_COUNT, LEAST_REMAINDER


def compensated(
    radiance: NDArray[np.float64], solid_angle: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The radiance (rows, columns) above its mean; unchanged where nothing but rounding would be.

    solid_angle : (rows,) of a cell of each row, in any unit
    """
    columns = radiance.shape[1]
    sphere = columns * solid_angle.sum()
    mean = float(radiance.sum(axis=1) @ solid_angle) / sphere
    rest = radiance - mean
    np.maximum(rest, 0.0, out=rest)
    left = float(rest.sum(axis=1) @ solid_angle)
    return rest if left > LEAST_REMAINDER * mean * sphere else radiance


def channel_mean(radiance: NDArray[np.float32]) -> NDArray[np.float64]:
    """The mean (H, W) of R, G and B (H, W, 3), in place of luminance."""
    mean = radiance[..., 0].astype(np.float64)
    mean += radiance[..., 1]
    mean += radiance[..., 2]
    mean /= 3.0
    return mean


@dataclass(frozen=True)
class RendererTable(LightSampler):
    """A renderer's table of the map, compensated where it is asked for."""

    stochastic: ClassVar[bool] = True
    in_all_tables: ClassVar[bool] = False

    compensation: bool = field(
        default=False, metadata={"fixed": "measured by the experiment `renderers`"}
    )

    def __post_init__(self) -> None:
        if self.compensation:
            object.__setattr__(self, "minimum_count", COMPENSATED_COUNT)
