"""Reference images, and how far off they are.

The estimator is that of `monte_carlo.py`, run in two halves whose random numbers are independent,
less what it errs by in diffuse light before shadows, which is known: `control_variate.py`. The
halves' mean is the reference; half of their difference is as large, in the root mean square, as the
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

from renderer.control_variate import SurfacePixels, fitted_beta
from renderer.image import write_whole
from renderer.monte_carlo import SampleSplit, shade_distribution
from renderer.rays import RayCount
from renderer.view import View
from samplers.environment import LUMINANCE_WEIGHTS, EnvironmentMap
from samplers.grids.tabulated import by_luminance
from samplers.lighting import LightDistribution
from samplers.preview import thumbnail

FIRST_SAMPLES = 24
"""Samples per shading point and half in the first round, light and BRDF samples together."""
COMPENSATION = 0.7
LEFT_BY_DOUBLING = 0.4
"""Share of its squared error that a tile keeps when its samples are doubled: between 1/2 of
independent samples and 1/2√2 of well stratified ones at the edges of shadows."""
FIRST_SEED = 1 << 30
"""Added to the seeds, so that no image shares its random numbers with its own reference."""
CHECKPOINT_SECONDS = 20.0
"""Least time between two checkpoints."""


@dataclass(frozen=True, eq=False)
class Reference:
    """A converged image.

    image : (height, width, 3) float32, linear radiance, the mean of two halves, at least 0
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

    def __repr__(self) -> str:
        height, width = self.image.shape[:2]
        return f"Reference({width}×{height}, noise {self.noise_floor:.3g}, {self.seconds:.3g} s)"

    def _repr_png_(self) -> bytes:
        return thumbnail(self.image)


@dataclass(eq=False)
class _State:
    """The samples taken so far, all that a later start needs to go on.

    per_tile : (t,) int64, samples per shading point and half
    sums : (2, 2, p, 3) float64, of each half's radiance and of its diffuse part before shadows,
        times the samples, over the pixels that show a surface
    rays : shadow, BRDF and skipped rays
    """

    per_tile: NDArray[np.int64]
    sums: NDArray[np.float64]
    rays: NDArray[np.int64]

    @classmethod
    def of(cls, pixels: SurfacePixels, checkpoint: Path | None) -> "_State":
        """What the checkpoint holds, if it is there and whole, otherwise nothing yet."""
        fresh = cls(
            np.zeros(len(pixels.view.tile) - 1, np.int64),
            np.zeros((2, 2, *pixels.known.shape)),
            np.zeros(3, np.int64),
        )
        if checkpoint is None or not checkpoint.is_file():
            return fresh
        try:
            with np.load(checkpoint) as file:
                state = cls(file["per_tile"], file["sums"], file["rays"])
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
            return fresh
        same = all(getattr(state, name).shape == getattr(fresh, name).shape for name in vars(fresh))
        return state if same else fresh

    def save(self, checkpoint: Path) -> None:
        def write(path: Path) -> None:
            with path.open("wb") as file:
                np.savez(file, per_tile=self.per_tile, sums=self.sums, rays=self.rays)

        write_whole(checkpoint, write)

    def halves(self, pixels: SurfacePixels) -> NDArray[np.float64]:
        """Radiance of the two halves, (2, p, 3)."""
        means = self.sums / np.maximum(self.per_tile, 1)[pixels.tile][:, None]
        radiance, diffuse = means[:, 0], means[:, 1]
        beta = fitted_beta(pixels.tile, radiance[0] - radiance[1], diffuse[0] - diffuse[1])
        controlled: NDArray[np.float64] = radiance + beta[pixels.tile][:, None] * (
            pixels.known - diffuse
        )
        return controlled


def _tiles_to_refine(
    error: NDArray[np.float64],
    cost: NDArray[np.int64],
    allowed: NDArray[np.bool_],
    wanted: float,
) -> NDArray[np.bool_]:
    """The tiles whose doubling, best gain per cost first, brings the summed error to `wanted`."""
    gain = np.where(allowed, (1.0 - LEFT_BY_DOUBLING) * error, 0.0)
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
    all_pixels = view.width * view.height
    lighting = by_luminance(environment, FIRST_SAMPLES, compensation=COMPENSATION)
    pixels, points = SurfacePixels.of(view, environment), np.diff(view.tile)
    state = _State.of(pixels, checkpoint)
    active = state.per_tile == 0
    while True:
        if active.any():
            _refine(state, active, pixels, environment, lighting, seed)
        first, second = state.halves(pixels)
        image = pixels.image(0.5 * (first + second))
        error = ((first - second) ** 2).mean(axis=1) / 4.0
        floor = math.sqrt(error.sum() / all_pixels)
        wanted = target * _foreground_mean(view, image)
        active = _tiles_to_refine(
            np.bincount(pixels.tile, error, len(points)).astype(np.float64),
            state.per_tile * points,
            4 * state.per_tile <= max_samples,
            wanted**2 * all_pixels,
        )
        if floor <= wanted or not active.any():
            break
        if checkpoint and time.perf_counter() - saved > CHECKPOINT_SECONDS:
            state.save(checkpoint)
            saved = time.perf_counter()
    if checkpoint:
        checkpoint.unlink(missing_ok=True)
    samples = 2.0 * float(state.per_tile @ points) / max(len(view), 1)
    rays = RayCount(all_pixels * view.subpixels, *map(int, state.rays))
    seconds = time.perf_counter() - started
    return Reference(
        image.astype(np.float32), pixels.image(first).astype(np.float32), floor, samples, rays,
        seconds,
    )  # fmt: skip


def _refine(
    state: _State,
    active: NDArray[np.bool_],
    pixels: SurfacePixels,
    environment: EnvironmentMap,
    lighting: LightDistribution,
    seed: int,
) -> None:
    """Double the samples of the active tiles, in both halves."""
    view = pixels.view
    for amount in np.unique(state.per_tile[active]):
        chosen = active & (state.per_tile == amount)
        spans = np.stack([view.tile[:-1][chosen], view.tile[1:][chosen]], axis=1)
        more = max(FIRST_SAMPLES, int(amount))
        for half, sums in enumerate(state.sums):
            half_seed = FIRST_SEED + 2 * seed + half
            diffuse = np.zeros((len(view), 3), np.float32)
            radiance, rays = shade_distribution(
                view, environment, lighting, half_seed, _split(more),
                before=_split(int(amount)), spans=spans, diffuse=diffuse,
            )  # fmt: skip
            for total, part in zip(sums, (radiance, diffuse), strict=True):
                total += pixels.of_points(part) * more
            state.rays += (rays.shadow, rays.brdf, rays.skipped)
        state.per_tile[chosen] += more


def _split(count: int) -> SampleSplit:
    """Two samples of the light for each of the BRDF: on photographed maps they reach a noise sooner
    than as many of each, with a table that is not fully compensated.
    """
    return SampleSplit(count - count // 3, count // 3)


def _foreground_mean(view: View, image: NDArray[np.float64]) -> float:
    seen = view.coverage > 0.0
    return float((image[seen] @ LUMINANCE_WEIGHTS).mean()) if seen.any() else 0.0
