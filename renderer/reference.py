"""Reference images, and how far off they are.

The estimator is that of `monte_carlo.py`, run in two halves whose random numbers are independent.
Their mean is the reference; half of their difference is as large, in the root mean square, as the
error of their mean, because both have the same variance: that is the noise floor. Rounds double the
samples of those tiles where a sample lowers the error most, until the floor is low enough.
"""

import math
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from renderer.monte_carlo import SampleSplit, shade_distribution
from renderer.rays import RayCount
from renderer.render import background_radiance
from renderer.view import View
from samplers.environment import LUMINANCE_WEIGHTS, EnvironmentMap
from samplers.lighting import LightDistribution
from samplers.multiple_importance import MultipleImportance

FIRST_SAMPLES = 16
"""Samples per shading point and half in the first round, light and BRDF samples together."""
COMPENSATION = 0.5


@dataclass(frozen=True, eq=False)
class Reference:
    """A converged image.

    image : (height, width, 3) float32, linear radiance, the mean of two halves
    noise_floor : estimated RMSE of `image` over all pixels and channels
    samples : mean number of samples per shading point, both halves together
    """

    image: NDArray[np.float32]
    noise_floor: float
    samples: float
    rays: RayCount
    seconds: float


@dataclass(eq=False)
class _Half:
    """Running mean of one half."""

    total: NDArray[np.float64]
    seed: int

    def mean(self, count: NDArray[np.int64]) -> NDArray[np.float64]:
        return self.total / np.maximum(count, 1)[:, None]


def _tile_error(view: View, image_error: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sum of the squared error over each tile's pixels, (t,)."""
    # A pixel lies in one tile, so each pixel's error goes to the tile of its first point.
    pixel, where = np.unique(view.pixel, return_index=True)
    tile = np.searchsorted(view.tile, where, side="right") - 1
    weight = image_error.reshape(-1)[pixel]
    return np.bincount(tile, weight, minlength=len(view.tile) - 1).astype(np.float64)


def _tiles_to_refine(
    error: NDArray[np.float64],
    cost: NDArray[np.int64],
    allowed: NDArray[np.bool_],
    wanted: float,
) -> NDArray[np.bool_]:
    """The tiles whose doubling, best gain per cost first, brings the summed error to `wanted`."""
    gain = np.where(allowed, 0.5 * error, 0.0)
    order = np.argsort(-gain / np.maximum(cost, 1), kind="stable")
    left = error.sum() - np.cumsum(gain[order])
    needed = int(np.searchsorted(-left, -wanted)) + 1
    chosen = np.zeros(len(error), bool)
    chosen[order[:needed]] = True
    return chosen & (gain > 0.0)


def render_reference(
    view: View,
    environment: EnvironmentMap,
    target: float,
    max_samples: int,
    seed: int = 0,
) -> Reference:
    """The view under `environment`, sampled until its noise floor is at most `target`.

    target : RMSE in units of the foreground's mean luminance
    max_samples : samples per shading point, both halves together, at which to stop in any case
    """
    started = time.perf_counter()
    lighting = MultipleImportance(compensation=COMPENSATION).prepare(
        environment, FIRST_SAMPLES, np.random.default_rng(seed)
    )
    assert isinstance(lighting, LightDistribution)
    halves = [_Half(np.zeros((len(view), 3)), 2 * seed + k) for k in (0, 1)]
    tiles = len(view.tile) - 1
    count = np.zeros(len(view), np.int64)
    per_tile = np.zeros(tiles, np.int64)
    active = np.ones(tiles, bool)
    size = np.diff(view.tile)
    background = background_radiance(view, environment)
    rays = RayCount(primary=view.width * view.height * view.subpixels)
    while True:
        for amount in np.unique(per_tile[active]):
            chosen = active & (per_tile == amount)
            spans = np.stack([view.tile[:-1][chosen], view.tile[1:][chosen]], axis=1)
            more = max(FIRST_SAMPLES, int(amount))
            for half in halves:
                mean, traced = shade_distribution(
                    view, environment, lighting, half.seed, SampleSplit.half_and_half(more),
                    first=1 if amount else 0, spans=spans,
                )  # fmt: skip
                half.total += mean * np.float64(more)
                rays = rays + traced
            count += np.repeat(np.where(chosen, more, 0), size)
            per_tile[chosen] += more
        first, second = (view.to_image(half.mean(count), background) for half in halves)
        image = 0.5 * (first.astype(np.float64) + second)
        error = ((first.astype(np.float64) - second) ** 2).mean(axis=2) / 4.0
        floor = math.sqrt(error.mean())
        wanted = target * _foreground_mean(view, image)
        active = _tiles_to_refine(
            _tile_error(view, error), per_tile * size, 4 * per_tile <= max_samples,
            wanted**2 * error.size,
        )  # fmt: skip
        if floor <= wanted or not active.any():
            break
    samples = 2.0 * float(count.mean()) if len(view) else 0.0
    return Reference(image.astype(np.float32), floor, samples, rays, time.perf_counter() - started)


def _foreground_mean(view: View, image: NDArray[np.float64]) -> float:
    seen = view.coverage > 0.0
    return float((image[seen] @ LUMINANCE_WEIGHTS).mean()) if seen.any() else 0.0
