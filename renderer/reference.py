"""Reference images, and how far off they are.

The estimator is that of `monte_carlo.py`, run in two halves whose random numbers are independent.
Their mean is the reference; half of their difference is as large, in the root mean square, as the
error of their mean, because both have the same variance: that is the noise floor. Rounds double the
samples of those tiles where a sample lowers the error most, until the floor is low enough.
"""

import math
import time
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from renderer.image import write_whole
from renderer.monte_carlo import SampleSplit, shade_distribution
from renderer.rays import RayCount
from renderer.render import background_radiance
from renderer.view import View
from samplers.environment import LUMINANCE_WEIGHTS, EnvironmentMap
from samplers.grids.tabulated import by_luminance
from samplers.lighting import LightDistribution

FIRST_SAMPLES = 16
"""Samples per shading point and half in the first round, light and BRDF samples together."""
COMPENSATION = 0.5
FIRST_SEED = 1 << 30
"""Added to the seeds, so that no image shares its random numbers with its own reference."""
CHECKPOINT_SECONDS = 20.0
"""Least time between two checkpoints."""


@dataclass(frozen=True, eq=False)
class Reference:
    """A converged image.

    image : (height, width, 3) float32, linear radiance, the mean of two halves
    first_half : the same of the first half's samples alone
    noise_floor : estimated RMSE of `image` over all pixels and channels
    samples : mean number of samples per shading point, both halves together
    """

    image: NDArray[np.float32]
    first_half: NDArray[np.float32]
    noise_floor: float
    samples: float
    rays: RayCount
    seconds: float


@dataclass(eq=False)
class _State:
    """The samples taken so far, all that a later start needs to go on.

    per_tile : (t,) int64, samples per shading point and half
    total : (2, n, 3) float64, sums of both halves' samples
    rays : shadow, BRDF and skipped rays
    """

    per_tile: NDArray[np.int64]
    total: NDArray[np.float64]
    rays: NDArray[np.int64]

    @classmethod
    def of(cls, view: View, checkpoint: Path | None) -> "_State":
        """What the checkpoint holds, if it is there and whole, otherwise nothing yet."""
        per_tile = np.zeros(len(view.tile) - 1, np.int64)
        fresh = cls(per_tile, np.zeros((2, len(view), 3)), np.zeros(3, np.int64))
        if checkpoint is None or not checkpoint.is_file():
            return fresh
        try:
            with np.load(checkpoint) as file:
                state = cls(file["per_tile"], file["total"], file["rays"])
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
            return fresh
        same = state.per_tile.shape == per_tile.shape and state.total.shape == fresh.total.shape
        return state if same else fresh

    def save(self, checkpoint: Path) -> None:
        def write(path: Path) -> None:
            with path.open("wb") as file:
                np.savez(file, per_tile=self.per_tile, total=self.total, rays=self.rays)

        write_whole(checkpoint, write)

    def images(self, view: View, background: NDArray[np.float32]) -> list[NDArray[np.float64]]:
        """The two halves as images."""
        count = np.repeat(np.maximum(self.per_tile, 1), np.diff(view.tile))[:, None]
        return [view.to_image(total / count, background).astype(np.float64) for total in self.total]


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
    checkpoint: Path | None = None,
) -> Reference:
    """The view under `environment`, sampled until its noise floor is at most `target`.

    target : RMSE in units of the foreground's mean luminance
    max_samples : samples per shading point, both halves together, at which to stop in any case
    checkpoint : file that keeps the samples of long work; a later start goes on from it, with the
        same result bit for bit, and the end removes it. `seconds` counts this start only.
    """
    started = saved = time.perf_counter()
    lighting = by_luminance(environment, FIRST_SAMPLES, compensation=COMPENSATION)
    background = background_radiance(view, environment)
    state = _State.of(view, checkpoint)
    active = state.per_tile == 0
    while True:
        if active.any():
            _refine(state, active, view, environment, lighting, seed)
        first, second = state.images(view, background)
        image = 0.5 * (first + second)
        error = ((first - second) ** 2).mean(axis=2) / 4.0
        floor = math.sqrt(error.mean())
        wanted = target * _foreground_mean(view, image)
        active = _tiles_to_refine(
            _tile_error(view, error),
            state.per_tile * np.diff(view.tile),
            4 * state.per_tile <= max_samples,
            wanted**2 * error.size,
        )
        if floor <= wanted or not active.any():
            break
        if checkpoint and time.perf_counter() - saved > CHECKPOINT_SECONDS:
            state.save(checkpoint)
            saved = time.perf_counter()
    if checkpoint:
        checkpoint.unlink(missing_ok=True)
    points = max(len(view), 1)
    samples = 2.0 * float(state.per_tile @ np.diff(view.tile)) / points
    rays = RayCount(view.width * view.height * view.subpixels, *map(int, state.rays))
    seconds = time.perf_counter() - started
    return Reference(
        image.astype(np.float32), first.astype(np.float32), floor, samples, rays, seconds
    )


def _refine(
    state: _State,
    active: NDArray[np.bool_],
    view: View,
    environment: EnvironmentMap,
    lighting: LightDistribution,
    seed: int,
) -> None:
    """Double the samples of the active tiles, in both halves."""
    for amount in np.unique(state.per_tile[active]):
        chosen = active & (state.per_tile == amount)
        spans = np.stack([view.tile[:-1][chosen], view.tile[1:][chosen]], axis=1)
        more = max(FIRST_SAMPLES, int(amount))
        for half, total in enumerate(state.total):
            half_seed = FIRST_SEED + 2 * seed + half
            mean, rays = shade_distribution(
                view, environment, lighting, half_seed, SampleSplit.half_and_half(more),
                before=SampleSplit.half_and_half(int(amount)), spans=spans,
            )  # fmt: skip
            total += mean * np.float64(more)
            state.rays += (rays.shadow, rays.brdf, rays.skipped)
        state.per_tile[chosen] += more


def _foreground_mean(view: View, image: NDArray[np.float64]) -> float:
    seen = view.coverage > 0.0
    return float((image[seen] @ LUMINANCE_WEIGHTS).mean()) if seen.any() else 0.0
