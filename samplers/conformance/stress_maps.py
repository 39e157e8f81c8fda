"""Maps that break samplers: extremes of size, contrast and placement, each a few texels large."""

import math
from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from samplers.environment import EnvironmentMap
from samplers.sphere import angular_distance, direction_from_uv, pixel_direction, pixel_directions

CONTRASTS = (0, 3, 6, 9)
DECADES = range(10)
"""Powers of ten by which the sun outshines the sky."""
SUN_TO_SKY = 1e5
SUN_RADIUS = math.radians(0.2667)
SUN_AT = (0.31, 0.29)
"""u and v of the sun: off every symmetry of the map."""
LARGEST = float(np.finfo(np.float32).max)
SMALLEST = float(np.finfo(np.float32).smallest_subnormal)


def _noise(height: int, decades: float, seed: int = 7) -> np.ndarray:
    """Coloured noise whose radiance spans the given number of decades."""
    rng = np.random.default_rng(seed)
    level = 10.0 ** rng.uniform(-decades / 2.0, decades / 2.0, (height, 2 * height, 1))
    return level * rng.uniform(0.5, 1.0, (height, 2 * height, 3))


def _texels(height: int, *places: tuple[int, int]) -> np.ndarray:
    """A black map with lit texels at (row, column)."""
    radiance = np.zeros((height, 2 * height, 3))
    for row, column in places:
        radiance[row, column] = (3.0, 2.0, 1.0)
    return radiance


def _sun_and_sky() -> np.ndarray:
    """A sky gradient over a dark ground, with one texel of a sun 10⁵ times as bright."""
    height = 32
    radiance = np.full((height, 2 * height, 3), 0.05)
    radiance[: height // 2] = np.linspace(0.4, 1.0, height // 2)[:, None, None] * [0.6, 0.8, 1.0]
    radiance += 0.02 * _noise(height, 0.5)
    radiance[9, 21] = SUN_TO_SKY
    return radiance


def sun_over_sky(height: int, contrast: float) -> NDArray[np.float32]:
    """A textured sky and a sun `contrast` times as bright as its mean: radiance (H, 2H, 3).

    The sun has its true size of 0.53°, or one texel where texels are larger.
    """
    rng = np.random.default_rng(11)
    radiance = rng.random((height, 2 * height, 3), np.float32)
    radiance *= np.float32(0.5)
    radiance += np.float32(0.5)
    radiance *= np.linspace(1.25, 0.25, height, dtype=np.float32)[:, None, None]
    u, v = SUN_AT
    row, column = int(v * height), int(u * 2 * height)
    # No texel farther than this from the sun's own can lie within it: columns narrow by sin θ.
    rows = math.ceil(SUN_RADIUS * height / math.pi) + 1
    columns = math.ceil(rows / math.sin(math.pi * v)) + 1
    r, c = np.arange(row - rows, row + rows + 1), np.arange(column - columns, column + columns + 1)
    r, c = r[(r >= 0) & (r < height)], c[(c >= 0) & (c < 2 * height)]
    centre = pixel_direction(r[:, None], c[None], height)
    inside = angular_distance(centre, direction_from_uv(u, v)) <= SUN_RADIUS
    inside |= (r[:, None] == row) & (c[None] == column)
    patch = radiance[r[0] : r[-1] + 1, c[0] : c[-1] + 1]
    patch[inside] = np.float32(contrast * radiance.mean(dtype=np.float64))
    return radiance


def _row(height: int, row: int) -> np.ndarray:
    """Noise with one row, such as one around a pole, 10⁵ times as bright."""
    radiance = _noise(height, 1.0)
    radiance[row] *= SUN_TO_SKY
    return radiance


def _all_of_float32() -> np.ndarray:
    """Texels from the smallest normal float32 to the largest."""
    power = np.random.default_rng(5).uniform(-37.0, 38.0, (16, 32, 1))
    return 10.0**power * np.ones(3)


STRESS_MAPS: dict[str, Callable[[], np.ndarray]] = {
    "noise": lambda: _noise(16, 2.0),
    "sun-and-sky": _sun_and_sky,
    "constant": lambda: np.full((16, 32, 3), 0.7),
    "black": lambda: np.zeros((8, 16, 3)),
    "one-texel": lambda: _texels(16, (5, 11)),
    "one-texel-on-the-seam": lambda: _texels(16, (7, 0)),
    "two-texels-over-the-seam": lambda: _texels(16, (7, 0), (7, 31)),
    "one-texel-at-the-top": lambda: _texels(16, (0, 3)),
    "one-texel-at-the-bottom": lambda: _texels(16, (15, 20)),
    "smallest": lambda: _noise(1, 1.0),
    "four-by-two": lambda: _noise(2, 2.0),
    "odd-height": lambda: _noise(5, 2.0),
    "three-rows": lambda: _noise(3, 2.0),
    **{f"contrast-1e{decades}": partial(_noise, 16, decades) for decades in CONTRASTS},
    "bright-top-row": lambda: _row(16, 0),
    "bright-bottom-row": lambda: _row(16, -1),
    "nearly-denormal": lambda: 1e-37 * _noise(16, 1.0),
    "denormal": lambda: 1e-42 * _noise(16, 1.0),
    "smallest-blue": lambda: SMALLEST * np.ones((16, 32, 3)) * [0.0, 0.0, 1.0],
    "half-float-maximum": lambda: 65504.0 * _noise(16, 0.0),
    "float-maximum": lambda: np.full((16, 32, 3), LARGEST),
    "all-of-float32": _all_of_float32,
    "one-channel": lambda: _noise(16, 2.0) * [0.0, 0.0, 1.0],
}
"""Radiance (H, 2H, 3) by name."""
CONTRAST_MAPS: dict[str, Callable[[], np.ndarray]] = {
    f"sun-1e{decades}": partial(sun_over_sky, 32, 10.0**decades) for decades in DECADES
}
"""The same sky under ever brighter suns, to see how errors grow."""


def _smooth(light: Callable[[NDArray[np.float64]], NDArray[np.float64]]) -> np.ndarray:
    """A grey map of 32 rows by the height y of its texels' directions."""
    return light(pixel_directions(32)[..., 1:2]) * np.ones(3)


def _two_suns() -> np.ndarray:
    """Two texels 30° above the horizon, opposite each other, and a dim sky: 99.9 % of the light."""
    radiance = _texels(32, (10, 15), (10, 47))
    return radiance + 1e-3 * radiance.sum() / radiance.size


SHAPES: dict[str, Callable[[], np.ndarray]] = {
    "constant": STRESS_MAPS["constant"],
    "gradient": partial(_smooth, lambda y: 1.0 + y),
    "ring": partial(_smooth, lambda y: np.where(np.abs(y - 0.5) < 0.06, 1.0, 1e-3)),
    "rings": partial(_smooth, lambda y: np.where(np.abs(np.abs(y) - 0.5) < 0.045, 1.0, 1e-3)),
    "two-suns": _two_suns,
}
"""Even maps, and lights whose common centroid is dark: where lights stand shows in irradiance."""


def stress_map(name: str) -> EnvironmentMap:
    """The stress map called `name`, or the one of `SHAPES`."""
    return EnvironmentMap.from_array((STRESS_MAPS | SHAPES)[name](), name)
