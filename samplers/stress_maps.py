"""Maps that break samplers: extremes of size, contrast and placement, each a few texels large."""

from collections.abc import Callable
from functools import partial

import numpy as np

from samplers.environment import EnvironmentMap

CONTRASTS = (0, 3, 6, 9)
SUN_TO_SKY = 1e5


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
    "nearly-denormal": lambda: 1e-37 * _noise(16, 1.0),
    "half-float-maximum": lambda: 65504.0 * _noise(16, 0.0),
    "one-channel": lambda: _noise(16, 2.0) * [0.0, 0.0, 1.0],
}
"""Radiance (H, 2H, 3) by name."""


def stress_map(name: str) -> EnvironmentMap:
    """The stress map called `name`."""
    return EnvironmentMap.from_array(STRESS_MAPS[name](), name)
